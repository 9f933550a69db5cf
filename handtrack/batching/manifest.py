"""Manifests: tables that say what a data set consists of."""

from __future__ import annotations

import csv
import io
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from handtrack.batching.clip import Clip, common_root, named, with_subjects
from handtrack.batching.found import clips_in, stamped
from handtrack.batching.store import child, filesystem, is_remote, tried
from handtrack.errors import InputError, SettingsError, shown
from handtrack.sequences.hands import CHOICES
from handtrack.sequences.joint_order import check_order
from handtrack.sequences.names import UNITS

if TYPE_CHECKING:
    import pyarrow

COLUMNS = ("path", "name", "hand", "subject", "fps", "unit", "order", "start", "end", "truth")
"""What a manifest may say of a clip; only the path is needed."""
_NUMBERS = ("fps", "start", "end")
_SHOWN = 3


def clips_of(
    inputs: Sequence[str], subject: str | None = None, own: Sequence[str] = ()
) -> list[Clip]:
    """The clips of a data set.

    Args:
        inputs: folders, files, archives, globs, URLs, manifests (.csv or .parquet with a column
            `path`).
        subject: regular expression that finds the subject in a path.
        own: columns of the user's that manifests may have.

    Raises:
        InputError: something is not there or not as expected; the message names it.
        SettingsError: the expression is none, or found nowhere; no manifest can have the columns.
    """
    clips: list[Clip] = []
    roots: list[str] = []
    listed = False
    for place in inputs:
        table = _as_manifest(place)
        listed |= table is not None
        if table is not None:
            found, root = clips_of_rows(table, place, own), ""
            root = common_root(clip.path for clip in found)
        else:
            found, root = clips_in(place)
        clips += found
        roots += [root] * len(found)
    if own and not listed:
        raise SettingsError(
            f"--column {own[0]}: columns are a manifest's, and {', '.join(inputs[:_SHOWN])} is none"
        )
    return _finished(clips, roots, subject)


def clips_of_table(
    table: pyarrow.Table | Iterable[Mapping[str, Any]],
    subject: str | None = None,
    own: Sequence[str] = (),
) -> list[Clip]:
    """The clips of a manifest that is at hand; arguments and errors as `clips_of`."""
    rows = table.to_pylist() if hasattr(table, "to_pylist") else [dict(row) for row in table]
    clips = clips_of_rows(rows, "manifest", own)
    root = common_root(clip.path for clip in clips)
    return _finished(clips, [root] * len(clips), subject)


def _finished(clips: list[Clip], roots: list[str], subject: str | None) -> list[Clip]:
    made = with_subjects(named(clips, roots), subject)
    return sorted(made, key=lambda clip: clip.name)


def _as_manifest(place: str) -> list[dict[str, Any]] | None:
    """The rows of a manifest; None where the file is none.

    Raises:
        InputError: it is a table that cannot be read, or a manifest without a path.
    """
    suffix = Path(place).suffix.lower()
    if suffix not in (".csv", ".parquet", ".pq") or any(c in place for c in "*?["):
        return None
    if is_remote(place):
        fs, key = filesystem(place)
        try:
            data = bytes(tried(place, lambda: fs.cat_file(key)))
        except FileNotFoundError:
            raise InputError("no such file or folder", place) from None
    else:
        if not Path(place).is_file():
            return None
        data = Path(place).read_bytes()
    if suffix == ".csv":
        return _csv_rows(data, place)
    import pyarrow as pa
    from pyarrow import parquet

    try:
        table = parquet.read_table(io.BytesIO(data))
    except (pa.ArrowInvalid, OSError) as error:
        raise InputError(f"is no Parquet file: {error}", place) from error
    if "path" not in table.column_names:
        names = ", ".join(table.column_names)
        raise InputError(f"has no column `path`, as a manifest needs: {names}", place)
    rows: list[dict[str, Any]] = table.to_pylist()
    return rows


def _csv_rows(data: bytes, place: str) -> list[dict[str, Any]] | None:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return None
    first = text.partition("\n")[0]
    comma = max(",;\t", key=first.count)
    header = [name.strip().lower() for name in next(csv.reader([first], delimiter=comma), [])]
    if "path" not in header:
        if header and set(header) <= set(COLUMNS):
            raise InputError("has no column `path`, as a manifest needs", place)
        return None
    reader = csv.reader(io.StringIO(text), delimiter=comma)
    next(reader)
    rows = []
    for number, cells in enumerate(reader, 2):
        if not any(cell.strip() for cell in cells):
            continue
        if len(cells) > len(header):
            raise InputError(f"line {number} has {len(cells)} cells, expected {len(header)}", place)
        cells = cells + [""] * (len(header) - len(cells))
        rows.append(dict(zip(header, (cell.strip() for cell in cells), strict=True)))
    return rows


def clips_of_rows(rows: Sequence[Mapping[str, Any]], place: str, own: Sequence[str]) -> list[Clip]:
    """The clips of a manifest's rows.

    Raises:
        InputError: a column is unknown, a value cannot be used, or a path is not there.
    """
    if not rows:
        raise InputError("is a manifest without a row", place)
    _check_columns(rows[0], place, own)
    at = str(Path(place).parent) if not is_remote(place) else place.rpartition("/")[0]
    clips = [_clip(row, i, place, at, own) for i, row in enumerate(rows, 1)]
    _check_claims(clips, place)
    return _there(clips, place)


def _check_claims(clips: Sequence[Clip], place: str) -> None:
    """Refuse rows that say different things of the same hand.

    Raises:
        InputError: a part of a file is of two subjects, or given both as one hand and as all.
    """
    seen: dict[tuple[str, float | None, float | None], dict[str | None, tuple[int, Clip]]] = {}
    for number, clip in enumerate(clips, 1):
        hands = seen.setdefault((clip.path, clip.start, clip.end), {})
        for hand, (row, other) in hands.items():
            if None in (hand, clip.hand) and hand != clip.hand:
                raise InputError(
                    f"rows {row} and {number}: {clip.path} is given as the"
                    f" {hand or clip.hand} hand and as all its hands: mixed hands of one subject",
                    place,
                )
            if hand == clip.hand and other.subject != clip.subject:
                raise InputError(
                    f"rows {row} and {number}: {clip.path} is of {other.subject or 'nobody'} and"
                    f" of {clip.subject or 'nobody'}",
                    place,
                )
        hands.setdefault(clip.hand, (number, clip))


def _check_columns(row: Mapping[str, Any], place: str, own: Sequence[str]) -> None:
    if "path" not in row:
        raise InputError("has no column `path`, as a manifest needs", place)
    for name in row:
        if name in COLUMNS or name in own:
            continue
        near = get_close_matches(name, COLUMNS, 1)
        meant = f" (is it {near[0]}?)" if near else ""
        raise InputError(
            f"column {shown(name, 40)!r} is unknown{meant}, expected {', '.join(COLUMNS)}; for a"
            f" column of your own: --column {shown(name, 40)}",
            place,
        )
    for name in own:
        if name not in row:
            raise InputError(f"has no column {name!r} (--column)", place)


def _clip(row: Mapping[str, Any], number: int, place: str, at: str, own: Sequence[str]) -> Clip:
    values: dict[str, Any] = {}
    for name in COLUMNS:
        value = row.get(name)
        if value is None or value == "" or value != value:
            continue
        values[name] = _number(value, name, number, place) if name in _NUMBERS else str(value)
    if "path" not in values:
        raise InputError(f"row {number}: no path", place)
    _check_values(values, number, place)
    for name in ("path", "truth"):
        if name in values:
            values[name] = child(at, values[name])
    mine = tuple((name, "" if row.get(name) is None else str(row[name])) for name in own)
    return Clip(**{"name": "", **values}, own=mine, listed=True)


def _number(value: Any, name: str, number: int, place: str) -> float:
    try:
        found = float(value)
    except (TypeError, ValueError):
        found = float("nan")
    if not (found > 0 or (found == 0 and name == "start")) or found == float("inf"):
        wanted = "a number of seconds" if name != "fps" else "a positive number"
        raise InputError(f"row {number}: {name} is {shown(value, 40)}, expected {wanted}", place)
    return found


def _check_values(values: dict[str, Any], number: int, place: str) -> None:
    hand = values.get("hand")
    if hand is not None:
        values["hand"] = hand = hand.lower()
        if hand not in CHOICES:
            raise InputError(
                f"row {number}: hand is {shown(hand, 40)!r}, expected {', '.join(CHOICES)}", place
            )
        if hand == "auto":
            del values["hand"]
    if "unit" in values and values["unit"] not in set(UNITS.values()):
        raise InputError(
            f"row {number}: unit is {shown(values['unit'], 40)!r}, expected m, cm, mm or in", place
        )
    if "order" in values:
        try:
            check_order(values["order"])
        except SettingsError as error:
            raise InputError(f"row {number}: {error}", place) from None
    if values.get("end") is not None and values["end"] <= values.get("start", 0.0):
        raise InputError(
            f"row {number}: end is {values['end']:g}, start {values.get('start', 0.0):g}, expected"
            " a later end",
            place,
        )
    name = values.get("name")
    if name is not None and (name.startswith("/") or ".." in name.split("/")):
        raise InputError(
            f"row {number}: name is {shown(name, 40)}, expected one inside the results", place
        )


def _there(clips: list[Clip], place: str) -> list[Clip]:
    """The clips with their stamps.

    Raises:
        InputError: some are not there; the first are named.
    """
    made: list[Clip] = []
    missing: list[str] = []
    remote: dict[str, dict[str, Any]] = {}
    for number, clip in enumerate(clips, 1):
        if is_remote(clip.path):
            info = _remote_info(clip.path, remote)
            if info is None:
                missing.append(f"row {number}: {clip.path}")
            else:
                made.append(replace(clip, stamp=info[0], size=info[1]))
            continue
        if not os.path.exists(clip.path):
            missing.append(f"row {number}: {clip.path}")
            continue
        made.append(stamped(clip))
    for number, clip in enumerate(clips, 1):
        if clip.truth is not None and not is_remote(clip.truth) and not os.path.exists(clip.truth):
            missing.append(f"row {number}: truth {clip.truth}")
    if missing:
        more = f" and {len(missing) - _SHOWN} more" if len(missing) > _SHOWN else ""
        raise InputError(f"no such file: {', '.join(missing[:_SHOWN])}{more}", place)
    return made


def _remote_info(path: str, folders: dict[str, dict[str, Any]]) -> tuple[str, int] | None:
    """Stamp and size of what is in a store; its folders are listed once."""
    from handtrack.batching.found import mark

    if "::" in path:
        return path, 0
    fs, key = filesystem(path)
    folder = f"{path.partition('://')[0]}://{key.rpartition('/')[0]}"
    if folder not in folders:

        def listed() -> dict[str, Any]:
            try:
                return {str(i["name"]): i for i in fs.ls(key.rpartition("/")[0], detail=True)}
            except FileNotFoundError:
                return {}

        folders[folder] = tried(folder, listed)
    info = folders[folder].get(key)
    return None if info is None else (mark(info), int(info.get("size") or 0))
