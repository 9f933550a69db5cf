"""Time that jumps, frames that repeat, hands and joints that are suddenly elsewhere, shakes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.auditing.findings import Finding
from handtrack.evaluation.arrays import Array, lengths
from handtrack.evaluation.motion import gaps_between
from handtrack.evaluation.shake import palm_motion, shake_values
from handtrack.hand.skeleton import PALM
from handtrack.sequences.sequence import Sequence
from handtrack.sequences.skeleton_check import median

_GLITCH_M, _JOINT_M = 0.03, 0.02
"""How far the palm, or a joint in the palm's frame, may be from between its neighbours in time."""
_TIMES = 10.0
"""And how many times as far as it usually is."""
_SPEED_M_S = 12.0
"""No hand is as fast."""
_SHAKE_MM, _SHAKE_DEG = 2.5, 8.0
"""Median shakes of the palm and of the fingers that are let pass."""


def time_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Steps of time that are no frame's."""
    steps = np.diff(s.time_ns) * 1e-9
    numbers["fps"] = float(1 / np.median(steps)) if len(steps) else float("nan")
    broken = gaps_between(s.time_ns, len(s)) if s.timed else np.zeros(len(s) - 1, dtype=bool)
    if broken.any():
        usual = float(np.median(steps))
        worst = float(max(steps[broken].max() / usual, usual / steps[broken].min()))
        yield Finding(
            "time",
            f"time jumps {int(broken.sum())} times: a step of {worst:.3g} times the usual"
            f" {1e3 * usual:.3g} ms, or its inverse",
            _frames(s, np.concatenate([[False], broken])),
            worst / 1.5,
        )


def frozen_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Frames that are an earlier one to the last digit."""
    seen: dict[bytes, int] = {}
    marks = np.zeros(len(s), dtype=bool)
    for t in np.flatnonzero(s.present.any(1)):
        key = s.joints[t].tobytes()
        marks[t] = key in seen
        seen.setdefault(key, int(t))
    numbers["repeated_percent"] = 100 * float(marks.mean())
    if marks.any():
        n = int(marks.sum())
        held = marks & np.concatenate([[False], (s.joints[1:] == s.joints[:-1]).any((1, 2))])
        how = "the frame before" if held.sum() > n / 2 else "an earlier frame"
        text = f"{n} frames repeat {how} to the last digit"
        yield Finding("frozen", text, _frames(s, marks), 1 + 9 * float(marks.mean()))


def motion_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Jumps and shakes, both seen from the palm."""
    palm = palm_motion(s.joints)
    yield from _jump_findings(s, palm, numbers)
    yield from _shake_findings(s, palm, numbers)


def _jump_findings(
    s: Sequence, palm: tuple[Array, Array], numbers: dict[str, float]
) -> Iterator[Finding]:
    """A hand that is suddenly elsewhere, and joints that are without their hand."""
    middle, turns = palm
    broken = gaps_between(s.time_ns, len(s))
    off = _between(middle[:, None], broken)[:, 0]
    most = max(_GLITCH_M, _TIMES * float(median(off, 0)))
    step = np.concatenate([[np.nan], lengths(np.diff(middle, axis=0))])
    speed = step / np.concatenate([[np.nan], np.diff(s.time_ns) * 1e-9])
    numbers["palm_speed_m_s"] = float(np.nanmax(speed, initial=0.0))
    marks = (off > most) | ((speed > _SPEED_M_S) & (step > _GLITCH_M) & (off > _GLITCH_M))
    if marks.any():
        far = float(np.nanmax(np.where(marks, off, 0)))
        yield Finding(
            "jump",
            f"the hand is {1e3 * far:.0f} mm from between its neighbours in time;"
            f" {1e3 * most:.0f} mm is let pass",
            _frames(s, marks),
            max(1.0, far / most),
        )
    inside = np.einsum("tji,tkj->tki", turns, s.joints - middle[:, None])
    beside = _between(inside, broken)
    limit = np.maximum(_JOINT_M, _TIMES * median(beside, 0))
    single = (beside > limit) & ~marks[:, None]
    # the palm's own joints pull its frame along: what jumps is what is farthest off
    single[:, PALM] &= beside[:, PALM] >= 0.5 * np.nanmax(beside, axis=1, initial=0.0)[:, None]
    if single.any():
        times = np.where(single, beside / limit, 0)
        t, j = np.unravel_index(int(np.nanargmax(times)), times.shape)
        yield Finding(
            "joint jumps",
            f"a joint is {1e3 * beside[t, j]:.0f} mm from between its neighbours in time, seen"
            f" from the palm; {1e3 * limit[j]:.0f} mm is let pass",
            single & s.present,
            float(times[t, j]),
        )


def _shake_findings(
    s: Sequence, palm: tuple[Array, Array], numbers: dict[str, float]
) -> Iterator[Finding]:
    """The whole hand's shake, and that of the fingers by themselves."""
    values = shake_values(s.joints, s.time_ns, palm=palm)
    for kind, name, most, unit in (
        ("hand shakes", "palm_mm", _SHAKE_MM, "mm"),
        ("fingers shake", "fingers_deg", _SHAKE_DEG, "degrees"),
    ):
        usual = float(median(values[name], 0))
        numbers[f"shake_{name}"] = usual
        if usual > most:
            text = f"{kind} by {usual:.3g} {unit} about parabolas (median); {most:g} is let pass"
            yield Finding(kind, text, _frames(s, values[name] > most), usual / most)


def _between(x: Array, broken: NDArray[np.bool_]) -> Array:
    """(T, n) distance of points (T, n, 3) from the middle of those before and after; NaN at gaps.

    A point that jumps for one frame is found, and its neighbours by half as much.
    """
    out = np.full(x.shape[:2], np.nan)
    if len(x) > 2:
        out[1:-1] = lengths(x[1:-1] - (x[2:] + x[:-2]) / 2)
        out[1:-1][broken[1:] | broken[:-1]] = np.nan
    return out


def _frames(s: Sequence, marks: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return marks[:, None] & s.present
