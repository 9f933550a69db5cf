"""fit_2d(): the pose of a hand model that best explains joints seen in pictures."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.cameras.camera import Camera
from handtrack.cameras.triangulate import triangulate
from handtrack.deprecated import moved, old_positions
from handtrack.errors import InputError, SettingsError
from handtrack.fitting.fit import fit
from handtrack.fitting.result import N_POSE, Fit
from handtrack.fitting.settings import ImageSettings
from handtrack.fitting.solver import constants
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS
from handtrack.kernels.image_fit import fit_views
from handtrack.kernels.workspace import CONVERGED, LENS

Array = NDArray[np.float64]

SPREAD_PX = ImageSettings().spread_px
PRIOR_DEG = 40.0
"""How far from the start's angles one camera is believed [degrees]: it cannot see depth well."""
NOISE_PX = 3.0
"""Error of a detector that the prior is weighed against [px]."""
MAX_STEPS = 60
TOLERANCE = 1e-5
MIN_POINTS = 6
"""Fewer points in pictures than this do not make a pose."""

_BETWEEN = 0.5
_DOUBT_TURN, _DOUBT_DEPTH = np.deg2rad(30.0), 0.2

if not TYPE_CHECKING:
    __getattr__ = moved(__name__, {"ViewFit": "fitting.result:Fit"})


@old_positions("spread_px", "prior_deg")
def fit_2d(
    model: HandModel,
    image_points: ArrayLike,
    cameras: Sequence[Camera],
    weights: ArrayLike | None = None,
    start: Fit | ArrayLike | None = None,
    *,
    settings: ImageSettings | None = None,
    **options: Any,
) -> Fit:
    """Fit a hand model to joints in the pictures of one or several calibrated cameras.

    Reprojection errors under the model's limits, Huber's loss. With several cameras a joint
    that only one of them sees counts as well. With one camera the depth comes from the model's
    size (a hand 1 % too large is seen 1 % too far away), and how the fingers bend towards the
    camera or away from it hardly shows: the start's angles decide there.

    Args:
        model: the hand, calibrated to the subject's size.
        image_points: (C, 21, 2) [px]; NaN = not seen.
        cameras: C of them.
        weights: (C, 21), not negative; 1 by default.
        start: a Fit, or (20,) angles [rad]. By default what several cameras
            triangulate, or with one camera the best of several turns of the mean pose.
        settings: how to fit; the defaults if left out.
        options: fields of `ImageSettings` that replace the settings': spread_px, prior_deg.

    Returns:
        The fit, with `reprojection`.

    Raises:
        InputError: wrong shapes, infinite points, weights that are negative or not finite, or
            fewer than six points seen.
        SettingsError: no camera, or a setting that makes no sense.
    """
    chosen = ImageSettings.of(settings, options)
    pixels, w = _observed(image_points, cameras, weights)
    prior_deg = chosen.prior_deg
    if prior_deg is None:
        prior_deg = PRIOR_DEG if len(cameras) == 1 else 0.0
    stiffness = (NOISE_PX / np.deg2rad(prior_deg)) ** 2 if prior_deg else 0.0
    fits = [
        _solve(model, cameras, pixels, w, angles, root, chosen.spread_px, stiffness)
        for angles, root in _starts(model, cameras, pixels, w, start)
    ]
    return min(fits, key=lambda f: float(f.objective))


def _observed(
    image_points: ArrayLike, cameras: Sequence[Camera], weights: ArrayLike | None
) -> tuple[Array, Array]:
    """Points without NaN, and weights that are 0 where there was one."""
    if not cameras:
        raise SettingsError("no camera is given")
    pixels = np.array(image_points, dtype=np.float64, order="C")
    shape = (len(cameras), N_JOINTS)
    if pixels.shape != (*shape, 2):
        raise InputError(
            f"image points have shape {pixels.shape}, expected ({len(cameras)}, 21, 2)"
        )
    if np.isinf(pixels).any():
        raise InputError("an image point is infinite, expected pixels or NaN")
    w = np.ones(shape) if weights is None else np.array(weights, dtype=np.float64, order="C")
    if w.shape != shape:
        raise InputError(f"weights have shape {w.shape}, expected ({len(cameras)}, 21)")
    if not np.isfinite(w).all() or w.min() < 0:
        raise InputError("weights must be finite and not negative")
    missing = np.isnan(pixels).any(-1)
    w[missing] = 0.0
    pixels[missing] = 0.0
    if (w > 0).sum() < MIN_POINTS:
        raise InputError(f"{(w > 0).sum()} points are seen, expected at least {MIN_POINTS}")
    return pixels, w


def _starts(
    model: HandModel, cameras: Sequence[Camera], pixels: Array, w: Array, start: object
) -> list[tuple[Array, Array]]:
    """Where to begin: angles (20,) and root (12,)."""
    if isinstance(start, Fit):
        root = np.concatenate([start.rotation.ravel(), start.translation])
        return [(model.limits.clamp(start.angles), root)]
    angles = model.mean_angles.copy()
    if start is not None:
        angles = np.asarray(start, dtype=np.float64)
        if angles.shape != (N_ANGLES,) or not np.isfinite(angles).all():
            raise InputError(f"start has shape {angles.shape}, expected (20,) finite angles")
        angles = model.limits.clamp(angles)
    if len(cameras) > 1:
        points, _ = triangulate(cameras, np.where(w[..., None] > 0, pixels, np.nan), w)
        if np.isfinite(points[:, 0]).sum() >= MIN_POINTS:
            solid = fit(model, points, start=None if start is None else angles)
            return [(solid.angles, np.concatenate([solid.rotation.ravel(), solid.translation]))]
    return [(angles, root) for root in _turns(model, cameras, pixels, w, angles)]


def _turns(
    model: HandModel, cameras: Sequence[Camera], pixels: Array, w: Array, angles: Array
) -> list[Array]:
    """Roots (12,) for 24 turns of a pose, each where it best meets the first camera's rays."""
    c = int(np.argmax((w > 0).sum(1)))
    camera, seen = cameras[c], w[c] > 0
    rays = camera.undistorted(pixels[c][seen])
    joints = model.joints(angles)[seen]
    roots = []
    # 6 directions of the fingers' axis times 4 turns about it
    for i, j in product(range(6), range(4)):
        axis = np.eye(3)[i % 3] * (1 if i < 3 else -1)
        turn = vector_to_matrix(axis * np.pi / 2 * (1 + i // 3)) @ vector_to_matrix(
            np.array([0.0, 0.0, j * np.pi / 2])
        )
        x = joints @ turn.T
        shift = shift_before_camera(x, np.ones(len(x), dtype=bool), rays, model.size)
        rotation = camera.rotation.T @ turn
        translation = camera.rotation.T @ (shift - camera.translation)
        roots.append(np.concatenate([rotation.ravel(), translation]))
    return roots


def shift_to_rays(points: Array, rays: Array) -> Array:
    """(3,) the shift of points (n, 3), in a camera's frame, that best brings them onto rays (n, 2).

    (x + t_x) / (z + t_z) = ray is linear in t.
    """
    rows = np.zeros((2 * len(points), 3))
    right = np.empty(2 * len(points))
    for k in (0, 1):
        rows[k::2, k] = 1.0
        rows[k::2, 2] = -rays[:, k]
        right[k::2] = rays[:, k] * points[:, 2] - points[:, k]
    return np.asarray(np.linalg.lstsq(rows, right, rcond=None)[0])


def shift_before_camera(points: Array, seen: NDArray[np.bool_], rays: Array, size: float) -> Array:
    """(3,) `shift_to_rays` of the points seen, with all points half a hand before the camera.

    Args:
        points: (n, 3) in the camera's frame [m]; seen: (n,).
        rays: of those that are seen.
        size: of the hand [m].
    """
    shift = shift_to_rays(points[seen], rays)
    shift[2] = max(shift[2], float(_BETWEEN * size - points[:, 2].min()))
    return shift


def _solve(
    model: HandModel,
    cameras: Sequence[Camera],
    pixels: Array,
    w: Array,
    angles: Array,
    root: Array,
    spread_px: float,
    stiffness: float,
) -> Fit:
    results = ViewResults(1)
    results.run(
        model, cameras, pixels[None], w[None], angles[None], root[None], spread_px, stiffness
    )
    return results.fit(0, cameras, pixels, w)


class ViewResults:
    """What `image_fit.fit_views` writes, for T frames."""

    def __init__(self, n: int):
        self.joints = np.empty((n, N_JOINTS, 3))
        self.objective = np.empty(n)
        self.steps = np.zeros(n, dtype=np.int64)
        self.state = np.zeros(n, dtype=np.int64)
        self.covariance = np.empty((n, N_POSE, N_POSE))
        self.angles = np.empty((n, N_ANGLES))
        self.roots = np.empty((n, 12))
        self._of: tuple[HandModel, Sequence[Camera]] | None = None
        self._hand: tuple[Any, ...] = ()
        self._lenses = np.empty(0, LENS)

    def run(
        self,
        model: HandModel,
        cameras: Sequence[Camera],
        pixels: Array,
        weights: Array,
        angles: Array,
        roots: Array,
        spread_px: float = SPREAD_PX,
        stiffness: float = 0.0,
    ) -> None:
        """Fit frames, each from its own start.

        Args:
            pixels: (T, C, 21, 2) without NaN; weights: (T, C, 21), 0 = not seen.
            angles, roots: (T, 20), (T, 12) to start from; not changed.
            spread_px, stiffness: of the loss [px], and of the prior [px^2/rad^2].
        """
        self.angles[:], self.roots[:] = angles, roots
        # frame after frame the same: what is made of them is kept
        if self._of != (model, cameras):
            self._hand = constants(model)
            self._lenses = np.stack([camera.lens for camera in cameras])
            self._of = (model, cameras)
        fit_views(
            self._hand,
            self._lenses,
            np.ascontiguousarray(pixels),
            np.ascontiguousarray(weights),
            float(spread_px),
            np.array(angles, order="C"),
            np.full(N_ANGLES, float(stiffness)),
            self.angles,
            self.roots,
            (MAX_STEPS, TOLERANCE),
            (self.joints, self.objective, self.steps, self.state, self.covariance),
        )

    def fit(self, t: int, cameras: Sequence[Camera], pixels: Array, w: Array) -> Fit:
        """Frame t as a Fit; pixels (C, 21, 2) and weights (C, 21) as they were given."""
        marks = self.joints[t]
        if self._of is not None:
            turn = self.roots[t][:9].reshape(3, 3)
            marks = marks + self._of[0].landmarks_from_joints(self.angles[t], turn)
        seen = np.stack([camera.project(marks) for camera in cameras])
        error = np.where(w > 0, np.linalg.norm(seen - pixels, axis=-1), np.nan)
        rotation = self.roots[t, :9].reshape(3, 3)
        free = max(2 * int((w > 0).sum()) - N_POSE, 1)
        covariance = self.covariance[t] * (self.objective[t] / free)
        # the solver's omega and v are in the root frame
        to_world = np.eye(N_POSE)
        to_world[20:23, 20:23] = to_world[23:26, 23:26] = rotation
        covariance = to_world @ covariance @ to_world.T
        status = "converged" if self.state[t] == CONVERGED else "iteration limit"
        turn = np.sqrt(np.linalg.eigvalsh(covariance[20:23, 20:23])[-1])
        shift = np.sqrt(np.linalg.eigvalsh(covariance[23:26, 23:26])[-1])
        distance = min(float(np.linalg.norm(c.centre - self.joints[t, 0])) for c in cameras)
        if not (turn < _DOUBT_TURN and shift < _DOUBT_DEPTH * distance):
            status = "underdetermined"
        return Fit(
            angles=self.angles[t].copy(),
            rotation=rotation.copy(),
            translation=self.roots[t, 9:].copy(),
            joints=self.joints[t].copy(),
            objective=float(self.objective[t]),
            reprojection=error,
            steps=int(self.steps[t]),
            covariance=covariance,
            status=status,
        )
