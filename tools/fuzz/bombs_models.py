# mypy: disable-error-code="misc, unused-ignore, import-untyped"
"""Bombs for models, cameras and MCAP files."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from typing import Any

from tools.fuzz import corpus
from tools.fuzz.kinds import kinds

MB = 10**6
Bomb = tuple[str, str, Callable[[], bytes]]
"""Name of the kind that reads it, the file's name, what makes it."""


def models() -> Iterator[Bomb]:
    files = kinds()["glb"].make(corpus.motion())
    data = files["a.glb"]
    size = struct.unpack_from("<I", data, 12)[0]
    document, rest = json.loads(data[20 : 20 + size]), data[28 + size :]

    def changed(change: Callable[[dict[str, Any]], object]) -> Callable[[], bytes]:
        def make() -> bytes:
            copy = json.loads(json.dumps(document))
            change(copy)
            text = json.dumps(copy).encode()
            text += b" " * (-len(text) % 4)
            body = struct.pack("<I4s", len(text), b"JSON") + text
            body += struct.pack("<I4s", len(rest), b"BIN\0") + rest
            return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body

        return make

    def every(key: str, **values: Any) -> Callable[[dict[str, Any]], object]:
        return lambda d: [entry.update(values) for entry in d[key]]

    changes: dict[str, Callable[[dict[str, Any]], object]] = {
        "count": every("accessors", count=10**9),
        "negative": every("accessors", count=-1),
        "offset": every("accessors", byteOffset=2**40),
        "negative offset": every("accessors", byteOffset=-8),
        "still": every("bufferViews", byteStride=0),
        "backwards": every("bufferViews", byteStride=-4),
        "stride 1": every("bufferViews", byteStride=1),
        "long": every("bufferViews", byteLength=2**60),
        "sparse": every("accessors", sparse={"count": 2**40}),
        "primitives": lambda d: d["meshes"][0].update(
            primitives=d["meshes"][0]["primitives"] * 5000
        ),
        "hosts": lambda d: d["nodes"].extend([{"mesh": 0, "skin": 0}] * 5000),
        "joints": lambda d: d["skins"][0].update(joints=d["skins"][0]["joints"] * 10_000),
        "nodes": lambda d: d["nodes"].extend([{}] * 10**6),
        "chain": lambda d: d["nodes"].extend({"children": [i + 1]} for i in range(27, 15_000)),
        "circle": lambda d: [n.update(children=[0]) for n in d["nodes"]],
        "far": lambda d: [
            n.update(translation=[1e300] * 3) or n.pop("matrix", 0) for n in d["nodes"]
        ],
        "zero": lambda d: [n.update(scale=[0, 0, 0]) or n.pop("matrix", 0) for n in d["nodes"]],
        "no turn": lambda d: [
            n.update(rotation=[0, 0, 0, 0]) or n.pop("matrix", 0) for n in d["nodes"]
        ],
        "sets": lambda d: d["meshes"][0]["primitives"][0]["attributes"].update(
            {
                f"{k}_{i}": d["meshes"][0]["primitives"][0]["attributes"][f"{k}_0"]
                for i in range(9999)
                for k in ("JOINTS", "WEIGHTS")
            }
        ),
        "uri": lambda d: d["buffers"][0].update(uri="data:," + "A" * 10**7),
        "zero device": lambda d: d["buffers"][0].update(uri="../../../../dev/zero"),
        "names": lambda d: (
            d["extensionsRequired"]
            if "extensionsRequired" in d
            else d.update(extensionsRequired=["x" * 10**6])
        ),
    }
    for name, change in changes.items():
        yield "glb", f"{name}.glb", changed(change)
    yield "glb", "deep.gltf", lambda: b'{"asset": {"version": "2.0", "extras": ' + b"[" * MB
    yield (
        "glb",
        "chunks.glb",
        lambda: (
            struct.pack("<4sII", b"glTF", 2, 12 + 8 * MB) + struct.pack("<I4s", 0, b"XXXX") * MB
        ),
    )
    yield (
        "hand.json",
        "hand.json",
        lambda: b'{"format": "handtrack hand", "version": ' + b"9" * 5000 + b"}",
    )
    for text in (
        b"[" * MB,
        b'{"a":' * MB,
        b"9" * 5000,
        b"{" + b'"a":1,' * MB + b'"b":2}',
        b" " * 3 * MB,
    ):
        yield "hand.json", "hand.json", lambda text=text: text  # type: ignore[misc]


def cameras() -> Iterator[Bomb]:
    for text in (
        *(b"a" + b".a" * 500_000 + b"=1", b"a" + b".a" * 4000 + b"=1\n", b"x=" + b"[" * MB),
        *(b"x=" + b"{a=" * 3000, b"x=" + b"9" * 5000, b"\n" * 3 * MB, b"[a]\n" * 400_000),
        *(b"".join(b"a%d = 1\n" % i for i in range(150_000)), b"x='''" + b"y" * MB),
    ):
        yield "toml", "a.toml", lambda text=text: text  # type: ignore[misc]
    matrix = b"a: !!opencv-matrix\n rows: 3\n cols: 3\n dt: d\n data: ["
    for text in (
        matrix * 30_000,
        b"a:" + b"\n" * MB,
        b"a:\n" * (MB // 2),
        b"a" * MB,
        matrix + b"1," * MB,
    ):
        yield "yaml", "a.yaml", lambda text=text: b"%YAML:1.0\n---\n" + text  # type: ignore[misc]
    for text in (b"[" * MB, b"9" * 5000, b'{"K":' * 10**5, b"[" + b"{}," * 500_000 + b"{}]"):
        yield "cameras.json", "a.json", lambda text=text: b'{"cameras": ' + text  # type: ignore[misc]
        yield "cameras.json", "a.json", lambda text=text: b'{"cameras": ' + text + b"}"  # type: ignore[misc]


def mcaps() -> Iterator[Bomb]:
    magic = b"\x89MCAP0\r\n"
    head = b"\x01" + struct.pack("<Q", 8) + bytes(8)

    def chunk(name: bytes, body: bytes, size: int) -> bytes:
        content = struct.pack("<QQQII", 0, 1, size, 0, len(name)) + name
        content += struct.pack("<Q", len(body)) + body
        return magic + head + b"\x06" + struct.pack("<Q", len(content)) + content + magic

    def squeezed(name: str, size: int) -> bytes:
        if name == "lz4":
            import lz4.frame

            return bytes(lz4.frame.compress(bytes(size)))
        import zstandard

        return zstandard.compress(bytes(size))

    for name in ("lz4", "zstd"):
        for size in (200 * MB, 2**40, 2**63, 10, 0):
            yield (
                "mcap",
                f"{name}{size}.mcap",
                lambda n=name, s=size: chunk(n.encode(), squeezed(n, 200 * MB), s),
            )  # type: ignore[misc]

        def chunks(name: str = name) -> bytes:
            one = chunk(name.encode(), squeezed(name, 50 * MB), 50 * MB)[
                len(magic) + len(head) : -8
            ]
            return magic + head + one * 40 + magic

        yield "mcap", f"{name}many.mcap", chunks
    for size in (2**31, 2**40, 2**63, 2**64 - 1):
        for code in (1, 3, 4, 5, 6, 9, 12):
            yield (
                "mcap",
                f"record{code}.mcap",
                lambda c=code, s=size: (
                    magic + head + bytes([c]) + struct.pack("<Q", s) + bytes(100)
                ),
            )  # type: ignore[misc]
    yield (
        "mcap",
        "records.mcap",
        lambda: magic + head + (b"\x0f" + struct.pack("<Q", 0)) * 10**6 + magic,
    )
