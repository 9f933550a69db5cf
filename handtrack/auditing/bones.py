"""Bones that jump, breathe or are no hand's; joints that bend as none can."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.auditing.findings import Finding, Marks, some
from handtrack.evaluation.anatomy import bone_lengths
from handtrack.evaluation.arrays import Array, nan_mean
from handtrack.evaluation.shake import bends
from handtrack.hand.skeleton import BASES, JOINT_NAMES, N_JOINTS, ORDERS
from handtrack.sequences.chirality import frame_chirality
from handtrack.sequences.sequence import Sequence
from handtrack.sequences.size import palm_length
from handtrack.sequences.skeleton_check import (
    GOOD,
    better_order,
    folded_back,
    median,
    misfit,
)

SLOW = 31
"""Frames whose median is a slow part."""


def robust_deviation(x: Array) -> Array:
    """Standard deviation (n,) of what is not far off, from the median of distances (T, n)."""
    return np.asarray(1.4826 * median(np.abs(x - median(x, 0)), 0))


def slow(x: Array, frames: int = SLOW) -> Array:
    """Median (T, n) over the frames about each; fewer at the ends; NaN of nothing."""
    half = frames // 2
    edge = np.full((half, x.shape[1]), np.nan)
    padded = np.concatenate([edge, x, edge])
    out = np.empty(x.shape)
    for start in range(0, len(x), _BLOCK):  # windows are copied when sorted
        part = padded[start : min(start + _BLOCK, len(x)) + 2 * half]
        windows = np.lib.stride_tricks.sliding_window_view(part, frames, axis=0)
        out[start : start + _BLOCK] = median(np.ascontiguousarray(windows), 2)
    return out


def marked_runs(marks: NDArray[np.bool_], least: int) -> list[tuple[int, int]]:
    """First and last frame of every run of at least so many marked frames."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], marks, [False]]).astype(np.int8)))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2) if b - a >= least]


_BLOCK = 4000


_JUMP, _JUMP_SPREADS = 0.15, 8.0
"""A bone that is so much longer or shorter than it was (logarithm), and beyond its noise."""
_FLASH, _FLASH_SPREADS = 0.12, 5.0
"""The same of one that is so for a few frames, beside those around them."""
_BREATH = 0.04
"""Slow changes of the hand's size, or of one bone's, that are let pass."""
_SIZED, _SIZE = 7, 0.06
"""The same of the size's median over few frames."""
_PALM_M = (0.06, 0.125)
"""Wrist to knuckles, of a child of four to the largest adult."""
_NO_HAND, _FEW = 1.65, 10
"""A misfit that no hand has, and frames that are too few to tell."""
_OPPOSITE, _VOTES = 0.5, 9
_LEAST_RUN = 5
# farther than any joint bends: PIP and DIP, with 15 degrees for landmarks that are no centres
_FOLD_DEG = {1: 150.0, 2: 125.0, 3: 115.0}
_BACK_DEG = {2: 40.0, 3: 60.0}


def bone_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Lengths that change, at once or slowly."""
    with np.errstate(divide="ignore"):
        logs = np.log(bone_lengths(s.joints))
    logs = np.where(np.isfinite(logs), logs, np.nan)
    size = median(logs - median(logs, 0), 1)[:, None]  # one camera's depth: all bones together
    off = logs - median(logs, 0) - size
    numbers["bones_percent"] = 100 * float(nan_mean(np.expm1(robust_deviation(off))))
    numbers["size_percent"] = 100 * float(np.expm1(robust_deviation(size)[0]))
    yield from _jumps(off - slow(off), np.maximum(_JUMP, _JUMP_SPREADS * robust_deviation(off)))
    beside = off - _beside(off)
    yield from _jumps(beside, np.maximum(_FLASH, _FLASH_SPREADS * _noise_of(beside, s.joints)))
    breath = np.abs(slow(off)), np.abs(slow(size))
    # the whole hand's size is of so many bones that it needs no long window
    breath = breath[0], np.fmax(breath[1], np.abs(slow(size, _SIZED)) * (_BREATH / _SIZE))
    # noise is averaged over the window, but not to nothing
    bounds = np.maximum(_BREATH, 1.5 * robust_deviation(off - slow(off))), np.array([_BREATH])
    marks = _of_bones(breath[0] > bounds[0]) | (breath[1] > bounds[1])
    marks &= s.present
    sized = breath[1][:, 0] > _BREATH
    if marked_runs(np.asarray(marks.any(1)), 2 * _LEAST_RUN) or marked_runs(sized, _LEAST_RUN):
        worst = max(float(np.nanmax(b)) for b in breath if not np.isnan(b).all())
        yield Finding(
            "bones breathe",
            f"bones or the whole hand change their size slowly, by up to"
            f" {100 * float(np.expm1(worst)):.0f} %; {100 * _BREATH:.0f} % is let pass",
            marks,
            worst / _BREATH,
        )


def _jumps(off: Array, most: Array) -> Iterator[Finding]:
    """Bones that are longer or shorter by `off` (T, 20) than noise makes them (20,)."""
    jumps = np.abs(off) > most
    if not jumps.any():
        return
    t, b = np.unravel_index(int(np.nanargmax(np.where(jumps, np.abs(off) / most, 0))), off.shape)
    yield Finding(
        "bone jumps",
        f"a bone changes its length by {100 * float(np.expm1(np.abs(off[t, b]))):.0f} % in a"
        f" frame; noise explains {100 * float(np.expm1(most[b])):.0f} %",
        _of_bones(jumps),
        float(np.abs(off[t, b]) / most[b]),
    )


def _beside(x: Array) -> Array:
    """Median (T, n) of the three frames before and the three after each."""
    padded = np.concatenate([np.full((3, x.shape[1]), np.nan), x, np.full((3, x.shape[1]), np.nan)])
    return median(np.stack([padded[i : i + len(x)] for i in (0, 1, 2, 4, 5, 6)]), 0)


def _noise_of(off: Array, joints: Array) -> Array:
    """(20,) deviation of each bone's logarithm, no less than the joints' usual noise makes it:
    few frames do not tell it well."""
    own = robust_deviation(off)
    usual = median(bone_lengths(joints), 0)
    shared = median((own * usual)[:, None], 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.fmax(own, shared / usual))


def shape_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """A hand of no human's size, or whose joints are another order's."""
    everywhere = s.present.copy()
    palm = palm_length(s.joints)
    numbers["palm_mm"] = 1e3 * palm
    if palm > 0 and not _PALM_M[0] <= palm <= _PALM_M[1]:
        ratio = max(palm / _PALM_M[1], _PALM_M[0] / palm)
        yield Finding(
            "unit",
            f"wrist to knuckles is {1e3 * palm:.4g} mm, of a hand 60 to 125: another unit or scale",
            everywhere,
            float(ratio),
        )
    yield from _order_findings(s)


def _order_findings(s: Sequence) -> Iterator[Finding]:
    """Joints of another order, told by bones that fit, that fold back or that are no hand's."""
    own = ORDERS["handtrack"]
    other = better_order(s.joints, own, len(s))
    if other is not None:
        moved = [JOINT_NAMES[i] for i, place in enumerate(other.picks) if place != i]
        name = f"in the order {other.name}" if other.name else f"with others as {some(moved)}"
        text = f"the joints make a hand {name}: misfit {other.misfit:.2f} instead of"
        yield _order(s, f"{text} {misfit(s.joints, own):.2f} (a hand's is below {GOOD})")
        return
    folded = [JOINT_NAMES[j] for j in folded_back(s.joints, own)] if len(s) >= _FEW else []
    if folded:
        yield _order(
            s,
            f"bones fold back by more than 135 degrees at {some(folded)} in most"
            " frames: joints of a finger in another order",
        )
        return
    value = misfit(s.joints, own)
    if len(s) >= _FEW and value > _NO_HAND:
        yield _order(
            s, f"the bones are no hand's in this order: misfit {value:.2f}, of a hand below {GOOD}"
        )


def _order(s: Sequence, text: str) -> Finding:
    return Finding("order", text, s.present.copy(), 4.0)


def side_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Fingers that flex like the other hand's."""
    sign = 1.0 if s.hand == "right" else -1.0
    votes = sign * frame_chirality(s.joints)
    calm = slow(votes[:, None], _VOTES)[:, 0]
    numbers["chirality"] = float(median(votes, 0))
    wrong = calm < -_OPPOSITE
    runs = marked_runs(wrong, _LEAST_RUN)
    if runs:
        marks = np.zeros(s.present.shape, dtype=bool)
        for first, last in runs:
            marks[first : last + 1] = s.present[first : last + 1]
        where = (
            "throughout" if marks.any(1).mean() > 0.5 else f"in {int(marks.any(1).sum())} frames"
        )
        yield Finding(
            "other hand",
            f"the fingers of this {s.hand} hand flex like the other's, {where}",
            marks,
            float(-np.nanmin(calm) / _OPPOSITE),
        )


def limit_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Fingers folded into themselves, or bent backwards."""
    bent, backwards = signed_bends(s)
    marks = np.zeros(s.present.shape, dtype=bool)
    worst = 0.0
    for angles, fingers, limits in (
        (bent, slice(0, 5), _FOLD_DEG),
        (backwards, slice(1, 5), _BACK_DEG),
    ):
        for place, most in limits.items():
            times = np.nan_to_num(angles[:, fingers, place - 1] / most)
            marks[:, BASES[fingers] + place - 1] |= times > 1
            worst = max(worst, float(times.max(initial=0.0)))
    numbers["bent_deg"] = float(np.nanmax(bent, initial=0.0))
    if marks.any():
        n = int(marks.any(1).sum())
        text = f"a finger bends as none can, {worst:.2f} times as far as joints go, in {n} frames"
        yield Finding("beyond limits", text, marks, worst)


def signed_bends(s: Sequence) -> tuple[Array, Array]:
    """(T, 5, 3) angle at MCP, PIP and DIP of each finger [degrees], and how much of it is
    backwards (0 where it flexes)."""
    bent = np.rad2deg(bends(s.joints)).reshape(len(s), 5, 3)
    x = s.joints
    across = x[:, 5] - x[:, 17]
    across = across * (1.0 if s.hand == "right" else -1.0)
    out = np.zeros_like(bent)
    for f, base in enumerate(BASES):
        bones = np.diff(x[:, base : base + 4], axis=1)
        axis = np.cross(bones[:, :2], bones[:, 1:])
        back = np.einsum("tij,tj->ti", axis, across) < 0
        out[:, f, 1:] = np.where(back, bent[:, f, 1:], 0.0)
    return bent, out


def _of_bones(marks: Marks) -> Marks:
    """(T, 21) of (T, 20) bones: a bone's far joint."""
    out = np.zeros((len(marks), N_JOINTS), dtype=bool)
    out[:, 1:] = marks
    return out
