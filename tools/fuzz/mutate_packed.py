# mypy: disable-error-code="import-untyped"
"""Ways to spoil what is inside of containers: sums, lengths and headers are made right again."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import pickletools
import random
import re
import struct
import tarfile
import warnings
import zipfile
import zlib
from collections.abc import Callable
from typing import Any

from tools.fuzz.mutate import in_json, of_bytes, of_cells, of_lines, of_numbers

SHAPES = (
    *("()", "(0,)", "(-1, 21, 3)", "(99999999999, 21, 3)", "(1,) * 9", "(6, 63)", "(3, 21, 6)"),
    *("(2, 3, 21, 3)", "(" + "1, " * 40 + ")", "(" + "9" * 5000 + ",)", "(True, 21, 3)", "'x'"),
)
Mutator = Callable[[bytes, random.Random], bytes]
_SLOW = 100_000
"""Bytes that are not packed again: it takes longer than all readers."""


def mutated(data: bytes, rng: random.Random) -> bytes:
    """The data, spoilt in a way that fits what they are, once or a few times."""
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        try:
            data = rng.choice(fitting(data))(data, rng)
        except Exception:  # noqa: BLE001 - what is spoilt already may not be taken apart again
            data = of_bytes(data, rng)
    return data


def fitting(data: bytes) -> list[Mutator]:
    """Ways for data of that kind."""
    if data.startswith(b"PK\x03\x04"):
        return [of_bytes, in_zip, in_zip, in_zip]
    if data.startswith((b"\x1f\x8b", b"BZh", b"\xfd7zXZ")):
        return [of_bytes, packed, packed, packed]
    if data[257:262] == b"ustar":
        return [of_bytes, in_tar, in_tar, in_tar]
    if data.startswith(b"\x93NUMPY"):
        return [of_bytes, npy_header, npy_header]
    if data.startswith(b"\x89MCAP"):
        return [of_bytes, in_mcap, in_mcap, in_mcap]
    if data.startswith(b"\x89HDF") or data[1:2] == b"\x50":
        return [of_bytes]
    if data.startswith(b"glTF"):
        return [of_bytes, in_glb, in_glb, in_glb]
    if data[:1] == b"\x80" or data[:2] in (b"(d", b"(l"):
        return [of_bytes, in_pickle, in_pickle, in_pickle]
    if data.lstrip()[:1] in (b"{", b"["):
        return [of_bytes, of_numbers, of_lines, in_json, in_json, in_json]
    return [of_bytes, of_numbers, of_lines, of_cells, of_cells]


def npy_header(data: bytes, rng: random.Random) -> bytes:
    """Another shape, type or order; or the array's bytes are spoilt."""
    length = struct.unpack_from("<H", data, 8)[0] if len(data) > 10 else 0
    header, body = data[10 : 10 + length].decode("latin-1"), data[10 + length :]
    what = rng.randrange(5)
    if what == 0:
        shape = rng.choice(SHAPES)
        header = re.sub(r"\([^)]*\)", lambda _: shape, header, count=1)
    elif what == 1:
        kind = rng.choice(
            (
                "<f4",
                ">f8",
                "|O",
                "|V8",
                "<U2",
                "<M8[ns]",
                "<c16",
                "|b1",
                "<i8",
                "<u2",
                "|S8",
                "[('a','<f8')]",
                "<f16",
                "<f2",
            )
        )
        header = re.sub(
            r"'descr': ('[^']*'|\[[^\]]*\])", lambda _: f"'descr': '{kind}'", header, count=1
        )
    elif what == 2:
        header = header.replace("False", rng.choice(("True", "None", "1", "__import__('os')")))
    elif what == 3:
        header = of_bytes(header.encode("latin-1"), rng).decode("latin-1")
    else:
        body = (in_pickle if "'|O'" in header else of_bytes)(body, rng)
    raw = header.encode("latin-1")[:65535]
    version = data[6:8] if rng.random() < 0.95 else rng.randbytes(2)
    return data[:6] + version + struct.pack("<H", len(raw)) + raw + body


def _shuffled(parts: list[Any], rng: random.Random) -> tuple[int, int]:
    """A part is taken out (0), or there twice (1), or is left to the caller: 2 to 5; its place."""
    at, what = rng.randrange(len(parts)), rng.randrange(6)
    if what == 0:
        del parts[at]
    elif what == 1:
        parts.insert(at, parts[at])
    return what, at


def in_zip(data: bytes, rng: random.Random) -> bytes:
    """A member is spoilt inside, with a sum that is right; or the list of them is."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            members = [(i.filename, archive.read(i)) for i in archive.infolist()]
    except (
        zipfile.BadZipFile,
        ValueError,
        RuntimeError,
        OSError,
        zlib.error,
        EOFError,
        NotImplementedError,
    ):
        return of_bytes(data, rng)
    if not members:
        return of_bytes(data, rng)
    what, at = _shuffled(members, rng)
    if what == 2:
        named = rng.choice(("x.npy", "joints.npy", "../x", "", "hand.npy", "fps.npy"))
        members[at] = (named, members[at][1])
    elif what > 2:
        members[at] = (members[at][0], mutated(members[at][1], rng))
    out = io.BytesIO()
    method = rng.choice((zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_LZMA))
    if sum(len(content) for _, content in members) > _SLOW:
        method = zipfile.ZIP_STORED
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with zipfile.ZipFile(out, "w", method) as archive:
            for name, content in members:
                archive.writestr(name or "x", content)
    bad = bytearray(out.getvalue())
    if rng.random() < 0.1:  # encrypted, or another method, of the first in the list
        place = bad.rfind(b"PK\x01\x02")
        bad[place + rng.choice((8, 10))] ^= rng.choice((1, 9, 97))
    return bytes(bad)


def packed(data: bytes, rng: random.Random) -> bytes:
    """What is compressed is spoilt, and compressed again."""
    tool: Any = gzip if data.startswith(b"\x1f\x8b") else bz2 if data.startswith(b"BZh") else lzma
    try:
        inside = tool.decompress(data)
    except (OSError, EOFError, ValueError, zlib.error, lzma.LZMAError):
        return of_bytes(data, rng)
    return bytes(tool.compress(mutated(inside, rng)))


def in_tar(data: bytes, rng: random.Random) -> bytes:
    """A member is spoilt, of another type, or its header is, with a sum that is right."""
    try:
        with tarfile.open(fileobj=io.BytesIO(data)) as archive:
            members = [(m, (archive.extractfile(m) or io.BytesIO()).read()) for m in archive]
    except (
        tarfile.TarError,
        OSError,
        ValueError,
        EOFError,
        KeyError,
        AttributeError,
        OverflowError,
    ):
        return of_bytes(data, rng)
    if not members:
        return of_bytes(data, rng)
    what, at = _shuffled(members, rng)
    if what == 2:
        member, _ = members[at]
        member.type = rng.choice(
            (b"1", b"2", b"3", b"5", b"6", b"7", b"S", b"x", b"g", b"L", b"\0")
        )
    elif what == 3:
        member, _ = members[at]
        member.name = rng.choice(
            ("../" + member.name, "x" * 300, "", "\udcff", member.name[:-1], "/etc/passwd")
        )
        member.linkname = rng.choice(("", member.name, "/dev/zero"))
    elif what > 3:
        member, content = members[at]
        members[at] = (member, mutated(content, rng))
    out = io.BytesIO()
    with tarfile.open(
        fileobj=out, mode="w", format=rng.choice((tarfile.PAX_FORMAT, tarfile.GNU_FORMAT))
    ) as made:
        for each, content in members:
            each.size = len(content) if rng.random() < 0.98 else rng.choice((0, 10**6, 8**11 - 1))
            try:
                made.addfile(
                    each,
                    io.BytesIO(
                        content + bytes(each.size - len(content)) if each.size < 10**7 else content
                    ),
                )
            except (ValueError, OSError):
                made.fileobj.write(content)
    return out.getvalue()


def in_pickle(data: bytes, rng: random.Random) -> bytes:
    """Opcodes are gone, there twice, exchanged, with another argument."""
    try:
        starts = [place for _, _, place in pickletools.genops(data) if place is not None]
    except (
        ValueError,
        IndexError,
        AttributeError,
        UnicodeDecodeError,
        OverflowError,
        struct.error,
    ):
        return of_bytes(data, rng)
    codes = [data[a:b] for a, b in zip(starts, [*starts[1:], len(data)], strict=True)]
    what, at = _shuffled(codes, rng)
    if what == 2:
        other = rng.randrange(len(codes))
        codes[at], codes[other] = codes[other], codes[at]
    elif what == 3:
        codes[at] = of_bytes(codes[at], rng)
    elif what == 4:
        codes[at : at + 1] = [rng.choice(codes) for _ in range(rng.randrange(5))]
    elif what > 4:
        codes.insert(
            at,
            rng.choice(
                (
                    b"(",
                    b"0",
                    b"2",
                    b"]",
                    b"}",
                    b")",
                    b"N",
                    b"K\x01",
                    b"\x85",
                    b"R",
                    b"b",
                    b"s",
                    b"a",
                    b"G\x7f\xf0\0\0\0\0\0\0",
                )
            ),
        )
    return b"".join(codes)


def in_glb(data: bytes, rng: random.Random) -> bytes:
    """The JSON or the numbers of a .glb."""
    try:
        size = struct.unpack_from("<I", data, 12)[0]
        text, rest = data[20 : 20 + size], data[28 + size :]
    except struct.error:
        return of_bytes(data, rng)
    text, rest = (in_json(text, rng), rest) if rng.random() < 0.8 else (text, of_bytes(rest, rng))
    text += b" " * (-len(text) % 4)
    body = (
        struct.pack("<I4s", len(text), b"JSON")
        + text
        + struct.pack("<I4s", len(rest), b"BIN\0")
        + rest
    )
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def in_mcap(data: bytes, rng: random.Random) -> bytes:
    """A record is spoilt, gone or there twice; chunks and their sums are made anew."""
    records = _records(data[8:-8])
    if not records:
        return of_bytes(data, rng)
    what, at = _shuffled(records, rng)
    if what == 2:
        other = rng.randrange(len(records))
        records[at], records[other] = records[other], records[at]
    elif what > 2:
        code, content = records[at]
        records[at] = (code, _chunk(content, rng) if code == 6 else of_bytes(content, rng))
    return data[:8] + b"".join(map(_record, records)) + data[-8:]


def _records(data: bytes) -> list[tuple[int, bytes]]:
    found, place = [], 0
    while place + 9 <= len(data):
        code, size = struct.unpack_from("<BQ", data, place)
        if size > len(data) - place - 9:
            break
        found.append((code, data[place + 9 : place + 9 + size]))
        place += 9 + size
    return found


def _record(record: tuple[int, bytes]) -> bytes:
    return struct.pack("<BQ", record[0], len(record[1])) + record[1]


def _chunk(content: bytes, rng: random.Random) -> bytes:
    try:
        length = struct.unpack_from("<I", content, 28)[0]
        name = content[32 : 32 + length]
        body = content[40 + length :]
        if name == b"lz4":
            import lz4.frame

            body = lz4.frame.decompress(body)
        elif name == b"zstd":
            import zstandard

            body = zstandard.decompress(body)
    except (struct.error, RuntimeError, ValueError):
        return of_bytes(content, rng)
    records = _records(body)
    if records and rng.random() < 0.7:
        at = rng.randrange(len(records))
        code, inside = records[at]
        if code == 5 and len(inside) > 22:  # a message: JSON, or protobuf
            text = inside[22:]
            inside = inside[:22] + (in_json(text, rng) if text[:1] == b"{" else of_bytes(text, rng))
        else:
            inside = of_bytes(inside, rng)
        records[at] = (code, inside)
        body = b"".join(map(_record, records))
    else:
        body = of_bytes(body, rng)
    size = len(body) if rng.random() < 0.9 else rng.choice((0, 2**40, 2**63, len(body) + 1))
    head = content[:16] + struct.pack("<QII", size, zlib.crc32(body), 0)
    return head + struct.pack("<Q", len(body)) + body
