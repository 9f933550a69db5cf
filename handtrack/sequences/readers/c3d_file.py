"""Reader of .c3d, the mocap systems' binary file of markers, by the library c3d.

Points whose residual is below 0 were not seen. Units and rate stand in the parameters
POINT:UNITS and POINT:RATE; a label over several parameters (LABELS, LABELS2) goes on. Markers are
joints by their names, or by `--markers`.
"""

from __future__ import annotations

import io
import struct
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.markers import Markers, frames_told, stated_unit, told_apart
from handtrack.sequences.readers.raw import Array, Raw, stem

_MARK, _BLOCK = 0x50, 512
_MOST_POINTS, _MOST_LABELS = 10_000, 20
_DAMAGED = (
    *(AssertionError, AttributeError, IndexError, KeyError, OSError, OverflowError, EOFError),
    *(RuntimeError, TypeError, ValueError, ZeroDivisionError, struct.error, MemoryError),
)


def is_c3d(data: bytes) -> bool:
    """Whether a file's parameters stand where its first byte says, for one of three processors."""
    if data[1:2] != bytes([_MARK]):
        return False
    at = _BLOCK * (data[0] - 1)
    return at > 0 and data[at + 3 : at + 4] in (b"\x54", b"\x55", b"\x56")


def read_c3d(data: bytes, path: Path) -> list[Raw]:
    """The markers of a .c3d file.

    Raises:
        InputError: the library is not installed, or the file is damaged or cut short.
    """
    try:
        import c3d
    except ImportError:
        raise InputError(
            '.c3d needs the package c3d: pip install "handtrack[formats]"', path
        ) from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            reader = c3d.Reader(io.BytesIO(data))
            _check_size(reader, len(data), path)
            labels = _labels(reader)
            points, seen = _points(reader)
            units = _text(reader, "POINT:UNITS").lower()
            rate = float(reader.point_rate)
            first = int(reader.first_frame)
            told = int(reader.last_frame) - first + 1
    except InputError:
        raise
    except _DAMAGED as error:
        raise InputError(
            f"the .c3d file is damaged or cut short ({shown(str(error), 100)})", path
        ) from None
    if not len(points) or not points.shape[1]:
        raise InputError("holds no points of markers", path)
    names = [labels[i] if i < len(labels) and labels[i] else f"*{i}" for i in range(len(points[0]))]
    points[~seen] = np.nan
    raw = Raw(points, path, stem(path), pending=Markers(tuple(told_apart(names))))
    raw.notes = tuple(frames_told(told, len(points)))
    raw.unit = stated_unit(units, path)
    raw.fps = rate if np.isfinite(rate) and rate > 0 else None
    raw.frame_index = first + np.arange(len(points))
    return [raw]


def _check_size(reader: Any, size: int, path: Path) -> None:
    """Refuse a header that tells of more than the file can hold."""
    n, frames = int(reader.point_used), int(reader.last_frame) - int(reader.first_frame) + 1
    word = 4 if reader.point_scale < 0 else 2
    if not 0 <= n <= _MOST_POINTS or frames < 1 or 4 * n * word > size:
        raise InputError(
            f"the header tells of {frames} frames of {n} points, the file has {size} bytes", path
        )


def _points(reader: Any) -> tuple[Array, np.ndarray]:
    """(T, N, 3) places and (T, N) whether each was seen."""
    frames = [points[:, :4].astype(np.float64) for _, points, _ in reader.read_frames()]
    if not frames:
        return np.empty((0, 0, 3)), np.empty((0, 0), dtype=bool)
    all_of = np.stack(frames)
    return all_of[..., :3], all_of[..., 3] >= 0


def _text(reader: Any, name: str) -> str:
    parameter = reader.get(name)
    if parameter is None:
        return ""
    return bytes(parameter.bytes).decode("latin-1").strip("\0 ")[:40]


def _labels(reader: Any) -> list[str]:
    found: list[str] = []
    for k in range(1, _MOST_LABELS):
        parameter = reader.get(f"POINT:LABELS{k if k > 1 else ''}")
        if parameter is None:
            break
        width = int(parameter.dimensions[0]) if len(parameter.dimensions) else 0
        raw = bytes(parameter.bytes)
        if width:
            found += [
                raw[i : i + width].decode("latin-1").strip("\0 ") for i in range(0, len(raw), width)
            ]
    return found


FORMATS = (
    Format(
        "Motion capture: .c3d",
        "markers named as joints, or by a file of pairs; also without wrist or tips",
        "by name",
        "as the file says",
        "by name",
        "file magic",
        "`--markers FILE` for other names; extra `formats`",
        kinds={"c3d": read_c3d},
        suffixes=(".c3d",),
        ways=(Way("bytes", lambda data, path: is_c3d(data), read_c3d),),
    ),
)
