"""Public predictions of depth-image networks as clips of the benchmark's layout.

`xinghaochen/awesome-hand-pose-estimation` collects what networks predicted on the NYU data set's
test frames, as text: a line a frame, and for each of 14 joints u v [px] and depth [mm]; the labels
are written in the same way. The networks were trained on such labels: their errors have no bias of
definition. Twelve of the joints are ours, near enough: tips, PIP joints, the thumb's IP and MCP
and, between two points at the wrist, the wrist; the others are missing.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from handtrack.errors import InputError
from tools.bench.rendered.layout import Array, Clip

FOCAL, CENTRE = np.array([588.03, 587.07]), np.array([320.0, 240.0])
"""Of the depth camera [px]."""
FPS = 25.0
FRAMES = 600
SUBJECTS = (2440,)
"""Frames at which the test set's subject changes."""
# little finger's tip and PIP, ring, middle, index; the thumb's tip, IP, MCP; then two at the wrist
OURS = (20, 18, 16, 14, 12, 10, 8, 6, 4, 3, 2)
WRIST = (11, 12)
JOINTS = 14


def read_text(path: Path) -> Array:
    """(T, 21, 3) joints in the camera's frame [m], x right, y down; NaN where there is none.

    Raises:
        InputError: not there, or a line is not of 42 numbers.
    """
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"no text file of predictions ({error})", path) from None
    values = np.empty((len(lines), 3 * JOINTS))
    for i, line in enumerate(lines):
        try:
            values[i] = [float(word) for word in line.split()]
        except ValueError:
            raise InputError(
                f"line {i + 1}: expected {3 * JOINTS} numbers, u v depth of {JOINTS} joints", path
            ) from None
    uvd = values.reshape(-1, JOINTS, 3)
    depth = 1e-3 * uvd[..., 2:]
    given = np.concatenate([(uvd[..., :2] - CENTRE) / FOCAL * depth, depth], axis=-1)
    joints = np.full((len(given), 21, 3), np.nan)
    joints[:, OURS] = given[:, : len(OURS)]
    joints[:, 0] = given[:, list(WRIST)].mean(1)
    return joints


def network_clips(predictions: Path, labels: Path, frames: int = FRAMES) -> list[Clip]:
    """Clips of that many frames, each of one subject; the right hand of both.

    Raises:
        InputError: as `read_text`; or the two have not as many lines.
    """
    seen, truth = read_text(predictions), read_text(labels)
    if len(seen) != len(truth):
        raise InputError(f"{len(seen)} lines, the labels have {len(truth)}", predictions)
    ends = [end for end in (*SUBJECTS, len(seen)) if end <= len(seen)]
    clips = []
    begin = 0
    for number, end in enumerate(ends):
        for start in range(begin, max(end - frames // 2, begin + 1), frames):
            part = slice(start, min(start + frames, end))
            clips.append(
                Clip(
                    f"{predictions.stem}-{start:05d}",
                    "right",
                    np.rint(np.arange(part.stop - start) * 1e9 / FPS).astype(np.int64),
                    truth[part],
                    subject=f"nyu{number}",
                    detector=predictions.stem,
                    joints=seen[part],
                )
            )
        begin = end
    return clips
