"""A hand followed through the pictures of calibrated cameras: reprojection fits over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from handtrack.detectors.chosen import chosen_profile
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
from handtrack.tracking.settings import FilterSettings, TrackSettings
from handtrack.video.one_camera import STIFFNESS, poses_of_joints, steady_depths
from handtrack.video.views import Array, Views

DOUBT_PX = 8.0
"""A warm-started frame whose views are off by more (root mean square) is begun anew as well."""

DOUBTFUL = 1.25
"""Of the usual reprojection error; a frame of one camera that has more is believed less."""
FEW, MANY = 10, 300
"""Frames that tell what is usual, at least and at most."""
CORRECTED = 0.8
"""How much of what a profile corrects in points is corrected in several cameras' pictures: a hand
that is fitted to all of them takes some out by itself. Less brings joints nearer, down to a half,
and angles farther off."""
LASTING = 2.0
"""Errors that last from frame to frame are no more than so many times as loud to a filter."""


@dataclass(frozen=True, eq=False)
class Followed:
    """What `follow` found.

    Attributes:
        sequence: joints (T, 21, 3) of the hand as fitted to the pictures, NaN where no camera
            saw the joint.
        reprojection: (T, C, 21) distance of the fitted joints to those seen [px], NaN where not
            seen.
        noise_mm: standard deviation per coordinate of the joints, as the reprojection errors
            show it at the hand's distance, of several cameras the louder the longer they last [mm].
    """

    sequence: Sequence
    reprojection: Array
    noise_mm: float


def follow(
    views: Views,
    model: HandModel,
    shown: HandModel | None = None,
    settings: TrackSettings | None = None,
) -> Followed:
    """Fit the hand to the pictures of every frame.

    Of one camera whose points were measured: from their poses, to which the angles are held. Else
    each from the frame before; where that has no fit, or the fit is doubtful, it is begun anew from
    the fit to the points, or to the picture alone, and the better is taken. Of several cameras
    what each saw of landmarks is moved as the detector's profile corrects the points.

    Args:
        views: what the cameras saw.
        model: the hand, calibrated, with the landmarks that the points are.
        shown: of one camera, the hand with the landmarks that pictures show. Without it points are
            no measurement, and only begin a fit.
        settings: whose landmarks the points are, and, of one camera, the filter that steadies
            their angles and the hand's distance; the defaults if left out.
    """
    chosen, detected = TrackSettings() if settings is None else settings, views.image
    if len(views.cameras) > 1 and model.has_landmarks:
        views = views.corrected(chosen_profile(chosen.detector, views.seen_by), CORRECTED)
    n, held = len(views), np.full((len(views), 32), np.nan)
    if shown is not None and len(views.cameras) == 1 and np.isfinite(views.points).any():
        held = np.concatenate(poses_of_joints(views, model, chosen), axis=1)
    shown = model if shown is None else shown
    is_whole = chosen.filter.name == "rts"
    fits = _Fits(views, shown, _believed(views, is_whole))
    joints, marks = _fitted(fits, views, model, held)
    seen, pictured = fits.seen, np.stack([c.project(marks) for c in views.cameras], 1)
    off = np.where(seen[..., None], pictured - views.image, np.nan)
    error, trust = np.linalg.norm(off, axis=-1), np.ones(n)
    noise_mm = _noise_mm(views, joints, error)
    if len(views.cameras) > 1:
        noise_mm *= _louder(off)
    if np.isfinite(held).any():
        joints += _steadier(joints, views, chosen.filter)
        trust = _trust(error[:, 0], is_whole)
    elif len(views.cameras) > 1 and is_whole:
        # one that looks back only is not nearer by it
        trust = _trust(error.reshape(n, -1), is_whole)
    joints[~seen.any(1)] = np.nan
    sequence = Sequence(
        time_ns=views.time_ns,
        joints=joints,
        confidence=trust[:, None] * np.where(seen, fits.weights, 0.0).max(1),
        hand=views.hand,
        frame_index=views.frame_index,
        name=views.name,
        source=views.source,
        notes=views.notes,
    )
    reprojection = np.where(seen, np.linalg.norm(pictured - detected, axis=-1), np.nan)
    return Followed(sequence, reprojection, noise_mm)


def _fitted(fits: _Fits, views: Views, model: HandModel, held: Array) -> tuple[Array, Array]:
    """Joints and landmarks (T, 21, 3) of the hand in every frame, NaN where there is no fit."""
    n = len(views)
    joints, marks = np.full((n, 21, 3), np.nan), np.full((n, 21, 3), np.nan)
    last: _Pose | None = None
    for t in range(n):
        if fits.seen[t].sum() < MIN_POINTS:
            last = None
            continue
        if np.isfinite(held[t]).all():
            last = fits.run(t, _Pose(held[t, :20], held[t, 20:]), STIFFNESS)
        else:
            last = fits.next(t, last, lambda t: _from_points(views, model, fits.shown, t))
        if last is not None:
            joints[t] = last.joints
            turn = last.root[:9].reshape(3, 3)
            marks[t] = last.joints + fits.shown.landmarks_from_joints(last.angles, turn)
    return joints, marks


def _steadier(joints: Array, views: Views, filter: FilterSettings) -> Array:
    """(T, 1, 3) how hands are to be moved along their rays, so that their distance is steady."""
    camera = views.cameras[0]
    rays = joints.mean(1) - camera.centre
    distance = np.linalg.norm(rays, axis=1)
    steady = steady_depths(distance, views.time_ns, filter.name, filter.lag)
    return np.asarray((rays * (steady / distance - 1.0)[:, None])[:, None])


class _Pose(NamedTuple):
    """angles (20,), root (12,), joints (21, 3) once it is fitted, and the objective of its fit."""

    angles: Array
    root: Array
    joints: Array = np.zeros(0)
    objective: float = np.inf


class _Fits:
    """Fits of a hand to the frames of some views."""

    def __init__(self, views: Views, shown: HandModel, believed: Array) -> None:
        self.weights, self.seen = views.weights * believed[..., None], views.weights > 0
        self._cameras, self.shown = views.cameras, shown
        self._pixels, self._results = np.nan_to_num(views.image), ViewResults(1)
        # one camera cannot see depth well
        self._loose = (NOISE_PX / np.deg2rad(PRIOR_DEG)) ** 2 if len(views.cameras) == 1 else 0.0

    def run(self, t: int, start: _Pose, stiffness: float) -> _Pose:
        """A frame's fit from a pose, whose angles are a prior."""
        at, results = slice(t, t + 1), self._results
        results.run(
            self.shown,
            self._cameras,
            self._pixels[at],
            self.weights[at],
            start.angles[None],
            start.root[None],
            SPREAD_PX,
            stiffness,
        )
        found = (results.angles, results.roots, results.joints)
        angles, root, joints = (array[0].copy() for array in found)
        return _Pose(angles, root, joints, float(results.objective[0]))

    def next(self, t: int, last: _Pose | None, anew: Callable[[int], _Pose | None]) -> _Pose | None:
        """A frame's fit from the frame before, or from where it is begun anew if that is better."""
        best = None if last is None else self.run(t, last, self._loose)
        if best is None or best.objective > DOUBT_PX**2 * self.weights[t].sum():
            start = anew(t)
            fresh = None if start is None else self.run(t, start, self._loose)
            if fresh is not None and (best is None or fresh.objective < best.objective):
                best = fresh
        return best


def _trust(error: Array, is_whole: bool) -> Array:
    """(T,) how far frames are believed: one that suits its picture badly shows another hand.

    Args:
        error: (T, n) of what is seen of the frame [px], NaN where not seen.
        is_whole: compared with all frames; else with those before.
    """
    known = np.flatnonzero(np.isfinite(error).any(1))
    size, trust = np.nanmean(error[known], axis=1), np.ones(len(error))
    usual = _usual(size, is_whole)
    trust[known] = np.minimum(1.0, (DOUBTFUL * usual / np.maximum(size, 1e-9)) ** 6)
    return trust


def _usual(size: Array, is_whole: bool) -> Array:
    """(T,) what sizes (T, ...) are usually, NaN left out: of all, or of those before; inf where
    these are too few to tell."""
    n = len(size)
    if is_whole:
        return np.full(n, np.nanmedian(size) if np.isfinite(size).any() else np.inf)
    usual = np.full(n, np.inf)
    for i in range(FEW, n):
        before = size[max(0, i - MANY) : i + 1]
        if np.isfinite(before).any():
            usual[i] = np.nanmedian(before)
    return usual


def _believed(views: Views, is_whole: bool) -> Array:
    """(T, C) how far each of several cameras is believed: by how far what it saw is from where
    all of them put the hand; a wrong detection is wrong in all joints."""
    count = len(views.cameras)
    if count == 1:
        return np.ones((len(views), 1))
    off = np.stack([c.project(views.points) for c in views.cameras], 1) - views.image
    error, seen = np.linalg.norm(off, axis=-1), np.isfinite(off).all(-1)
    size = np.nansum(error, -1) / np.maximum(seen.sum(-1), 1)
    size[~seen.any(-1)] = np.nan
    usual = _usual(size, is_whole)[:, None]
    # views of which nothing is known are as good as any
    share = np.nan_to_num(size / np.maximum(usual, 1e-9), nan=1.0)
    return np.asarray(1.0 / (1.0 + share**2))


def _louder(off: Array) -> float:
    """How much louder errors (T, C, 21, 2) are to a filter that takes them for new in every frame:
    by how much the mean of many frames is worse, sqrt((1 + r) / (1 - r)), up to LASTING."""
    left = off - np.nansum(off, axis=0) / np.maximum(np.isfinite(off).sum(0), 1)
    pairs = np.stack([left[:-1], left[1:]])
    pairs = pairs[:, np.isfinite(pairs).all(0)]
    if len(off) < FEW or not pairs.size:
        return 1.0
    r = float(np.clip(pairs.prod(0).sum() / max((pairs**2).mean(0).sum(), 1e-12), 0.0, 0.99))
    return min(LASTING, float(np.sqrt((1.0 + r) / (1.0 - r))))


def _noise_mm(views: Views, joints: Array, error: Array) -> float:
    """Pixels as millimetres: at the joints' depth, over the focal length, by so many views."""
    per_pixel = []
    for camera in views.cameras:
        depth = joints @ camera.rotation[2] + camera.translation[2]
        per_pixel.append(np.nanmedian(depth) / np.sqrt(np.prod(np.diag(camera.matrix)[:2])))
    # two coordinates in each of C views stand for three of the joint
    variance = np.nanmedian(error**2) / (2 * np.log(2)) * np.mean(per_pixel) ** 2
    return float(1e3 * np.sqrt(variance / len(views.cameras)))


def _from_points(views: Views, model: HandModel, shown: HandModel, t: int) -> _Pose | None:
    """A pose by the points of a frame, or without points by a picture alone; None where too few are
    seen."""
    if np.isfinite(views.points[t, :, 0]).sum() >= MIN_POINTS:
        found = fit(model, views.points[t], robust="huber")
    elif len(views.cameras) > 1:
        return None
    else:
        found = fit_2d(shown, views.image[t], views.cameras, views.weights[t])
    return _Pose(found.angles, np.concatenate([found.rotation.ravel(), found.translation]))
