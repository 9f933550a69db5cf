"""Shakes: of the whole hand, and of the fingers seen from its palm; all through or for a while."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from handtrack.auditing.bones import marked_runs, slow
from handtrack.auditing.findings import Finding, Marks
from handtrack.evaluation.arrays import Array, lengths, nan_mean
from handtrack.evaluation.motion import gaps_between
from handtrack.evaluation.shake import bends, followed, palm_motion, shake_values
from handtrack.hand.skeleton import N_JOINTS, PALM
from handtrack.sequences.sequence import Sequence
from handtrack.sequences.skeleton_check import median

_SHAKE_MM, _SHAKE_DEG = 1.75, 8.0
"""Median shakes of the palm and of the fingers that are let pass."""
_WHITE_MM = 1.5
"""Of the palm's shake, what must be faster than a quick motion: third differences, divided by
what white noise of 1 mm makes of them."""
_STRONG_MM = 2.5
"""More than that is a shake however fast."""
_WHILE, _LEAST = 15, 10
"""Frames that a passing shake is the median over, and that it lasts at least."""
_FINGERS_MM, _CARRIED = 1.0, 1.5
"""White noise of the fingers' joints along an axis beyond what the palm's makes them, seen in the
palm's frame, that is let pass; and that share."""
_PALM_LOSES = 18 / 12
"""Six of the palm's 18 coordinates are its place and turn."""
_ONE_DEG, _TIMES = 6.0, 2.5
"""One finger's shake, where it is so many times that of the middle one."""


def shake_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """The whole hand's shake, and that of the fingers by themselves."""
    palm = palm_motion(s.joints)
    values = shake_values(s.joints, s.time_ns, palm=palm)
    broken = gaps_between(s.time_ns, len(s))
    hand, fingers = values["palm_mm"], values["fingers_deg"]
    usual = numbers["shake_palm_mm"] = float(median(hand, 0))
    numbers["shake_fingers_deg"] = float(median(fingers, 0))
    white = 1e3 * _white(palm[0], broken)
    whole = usual > _STRONG_MM or (usual > _SHAKE_MM and median(white, 0) > _WHITE_MM)
    around = slow(np.stack([hand, white, fingers], 1), _WHILE)
    marks = (around[:, 0] > _SHAKE_MM) & (around[:, 1] > _WHITE_MM)
    marks = _lasting(marks) | (whole & (hand > _SHAKE_MM))
    yield from _found(s, "hand shakes", marks, around[:, 0], _SHAKE_MM, "mm")
    marks = _lasting(around[:, 2] > _SHAKE_DEG) | (
        (numbers["shake_fingers_deg"] > _SHAKE_DEG) & (fingers > _SHAKE_DEG)
    )
    yield from _unlike_the_palm(s, palm, broken, numbers)
    single = _single(s, broken)
    marked = np.zeros(s.present.shape, dtype=bool)
    for f in range(5):
        marked[:, 1 + 4 * f : 5 + 4 * f] = single[1][:, f, None]
    if marks.any():
        marked |= marks[:, None]
    most = np.where(marks, around[:, 2], np.where(single[1], single[0], 0).max(1))
    limit = _SHAKE_DEG if marks.any() else _ONE_DEG
    yield from _found(s, "fingers shake", marked, most, limit, "degrees")


def _found(
    s: Sequence, kind: str, marks: Marks, size: Array, most: float, unit: str
) -> Iterator[Finding]:
    if not marks.any():
        return
    marks = (marks if marks.ndim == 2 else marks[:, None]) & s.present
    frames = marks.any(1)
    if not frames.any():
        return
    usual = float(median(size[frames], 0))
    n = int(frames.sum())
    text = (
        f"{kind} by {usual:.3g} {unit} about parabolas through 11 frames, in {n} frames (median);"
        f" {most:g} is let pass"
    )
    yield Finding(kind, text, marks, max(1.0, usual / most))


def _lasting(marks: Marks) -> Marks:
    """(T,) only what lasts."""
    out = np.zeros(len(marks), dtype=bool)
    for first, last in marked_runs(np.asarray(marks), _LEAST):
        out[first : last + 1] = True
    return out


def _white(x: Array, broken: Marks) -> Array:
    """(T,) of points (T, 3) the size of white noise that makes their third differences."""
    out = np.full(len(x), np.nan)
    if len(x) > 3:
        out[1:-2] = lengths(np.diff(x, 3, axis=0)) / np.sqrt(20)
        out[1:-2][np.lib.stride_tricks.sliding_window_view(broken, 3).any(1)] = np.nan
    return out


def _unlike_the_palm(
    s: Sequence, palm: tuple[Array, Array], broken: Marks, numbers: dict[str, float]
) -> Iterator[Finding]:
    """Fingers that shake more, all through, than what shakes the palm's joints would make them:
    noise that is alike in all joints is no shake of the fingers."""
    middle, turns = palm
    inside = np.einsum("tji,tkj->tki", turns, s.joints - middle[:, None])
    free = np.setdiff1d(np.arange(N_JOINTS), PALM)
    square = 1e6 * _fast_squares(inside, broken)
    own = _CARRIED**2 * _PALM_LOSES * square[:, list(PALM)].mean(1)
    fingers = square[:, free]
    beside = median(own, 0)
    excess = float(np.sqrt(np.maximum(median(fingers.mean(1), 0) - beside, 0.0)))
    numbers["shake_fingers_mm"] = excess
    # a joint alone is over few numbers: its mean is of all frames
    shaken = nan_mean(fingers, 0) - nan_mean(own[:, None], 0) > _FINGERS_MM**2
    marks = np.zeros(s.present.shape, dtype=bool)
    marks[:, free] = shaken & s.present[:, free]
    if excess > _FINGERS_MM and marks.any():
        text = (
            f"the fingers' joints shake by {excess:.2g} mm an axis beyond what the palm's do, all"
            f" through; {_FINGERS_MM:g} is let pass"
        )
        yield Finding("fingers shake", text, marks, excess / _FINGERS_MM)


def _fast_squares(x: Array, broken: Marks) -> Array:
    """(T, n) variance along an axis [m^2] of the white noise that makes the third differences of
    points (T, n, 3)."""
    out = np.full(x.shape[:2], np.nan)
    if len(x) > 3:
        out[1:-2] = np.square(np.diff(x, 3, axis=0)).mean(2) / 20
        out[1:-2][np.lib.stride_tricks.sliding_window_view(broken, 3).any(1)] = np.nan
    return out


def _single(s: Sequence, broken: Marks) -> tuple[Array, Marks]:
    """(T, 5) each finger's shake [degrees], and where only that finger's is large."""
    angles = bends(s.joints)
    fast = np.rad2deg(angles - followed(angles, broken)).reshape(len(s), 5, 3)
    sizes = slow(np.sqrt(np.square(fast[:, :, 1:]).mean(2)), _WHILE)
    middle = median(sizes, 1)[:, None]
    large = (sizes > _ONE_DEG) & (sizes > _TIMES * middle)
    return sizes, np.stack([_lasting(large[:, f]) for f in range(5)], 1)
