"""Joints from where the user says they are: an array by its key, or columns of a table."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError, SettingsError, shown
from handtrack.files import budget, npz
from handtrack.sequences.readers import hdf5_file
from handtrack.sequences.readers.both_hands import by_frame, two_hands
from handtrack.sequences.readers.fields import from_fields, names_joints
from handtrack.sequences.readers.jsontext import as_utf8, decode
from handtrack.sequences.readers.raw import Raw
from handtrack.sequences.readers.table_cells import Table, is_number, read_cells
from handtrack.sequences.titles import (
    is_confidence,
    is_frame_number,
    is_hand_label,
    joints_key,
    time_unit,
)

_JOINTS = "joints"
_HEAD = 4096
_MOST = 30
"""So many names are listed of a file that has no such key."""


def read_chosen(path: Path, key: str | None, columns: str | None) -> list[Raw]:
    """The hands whose joints stand under a key, or in some columns.

    Args:
        path: an .npz, HDF5 or JSON file, or JSON lines, for `key`; a text table for `columns`.
        key: a name; in HDF5 with its groups (`a/b`), in JSON with the keys above it (`a.b`), of
            which lists of records are gone through record by record.
        columns: `A:B`, the first and the last, or all with commas between; titles, or numbers
            from 0.

    Raises:
        InputError: nothing is there under that name, or what is there is no joints.
        SettingsError: both are given, or columns that are none.
    """
    if key is not None and columns is not None:
        raise SettingsError("--key is for arrays and --columns for tables: give one")
    if columns is not None:
        data = budget.read(path)
        head = as_utf8(data)[:_HEAD].lstrip()
        if b"\x00" in head or head.startswith((b"{", b"[{", npz.ZIP)):
            raise InputError("--columns is for text tables; .npz, HDF5 and JSON have --key", path)
        fields = _of_table(read_cells(data, path), columns, path)
    else:
        fields = _of_key(path, key or "")
    parts = by_frame(fields, path)
    return [raw for part in parts for raw in two_hands(from_fields(part, path))]


def _of_key(path: Path, key: str) -> dict[str, Any]:
    """The joints under their name, and what stands beside them."""
    with budget.opened(path) as stream:
        head = stream.read(8)
    if head.startswith(hdf5_file.HDF5_MAGIC):
        return _of_hdf5(path, key)
    if head.startswith(npz.ZIP):
        arrays, _ = npz.read_npz(path, path)
        named = {n: (a.item() if np.ndim(a) == 0 else a) for n, a in arrays.items()}
        return _with_joints(named, key, path)
    data = as_utf8(budget.read(path)).strip()
    if data[:1] not in (b"{", b"["):
        raise InputError("--key is for .npz, HDF5 and JSON; a table has --columns", path)
    lines = [line for line in data.splitlines() if line.strip()]
    if len(lines) > 1 and all(line.strip()[:1] == b"{" for line in lines[:2]):
        value: Any = [decode(line, Any, path, i + 1) for i, line in enumerate(lines)]
    else:
        value = decode(data, Any, path)
    return _of_json(value, key, path)


def _with_joints(named: Mapping[str, Any], key: str, path: Path, above: str = "") -> dict[str, Any]:
    """Fields of which only those under the key are joints.

    Raises:
        InputError: there is no such key.
    """
    if key not in named:
        known = ", ".join(shown(above + str(name), 40) for name in list(named)[:_MOST]) or "none"
        raise InputError(f"there is no key {shown(above + key, 60)}, its keys are: {known}", path)
    rest = {n: v for n, v in named.items() if n != key and not names_joints(n)}
    said = joints_key(key)
    unit = {} if said is None or said.unit is None else {"unit": said.unit}
    hand = {} if said is None or said.hand is None else {"hand": said.hand}
    return unit | hand | {n: v for n, v in rest.items() if v is not None} | {_JOINTS: named[key]}


def _of_hdf5(path: Path, key: str) -> dict[str, Any]:
    *groups, name = [part for part in key.split("/") if part] or [key]
    with hdf5_file.opened(path) as file:
        group, above = file, ""
        for part in groups:
            inner = hdf5_file.member(group, part, path)
            if not hasattr(inner, "keys"):
                _with_joints(
                    dict.fromkeys(hdf5_file.names_in(group, path)), part + "/", path, above
                )
            group, above = inner, f"{above}{part}/"
        found: dict[str, Any] = {}
        for each in hdf5_file.names_in(group, path):
            data = hdf5_file.dataset(group, each, path)
            if data is not None and data.dtype.kind in "fiuSO":
                value = data.asstr()[()] if data.dtype.kind in "SO" else data[()]
                found[each] = value.item() if getattr(value, "ndim", 1) == 0 else value
        return _with_joints(found, name, path, above)


def _of_json(value: Any, key: str, path: Path) -> dict[str, Any]:
    """The joints of JSON, with the plain values that stand above and beside them."""
    parts = [key] if isinstance(value, dict) and key in value else key.split(".")
    fields: dict[str, Any] = {}
    for depth, part in enumerate(parts):
        if isinstance(value, list):
            return fields | _of_records(value, parts[depth:], path)
        if not isinstance(value, dict):
            raise InputError(f"{'.'.join(parts[:depth])} holds no keys", path)
        if depth == len(parts) - 1:
            break
        fields |= {n: v for n, v in value.items() if _is_plain(v)}
        _with_joints(value, part, path)
        value = value[part]
    return fields | _with_joints(value, parts[-1], path)


def _of_records(records: list[Any], parts: list[str], path: Path) -> dict[str, Any]:
    """One record for each frame: their values by name, as arrays."""
    joints: list[Any] = []
    beside: dict[str, list[Any]] = {}
    known: dict[str, None] = {}
    for i, record in enumerate(records):
        if not isinstance(record, dict):
            raise InputError(f"record {i} is no object with keys", path)
        known |= dict.fromkeys(record)
        value: Any = record
        for part in parts:
            value = value.get(part) if isinstance(value, dict) else None
        joints.append(value)
        for name, plain in record.items():
            if _is_plain(plain) and name != parts[0]:
                beside.setdefault(name, []).append(plain)
    if all(value is None for value in joints):
        _with_joints(known, ".".join(parts), path)
        raise InputError(f"nothing stands under {shown('.'.join(parts), 60)}", path)
    whole = {n: np.array(v) for n, v in beside.items() if len(v) == len(records)}
    alike = {
        n: v[0].item()
        for n, v in whole.items()
        if is_hand_label(n) and len(v) and bool((v == v[0]).all())
    }
    return _with_joints({**whole, **alike, ".".join(parts): joints}, ".".join(parts), path)


def _is_plain(value: Any) -> bool:
    return isinstance(value, str | int | float) and not isinstance(value, bool)


def _of_table(table: Table, columns: str, path: Path) -> dict[str, Any]:
    """The joints of a table's columns, and its times, frame numbers, hands and confidences."""
    titles = table.titles
    if titles is None:
        titles = [str(i) for i in range(table.width)]
    chosen = _columns(columns, titles, path)
    if not table.lines:
        raise InputError("a header, but no frames", path)
    table.check_width()
    fields: dict[str, Any] = {}
    for i, title in enumerate(titles):
        told = time_unit(title) is not None or is_frame_number(title)
        if i in chosen or not (told or is_hand_label(title) or is_confidence(title)):
            continue
        texts = table.texts(i)
        numeric = all(is_number(text) for text in texts)
        fields[title] = table.numbers([i], [title])[:, 0] if numeric else np.array(texts)
    return fields | {_JOINTS: table.numbers(chosen, [titles[c] for c in chosen])}


def _columns(text: str, titles: list[str], path: Path) -> list[int]:
    """Places of the columns that the user names.

    Raises:
        SettingsError: a name or number that is none, or a first column after the last.
    """

    def place(word: str) -> int:
        word = word.strip()
        if word in titles:
            return titles.index(word)
        if re.fullmatch(r"\d{1,6}", word) and int(word) < len(titles):
            return int(word)
        some = ", ".join(shown(t, 40) for t in titles[:_MOST])
        raise SettingsError(
            f"{path}: --columns {shown(word, 40)} is none of its {len(titles)} columns ({some}"
            f"{', ...' if len(titles) > _MOST else ''})"
        )

    if "," not in text and ":" in text and text not in titles:
        first, _, last = text.partition(":")
        a, b = place(first), place(last)
        if a > b:
            raise SettingsError(f"--columns {text}: the last column stands before the first")
        found = list(range(a, b + 1))
    else:
        found = [place(word) for word in text.split(",")]
    if len(found) % 3:
        raise SettingsError(
            f"--columns {shown(text, 60)} are {len(found)} columns, expected x, y and z of each"
            " joint, 63 in all"
        )
    return found
