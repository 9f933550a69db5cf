"""A track as BVH (Biovision hierarchy): a skeleton with fingers, and its motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import SettingsError
from handtrack.exporting.motion import Motion, offsets
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_vector, vector_to_matrix
from handtrack.hand.skeleton import BASES, JOINT_NAMES
from handtrack.hand.units import METRES

Array = NDArray[np.float64]

_UNEVEN = 0.25
"""Frames farther than this share of a step from an even grid are brought onto it."""
_LONG_S = 10.0
"""A time without frames that is longer than this would only be a hand that stands still [s]."""
_SHORT_S = 1.0
"""What such times are shortened to [s]."""
_MOST = 20
"""Frames on the grid for each frame of the motion, at most ..."""
_FREE = 1000
"""... and these."""
_FIXED = 6  # digits after the point
_BLOCK = 4096  # frames turned into text at a time


def write_bvh(model: HandModel, moved: Motion, path: Path, unit: str = "cm") -> str:
    """Write the motion of a hand.

    Joints are named with their hand (`right_index_mcp`). The root is the wrist: `Xposition
    Yposition Zposition Zrotation Xrotation Yrotation`, in the world with y up. Every finger
    joint has `Zrotation Xrotation Yrotation` (R = Rz Rx Ry,
    degrees) in the frame of its parent; at zero the hand is flat and all frames lie parallel.
    The tips are end sites.

    BVH knows one frame time only. Where the frames do not come evenly, the motion is brought
    onto an even grid of the median step, between frames by interpolation. Times of more than
    10 s without frames are shortened to 1 s, so that no gap fills the file.

    Args:
        model: its rest joints give the offsets.
        moved: its motion.
        path: the file.
        unit: of offsets and positions; BVH names none, and most programs take its numbers for cm.

    Returns:
        What was done beyond writing the frames as they are, in words; else "".

    Raises:
        SettingsError: the unit is unknown.
    """
    metres = next((size for known, size in METRES.items() if known == unit), None)
    if metres is None:
        raise SettingsError(f"unit is {unit!r}, expected one of {', '.join(METRES)}")
    scale = 1.0 / metres
    step, moved, note = _even(moved)
    frames = len(moved.time_s)
    values = np.empty((frames, 3 + 3 * 16))
    values[:, :3] = moved.wrist * scale
    values[:, 3:] = np.rad2deg(euler_zxy(moved.rotations)).reshape(frames, -1)
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("HIERARCHY\n")
        file.write("\n".join(_hierarchy(offsets(model) * scale, model.hand)))
        file.write(f"\nMOTION\nFrames: {frames}\nFrame Time: {step:.9f}\n")
        line = " ".join([f"%.{_FIXED}f"] * values.shape[1]) + "\n"
        for start in range(0, frames, _BLOCK):
            block = np.round(values[start : start + _BLOCK], _FIXED) + 0.0  # no -0.0
            file.write((line * len(block)) % tuple(block.ravel()))
    return note


def _hierarchy(offset: Array, hand: str) -> list[str]:
    """The skeleton's lines, joints in the order of their channels."""

    def place(joint: int) -> str:
        return "OFFSET " + " ".join(f"{x:.{_FIXED}f}" for x in offset[joint] + 0.0)

    turns = "Zrotation Xrotation Yrotation"
    lines = [
        f"ROOT {hand}_{JOINT_NAMES[0]}",
        "{",
        f"  {place(0)}",
        f"  CHANNELS 6 Xposition Yposition Zposition {turns}",
    ]
    for base in BASES:
        for depth in range(3):
            joint, indent = base + depth, "  " * (depth + 1)
            lines += [
                f"{indent}JOINT {hand}_{JOINT_NAMES[joint]}",
                f"{indent}{{",
                f"{indent}  {place(joint)}",
                f"{indent}  CHANNELS 3 {turns}",
            ]
        lines += ["        End Site", "        {", f"          {place(base + 3)}", "        }"]
        lines += ["  " * depth + "}" for depth in (3, 2, 1)]
    return [*lines, "}"]


def euler_zxy(rotations: Array) -> Array:
    """Angles z, x, y (T, P, 3) [rad] with R = Rz(z) Rx(x) Ry(y) of rotations (T, P, 3, 3).

    Of the many triples of a rotation the one nearest to the frame before is taken, so that
    programs that interpolate the numbers find no jumps.
    """
    r = np.asarray(rotations, np.float64)
    # Rz Rx Ry has the rows (.., -sz cx, ..), (.., cz cx, ..), (-cx sy, sx, cx cy)
    x = np.arcsin(np.clip(r[..., 2, 1], -1, 1))
    steep = np.abs(r[..., 2, 1]) > 1 - 1e-12  # z and y turn about the same axis
    z = np.where(
        steep, np.arctan2(r[..., 1, 0], r[..., 0, 0]), np.arctan2(-r[..., 0, 1], r[..., 1, 1])
    )
    y = np.where(steep, 0.0, np.arctan2(-r[..., 2, 0], r[..., 2, 2]))
    out = np.unwrap(np.stack([z, x, y], -1), axis=0)
    if len(out) > 1 and np.abs(np.diff(out, axis=0)).max() > np.pi / 2:
        _nearest(out)
    return np.asarray(out)


def _nearest(triples: Array) -> None:
    """Take in every frame the triple that is nearest to the one before, in place."""
    flip = np.array([np.pi, np.pi, np.pi])
    for t in range(1, len(triples)):
        same = triples[t]
        other = flip + same * [1, -1, 1]
        both = np.stack([same, other])
        both += 2 * np.pi * np.round((triples[t - 1] - both) / (2 * np.pi))
        far = np.abs(both - triples[t - 1]).sum(-1)
        triples[t] = np.where((far[0] <= far[1])[:, None], both[0], both[1])


def _even(moved: Motion) -> tuple[float, Motion, str]:
    """The step [s], and the motion on the grid of that step."""
    time = moved.time_s
    if len(time) < 2:
        return 1 / 30, moved, ""
    # the mean step of even stamps is free of their rounding
    step = float(time[-1] - time[0]) / (len(time) - 1)
    if np.abs(time - time[0] - step * np.arange(len(time))).max() <= _UNEVEN * step:
        return step, moved, ""
    step = float(np.median(np.diff(time)))
    time, note = _shortened(time, step)
    count = int(np.floor((time[-1] - time[0]) / step + 1e-6)) + 1
    if count > _MOST * len(time) + _FREE:  # bursts of frames far apart: a coarser grid
        count = _MOST * len(time) + _FREE
        step = float(time[-1] - time[0]) / (count - 1)
    grid = time[0] + step * np.arange(count)
    after = np.clip(np.searchsorted(time, grid, "left"), 1, len(time) - 1)
    share = np.clip((grid - time[after - 1]) / (time[after] - time[after - 1]), 0, 1)
    wrist = moved.wrist[after - 1] + share[:, None] * (moved.wrist[after] - moved.wrist[after - 1])
    before = moved.rotations[after - 1]
    turn = matrix_to_vector(before.swapaxes(-1, -2) @ moved.rotations[after])
    rotations = before @ vector_to_matrix(share[:, None, None] * turn)
    held = np.where(share < 0.5, moved.held[after - 1], moved.held[after])
    even = f"uneven times: brought onto an even grid of {1 / step:.2f} frames/s ({count} frames)"
    return step, Motion(grid, wrist, rotations, held), f"{even}{note}"


def _shortened(time: Array, step: float) -> tuple[Array, str]:
    """The times with long gaps made short, and what to say of it."""
    steps = np.diff(time)
    long = steps > max(_LONG_S, 2 * step)
    if not long.any():
        return time, ""
    left_out = float((steps[long] - max(_SHORT_S, step)).sum())
    steps[long] = max(_SHORT_S, step)
    count = int(long.sum())
    gaps = f"{count} gap{'s' * (count > 1)}"
    note = f"; {gaps} of more than {_LONG_S:.0f} s shortened, {left_out:,.0f} s left out"
    return time[0] + np.concatenate([[0.0], np.cumsum(steps)]), note
