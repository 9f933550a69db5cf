"""Time that jumps or goes at no camera's rate; hands and joints that are suddenly elsewhere."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.auditing.findings import Finding
from handtrack.evaluation.arrays import Array, lengths
from handtrack.evaluation.motion import gaps_between
from handtrack.evaluation.shake import palm_motion
from handtrack.hand.skeleton import PALM
from handtrack.sequences.sequence import Sequence
from handtrack.sequences.skeleton_check import median

_GLITCH_M, _JOINT_M = 0.03, 0.02
"""How far the palm, or a joint in the palm's frame, may be from between its neighbours in time."""
_TIMES = 10.0
"""And how many times as far as it usually is."""
_SPEED_M_S = 12.0
"""No hand is as fast."""
_TURN_DEG = 30.0
"""How far the palm may be turned from between its neighbours in time."""
_FPS = 1.0, 1000.0
"""Frames a second that are let pass."""


def time_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """Steps of time that are no frame's."""
    steps = np.diff(s.time_ns) * 1e-9
    numbers["fps"] = float(1 / np.median(steps)) if len(steps) else float("nan")
    rate = numbers["fps"]
    if s.timed and not (np.isnan(rate) or _FPS[0] <= rate <= _FPS[1]):
        yield Finding(
            "time",
            f"{rate:.4g} frames/s; {_FPS[0]:g} to {_FPS[1]:g} are let pass: times are in another"
            " unit",
            s.present.copy(),
            max(_FPS[0] / rate, rate / _FPS[1]),
        )
    broken = gaps_between(s.time_ns, len(s)) if s.timed else np.zeros(len(s) - 1, dtype=bool)
    if broken.any():
        usual = float(np.median(steps))
        worst = float(max(steps[broken].max() / usual, usual / steps[broken].min()))
        yield Finding(
            "time",
            f"time jumps {int(broken.sum())} times: a step of {worst:.3g} times the usual"
            f" {1e3 * usual:.3g} ms, or its inverse; half to 1.5 times are let pass",
            _frames(s, np.concatenate([[False], broken])),
            worst / 1.5,
        )


def jump_findings(s: Sequence, numbers: dict[str, float]) -> Iterator[Finding]:
    """A hand that is suddenly elsewhere, or turned, and joints that are without their hand."""
    middle, turns = palm_motion(s.joints)
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
    turned = np.rad2deg(_turned(turns, broken))
    most_deg = max(_TURN_DEG, _TIMES * float(median(turned, 0)))
    spun = (turned > most_deg) & ~marks
    if spun.any():
        far = float(turned[spun].max())
        yield Finding(
            "jump",
            f"the palm is turned by {far:.0f} degrees from between its neighbours in time;"
            f" {most_deg:.0f} is let pass",
            _frames(s, spun),
            far / most_deg,
        )
        marks = marks | spun
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


def _between(x: Array, broken: NDArray[np.bool_]) -> Array:
    """(T, n) distance of points (T, n, 3) from the middle of those before and after; NaN at gaps.

    A point that jumps for one frame is found, and its neighbours by half as much.
    """
    out = np.full(x.shape[:2], np.nan)
    if len(x) > 2:
        out[1:-1] = lengths(x[1:-1] - (x[2:] + x[:-2]) / 2)
        out[1:-1][broken[1:] | broken[:-1]] = np.nan
    return out


def _turned(turns: Array, broken: NDArray[np.bool_]) -> Array:
    """(T,) angle [rad] of palms (T, 3, 3) from half way between those before and after."""
    out = np.full(len(turns), np.nan)
    if len(turns) > 2:
        step = np.einsum("tji,tjk->tik", turns[:-1], turns[1:])
        # half the difference of two steps is the distance from their middle
        out[1:-1] = 0.5 * _angle(np.einsum("tij,tkj->tik", step[1:], step[:-1]))
        out[1:-1][broken[1:] | broken[:-1]] = np.nan
    return out


def _angle(turns: Array) -> Array:
    return np.asarray(np.arccos(np.clip((np.trace(turns, axis1=1, axis2=2) - 1) / 2, -1, 1)))


def _frames(s: Sequence, marks: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return marks[:, None] & s.present
