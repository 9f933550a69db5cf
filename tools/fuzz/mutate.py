"""Ways to spoil a file that keep what a reader checks first: sums, lengths, brackets."""

from __future__ import annotations

import json
import random
import re
import struct
from typing import Any

NUMBERS = (
    *("0", "-1", "1", "NaN", "nan", "inf", "-Infinity", "1e999", "1e308", "1e-320", "-0.0", "null"),
    *("true", '"text"', '""', "", "9" * 400, "9" * 5000, "1e5000", "2147483648", "4294967295"),
    *(
        "9223372036854775808",
        "-9223372036854775809",
        "1e18",
        "0.5",
        "[]",
        "{}",
        "0x10",
        "1_000",
        "٣",
    ),
)
VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 2**31, 2**63, 2**64, 10**400, 0.5, 1e308, -1e308, 1e-320),
    *(
        "",
        "x",
        "right",
        "left",
        "NaN",
        "\x00\x1b[31m\n",
        "\ud800",
        "x" * 5000,
        [],
        {},
        [[]],
        [None],
    ),
    *([0, 0, 0], [1e300] * 3, {"x": 1, "y": 2, "z": 3}, [[[[[]]]]], float("nan"), float("inf")),
)
_NUMBER = re.compile(rb"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")


def of_bytes(data: bytes, rng: random.Random) -> bytes:
    """Flips, cuts, insertions, deletions, copies, wrong lengths."""
    if not data:
        return rng.randbytes(8)
    bad, at = bytearray(data), rng.randrange(len(data))
    size = rng.choice((1, 2, 4, 8, 64, 1000))
    what = rng.randrange(8)
    if what == 0:
        bad[at] ^= 1 << rng.randrange(8)
    elif what == 1:
        del bad[at:]
    elif what == 2:
        bad[at:at] = rng.randbytes(size)
    elif what == 3:
        del bad[at : at + size]
    elif what == 4:
        other = rng.randrange(len(data))
        bad[at:at] = data[other : other + size]
    elif what == 5:
        bad[at : at + size] = bytes([rng.choice((0, 255, 10, 34, 91, 123))]) * size
    elif what == 6:
        form, value = rng.choice(
            (("<I", 2**32 - 1), ("<Q", 2**63), ("<H", 65535), ("<Q", 6 * 2**30), ("<I", 0))
        )
        wrong = struct.pack(form, value)
        bad[at : at + len(wrong)] = wrong
    else:
        bad += rng.choice((b"\0" * size, b"\n" * size, rng.randbytes(size), data[:size], data))
    return bytes(bad)


def of_numbers(data: bytes, rng: random.Random) -> bytes:
    """A number that stands as text is another, or none."""
    found = list(_NUMBER.finditer(data))
    if not found:
        return of_bytes(data, rng)
    match = rng.choice(found)
    return data[: match.start()] + rng.choice(NUMBERS).encode() + data[match.end() :]


def of_lines(data: bytes, rng: random.Random) -> bytes:
    """A line is gone, there twice, elsewhere, blank, cut, a remark."""
    lines = data.split(b"\n")
    at = rng.randrange(len(lines))
    what = rng.randrange(7)
    if what == 0:
        del lines[at]
    elif what == 1:
        lines.insert(at, lines[at])
    elif what == 2:
        lines.insert(rng.randrange(len(lines)), lines.pop(at))
    elif what == 3:
        lines.insert(at, rng.choice((b"", b"null", b"#", b"{}", b"[]", b",", b"\xff\xfe", b"\0")))
    elif what == 4:
        lines[at] = lines[at][: rng.randrange(len(lines[at]) + 1)]
    elif what == 5:
        return data.replace(b"\n", rng.choice((b"\r\n", b"\r", b"\n\n", b" \n", b"")))
    else:
        return rng.choice((b"\xef\xbb\xbf", b"\xff\xfe", b"\n\n", b"# x\n")) + data
    return b"\n".join(lines)


def of_cells(data: bytes, rng: random.Random) -> bytes:
    """A cell of a table, its separators, its quotes."""
    separator = b"," if b"," in data else b" "
    what = rng.randrange(4)
    if what == 0:
        return data.replace(separator, rng.choice((b";", b"\t", b" ", b", ", b",,", b"|")))
    cells = data.split(separator)
    at = rng.randrange(len(cells))
    if what == 1:
        cells[at] = rng.choice((*NUMBERS, '"', "'", "1,5", "hand", "wrist_x", "a" * 300)).encode()
    elif what == 2:
        del cells[at]
    else:
        other = rng.randrange(len(cells))
        cells[at], cells[other] = cells[other], cells[at]
    return separator.join(cells)


def in_json(data: bytes, rng: random.Random) -> bytes:
    """A value of a tree, of a random line where there are several."""
    lines = data.split(b"\n") if data.lstrip()[:1] == b"{" and data.count(b"\n{") else [data]
    at = rng.randrange(len(lines))
    try:
        tree = json.loads(lines[at])
    except (ValueError, RecursionError):
        return of_bytes(data, rng)
    places: list[tuple[Any, Any]] = []
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        keys = list(node) if isinstance(node, dict) else range(len(node))
        # of long lists a few
        for key in keys if len(keys) < 8 else rng.sample(list(keys), 8):
            places.append((node, key))
            if isinstance(node[key], dict | list):
                waiting.append(node[key])
    if not places:
        return of_bytes(data, rng)
    node, key = rng.choice(places)
    what = rng.randrange(6)
    if what == 0:
        del node[key]
    elif what == 1:
        other, place = rng.choice(places)
        if place in other if isinstance(other, dict) else place < len(other):
            node[key] = other[place]
    elif what == 2 and isinstance(node, dict):
        node[
            rng.choice(("x", "", "joints", "hand", "time", "frames", "people", str(key) + " "))
        ] = node.pop(key)
    elif what == 3 and isinstance(node, list):
        node.insert(key, rng.choice(VALUES))
    elif what == 4:
        node[key] = rng.choice(([node[key]], {"x": node[key]}, str(node[key])[:100]))
    else:
        node[key] = rng.choice(VALUES)
    try:
        lines[at] = json.dumps(tree, ensure_ascii=rng.random() < 0.5).encode(
            "utf-8", "surrogatepass"
        )
    except (ValueError, RecursionError):
        return of_bytes(data, rng)
    if rng.random() < 0.1 and isinstance(tree, dict) and tree:  # a name twice
        lines[at] = b"{" + lines[at][1:-1] + b"," + lines[at][1:]
    return b"\n".join(lines)
