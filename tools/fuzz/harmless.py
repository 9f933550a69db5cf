# mypy: disable-error-code="import-untyped"
"""Ways to write the same once more: other blanks, order, packing; what is read may not change."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import pickle
import random
import re
import struct
import tarfile
import zipfile
from collections.abc import Callable
from typing import Any

import numpy as np

from tools.fuzz import as_written, brought, corpus, robots

Files = dict[str, bytes]
Rewriter = Callable[[bytes, random.Random], bytes]
_FLOAT = re.compile(rb"(?<![\w.\"'+-])-?\d+\.\d+(?![\w.\"'])")
NONE = (
    *("own recording", "recording lz4", "recording zstd", "recording none", "mano"),
    *brought.ONE_WAY,
    *robots.ONE_WAY,
    *as_written.ONE_WAY,
)
"""Kinds that only this project writes, which `tools.bench.damage` judges too; and pickles of
classes that are not here."""
_CLOSED = ("hand.json",)
"""Kinds in which a name that is not known is refused."""


def rewritten(kind: str, files: Files, rng: random.Random) -> tuple[Files, str]:
    """The same files, written otherwise, and in which way; in none where there is none."""
    if kind in NONE:
        return files, ""
    if kind == "mcap":
        return _mcap(rng)
    found = dict(files)
    how = []
    for name in sorted(files) if rng.random() < 0.5 else [rng.choice(sorted(files))]:
        ways = _ways(kind, name, files[name])
        way = rng.choice(ways)
        found[name] = way(files[name], rng)
        how.append(getattr(way, "__name__", "way"))
    if len(files) > 1 and rng.random() < 0.2:
        found["README.md"] = b"# Hands\n"
        how.append("a readme")
    return found, " ".join(sorted(set(how)))


def _ways(kind: str, name: str, data: bytes) -> list[Rewriter]:
    if data.startswith(b"PK\x03\x04"):
        return [zip_again]
    if data.startswith(b"\x93NUMPY"):
        return [npy_again]
    if data.startswith(b"glTF"):
        return [glb_again]
    if name.endswith(".pkl"):
        return [pickle_again]
    if name.endswith(".tar"):
        return [tar_again]
    if name.endswith(".jsonl"):
        return [lines_again, line_ends, mark, numbers]
    if name.endswith(".json"):
        return [json_again, numbers, mark, *([] if kind in _CLOSED else [json_more])]
    if name.endswith((".toml", ".yaml", ".yml")):
        return [remarks, line_ends]
    if name.endswith(".csv"):
        return [cells_again, line_ends, mark, numbers, utf16, blank_end]
    return [blanks, line_ends, numbers, blank_end]


def _dumped(tree: Any, rng: random.Random, lines: bool = False) -> bytes:
    indent = None if lines else rng.choice((None, 1, "\t"))
    separators = rng.choice(((",", ":"), (", ", ": "), (" ,  ", " :  ")))
    return json.dumps(tree, indent=indent, separators=separators).encode()


def _shuffled(tree: Any, rng: random.Random) -> Any:
    """Names in another order."""
    if isinstance(tree, list):
        return [_shuffled(v, rng) for v in tree]
    if not isinstance(tree, dict):
        return tree
    names = list(tree)
    rng.shuffle(names)
    return {name: _shuffled(tree[name], rng) for name in names}


def json_again(data: bytes, rng: random.Random) -> bytes:
    return b" \n" * rng.randrange(2) + _dumped(_shuffled(json.loads(data), rng), rng) + b"\n"


def json_more(data: bytes, rng: random.Random) -> bytes:
    """With a name that nobody knows, where names of one's own are allowed."""
    tree = json.loads(data)
    if isinstance(tree, dict) and not any(isinstance(v, dict) for v in tree.values()):
        tree[rng.choice(("comment", "software", "made by"))] = rng.choice(
            ("x", None, True, {"a": "b"}, "", {"url": "x", "n": 3})
        )
    return json.dumps(tree).encode()


def lines_again(data: bytes, rng: random.Random) -> bytes:
    found = [_dumped(_shuffled(json.loads(line), rng), rng, True) for line in data.split(b"\n")]
    return rng.choice((b"\n", b"\n\n", b" \n", b"\r\n")).join(found) + b"\n"


def line_ends(data: bytes, rng: random.Random) -> bytes:
    return data.replace(b"\n", b"\r\n")


def mark(data: bytes, rng: random.Random) -> bytes:
    return b"\xef\xbb\xbf" + data


def utf16(data: bytes, rng: random.Random) -> bytes:
    return data.decode().encode("utf-16")


def blank_end(data: bytes, rng: random.Random) -> bytes:
    return data.rstrip(b"\n") + b"\n" * rng.randrange(4)


def numbers(data: bytes, rng: random.Random) -> bytes:
    """The same numbers with zeros behind or as a power of ten."""
    power = rng.random() < 0.5

    def other(match: re.Match[bytes]) -> bytes:
        same = b"%se0" % match[0] if power else match[0] + b"000"
        return same if rng.random() < 0.7 else match[0]

    return _FLOAT.sub(other, data)


def cells_again(data: bytes, rng: random.Random) -> bytes:
    """Another separator, quotes around all cells, blanks."""
    rows = [line.split(b",") for line in data.rstrip(b"\n").split(b"\n")]
    separator = rng.choice((b",", b";", b"\t", b", "))
    if rng.random() < 0.4 and separator != b", ":
        rows = [[b'"' + cell + b'"' for cell in row] for row in rows]
    if rows[0][0] == b"time" and rng.random() < 0.5:
        columns = list(range(len(rows[0])))
        rng.shuffle(columns)
        rows = [[row[i] for i in columns] for row in rows]
    if rows[0][0] == b"time" and rng.random() < 0.5:
        rows = [[*row, b"remark" if i == 0 else b"x"] for i, row in enumerate(rows)]
    return b"\n".join(map(separator.join, rows)) + b"\n"


def blanks(data: bytes, rng: random.Random) -> bytes:
    return data.replace(b" ", rng.choice((b"\t", b"  ")))


def remarks(data: bytes, rng: random.Random) -> bytes:
    """Remarks and empty lines at the end."""
    return data.rstrip(b"\n") + b"\n" + rng.choice((b"# x\n", b"\n\n", b"# made by hand: 1\n\n"))


def npy_again(data: bytes, rng: random.Random) -> bytes:
    """Another order in memory, order of bytes, version of the header."""
    array = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    if array.dtype.kind in "fiu" and rng.random() < 0.5:
        array = array.astype(array.dtype.newbyteorder(">"))
    array = np.asfortranarray(array) if rng.random() < 0.5 else array
    out = io.BytesIO()
    np.lib.format.write_array(out, array, version=rng.choice(((1, 0), (2, 0), (3, 0))))
    return out.getvalue()


def zip_again(data: bytes, rng: random.Random) -> bytes:
    """Members in another order, packed or not, with a note, and one that nobody knows."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = [(i.filename, archive.read(i)) for i in archive.infolist()]
    rng.shuffle(members)
    if rng.random() < 0.3:
        members.append(("remark.txt", b"x"))
    method = zipfile.ZIP_STORED if rng.random() < 0.5 else zipfile.ZIP_DEFLATED
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", method, compresslevel=1) as made:
        for name, content in members:
            plain = content.startswith(b"\x93NUMPY") and b"|O" not in content[:128]
            content = npy_again(content, rng) if plain and rng.random() < 0.3 else content
            with made.open(name, "w", force_zip64=rng.random() < 0.3) as member:
                member.write(content)
        made.comment = b"x" * rng.choice((0, 30))
    return out.getvalue()


def pickle_again(data: bytes, rng: random.Random) -> bytes:
    """Another protocol, names in another order."""
    content = pickle.loads(data, encoding="latin1")
    if isinstance(content, dict):
        content = _shuffled_names(content, rng)
    return pickle.dumps(content, rng.randrange(6))


def _shuffled_names(content: dict[Any, Any], rng: random.Random) -> dict[Any, Any]:
    names = list(content)
    rng.shuffle(names)
    return {name: content[name] for name in names}


def tar_again(data: bytes, rng: random.Random) -> bytes:
    """Another form, packing and order, with folders and a file that is no hand's."""
    out = io.BytesIO()
    with tarfile.open(fileobj=io.BytesIO(data)) as archive:
        members = [(m, (archive.extractfile(m) or io.BytesIO()).read()) for m in archive]
    rng.shuffle(members)
    form = rng.choice((tarfile.PAX_FORMAT, tarfile.GNU_FORMAT, tarfile.USTAR_FORMAT))
    with tarfile.open(fileobj=out, mode="w", format=form) as made:
        folder = tarfile.TarInfo("hdHand3d")
        folder.type = tarfile.DIRTYPE
        made.addfile(folder)
        for member, content in members:
            made.addfile(member, io.BytesIO(content))
    plain = out.getvalue() + bytes(512 * rng.randrange(5))
    if rng.random() < 0.25:
        half = len(plain) // 2  # as parallel packers write it
        return gzip.compress(plain[:half], 1) + gzip.compress(plain[half:], 1)
    pack: Callable[[bytes], bytes] = rng.choice((bytes, bz2.compress, lzma.compress, gzip.compress))
    return pack(plain)


def glb_again(data: bytes, rng: random.Random) -> bytes:
    size = struct.unpack_from("<I", data, 12)[0]
    text = _dumped(_shuffled(json.loads(data[20 : 20 + size]), rng), rng)
    text += b" " * (-len(text) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + data[20 + size :]
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _mcap(rng: random.Random) -> tuple[Files, str]:
    from mcap.writer import CompressionType, IndexType

    options = {
        "chunk_size": rng.choice((1, 1000, 10**6)),
        "compression": rng.choice(list(CompressionType)),
        "index_types": rng.choice((IndexType.ALL, IndexType.NONE, IndexType.CHUNK)),
        "use_chunking": rng.random() < 0.8,
        "enable_crcs": rng.random() < 0.5,
        "repeat_channels": rng.random() < 0.5,
        "use_statistics": rng.random() < 0.5,
        "use_summary_offsets": rng.random() < 0.5,
    }
    return corpus.mcap(corpus.motion(), **options), f"{options}"
