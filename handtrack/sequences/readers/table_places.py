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


_BRACKET = frozenset(" ()[]{}")
_NO_NUMBERS = str.maketrans("", "", "0123456789+-.eE")
_LITERAL_BLANKS = re.compile(r"(?:\\ |\s)+")
_PLAIN = r"[-+]?[\d.]+(?:[eE][-+]?\d+)?"


def _alike(
    lines: list[str], split: Callable[[str], list[str]], widths: dict[int, int]
) -> list[str] | None:
    """The rows where all places are written as the first one is, which is fast; None where not."""
    cells = split(lines[0])
    quick = _alike_letters(lines, cells, widths)
    if quick is not None:
        return quick
    templates = {_template(cells[c], width) for c, width in widths.items() if c < len(cells)}
    template = templates.pop() if len(templates) == 1 else None
    if template is None or len(set(widths.values())) > 1:
        return None
    width = next(iter(widths.values()))
    mark = _mark_of(lines[0], cells)
    if mark is None:
        return None
    groups = SEPARATOR.join(rf"\{i + 1}" for i in range(width))
    places = [cells[c] for c in widths]
    quick = _literally(
        lines, mark, places, re.sub(template, groups, lines[0]).replace(mark, SEPARATOR)
    )
    if quick is not None:
        return quick
    text, count = re.subn(template, groups, "\n".join(lines))
    if count != len(widths) * len(lines):
        return None
    rows = text.replace(mark, SEPARATOR).split("\n")
    n = len(cells) - 1 + (width - 1) * len(widths)
    return rows if all(row.count(SEPARATOR) == n for row in rows) else None


def _literally(lines: list[str], mark: str, places: list[str], first: str) -> list[str] | None:
    """The rows where no more than the coordinates differ in the cells of places; None where other
    than numbers would stay.

    Args:
        lines: of data.
        mark: between their cells.
        places: the first line's cells that hold one.
        first: the first line as a row.
    """
    around = [[_squeezed(part) for part in _around(place, numbers_in(place))] for place in places]
    if any(parts != around[0] for parts in around):
        return None
    before, *between, after = around[0]
    text = _squeezed("\n".join(("", *lines, "")))
    text = text.replace(f"{after}{mark}{before}", mark)
    for part in dict.fromkeys(between):
        text = text.replace(part, SEPARATOR)
    for edge in (mark, "\n"):
        text = text.replace(f"{edge}{before}", edge).replace(f"{after}{edge}", edge)
    text = text.replace(mark, SEPARATOR)
    rows = text[1:-1].split("\n")
    form = first.translate(_NO_NUMBERS)
    if any(row.translate(_NO_NUMBERS) != form for row in rows) or len(rows) != len(lines):
        return None
    empty = (
        f"{SEPARATOR}{SEPARATOR}" in text or f"\n{SEPARATOR}" in text or f"{SEPARATOR}\n" in text
    )
    return None if empty else rows


def _mark_of(line: str, cells: list[str]) -> str | None:
    """What separates a line's cells."""
    marks = [mark for mark in (SEPARATOR, ";", "\t", ",", "|") if mark in line]
    return next((m for m in marks if len(line.split(m)) == len(cells)), None)


def _alike_letters(lines: list[str], cells: list[str], widths: dict[int, int]) -> list[str] | None:
    """The rows where brackets can be blanks, and one letter stands between coordinates: all lines
    have the first one's letters but for numbers. None where it is otherwise."""
    mark = _mark_of(lines[0], cells)
    if mark is None or max(widths) >= len(cells):
        return None
    around = {c: _around(cells[c], numbers_in(cells[c])) for c in widths}
    between = {part for of in around.values() for part in of[1:-1]}
    ends = {part for of in around.values() for part in (of[0], of[-1])}
    stops = {letter for part in between for letter in part} - _BRACKET
    if len(stops) != 1 or any(len({*part} & stops) != 1 for part in between) or mark in stops:
        return None
    if any(part.count(stop) != 1 for part in between for stop in stops):
        return None
    if any({*part} - _BRACKET for part in ends):
        return None
    form = lines[0].translate(_NO_NUMBERS)
    if any(line.translate(_NO_NUMBERS) != form for line in lines):
        return None
    text = "\n".join(lines)
    begins = {of[0] for of in around.values()} | between
    if any(a + b in text for a in begins - {""} for b in ends - {""} | between):
        return None  # a coordinate is empty
    (stop,) = stops
    letters = str.maketrans(dict.fromkeys(_BRACKET, " ") | {mark: SEPARATOR, stop: SEPARATOR})
    rows = text.translate(letters).split("\n")
    wanted = [
        n for c, cell in enumerate(cells) for n in (numbers_in(cell) if c in widths else [cell])
    ]
    return rows if [cell.strip() for cell in rows[0].split(SEPARATOR)] == wanted else None


def _squeezed(text: str) -> str:
    """Text with one blank for several, as in NumPy's columns, and none within a bracket."""
    while "  " in text:
        text = text.replace("  ", " ")
    for bracket in "([{":
        text = text.replace(f"{bracket} ", bracket)
    return text


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
