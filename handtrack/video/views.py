"""One hand as calibrated cameras saw it, and followed through their pictures: reprojection fits
over time."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.cameras.triangulate import triangulate
from handtrack.errors import InputError
from handtrack.fitting.fit import fit
from handtrack.fitting.images import (
    MIN_POINTS,
    NOISE_PX,
    PRIOR_DEG,
    SPREAD_PX,
    ViewResults,
    shift_to_rays,
)
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.sequences.sequence import Sequence
from handtrack.video.detections import Detections

Array = NDArray[np.float64]

RATE_TOLERANCE = 0.01
"""Frame rates that differ by more than this share are not those of one rig."""
ABSURD_PX = 40.0
"""Views that disagree by more than this (median) are not those of this calibration."""


@dataclass(frozen=True, eq=False)
class Views:
    """One hand in the T frames of C synchronised cameras.

    Attributes:
        hand, name, source: as in a Sequence.
        cameras: C of them.
        time_ns, frame_index: (T,) int64.
        image: (T, C, 21, 2) [px], NaN where it was not seen.
        score: (T, C) how sure the detector was, 0..1.
        points: (T, 21, 3) [m] in the world: triangulated, or of a single camera its world
            joints, moved onto the rays of the picture. NaN where too little was seen.
        notes: what the user should know.
    """

    hand: Hand
    name: str
    source: str
    cameras: tuple[Camera, ...]
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    image: Array
    score: Array
    points: Array
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def weights(self) -> Array:
        """(T, C, 21): the score where a joint was seen, else 0."""
        return np.asarray(np.isfinite(self.image).all(-1) * self.score[..., None])

    def sequence(self) -> Sequence:
        """The points as a joint sequence, by which the hand is calibrated."""
        return Sequence(
            time_ns=self.time_ns,
            joints=self.points,
            confidence=np.repeat(self.score.max(1)[:, None], N_JOINTS, axis=1),
            hand=self.hand,
            frame_index=self.frame_index,
            name=self.name,
            source=self.source,
            notes=self.notes,
            detector="mediapipe" if len(self.cameras) == 1 else "mediapipe-3d",
        )


def views_of(detections: Items[Detections], cameras: Items[Camera]) -> list[Views]:
    """What synchronised cameras saw, hand by hand.

    Where every camera saw a single hand it is the same one, whatever the detector called it.

    Args:
        detections: of each camera's video, in the order of the cameras.
        cameras: their calibration.

    Raises:
        InputError: not as many cameras as videos, videos of different length or rate, pictures
            of another size than was calibrated, or a calibration that does not belong to them.
    """
    _check(detections, cameras)
    first = detections[0]
    single = all(len(d.hands) == 1 for d in detections)
    found = []
    for hand in HANDS:
        named: list[Hand] = [d.hands[0] if single else hand for d in detections]
        if single and hand != _by_votes(detections):
            continue
        score = np.stack([d.score[h] for d, h in zip(detections, named, strict=True)], 1)
        if not score.any():
            continue
        image = np.stack([d.image[h] for d, h in zip(detections, named, strict=True)], 1)
        notes: tuple[str, ...] = ()
        if len(set(named)) > 1:
            notes = (f"the cameras' detections were called left and right: taken as {hand}",)
        if len(cameras) > 1:
            _check_belongs(image, cameras, detections)
            points, _ = triangulate(
                cameras, image.transpose(1, 0, 2, 3), np.repeat(score.T[..., None], 21, -1)
            )
        else:
            points = _onto_rays(first.world[named[0]], image[:, 0], cameras[0])
        if not np.isfinite(points).any():
            continue
        found.append(
            Views(
                hand=hand,
                name=Path(first.source).stem,
                source=first.source,
                cameras=tuple(cameras),
                time_ns=first.time_ns,
                frame_index=first.frame_index,
                image=image,
                score=score,
                points=points,
                notes=notes,
            )
        )
    if not found:
        raise InputError("no hand is seen by two cameras at once", first.source)
    if len(found) > 1:
        found = [replace(v, name=f"{v.name} {v.hand}") for v in found]
    return found


def _by_votes(detections: Items[Detections]) -> Hand:
    votes = {h: sum(float(d.score[h].sum()) for d in detections) for h in HANDS}
    return max(HANDS, key=lambda h: votes[h])


def _check(detections: Items[Detections], cameras: Items[Camera]) -> None:
    if len(detections) != len(cameras):
        names = ", ".join(c.name for c in cameras)
        raise InputError(
            f"{len(detections)} videos for {len(cameras)} calibrated cameras ({names}):"
            " give them in the order of the calibration"
        )
    first = detections[0]
    for d in detections[1:]:
        if len(d) != len(first):
            raise InputError(
                f"{len(d)} frames, {first.source} has {len(first)}: the cameras must have run"
                " together",
                d.source,
            )
        rates = [_rate(first), _rate(d)]
        if abs(rates[0] - rates[1]) > RATE_TOLERANCE * rates[0]:
            raise InputError(
                f"{rates[1]:.2f} frames/s, {first.source} has {rates[0]:.2f}: the cameras must"
                " have run together",
                d.source,
            )
    for d, camera in zip(detections, cameras, strict=True):
        if camera.size is not None and camera.size != d.size:
            raise InputError(
                f"the pictures are {d.size[0]} x {d.size[1]}, camera {camera.name} was"
                f" calibrated for {camera.size[0]} x {camera.size[1]}",
                d.source,
            )


def _rate(d: Detections) -> float:
    return float(1e9 / np.median(np.diff(d.time_ns))) if len(d) > 1 else 1.0


def _check_belongs(image: Array, cameras: Items[Camera], detections: Items[Detections]) -> None:
    """Refuse a calibration by which the views do not see the same points."""
    for a, b in combinations(range(len(cameras)), 2):
        pair = image[:, [a, b]]
        both = np.isfinite(pair).all((1, 3))
        if both.sum() < N_JOINTS:
            continue
        seen = pair.transpose(1, 0, 2, 3)[:, both]
        points, _ = triangulate([cameras[a], cameras[b]], seen, inlier_px=np.inf)
        error = np.stack(
            [
                np.linalg.norm(cameras[c].project(points) - seen[i], axis=-1)
                for i, c in enumerate((a, b))
            ]
        )
        # points behind a camera are as wrong as can be
        median = float(np.median(np.where(np.isfinite(error), error, np.inf)))
        if median > ABSURD_PX:
            raise InputError(
                f"the calibration does not belong to these videos: by cameras {cameras[a].name}"
                f" and {cameras[b].name} the same joints are {median:.0f} px apart",
                detections[b].source,
            )


def _onto_rays(world: Array, image: Array, camera: Camera) -> Array:
    """(T, 21, 3): a camera's own world joints, moved to where its picture shows them."""
    out = np.full_like(world, np.nan)
    seen = np.isfinite(world).all((1, 2)) & np.isfinite(image).all((1, 2))
    for t in np.flatnonzero(seen):
        shift = shift_to_rays(world[t], camera.undistorted(image[t]))
        out[t] = (world[t] + shift - camera.translation) @ camera.rotation
    return out


DOUBT_PX = 8.0
"""A warm-started frame whose views are off by more (root mean square) is begun anew as well."""


@dataclass(frozen=True, eq=False)
class Followed:
    """What `follow` found.

    Attributes:
        sequence: joints (T, 21, 3) of the hand as fitted to the pictures, NaN where no camera
            saw the joint.
        reprojection: (T, C, 21) distance of the fitted joints to those seen [px], NaN where not
            seen.
        noise_mm: standard deviation per coordinate of the joints, as the reprojection errors
            show it at the hand's distance [mm].
    """

    sequence: Sequence
    reprojection: Array
    noise_mm: float


def follow(views: Views, model: HandModel) -> Followed:
    """Fit the hand to the pictures of every frame, each from the frame before.

    Where the frame before has no fit, or the fit is doubtful, it is begun anew from the fit to
    the points (triangulated, or a single camera's own), and the better is taken.

    Args:
        views: what the cameras saw.
        model: the hand, calibrated.
    """
    n = len(views)
    pixels, weights = np.nan_to_num(views.image), views.weights
    seen = weights > 0
    joints, marks = np.full((n, 21, 3), np.nan), np.full((n, 21, 3), np.nan)
    one = len(views.cameras) == 1
    stiffness = (NOISE_PX / np.deg2rad(PRIOR_DEG)) ** 2 if one else 0.0
    results = ViewResults(1)
    last: tuple[Array, Array] | None = None

    def run(t: int, start: tuple[Array, Array]) -> tuple[float, Array, Array, Array]:
        """Objective, angles, root and joints of a frame's fit from angles and root."""
        at = slice(t, t + 1)
        results.run(
            model, views.cameras, pixels[at], weights[at], start[0][None], start[1][None],
            SPREAD_PX, stiffness,
        )  # fmt: skip
        found = (results.angles, results.roots, results.joints)
        angles, root, placed = (array[0].copy() for array in found)
        return float(results.objective[0]), angles, root, placed

    for t in range(n):
        if seen[t].sum() < MIN_POINTS:
            last = None
            continue
        best = None if last is None else run(t, last)
        if best is None or best[0] > DOUBT_PX**2 * weights[t].sum():
            anew = _from_points(views, model, t)
            fresh = None if anew is None else run(t, anew)
            if fresh is not None and (best is None or fresh[0] < best[0]):
                best = fresh
        if best is None:
            continue
        last = (best[1], best[2])
        joints[t] = best[3]
        turned = model.landmarks_from_joints(best[1], best[2][:9].reshape(3, 3))
        marks[t] = best[3] + turned
    error = np.stack(
        [
            np.linalg.norm(camera.project(marks) - views.image[:, c], axis=-1)
            for c, camera in enumerate(views.cameras)
        ],
        1,
    )
    joints[~seen.any(1)] = np.nan
    sequence = Sequence(
        time_ns=views.time_ns,
        joints=joints,
        confidence=np.where(seen, weights, 0.0).max(1),
        hand=views.hand,
        frame_index=views.frame_index,
        name=views.name,
        source=views.source,
        notes=views.notes,
    )
    error = np.where(seen, error, np.nan)
    return Followed(sequence, error, _noise_mm(views, joints, error))


def _noise_mm(views: Views, joints: Array, error: Array) -> float:
    """Pixels as millimetres: at the joints' depth, over the focal length, by so many views."""
    per_pixel = []
    for camera in views.cameras:
        depth = joints @ camera.rotation[2] + camera.translation[2]
        per_pixel.append(np.nanmedian(depth) / np.sqrt(np.prod(np.diag(camera.matrix)[:2])))
    # two coordinates in each of C views stand for three of the joint
    variance = np.nanmedian(error**2) / (2 * np.log(2)) * np.mean(per_pixel) ** 2
    return float(1e3 * np.sqrt(variance / len(views.cameras)))


def _from_points(views: Views, model: HandModel, t: int) -> tuple[Array, Array] | None:
    """A pose by the points of a frame; None where there are too few."""
    if np.isfinite(views.points[t, :, 0]).sum() < MIN_POINTS:
        return None
    solid = fit(model, views.points[t], robust="huber")
    return solid.angles, np.concatenate([solid.rotation.ravel(), solid.translation])
