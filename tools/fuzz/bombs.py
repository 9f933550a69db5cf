# mypy: disable-error-code="misc, unused-ignore, import-untyped"
"""Small files that ask for much: memory, time, or depth. Each reader gets its own."""

from __future__ import annotations

import bz2
import gzip
import io
import json
import lzma
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from typing import Any

from tools.fuzz import corpus, gadgets
from tools.fuzz.bombs_models import MB, Bomb, cameras, mcaps, models

TEXTS: dict[str, Callable[[int], bytes]] = {
    "zeros": bytes,
    "remarks": lambda n: b"#\n" * (n // 2),
    "lines": lambda n: b"\n" * n,
    "spaces": lambda n: b" " * n,
    "two columns": lambda n: b"1,2\n" * (n // 4),
    "a header and two columns": lambda n: b"wrist_x,wrist_y\n" + b"1,2\n" * (n // 4),
    "commas": lambda n: b"," * n,
    "a quote": lambda n: b'wrist_x,wrist_y\n"' + b"x\n" * (n // 2),
    "quotes": lambda n: b'"",' * (n // 3),
    "a long cell": lambda n: b"wrist_x," + b"x" * n,
    "many columns": lambda n: b",".join(b"c%d" % i for i in range(n // 8)),
    "open lists": lambda n: b"[" * n,
    "open objects": lambda n: b'{"a":' * (n // 5),
    "joints within joints": lambda n: b'{"joints":' * (n // 10),
    "nulls": lambda n: b"[" + b"null," * (n // 5) + b"null]",
    "null lines": lambda n: b"{}\n" * (n // 3),
    "lists of nothing": lambda n: b"[" + b"[]," * (n // 3) + b"[]]",
    "digits": lambda n: b'{"joints_m": [' + b"9" * n + b"]}",
    "exponent": lambda n: b'{"joints_m": [1e' + b"9" * min(n, MB) + b"]}",
    "one name": lambda n: b"{" + b'"joints":[],' * (n // 12) + b'"a":1}',
    "escapes": lambda n: b'{"' + b"\\u0000" * (n // 6) + b'": 1}',
    "frames": lambda n: b'{"frames": [' + b'{"hands": [], "pointables": []},' * (n // 32) + b"{}]}",
    "people": lambda n: b'{"people": [' + b'{"id": 0},' * (n // 10) + b'{"id": 1}]}',
}
SUFFIXES = {"[": "json", "{": "json"}


def bombs() -> Iterator[Bomb]:
    """All of them."""
    yield from _texts()
    yield from _packed()
    yield from _arrays()
    yield from _zips()
    yield from _tars()
    yield from _frames()
    for name, data in gadgets.bombs():
        yield "ho3d file", f"{name.replace(' ', '_')}.pkl", lambda data=data: data  # type: ignore[misc]
        yield "mano", "MANO_RIGHT.pkl", lambda data=data: data  # type: ignore[misc]
    for data in gadgets.pointers():
        yield "ho3d file", "pointer.pkl", lambda data=data: data  # type: ignore[misc]
    yield from models()
    yield from cameras()
    yield from mcaps()


def _texts() -> Iterator[Bomb]:
    for name, make in TEXTS.items():
        for size in (MB // 2, 12 * MB):
            suffix = SUFFIXES.get(make(64)[:1].decode("latin-1"), "csv")
            yield "json", f"{name}.{suffix}", lambda make=make, size=size: make(size)  # type: ignore[misc]
        yield "json", f"{name}.txt", lambda make=make: make(3 * MB)  # type: ignore[misc]


def _packed() -> Iterator[Bomb]:
    tools: dict[str, Any] = {"gz": gzip, "bz2": bz2, "xz": lzma}
    for name in ("zeros", "remarks", "spaces", "two columns", "open lists", "nulls", "digits"):
        make = TEXTS[name]
        for suffix, tool in tools.items():
            yield "json", f"{name}.{suffix}", lambda t=tool, m=make: t.compress(m(20 * MB)) * 10  # type: ignore[misc]
    for levels in (2, 3):

        def nested(levels: int = levels) -> bytes:
            data = bytes(100 * MB)
            for _ in range(levels):
                data = gzip.compress(data)
            return data

        yield "json", f"gz{levels}.json.gz", nested
    # ten members, each of which unpacks alone
    yield "json", "many.json.gz", lambda: gzip.compress(b" " * 30 * MB) * 10


def _arrays() -> Iterator[Bomb]:
    shapes = (
        *("(99999999999,)", "(9999999, 21, 3)", "(0, 99999999999999999999)", "(-1, 21, 3)"),
        *("(4294967296, 4294967296)", "(" + "1," * 3000 + ")", "(2,) * 99", "[6, 21, 3]"),
        *(
            "(" + "(" * 500 + ")" * 500 + ",)",
            "(" + "-" * 4000 + "1,)",
            "(9**9**9,)",
            "(1e9, 21, 3)",
        ),
    )
    for i, shape in enumerate(shapes):
        for descr in ("'<f8'", "'|O'", "'|V1000000'", "[('a', '<f8', (10000, 10000))]"):
            text = f"{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}, }}".encode()
            if descr != "'<f8'" and i > 1:
                continue
            data = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + bytes(1000)
            yield "npy", f"shape{i}.npy", lambda data=data: data  # type: ignore[misc]
            long = b"\x93NUMPY\x02\x00" + struct.pack("<I", 2**31) + text
            yield "npy", f"long{i}.npy", lambda data=long: data  # type: ignore[misc]

    def packed(data: bytes) -> bytes:
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("joints_m.npy", data)
        return out.getvalue()

    for i, shape in enumerate(shapes[:4]):
        text = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".encode()
        head = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text
        yield "npz", f"shape{i}.npz", lambda head=head: packed(head)  # type: ignore[misc]
        yield "npz", f"zeros{i}.npz", lambda head=head: packed(head + bytes(200 * MB))  # type: ignore[misc]


def _zips() -> Iterator[Bomb]:
    def zipped(
        members: int, size: int, name: str = "x%d.npy", method: int = zipfile.ZIP_DEFLATED
    ) -> bytes:
        out = io.BytesIO()
        with zipfile.ZipFile(out, "w", method) as archive:
            for i in range(members):
                archive.writestr(name % i if "%" in name else name, bytes(size))
        return out.getvalue()

    yield "npz", "members.npz", lambda: zipped(60_000, 0)
    yield "npz", "more members.npz", lambda: zipped(120_000, 0)
    yield "npz", "large.npz", lambda: zipped(4, 60 * MB)
    yield "npz", "bz2.npz", lambda: zipped(1, 200 * MB, "joints_m.npy", zipfile.ZIP_BZIP2)
    yield "npz", "lzma.npz", lambda: zipped(1, 200 * MB, "joints_m.npy", zipfile.ZIP_LZMA)
    yield "npz", "zip in zip.npz", lambda: _in_zip(_in_zip(zipped(1, 100 * MB)))
    sound = corpus.as_npz(joints_m=corpus.motion(), hand="right")
    for place in (8, 10):
        for value in (1, 8, 12, 14, 97, 99, 255):

            def changed(place: int = place, value: int = value) -> bytes:
                bad = bytearray(sound)
                for mark, shift in ((b"PK\x01\x02", 0), (b"PK\x03\x04", -2)):
                    bad[bad.find(mark) + place + shift] = value
                return bytes(bad)

            yield "npz", f"flag{place}-{value}.npz", changed
    for field, form, value in (
        (24, "<I", 2**32 - 2),
        (20, "<I", 2**32 - 2),
        (42, "<I", 2**31),
        (28, "<H", 65535),
    ):

        def lying(field: int = field, form: str = form, value: int = value) -> bytes:
            bad = bytearray(sound)
            struct.pack_into(form, bad, bad.find(b"PK\x01\x02") + field, value)
            return bytes(bad)

        yield "npz", f"lies{field}.npz", lying
    yield "npz", "overlap.npz", _overlapping


def _in_zip(data: bytes) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("joints_m.npy", data)
    return out.getvalue()


def _overlapping(members: int = 2000) -> bytes:
    """Many members in the list that are one and the same in the file."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    content = bytes(20 * MB)
    body = packer.compress(content) + packer.flush()
    sums = struct.pack("<III", zlib.crc32(content), len(body), len(content))
    local = (
        b"PK\x03\x04"
        + struct.pack("<HHHHH", 20, 0, 8, 0, 33)
        + sums
        + struct.pack("<HH", 1, 0)
        + b"x"
        + body
    )
    entries = b""
    for i in range(members):
        name = b"x%d" % i
        entries += b"PK\x01\x02" + struct.pack("<HHHHHH", 20, 20, 0, 8, 0, 33) + sums
        entries += struct.pack("<HHHHHII", len(name), 0, 0, 0, 0, 0, 0) + name
    end = struct.pack("<HHHHIIH", 0, 0, members, members, len(entries), len(local), 0)
    return local + entries + b"PK\x05\x06" + end


def _tars() -> Iterator[Bomb]:
    name = "hdHand3d/handRecon3D_hd%08d.json"

    def archive(*members: tuple[str, bytes, int, bytes], mode: str = "w:gz") -> bytes:
        out = io.BytesIO()
        with tarfile.open(fileobj=out, mode=mode, format=tarfile.GNU_FORMAT) as made:  # type: ignore[call-overload]
            for member, kind, size, data in members:
                info = tarfile.TarInfo(member)
                info.type, info.size = kind, size
                made.addfile(info)
                made.fileobj.write(data)
                made.offset += len(data)
        return out.getvalue()

    for mode in ("w", "w:gz", "w:bz2", "w:xz"):
        for kind in (b"0", b"x", b"g", b"L", b"K", b"S", b"7"):
            big = 150 * MB if mode != "w" else 10 * MB

            def one(kind: bytes = kind, mode: str = mode, big: int = big) -> bytes:
                return archive((name % 1, kind, big, bytes(big + -big % 512)), mode=mode)

            yield "tar", f"one{kind.decode()}{mode[2:]}.tar", one
            yield (
                "tar",
                f"lies{kind.decode()}{mode[2:]}.tar",
                lambda k=kind, m=mode: archive((name % 1, k, 8**11 - 1, b""), mode=m),
            )  # type: ignore[misc]
        if mode != "w":
            yield (
                "tar",
                f"members{mode[2:]}.tar",
                lambda mode=mode: _tool(mode).compress(tarfile.TarInfo("x").tobuf() * 300_000),  # type: ignore[misc]
            )
            yield (
                "tar",
                f"other{mode[2:]}.tar",
                lambda mode=mode: archive(("x.bin", b"0", 200 * MB, bytes(200 * MB)), mode=mode),
            )  # type: ignore[misc]
    yield "tar", "sparse.tar", lambda: _sparse(name % 1)
    records = b"".join(b"%d x%06d=1\n" % (12, i) for i in range(10**6))
    records += bytes(-len(records) % 512)
    yield (
        "tar",
        "pax.tar",
        lambda: archive(("p", b"x", len(records), records), (name % 1, b"0", 0, b"")),
    )
    yield "tar", "links.tar", lambda: archive(*[(name % i, b"2", 0, b"") for i in range(1000)])
    yield "tar", "twice.tar", lambda: archive(*[(name % 1, b"0", 0, b"")] * 100)


def _tool(mode: str) -> Any:
    return {"w:gz": gzip, "w:bz2": bz2, "w:xz": lzma}[mode]


def _sparse(name: str) -> bytes:
    """GNU's sparse header: an empty file that has 4 GB."""
    info = tarfile.TarInfo(name)
    info.type = tarfile.GNUTYPE_SPARSE
    block = bytearray(info.tobuf(tarfile.GNU_FORMAT))
    block[386:410] = b"00000000000\0" + b"00000000000\0"
    block[483:495] = b"37777777777\0"
    block[148:156] = b" " * 8
    block[148:156] = b"%06o\0 " % sum(block)
    return bytes(block) + bytes(1024)


def _frames() -> Iterator[Bomb]:
    hand = {"id": 7, "type": "right", "confidence": 1}
    finger = {"handId": 7, "type": 0, "id": 1, "tipPosition": [0, 0, 0]}
    for hands, fingers in ((20_000, 0), (20_000, 20_000), (1, 100_000)):
        frame = {
            "hands": [hand | {"id": i} for i in range(hands)],
            "pointables": [finger | {"handId": i % max(hands, 1), "id": i} for i in range(fingers)],
        }
        data = json.dumps({"frames": [frame, frame]}).encode()
        yield "leap", "a.json", lambda data=data: data  # type: ignore[misc]
    joints = corpus.motion()
    person = json.loads(corpus.panoptic_frame(joints[0]))["people"][0]
    many = json.dumps({"people": [person | {"id": i} for i in range(3000)]}).encode()
    yield "panoptic file", "handRecon3D_hd00000001.json", lambda: many
    same = json.dumps({"people": [person] * 3000}).encode()
    yield "panoptic file", "handRecon3D_hd00000001.json", lambda: same
    for size in (MB, 3 * MB):
        yield "dexycb meta", "meta.yml", lambda size=size: b"mano_sides:" + b"\n" * size  # type: ignore[misc]
        yield "dexycb meta", "meta.yml", lambda size=size: b"mano_sides:\n" * (size // 12)  # type: ignore[misc]
        yield "dexycb meta", "meta.yml", lambda size=size: b"mano_sides:\n" + b" " * size  # type: ignore[misc]
        yield "dexycb meta", "meta.yml", lambda size=size: b"mano_sides:\n- " + b"a" * size  # type: ignore[misc]
    frame = json.loads(corpus.interhand(joints)["joint_3d.json"])["0"]["0"]
    body = json.dumps(frame).encode()
    yield "interhand", "joint_3d.json", lambda: b'{"0": {"1": ' + body + b', "1": ' + body + b"}}"
    yield "interhand", "joint_3d.json", lambda: b'{"0": {"1": ' + body + b', "01": ' + body + b"}}"
    yield "interhand", "joint_3d.json", lambda: b'{"0": {"' + b"9" * MB + b'": ' + body + b"}}"
