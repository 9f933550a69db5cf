"""The lines of JSON lines, some at a time: a file of gigabytes is held once."""

from __future__ import annotations

from array import array
from collections.abc import Iterator
from itertools import islice

from handtrack.sequences.readers.alike import FEWEST, append_list
from handtrack.sequences.readers.number_text import Forms

_AT_ONCE = 4096


def lines_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The lines with something in them, and their numbers."""
    begin, number = 0, 0
    while begin < len(data):
        number += 1
        end = data.find(b"\n", begin)
        end = len(data) if end < 0 else end
        line = data[begin:end]
        if line.strip():
            yield number, line
        begin = end + 1


def forms_of_lines(data: bytes) -> tuple[Forms, array[int]] | None:
    """The records of lines of one each, by their forms, and the lines' numbers; None where they
    are few, of many forms, or no JSON."""
    lines = lines_in(data)
    forms, numbers = Forms(), array("q")
    while some := list(islice(lines, _AT_ONCE)):
        numbers.extend(number for number, _ in some)
        text = b"".join((b"[", b",".join(line for _, line in some), b"]"))
        enough = len(numbers) >= FEWEST  # of the first
        if not enough or not append_list(forms, text) or len(forms) != len(numbers):
            return None
    return (forms, numbers) if numbers else None
