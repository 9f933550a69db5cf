"""Errors of an estimate against a reference, and the other numbers the field reports.

Everywhere the estimate `a` comes first and the reference `b` second, both (T, J, 3) in one
unit, any unit; results are in that unit. A joint with a missing (NaN) coordinate in either is
left out; a frame in which nothing is left gives NaN. Nothing changes its arguments.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from handtrack.errors import InputError, SettingsError
from handtrack.evaluation.alignment import (
    align,
    pa_mpjpe,
    pa_mpvpe,
    procrustes,
    reflection_pa_mpjpe,
    rigid_pa_mpjpe,
)
from handtrack.evaluation.anatomy import (
    LimitViolations,
    angle_error,
    bone_length_drift,
    bone_lengths,
    limit_violations,
    self_intersection,
)
from handtrack.evaluation.arrays import Array, in_blocks, lengths, nan_mean, pair, points
from handtrack.evaluation.motion import acceleration, acceleration_error, jitter, lag
from handtrack.files.long_arrays import blocks
from handtrack.hand.capsules import FINGER_RADII
from handtrack.hand.skeleton import FINGERS, N_JOINTS

__all__ = [
    "FINGER_RADII",
    "FREIHAND_RANGE",
    "F_THRESHOLDS",
    "RHD_RANGE",
    "LimitViolations",
    "acceleration",
    "acceleration_error",
    "align",
    "angle_error",
    "auc",
    "bone_length_drift",
    "bone_lengths",
    "errors",
    "f_score",
    "jitter",
    "lag",
    "limit_violations",
    "mpjpe",
    "mpvpe",
    "nan_mean",
    "pa_mpjpe",
    "pa_mpvpe",
    "pck",
    "per_finger",
    "per_joint",
    "procrustes",
    "reflection_pa_mpjpe",
    "rigid_pa_mpjpe",
    "root_aligned_mpjpe",
    "self_intersection",
]

FREIHAND_RANGE = (0.0, 0.05)
"""Thresholds of FreiHAND's AUC [m]."""
RHD_RANGE = (0.02, 0.05)
"""Thresholds of the AUC on RHD and STB [m]."""
F_THRESHOLDS = (0.005, 0.015)
"""Thresholds of FreiHAND's F-scores [m]."""


def errors(a: ArrayLike, b: ArrayLike) -> Array:
    """Distance of each joint to its reference, (..., J); NaN where either is missing.

    Raises:
        InputError: shapes differ or values are infinite.
    """
    return in_blocks(lambda x, y: lengths(x - y), *pair(a, b))


def mpjpe(a: ArrayLike, b: ArrayLike) -> Array:
    """Mean per joint position error: mean over joints of |a_j - b_j|, no alignment.

    Args:
        a: estimate (T, J, 3), NaN = missing.
        b: reference (T, J, 3), same unit.

    Returns:
        (T,) in that unit.

    Raises:
        InputError: shapes differ or values are infinite.
    """
    return in_blocks(lambda x, y: nan_mean(lengths(x - y)), *pair(a, b))


def root_aligned_mpjpe(a: ArrayLike, b: ArrayLike, root: int = 0) -> Array:
    """MPJPE after both hands were moved so that joint `root` (the wrist) is at the origin.

    The root itself, then always 0, is part of the mean, as the field has it.

    Returns:
        (T,) in the unit of a; NaN where the root is missing in either.
    """
    a, b = pair(a, b)
    return mpjpe(a - a[..., root : root + 1, :], b - b[..., root : root + 1, :])


def mpvpe(a: ArrayLike, b: ArrayLike) -> Array:
    """Mean per vertex position error: `mpjpe` of mesh vertices (T, V, 3) that correspond."""
    return mpjpe(a, b)


def per_joint(a: ArrayLike, b: ArrayLike) -> Array:
    """(J,) mean error of each joint over all frames (T, J, 3); `align` first for aligned ones."""
    e = errors(a, b)
    return nan_mean(e.reshape(-1, e.shape[-1]), 0)


def per_finger(a: ArrayLike, b: ArrayLike) -> dict[str, float]:
    """Mean error over all frames and joints of the wrist and of each finger (T, 21, 3)."""
    e = errors(a, b)
    if e.shape[-1] != N_JOINTS:
        raise InputError(f"{e.shape[-1]} joints, expected 21")
    e = e.reshape(-1, N_JOINTS)
    out = {"wrist": float(nan_mean(e[:, 0]))}
    for f, finger in enumerate(FINGERS):
        out[finger] = float(nan_mean(e[:, 1 + 4 * f : 5 + 4 * f], None))
    return out


def pck(a: ArrayLike, b: ArrayLike, thresholds: ArrayLike | None = None) -> Array:
    """Share of correct keypoints: in which part of the frames a joint's error is <= threshold.

    Args:
        a, b: (T, J, 3), same unit.
        thresholds: (N,) in that unit; FreiHAND's 100 from 0 to 0.05 (metres) by default.

    Returns:
        (J, N), each row a joint's curve; NaN rows for joints never seen.
        `nan_mean(curve, 0)` is the curve that papers plot.
    """
    t = np.linspace(*FREIHAND_RANGE, 100) if thresholds is None else np.asarray(thresholds)
    return pck_of_errors(errors(a, b), t)


def pck_of_errors(error: Array, thresholds: ArrayLike) -> Array:
    """`pck` from distances (..., J) and thresholds (N,) in one unit."""
    t = np.asarray(thresholds, dtype=np.float64).ravel()
    e = error.reshape(-1, error.shape[-1])
    joints = e.shape[1]
    order = np.argsort(t)
    counts, known = np.zeros(joints * (t.size + 1), np.int64), np.zeros((joints, 1), np.int64)
    for part in blocks(len(e)):
        # how many of each joint's errors first fall below each threshold, counted in one go
        first = np.searchsorted(t[order], e[part], side="left")  # NaN sorts to the end
        cells = first + (t.size + 1) * np.arange(joints)
        counts += np.bincount(cells.ravel(), minlength=counts.size)
        known += (~np.isnan(e[part])).sum(0)[:, None]
    below = counts.reshape(joints, t.size + 1)[:, :-1].cumsum(1)
    curve = np.empty((joints, t.size))
    curve[:, order] = np.where(known > 0, below / np.maximum(known, 1), np.nan)
    return curve


def auc(
    a: ArrayLike,
    b: ArrayLike,
    minimum: float = FREIHAND_RANGE[0],
    maximum: float = FREIHAND_RANGE[1],
    steps: int = 100,
) -> float:
    """Area under the PCK curve, as part of the largest possible, 0..1.

    FreiHAND's definition: trapezoid rule over linspace(minimum, maximum, steps), divided by
    the range, for each joint; then the mean over joints.

    Args:
        a, b: (T, J, 3), same unit.
        minimum, maximum: range of thresholds in that unit; the defaults are metres.
        steps: number of thresholds.

    Raises:
        SettingsError: the range is empty or steps < 2.
    """
    return auc_of_errors(errors(a, b), minimum, maximum, steps)


def auc_of_errors(error: Array, minimum: float, maximum: float, steps: int = 100) -> float:
    """`auc` from distances (..., J) and a range in one unit."""
    if not minimum < maximum or steps < 2:
        raise SettingsError(f"AUC over {minimum}..{maximum} with {steps} thresholds is empty")
    thresholds = np.linspace(minimum, maximum, steps)
    curve = pck_of_errors(error, thresholds)
    areas = np.trapezoid(curve, thresholds, axis=1) / (maximum - minimum)
    return float(nan_mean(areas))


def f_score(a: ArrayLike, b: ArrayLike, thresholds: ArrayLike = F_THRESHOLDS) -> Array:
    """F-score of two point sets: harmonic mean of precision and recall within a distance.

    Precision is the share of estimated points with a reference point nearer than the
    threshold, recall the share of reference points with an estimated one (Knapitsch et al.
    2017; FreiHAND, at 5 and 15 mm). Points need not correspond, nor be equally many.

    Args:
        a: (T, V, 3) estimate.
        b: (T, W, 3) reference, same unit.
        thresholds: one or N distances in that unit; the defaults are metres.

    Returns:
        (T, N), or (T,) for a single threshold; 0..1, NaN where either set is empty.

    Raises:
        InputError: numbers of frames differ, or values are infinite.
    """
    from scipy.spatial import cKDTree

    a, b = points(a, "the estimate's points"), points(b, "the reference's points")
    if a.ndim != 3 or b.ndim != 3 or len(a) != len(b):
        raise InputError(f"the estimate has shape {a.shape}, the reference {b.shape}")
    limits = np.atleast_1d(np.asarray(thresholds, dtype=np.float64))
    out = np.full((len(a), limits.size), np.nan)
    for t in range(len(a)):
        p, q = a[t][~np.isnan(a[t, :, 0])], b[t][~np.isnan(b[t, :, 0])]
        if not len(p) or not len(q):
            continue
        to_reference = np.asarray(cKDTree(q).query(p)[0])
        to_estimate = np.asarray(cKDTree(p).query(q)[0])
        precision = (to_reference[:, None] < limits).mean(0)
        recall = (to_estimate[:, None] < limits).mean(0)
        total = precision + recall
        out[t] = np.where(total > 0, 2 * precision * recall / np.where(total > 0, total, 1), 0.0)
    return out if np.ndim(thresholds) else out[:, 0]
