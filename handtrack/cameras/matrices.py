"""Matrices and words by name, as OpenCV, ROS and NumPy write them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple
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


_MATRIX = re.compile(
    r"^(?P<name>\w{1,80}):[ \t]*(?:!!opencv-matrix)?\s{1,80}rows:[ \t]*(?P<rows>\d{1,4})\s{1,80}"
    r"cols:[ \t]*(?P<columns>\d{1,4})\s{1,80}(?:dt:[ \t]*\w{1,9}\s{1,80})?"
    r"data:\s{0,80}\[(?P<data>[^\]]{0,1000})\]",
    re.MULTILINE,
)
_ROW = re.compile(r"^(?P<name>\w{1,80}):[ \t]*\[(?P<data>[^\]]{0,1000})\]", re.MULTILINE)
_BLOCK = re.compile(
    r"^(?P<name>\w{1,80}):[ \t]*\n"
    r"(?P<data>(?:[ \t]{0,20}-[ \t]{1,20}[^\s\[\]:]{1,40}[ \t]*\n){1,40})",
    re.MULTILINE,
)
_WORD = re.compile(r"^(?P<name>\w{1,80}):[ \t]*(?P<value>[^\s!\[][^\n]{0,300})$", re.MULTILINE)


def read_yaml(text: str) -> Named:
    """OpenCV's FileStorage, whose first line general YAML readers refuse, and ROS's files and
    messages: matrices, lists and words by name.

    Raises:
        InputError: a name twice, or what is no number among numbers.
    """
    matrices: dict[str, Array] = {}
    for match in _MATRIX.finditer(text):
        shape = int(match["rows"]), int(match["columns"])
        words = match["data"].replace(",", " ").split()
        _add(matrices, match["name"], _read(words, match["name"], shape))
    for pattern, marks in ((_ROW, ","), (_BLOCK, "-")):
        for match in pattern.finditer(text if marks == "," else text + "\n"):
            data = match["data"].replace(",", " ") if marks == "," else match["data"]
            words = [w for w in data.split() if w != "-"]
            if words:
                _add(matrices, match["name"], _read(words, match["name"], (1, len(words))))
    found: dict[str, str] = {}
    for match in _WORD.finditer(text):
        if match["name"] in found:
            raise InputError(f"{match['name']} is there twice")
        found[match["name"]] = match["value"].strip().strip("\"'")
    return Named(matrices, found)


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
    for name, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.kind in "fiu" and array.ndim:
            matrices[name] = array.astype(np.float64)
        elif array.ndim == 0 and array.dtype.kind in "fiuU":
            words[name] = str(array.item())
    return Named(matrices, words)


def _add(matrices: dict[str, Array], name: str, matrix: Array) -> None:
    if name in matrices:
        raise InputError(f"{name} is there twice")
    matrices[name] = matrix


def _read(words: list[str], name: str, shape: tuple[int, int]) -> Array:
    return numbers([as_number(word, name) for word in words], name, shape).reshape(shape)
