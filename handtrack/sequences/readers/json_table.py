"""Tables as JSON, as pandas writes them: a list of rows with names, or names and rows apart."""

from __future__ import annotations

import csv
import io
from typing import Any

from handtrack.sequences.titles import column, is_frame_number, time_unit

_FEWEST, _MOST = 12, 5000
_PLAIN = {str, int, float, bool, type(None)}
_AXES = {"x", "y", "z"}


def table_of(value: Any) -> bytes | None:
    """The same table as CSV; None where it is none of hands.

    Rows are `{"frame": 0, "wrist_x": 0.1, ...}`, or one of each joint `{"frame": 0, "joint":
    "wrist", "x": ...}`; names and rows apart are `{"columns": [...], "data": [[...], ...]}`; all
    that pandas' to_json writes.
    """
    if isinstance(value, dict):
        rows_in = value.get("data")
        if isinstance(rows_in, list) and isinstance(value.get("schema"), dict):
            return table_of(rows_in)
        by_names = _of_names(value)
        if by_names is not None:
            return table_of(by_names)
        titles, rows = value.get("columns"), value.get("data")
        if not isinstance(titles, list) or not isinstance(rows, list) or len(titles) > _MOST:
            return None
        if not all(isinstance(row, list) and len(row) == len(titles) for row in rows):
            return None
        names = [" ".join(map(str, t)) if isinstance(t, list) else str(t) for t in titles]
        return _written(names, rows) if _is_of_hands(names, len(rows)) else None
    if not isinstance(value, list) or not value or not isinstance(value[0], dict):
        return None
    names = [str(name) for name in value[0]]
    if not _is_of_hands(names, len(value)):
        return None
    rows = []
    for row in value:
        if not isinstance(row, dict) or not _PLAIN.issuperset(map(type, row.values())):
            return None
        if len(row) > _MOST:
            return None
        rows.append([row.get(name) for name in value[0]])
    return _written(names, rows)


def _of_names(value: dict[str, Any]) -> list[dict[str, Any]] | None:
    """Rows of what pandas writes by columns (`{"wrist_x": {"0": 0.1, ...}, ...}`) or by its index
    (`{"0": {"wrist_x": 0.1, ...}, ...}`); None of anything else."""
    first = next(iter(value.values()), None)
    if not isinstance(first, dict) or not first or len(value) * len(first) > 5 * 10**7:
        return None
    if not all(isinstance(v, dict) and v.keys() == first.keys() for v in value.values()):
        return None
    if not _PLAIN.issuperset(map(type, first.values())):
        return None
    if _is_of_hands(list(value), len(first)):
        return [{name: column[key] for name, column in value.items()} for key in first]
    return list(value.values()) if _is_of_hands(list(first), len(value)) else None


def _is_of_hands(names: list[str], rows: int) -> bool:
    """Whether rows of these names are frames, or joints of frames."""
    if not 3 < len(names) <= _MOST:
        return False
    long = {n.lower() for n in names} >= _AXES
    if long:
        told = any(is_frame_number(n) or time_unit(n) is not None for n in names)
        return told and rows >= _FEWEST
    places = [said for n in names if (said := column(n)) is not None and said.axis is not None]
    return len(places) >= _FEWEST


def _written(names: list[str], rows: list[list[Any]]) -> bytes:
    text = io.StringIO()
    out = csv.writer(text, lineterminator="\n")
    out.writerow(names)
    out.writerows(rows)
    return text.getvalue().encode("utf-8", "replace")
