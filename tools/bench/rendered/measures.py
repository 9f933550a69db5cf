"""How near an estimate is to the truth, and how it moves; means over clips with intervals."""

from __future__ import annotations

from collections.abc import Sequence as Many
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.evaluation.metrics import acceleration_error, jitter, nan_mean, pa_mpjpe
from tools.bench.rendered.bones import aligned, bone_frames, in_bones
from tools.bench.rendered.cases import Case
from tools.bench.rendered.layout import Array

NUMBERS = ("pa_mm", "moving_mm", "acceleration", "jitter", "jitter_truth", "angle_deg", "said")
REPEATS = 2000


def measure(joints: Array, angles: Array | None, case: Case) -> dict[str, float]:
    """The numbers of one estimate on the frames in which something was detected.

    Returns:
        pa_mm: PA-MPJPE, mean over frames.
        moving_mm: the same without each joint's mean error in its bone's frame.
        acceleration: error of the second derivative, after each frame's alignment [m/s^2].
        jitter, jitter_truth: mean third derivative [m/s^3]; of one camera about the hand's
            middle, for both.
        angle_deg: mean over the 20 angles of the distance to the true ones; NaN without.
        said: share of those frames in which there is an estimate.
    """
    truth, time_ns = case.clip.truth_joints, case.clip.time_ns
    detected = np.asarray(np.isfinite(case.joints).all(-1).any(-1))
    mine = np.where(detected[:, None, None], joints, np.nan)
    pa = pa_mpjpe(mine, truth)
    near = aligned(mine, truth)
    error = in_bones(near - truth, bone_frames(truth, case.clip.hand))
    moving = np.linalg.norm(error - nan_mean(error, 0), axis=-1)
    fps = 1e9 / float(np.median(np.diff(time_ns)))
    pulled = acceleration_error(near, truth, time_ns) * fps**2
    both = np.where(np.isnan(mine), np.nan, truth)
    out = {
        "pa_mm": 1e3 * float(nan_mean(pa)),
        "moving_mm": 1e3 * float(nan_mean(moving, None)),
        "acceleration": float(nan_mean(pulled)),
        "jitter": float(nan_mean(jitter(_placed(mine, case), time_ns=time_ns))),
        "jitter_truth": float(nan_mean(jitter(_placed(both, case), time_ns=time_ns))),
        "angle_deg": np.nan,
        "said": float(np.isfinite(pa).sum() / detected.sum()),
    }
    if angles is not None and case.angles is not None:
        off = np.abs(angles - case.angles)[detected]
        out["angle_deg"] = float(np.rad2deg(nan_mean(off, None)))
    return out


def _placed(joints: Array, case: Case) -> Array:
    return joints - joints.mean(1, keepdims=True) if case.centred else joints


class Interval(NamedTuple):
    """A number with its 95 % interval over clips."""

    value: float
    low: float
    high: float


def summary(rows: Many[dict[str, Any]], raw: Many[dict[str, Any]]) -> dict[str, Any]:
    """One method's numbers over clips, against the raw detections of the same clips.

    Intervals are of the bootstrap over clips. Clips on which the method failed are counted, and
    left out on both sides.
    """
    ok = [(a, b) for a, b in zip(rows, raw, strict=True) if np.isfinite(a["pa_mm"])]
    out: dict[str, Any] = {"clips": len(ok), "failed": len(rows) - len(ok)}
    if not ok:
        return out
    draws = np.random.default_rng(0).integers(len(ok), size=(REPEATS, len(ok)))
    for name in NUMBERS:
        values = np.array([a[name] for a, _ in ok])
        base = np.array([b[name] for _, b in ok])
        out[name] = _interval(values, draws)
        if name in ("pa_mm", "moving_mm"):
            out[f"{name}_ratio"] = _interval(values, draws, base)
    pa = np.array([(a["pa_mm"], b["pa_mm"]) for a, b in ok])
    out["nearer"] = float((pa[:, 0] < pa[:, 1]).mean())
    return out


def _interval(values: Array, draws: NDArray[np.int64], base: Array | None = None) -> Interval:
    """Of the mean, or of the ratio of two means."""
    if not np.isfinite(values).all():
        return Interval(np.nan, np.nan, np.nan)
    value, drawn = values.mean(), values[draws].mean(1)
    if base is not None:
        value, drawn = value / base.mean(), drawn / base[draws].mean(1)
    low, high = np.quantile(drawn, [0.025, 0.975])
    return Interval(float(value), float(low), float(high))
