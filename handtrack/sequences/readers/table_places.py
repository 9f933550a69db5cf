"""Cells that hold a whole place, or a whole hand, as cells of one number each.

    "[0.1, 0.2, 0.3]" | (0.1, 0.2, 0.3) | 0.1 0.2 0.3 | {'x': 0.1, 'y': 0.2, 'z': 0.3}
    NormalizedLandmark(x=0.1, y=0.2, z=0.3, visibility=0.0) | x: 0.1\\ny: 0.2\\nz: 0.3

as Python, NumPy, MediaPipe and protocol buffers print them; a hand is 21 of them in one cell.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from collections.abc import Sequence as Items
from pathlib import Path

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import ORDER_JOINTS
from handtrack.sequences.names import words
from handtrack.sequences.readers.raw import NotJointsError
from handtrack.sequences.titles import of_side

NORMALISED = "NormalizedLandmark"
"""MediaPipe's name of a landmark in the picture."""
SEPARATOR = "\x1f"
"""Separates cells of which some held several numbers: no text holds it."""
_EMPTY = {"", "nan", "na", "n/a", "null", "none", "-", "--", "[]", "()", "{}", "<na>"}
_NOT_SEEN = _EMPTY | {"0", "0.0", "-1"}
"""What stands for a place that was not seen, in a column of places."""
_LOOK = 50
_BRACKETS = re.compile(
    r"\[(?:[^\[\]]|\[[^\[\]]*\])*\]|\((?:[^()]|\([^()]*\))*\)|\{(?:[^{}]|\{[^{}]*\})*\}"
)
_INSIDE = re.compile(r"[,;\t]")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf)\b|None\b|null\b"
_WRAPPER = re.compile(
    r"(?:np\.|numpy\.)?\b(?:array|float\d*|dtype=\w+|SIMD3<\w+>|[Vv]ec(?:tor)?3[df]?|Point3?[df]?)"
)
_BETWEEN = re.compile(r"[\s,;|()\[\]{}]+")
_NAMED = re.compile(
    rf"(?<![a-zA-Z])([xyzXYZ])['\"]?\s*[:=]\s*(?:np\.float\d+\()?({_NUMBER})(?![\w.])"
)
_MISSING = {"none", "null"}
_LONGEST = 20_000


def guarded(lines: list[str]) -> list[str]:
    """Lines whose commas inside brackets separate no cells; the same where none has any."""
    few = [line for line in lines[1:_LOOK] if "(" in line or "[" in line or "{" in line]
    if not few or not any(numbers_in(m[0]) for line in few for m in [_BRACKETS.search(line)] if m):
        return lines
    return [_BRACKETS.sub(lambda m: _INSIDE.sub(" ", m[0]), line) for line in lines]


def is_place(cell: str) -> bool:
    """Whether a cell holds a place or a hand: some numbers, and nothing that is none."""
    return len(numbers_in(cell)) in _WIDTHS


_WIDTHS = {3, *(3 * n for n in ORDER_JOINTS.values())}


def numbers_in(cell: str) -> list[str]:
    """The coordinates in a cell, in threes; none where it is something else."""
    if len(cell) > _LONGEST:
        return []
    if cell[:1] == "(" and cell[-1:] == ")":  # else a date
        cell = cell.replace("/", " ")
    named = _NAMED.findall(cell)
    if named:
        axes = "".join(axis.lower() for axis, _ in named)
        return [number for _, number in named] if axes == "xyz" * (len(axes) // 3) else []
    found = [part for part in _BETWEEN.split(_WRAPPER.sub(" ", cell)) if part]
    return found if len(found) in _WIDTHS and all(map(_is_number, found)) else []


def _is_number(part: str) -> bool:
    try:
        float(part)
    except ValueError:
        return part.lower() in _MISSING
    return True


def spread(
    lines: list[str],
    places: Items[int],
    split: Callable[[str], list[str]],
    titles: list[str] | None,
    path: Path,
) -> tuple[list[str], list[str] | None] | None:
    """Lines and titles in which each coordinate has a cell of its own, cells separated by
    `SEPARATOR`; None where no cell holds a place.

    Args:
        lines: of data.
        places: their numbers, for messages.
        split: a line's cells.
        titles: of the columns.
        path: the file.

    Raises:
        NotJointsError: cells of several numbers without a title.
        InputError: a cell that holds no place in a column that does.
    """
    widths = _widths([split(line) for line in lines[:_LOOK]])
    if not widths:
        return None
    if titles is not None:
        widths = _worlds(widths, titles)
    named = None if titles is None else _titles(titles, widths, path)
    alike = _alike(lines, split, widths)
    if alike is not None:
        return alike, named
    out = []
    for place, line in zip(places, lines, strict=True):
        row: list[str] = []
        for c, cell in enumerate(split(line)):
            width = widths.get(c)
            if width is None:
                row.append(cell)
            elif cell.lower() in _NOT_SEEN:
                row += ["nan"] * width
            else:
                row += _row(cell, width, f"line {place}: column {c + 1}", path)
        out.append(SEPARATOR.join(row))
    return out, named


_BLANKS = b" ()[]{}"
_OF_NUMBERS = b"0123456789+-.eE"
_SEP, _LINE = ord(SEPARATOR), ord("\n")
_LITERAL_BLANKS = re.compile(r"(?:\\ |\s)+")
_PLAIN = r"[-+]?[\d.]+(?:[eE][-+]?\d+)?"


def _alike(
    lines: list[str], split: Callable[[str], list[str]], widths: dict[int, int]
) -> list[str] | None:
    """The rows where all places are written as the first one is, which is fast; None where not."""
    cells = split(lines[0])
    mark = _mark_of(lines[0], cells)
    if mark is None or max(widths) >= len(cells):
        return None
    quick = _at_once(lines, mark, cells, widths)
    if quick is not None:
        return quick
    templates = {_template(cells[c], width) for c, width in widths.items()}
    template = templates.pop() if len(templates) == 1 else None
    if template is None or len(set(widths.values())) > 1:
        return None
    width = next(iter(widths.values()))
    groups = SEPARATOR.join(rf"\{i + 1}" for i in range(width))
    text, count = re.subn(template, groups, "\n".join(lines))
    if count != len(widths) * len(lines):
        return None
    rows = text.replace(mark, SEPARATOR).split("\n")
    n = len(cells) - 1 + (width - 1) * len(widths)
    return rows if all(row.count(SEPARATOR) == n for row in rows) else None


def _at_once(
    lines: list[str], mark: str, cells: list[str], widths: dict[int, int]
) -> list[str] | None:
    """The rows where all lines have the first one's letters but for numbers: what stands around
    coordinates is exchanged in the text as a whole. None where it is otherwise.

    Args:
        lines: of data.
        mark: between their cells.
        cells: the first line's.
        widths: how many numbers the cells of places hold.
    """
    wanted = [[cell] if c not in widths else numbers_in(cell) for c, cell in enumerate(cells)]
    around = [_around(cells[c], wanted[c]) for c in widths]
    between = {part.encode() for parts in around for part in parts[1:-1]}
    outer = {part.encode() for parts in around for part in (parts[0], parts[-1])}
    other = "".join(cell for c, cell in enumerate(cells) if c not in widths).encode()
    text = "\n".join([*lines, ""]).encode()
    blanks, marks = set(_BLANKS), {*mark.encode(), _SEP}
    by_blanks = not b"".join(between).translate(None, _BLANKS)
    letters = set(b"".join(between | outer)) | blanks
    stop = next((x for x in letters - blanks - marks if _is_stop(x, between, outer)), None)
    if by_blanks:
        if other.translate(None, _BLANKS) != other or not all(b" " in part for part in between):
            return None
    elif stop is not None and not letters & {*_OF_NUMBERS, *other.replace(b" ", b""), *marks}:
        marks, blanks = marks | {stop}, letters - {stop}
    else:
        for part in sorted(between, key=len, reverse=True):
            text = text.replace(part, SEPARATOR.encode())
        for part in sorted(outer, key=len, reverse=True):
            if part.translate(None, _BLANKS):
                text = text.replace(part, b" ")
    form = text.translate(None, _OF_NUMBERS + (_BLANKS if by_blanks else b""))
    if form != form[: form.index(b"\n") + 1] * len(lines):
        return None
    to = b" " * len(blanks) + SEPARATOR.encode() * len(marks)
    text = text.translate(bytes.maketrans(bytes([*blanks, *marks]), to))
    rows = (_by_blanks(text) if by_blanks else text).decode().split("\n")[:-1]
    numbers = [number for some in wanted for number in some]
    if [cell.strip() for cell in rows[0].split(SEPARATOR)] != numbers:
        return None
    return rows if _are_even(text, len(lines), by_blanks) else None


def _is_stop(letter: int, between: set[bytes], outer: set[bytes]) -> bool:
    """Whether a letter stands once between any two coordinates, and nowhere else."""
    return all(part.count(letter) == 1 for part in between) and not any(
        letter in part for part in outer
    )


def _are_even(text: bytes, n: int, by_blanks: bool) -> bool:
    """Whether the cells of all n lines hold as many numbers as the first one's; a blank begins
    another one, or is nothing."""
    letters = np.frombuffer(text if by_blanks else text.translate(None, b" "), np.uint8)
    ends = letters < ord(" ")
    if not by_blanks and not ends[0] and not (ends[1:] & ends[:-1]).any():
        return True  # none is empty
    inside = letters > ord(" ")
    begins = inside.copy()
    begins[1:] &= ~inside[:-1]
    said = begins[begins | ends]
    return len(said) % n == 0 and bool((said.reshape(n, -1) == said[: len(said) // n]).all())


def _by_blanks(text: bytes) -> bytes:
    """Lines in which a separator stands before each number but a line's first."""
    letters = np.frombuffer(text, np.uint8)
    inside = (letters > ord(" ")) | (letters == _LINE)
    before = np.append(inside[1:] & (letters[1:] != _LINE), False)
    out: bytes = np.where(inside, letters, np.uint8(_SEP))[inside | before].tobytes()
    return out.replace(b"\n\x1f", b"\n").removeprefix(b"\x1f")


def _mark_of(line: str, cells: list[str]) -> str | None:
    """What separates a line's cells."""
    marks = [mark for mark in (SEPARATOR, ";", "\t", ",", "|") if mark in line]
    return next((m for m in marks if len(line.split(m)) == len(cells)), None)


def _around(cell: str, numbers: list[str]) -> list[str]:
    """What stands before, between and after the coordinates of a cell."""
    out, at = [], 0
    for number in numbers:
        begin = cell.index(number, at)
        out.append(cell[at:begin])
        at = begin + len(number)
    return [*out, cell[at:]]


def _template(cell: str, width: int) -> str | None:
    """A pattern of cells written as one is, with a group for each coordinate."""
    parts = re.split(rf"({_PLAIN})", cell)
    if width > 3 or any(character.isdigit() for part in parts[::2] for character in part):
        return None
    wanted = numbers_in(cell)
    if len(wanted) < width:
        return None
    found, pattern = 0, ""
    for i, part in enumerate(parts):
        if i % 2 == 0:
            pattern += _LITERAL_BLANKS.sub(" +", re.escape(part))
        elif found < width and part == wanted[found]:
            pattern, found = pattern + f"({_PLAIN})", found + 1
        else:
            pattern += _PLAIN
    return pattern if found == width else None


def _widths(cells_of: list[list[str]]) -> dict[int, int]:
    """How many numbers the cells of each column hold, where they hold places."""
    widths: dict[int, int] = {}
    for cells in cells_of:
        for c, cell in enumerate(cells):
            if c not in widths and cell.lower() not in _NOT_SEEN:
                n = len(numbers_in(cell)) if len(cell) > 4 else 0
                widths[c] = n if n in _WIDTHS else 0
    return {c: n for c, n in widths.items() if n}


def _worlds(widths: dict[int, int], titles: list[str]) -> dict[int, int]:
    """Of columns of whole hands those in space, where others are in the picture."""
    whole = [c for c, n in widths.items() if n > 3 and c < len(titles)]
    worlds = [c for c in whole if "world" in words(titles[c])]
    if not worlds or len(worlds) == len(whole):
        return widths
    return {c: n for c, n in widths.items() if c not in whole or c in worlds}


def _row(cell: str, width: int, where: str, path: Path) -> list[str]:
    numbers = numbers_in(cell)
    if len(numbers) != width:
        raise InputError(f"{where} is {cell[:40]!r}, expected {width} numbers", path)
    return ["nan" if n.lower() in _MISSING else n for n in numbers]


def _titles(titles: list[str], widths: dict[int, int], path: Path) -> list[str]:
    out = []
    for c, title in enumerate(titles):
        width = widths.get(c, 0)
        if not width:
            out.append(title)
        elif width == 3:
            out += [f"{title} {axis}" for axis in "xyz"]
        else:
            hand = of_side(title)[0]
            if any(w in ("picture", "image", "pixel", "pixels") for w in words(title)):
                raise NotJointsError(f"column {title[:40]!r} is of the picture", path)
            begin = f"{hand} joint" if hand else "joint"
            out += [f"{begin} {i} {axis}" for i in range(width // 3) for axis in "xyz"]
    return out
