"""One camera's hand: what the detector says of its shape and where it shows it, together.

A detector gives joints about the hand's middle, of which the bending is known best and the turn and
the size badly, and landmarks in the picture, which show the turn and every finger's direction. The
pose is fitted to the picture, its angles held to those of the joints.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.calibrate import calibrate
from handtrack.detectors.chosen import of_pictures, seen_by
from handtrack.detectors.profile import Noise
from handtrack.fitting.images import NOISE_PX, shift_before_camera
from handtrack.hand.default import SHAPES
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import without_landmarks
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.tracking.sequence_track import track_joints
from handtrack.tracking.settings import TrackSettings
from handtrack.video.views import Views

Array = NDArray[np.float64]

ANGLES_DEG = 7.0
"""How far the angles of a detector's joints are believed [degrees]; from 5 to 10 hardly anything
changes (tools/bench/rendered, clips to tune on)."""
STIFFNESS = (NOISE_PX / np.deg2rad(ANGLES_DEG)) ** 2
"""The same as a prior of picture fits [px^2/rad^2]."""


# frames of the parabolas that tell how a depth shakes, and the fewest that are steadied
_WINDOW, _FEW = 11, 12
# how fast hands gain speed towards a camera or away from it [m/s^2]
_PULL = 3.0


class SeenHand(NamedTuple):
    """A hand that is fitted.

    Attributes:
        model: with the landmarks that the points are.
        shown: with those that pictures show; None where they are the same.
        size_deviation: of one camera's hand, of the logarithm of its size, so of its distance.
        noise_mm: of one camera, what is new or fades in the errors of its points [mm]; a picture
            does not show how far its fits are off in depth.
        detector: name of the profile whose landmarks they are; "": joint centres.
    """

    model: HandModel
    shown: HandModel | None = None
    size_deviation: float = 0.0
    noise_mm: float = 0.0
    detector: str = ""

    @property
    def fitted(self) -> HandModel:
        """The hand in the pictures."""
        return self.model if self.shown is None else self.shown


class Size(NamedTuple):
    """What is known of the size of a hand that one camera saw.

    Attributes:
        factor: what the calibrated hand is to be scaled by.
        deviation: of the logarithm of its size, so of its distance.
    """

    factor: float
    deviation: float


def believed_size(scale: float, noise: Noise | None) -> Size:
    """A detector's size weighed against what people's hands are like.

    Args:
        scale: of the calibrated hand over an adult's.
        noise: the detector's; where it is not known, its size is taken as it is.
    """
    people = SHAPES["size"]
    if noise is None or noise.size == 0:
        return Size(1.0, people)
    trust = people**2 / (people**2 + noise.size**2)
    return Size(float(scale ** (trust - 1.0)), float(noise.size * np.sqrt(trust)))


def hand_seen(
    views: Views,
    model: HandModel,
    method: bool | str,
    detector: str,
    is_own: bool = False,
    pictured: str | None = None,
) -> SeenHand:
    """The hand to fit to pictures, calibrated by the points that they give.

    Args:
        views: what cameras saw, with points that were measured.
        model: the prior, or the subject's hand.
        method: how to calibrate it: of `calibrate`, True, False, or "none".
        detector: whose landmarks they are: of `TrackSettings`.
        is_own: the model is the subject's, of known size.
        pictured: whose landmarks one camera's picture shows; by default the same detector's.

    Raises:
        InputError: no hand is found in the points.
    """
    points, one = views.sequence(), len(views.cameras) == 1
    model, profile = seen_by(model, detector, points.detector)
    size = Size(1.0, 0.0 if is_own else SHAPES["size"])
    noise = None if profile is None else profile.noise
    if method != "none":
        named = "auto" if method is True else method or "scale"
        found = calibrate(model, points.corrected(profile), named, noise=noise)
        model, size = found.model, believed_size(found.scale, noise)
    said = "" if profile is None else profile.name
    if not one:
        return SeenHand(model, detector=said)
    wanted, seen = of_pictures(pictured or detector), of_pictures(views.detector)
    shown, _ = seen_by(without_landmarks(model), wanted, seen)
    moving = 0.0 if noise is None else 1e3 * np.sqrt(np.mean(noise.fading**2 + noise.white**2))
    return SeenHand(model, shown.scaled(size.factor), size.deviation, float(moving), said)


def poses_of_joints(views: Views, model: HandModel, settings: TrackSettings) -> tuple[Array, Array]:
    """Poses (angles (T, 20), roots (T, 12)) to begin picture fits from, NaN where there is none.

    Args:
        views: of one camera, with points.
        model: calibrated on the points, with the landmarks that they are.
        settings: whose landmarks the points are, and the filter that steadies the angles.
    """
    told = {"filter": settings.filter.name, "lag": settings.filter.lag, "calibrate": "none"}
    told |= {"detector": settings.detector}
    solid = track_joints(views.sequence(), model, TrackSettings.of(told))
    angles = np.array(solid.angles)
    roots = np.full((len(views), 12), np.nan)
    camera, turns = views.cameras[0], quaternion_to_matrix(solid.quaternion)
    joints = model.joints(angles, turns, solid.translation)
    for t in np.flatnonzero(np.isfinite(angles).all(1) & np.isfinite(joints).all((1, 2))):
        seen = np.isfinite(views.image[t, 0]).all(-1)
        if seen.sum() < 2:
            continue
        marks = joints[t] + model.landmarks_from_joints(angles[t], turns[t])
        own = marks @ camera.rotation.T + camera.translation
        rays = camera.undistorted(views.image[t, 0, seen])
        shift = shift_before_camera(own, seen, rays, model.size)
        roots[t] = [*turns[t].ravel(), *(solid.translation[t] + camera.rotation.T @ shift)]
    return angles, roots


def steady_depths(depths: Array, time_ns: NDArray[np.int64], filter: str, lag: int) -> Array:
    """(T,) distances from a camera, steadied: the size in a picture shakes more than hands move.

    A hand drawing near or away at a speed that changes little (a Kalman filter of the logarithm),
    its errors what parabolas through eleven frames leave, and as much again that lasts longer.

    Args:
        depths: (T,) [m], NaN where there is none.
        time_ns: (T,).
        filter, lag: as of `FilterSettings`; causal ones look at no frame that comes later.
    """
    from filterpy.kalman import KalmanFilter
    from scipy.signal import savgol_filter

    known = np.flatnonzero(np.isfinite(depths))
    if filter == "none" or len(known) < _FEW:
        return depths
    logs, dt = np.log(depths[known]), np.diff(time_ns[known]) * 1e-9
    shake = float(np.std(logs - savgol_filter(logs, _WINDOW, 2)))
    steady = KalmanFilter(dim_x=2, dim_z=1)
    steady.x, steady.P = np.array([[logs[0]], [0.0]]), np.diag([1.0, 1.0])
    steady.H, steady.R = np.array([[1.0, 0.0]]), np.array([[2.0 * shake**2 + 1e-12]])
    steps = [0.0, *dt]
    moves = [np.array([[1.0, s], [0.0, 1.0]]) for s in steps]
    pull = _PULL / float(np.exp(np.median(logs)))
    pulls = [pull**2 * np.array([[s**4 / 4, s**3 / 2], [s**3 / 2, s**2]]) for s in steps]
    means, covariances, _, _ = steady.batch_filter(logs, Fs=moves, Qs=pulls)
    later = {"rts": len(known), "fixed-lag": lag}.get(filter, 0)
    if not later:
        found = [mean[0, 0] for mean in means]
    elif later == len(known):
        found = list(steady.rts_smoother(means, covariances, moves, pulls)[0][:, 0, 0])
    else:
        parts = [slice(i, i + later + 1) for i in range(len(known))]
        found = [
            steady.rts_smoother(means[p], covariances[p], moves[p], pulls[p])[0][0, 0, 0]
            for p in parts
        ]
    out = depths.copy()
    out[known] = np.exp(found)
    return out
