"""FreeMoCap's arrays and tables (mm): a hand each, or body, right hand, left hand and face."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.raw import Raw, stem

_HAND = re.compile(r"(?i)mediapipe_.*(left|right)_hand")
_BODY = 33
_WHOLE = (75, 543, 553)
"""Points of MediaPipe's holistic model: without a face, with it, and with its eyes."""


def with_unit(raws: list[Raw], path: Path) -> list[Raw]:
    """The same in mm, where a file's name says that FreeMoCap wrote it."""
    named = _HAND.match(path.name) is not None
    return [replace(r, unit="mm") if named and r.unit is None else r for r in raws]


def holistic(array: Any, path: Path) -> list[Raw] | None:
    """The hands of an array (T, N, 3) of bodies; None where it is none."""
    if array.ndim != 3 or array.shape[1] not in _WHOLE or array.shape[2] != 3:
        return None
    if array.dtype.kind not in "fiu" or not len(array):
        return None
    sides: tuple[Hand, Hand] = ("right", "left")
    note = f"{array.shape[1]} points a frame: body, right hand, left hand, face; the hands are read"
    return [
        Raw(
            array[:, _BODY + N_JOINTS * k : _BODY + N_JOINTS * (k + 1)].astype(np.float64),
            path,
            stem(path),
            hand=hand,
            unit="mm" if "mediapipe" in path.name.lower() else None,
            tagged=True,
            detector="mediapipe-3d" if "mediapipe" in path.name.lower() else "",
            notes=(note,) if k == 0 else (),
        )
        for k, hand in enumerate(sides)
    ]


FORMATS = (
    Format(
        "FreeMoCap, anipose, DeepLabCut",
        "`mediapipe_right_hand_3d_xyz.npy` or `.csv`, `*_spatialXYZ.npy` of bodies; 3D tables",
        "mediapipe, or by name",
        "mm (FreeMoCap)",
        "by name",
        "file names, columns",
    ),
)
