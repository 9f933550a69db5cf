"""Matrices by name out of calibration files: YAML, XML, JSON, .npz."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.numbers import as_number, numbers
from handtrack.errors import InputError, shown
from handtrack.files import npz

Array = NDArray[np.float64]


class Named(NamedTuple):
    """What a calibration file holds.

    Attributes:
        matrices: by name; one row or column of numbers too.
        words: text and single numbers by name.
    """

    matrices: dict[str, Array]
    words: dict[str, str]


_WRITTEN = re.compile(
    r"^(?P<name>\w{1,80}):[ \t]*(?:!!opencv-matrix)?[\s{]{1,80}"
    r"rows:[ \t]*(?P<rows>\d{1,4})[\s,]{1,80}"
    r"cols:[ \t]*(?P<columns>\d{1,4})[\s,]{1,80}(?:dt:[ \t]*\w{1,9}[\s,]{1,80})?"
    r"data:\s{0,80}\[(?P<data>[^\]]{0,1000})\]",
    re.MULTILINE,
)
_LIST = r"\[[^\[\]]{0,1000}\]"
_ITEM = r"[ \t]{1,20}[^\s\[\]:]{1,40}[ \t]*\n"
_DASH = r"[ \t]{0,20}-"
_NAMED = r"^(?P<name>\w{1,80}):[ \t]*"
_LISTS = tuple(
    re.compile(_NAMED + data, re.MULTILINE)
    for data in (
        rf"(?P<data>{_LIST})",
        rf"\[\s{{0,80}}(?P<data>{_LIST}(?:\s{{0,80}},\s{{0,80}}{_LIST}){{0,9}})",
        rf"\n(?P<data>(?:{_DASH}{_ITEM}){{1,40}})",
        rf"\n(?P<data>(?:{_DASH}[ \t]{{1,20}}{_LIST}[ \t]*\n){{1,10}})",
        rf"\n(?P<data>(?:{_DASH}[ \t]{{1,20}}-{_ITEM}(?:[ \t]{{1,20}}-{_ITEM}){{0,10}}){{1,10}})",
    )
)
"""A list, lists in a list, and both a line for each number or for each list."""
_WORD = re.compile(r"^(?P<name>\w{1,80}):[ \t]*(?P<value>[^\s!\[{][^\n]{0,300})$", re.MULTILINE)


def read_yaml(text: str) -> Named:
    """OpenCV's FileStorage, whose first line general YAML readers refuse, ROS's files and
    messages, and what scripts write of arrays: matrices, lists and words by name.

    Raises:
        InputError: a name twice, rows of different length, or what is no number among numbers.
    """
    matrices: dict[str, Array] = {}
    for match in _WRITTEN.finditer(text):
        shape = int(match["rows"]), int(match["columns"])
        words = match["data"].replace(",", " ").split()
        _add(matrices, match["name"], _read(words, match["name"], shape))
    for pattern in _LISTS:
        for match in pattern.finditer(text + "\n"):
            rows = _rows(match["data"])
            if len({len(row) for row in rows}) > 1:
                raise InputError(f"{match['name']} has rows of different length")
            if rows[0]:
                words = [word for row in rows for word in row]
                shape = len(rows), len(rows[0])
                _add(matrices, match["name"], _read(words, match["name"], shape))
    found: dict[str, str] = {}
    for match in _WORD.finditer(text):
        if match["name"] in found:
            raise InputError(f"{match['name']} is there twice")
        found[match["name"]] = match["value"].strip().strip("\"'")
    return Named(matrices, found)


def _rows(data: str) -> list[list[str]]:
    """The words of each row: of each list in brackets, of each "- -" and what follows, else of
    one row."""
    if "[" in data:
        return [row.replace(",", " ").split() for row in re.findall(r"\[([^\]]*)\]", data)]
    rows: list[list[str]] = []
    for line in data.splitlines():
        dashes, word = line.split()[:-1], line.split()[-1]
        if not rows or len(dashes) == 2:
            rows.append([])
        rows[-1].append(word)
    return rows


def read_fields(fields: dict[str, Any]) -> Named:
    """JSON: arrays, words and numbers by name, those of objects in it too.

    Raises:
        InputError: a name twice, or numbers that are none of a camera's.
    """
    matrices: dict[str, Array] = {}
    words: dict[str, str] = {}
    for key, value in fields.items():
        if isinstance(value, dict) and isinstance(value.get("data"), list):
            rows, columns = value.get("rows"), value.get("cols", value.get("columns"))
            flat = numbers(value["data"], shown(key, 40))
            if (
                type(rows) is int
                and type(columns) is int
                and rows > 0
                and rows * columns == flat.size
            ):
                flat = flat.reshape(rows, columns)
            _add(matrices, key, flat)
        elif isinstance(value, dict):
            inner = read_fields({k: v for k, v in value.items() if not isinstance(v, dict)})
            for name, matrix in inner.matrices.items():
                _add(matrices, name, matrix)
            words |= inner.words
        elif isinstance(value, list) and _is_of_numbers(value):
            flat = numbers(value, shown(key, 40))
            nested = isinstance(value[0], list)
            _add(matrices, key, flat.reshape(len(value) if nested else 1, -1))
        elif isinstance(value, str | int | float) and not isinstance(value, bool):
            words[key] = str(value)
    return Named(matrices, words)


def _is_of_numbers(value: list[Any]) -> bool:
    flat = [x for row in value for x in (row if isinstance(row, list) else [row])]
    return bool(flat) and all(isinstance(x, int | float) for x in flat)


def read_xml(text: str) -> Named:
    """OpenCV's FileStorage as XML.

    Raises:
        InputError: no XML, or one that declares what it is made of; a name twice, or what is no
            number among numbers.
    """
    if "<!" in text.replace("<!--", ""):
        raise InputError("not a calibration: XML with declarations, which are not read")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"not valid XML: {shown(str(error), 120)}") from None
    matrices: dict[str, Array] = {}
    words: dict[str, str] = {}
    for element in root:
        name = str(element.tag)
        rows, columns, data = (element.findtext(n) for n in ("rows", "cols", "data"))
        if data is not None:
            shape = (
                int(as_number(rows or "", f"{name}'s rows")),
                int(as_number(columns or "", f"{name}'s cols")),
            )
            _add(matrices, name, _read(data.split(), name, shape))
        elif not len(element) and element.text:
            words[name] = element.text.strip().strip('"')
    return Named(matrices, words)


def read_arrays(path: Path) -> Named:
    """Arrays of a .npz.

    Raises:
        InputError: damaged, or numbers that are not finite.
    """
    arrays, _ = npz.read_npz(path, path)
    matrices: dict[str, Array] = {}
    words: dict[str, str] = {}
    for key, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.kind in "fiu" and array.ndim:
            matrices[key] = array.astype(np.float64)
        elif array.ndim == 0 and array.dtype.kind in "fiuU":
            words[key] = str(array.item())
    return Named(matrices, words)


def _add(matrices: dict[str, Array], name: str, matrix: Array) -> None:
    if name in matrices:
        raise InputError(f"{name} is there twice")
    matrices[name] = matrix


def _read(words: list[str], name: str, shape: tuple[int, int]) -> Array:
    return numbers([as_number(word, name) for word in words], name, shape).reshape(shape)
