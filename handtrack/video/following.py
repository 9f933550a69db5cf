"""A hand followed through the pictures of calibrated cameras: reprojection fits over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from handtrack.fitting.fit import fit
from handtrack.fitting.images import (
    MIN_POINTS,
    NOISE_PX,
    PRIOR_DEG,
    SPREAD_PX,
    ViewResults,
    fit_2d,
)
from handtrack.hand.model import HandModel
from handtrack.sequences.sequence import Sequence
from handtrack.video.views import Array, Views

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
    """A pose by the points of a frame, or without points by a picture alone; None where too few are
    seen."""
    if np.isfinite(views.points[t, :, 0]).sum() < MIN_POINTS:
        if len(views.cameras) > 1:
            return None
        found = fit_2d(model, views.image[t], views.cameras, views.weights[t])
        return found.angles, np.concatenate([found.rotation.ravel(), found.translation])
    solid = fit(model, views.points[t], robust="huber")
    return solid.angles, np.concatenate([solid.rotation.ravel(), solid.translation])
