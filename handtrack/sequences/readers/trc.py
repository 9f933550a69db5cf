"""Reader of .trc, Motion Analysis' table of markers, as OpenSim, Cortex, OptiTrack and Pose2Sim
write it.

    PathFileType  4  (X/Y/Z)  walk.trc
    DataRate  CameraRate  NumFrames  NumMarkers  Units  OrigDataRate ...
    100.00  100.00  250  21  mm  100.00 ...
    Frame#  Time  RWRIST      RTHUMB1 ...
              X1  Y1  Z1  X2  Y2  Z2 ...

    1  0.000  812.3  1020.4  -33.1 ...

Empty cells are missing. Markers are joints by their names, or by `--markers`.
"""

from __future__ import annotations

import re
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.fields import frame_numbers
from handtrack.sequences.readers.jsontext import as_utf8
from handtrack.sequences.readers.markers import Markers, frames_told, stated_unit, told_apart
from handtrack.sequences.readers.raw import Raw, as_fps, stem
from handtrack.sequences.readers.table_cells import Table

START = b"PathFileType"
_MOST = 2000
_HEAD = 20
_AXES = re.compile(r"[XYZxyz]_?\d*")


def read_trc(data: bytes, path: Path) -> list[Raw]:
    """The markers of a .trc file, which are joints by their names or by a companion.

    Raises:
        InputError: a header that is cut short, or rows that do not fit it.
    """
    text = as_utf8(data).decode("utf-8", "replace").removeprefix("\ufeff")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    named = next((i for i, li in enumerate(lines[:_HEAD]) if li.lower().startswith("frame")), None)
    if named is None or named < 2:
        raise InputError("the header is cut short: expected a line that begins with Frame#", path)
    said = _header([li for li in lines[:named] if li.strip()])
    names = _names(lines[named], path)
    begin = named + 1
    while begin < len(lines) and not _is_row(lines[begin]):
        begin += 1
    rows = [(n, li) for n, li in enumerate(lines[begin:], begin + 1) if li.strip()]
    if not rows:
        raise InputError("a header, but no frames", path)
    values = _values(rows, names, path, not lines[-1].strip())
    notes = frames_told(said.get("numframes", ""), len(rows))
    rate = said.get("datarate")
    markers = values[:, 2:].reshape(len(values), len(names), 3)
    raw = Raw(markers, path, stem(path), pending=Markers(tuple(names)), notes=tuple(notes))
    raw.unit = stated_unit(said.get("units", ""), path)
    raw.fps = None if rate is None else as_fps(rate, path)
    raw.frame_index = frame_numbers(values[:, 0], len(values), path, "Frame#")
    if np.isfinite(values[:, 1]).all() and len(values) > 1:
        raw.stamps = Stamps(values[:, 1], "Time", "s", [f"line {n}" for n, _ in rows])
    return [raw]


def _header(lines: list[str]) -> dict[str, str]:
    """What the header says, by its titles."""
    for title, value in pairwise(lines):
        if title.lower().startswith("datarate"):
            keys, cells = title.split(), value.split()
            return {k.lower(): c for k, c in zip(keys, cells, strict=False)}
    return {}


def _names(line: str, path: Path) -> list[str]:
    """The markers' names, each over its three columns."""
    cells = [c.strip() for c in (line.split("\t") if "\t" in line else line.split())]
    names = [c for c in cells[2:] if c]
    # names of columns, as some write them: wrist_x wrist_y wrist_z
    whole = len(names) % 3 == 0 and all(
        {names[i + k][-1:].lower() for k in range(3)} == {"x", "y", "z"}
        and len({n[:-1] for n in names[i : i + 3]}) == 1
        for i in range(0, len(names), 3)
    )
    if whole and names:
        names = [n[:-1].rstrip("_. ") for n in names[::3]]
    if not names or len(names) > _MOST:
        raise InputError(f"names {len(names)} markers in the line of Frame#", path)
    return told_apart(names)


def _is_row(line: str) -> bool:
    first = line.split("\t")[0].split()[:1]
    try:
        return bool(first) and np.isfinite(float(first[0]))
    except ValueError:
        return False


def _values(
    rows: list[tuple[int, str]], names: list[str], path: Path, ended: bool
) -> NDArray[np.float64]:
    """(T, 2 + 3 M) frame, time and coordinates; NaN = missing."""
    width = 2 + 3 * len(names)
    separator = "\t" if "\t" in rows[0][1] else None
    lines, places = [], []
    for n, line in rows:
        if separator is None:
            lines.append(" ".join(line.split()))
            short = width - len(line.split())
        else:
            cells = line.rstrip("\n").count("\t") + 1
            while cells > width and line.endswith(("\t", "\t ", " ")):
                line = line[:-1].rstrip(" ")
                cells = line.count("\t") + 1
            short = width - cells
            # markers at the end that were not seen; not in a line that was cut
            if short > 0 and short % 3 == 0 and (n != rows[-1][0] or ended):
                line, short = line + "\t" * short, 0
            lines.append(line)
        if short:
            raise InputError(
                f"line {n} has {width - short} columns, expected {width}: frame, time and 3 for"
                f" each of {len(names)} markers ({shown(names[0], 30)} ...)",
                path,
            )
        places.append(n)
    mark = separator or " "
    titles = ["Frame#", "Time", *(f"{n} {a}" for n in names for a in "xyz")]
    table = Table(lines, places, mark, titles, [], path)
    return table.numbers(range(width), titles)


FORMATS = (
    Format(
        "Motion capture: .trc",
        "markers named as joints, or by a file of pairs; also without wrist or tips",
        "by name",
        "as the file says",
        "by name",
        "`PathFileType`",
        "`--markers FILE` for other names",
        kinds={"trc": read_trc},
        suffixes=(".trc",),
        ways=(Way("text", lambda data, path: data.startswith(START), read_trc),),
    ),
)
