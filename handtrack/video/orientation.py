"""Which way up a picture is: EXIF's orientation of images, display matrices of videos.

Both are one of eight ways, numbered as in EXIF 2.32 (tag 0x0112): 1 as it is, 2 mirrored left to
right, 3 upside down, 4 mirrored top to bottom, 5 rows and columns exchanged, 6 to be turned
clockwise, 7 exchanged and upside down, 8 to be turned counter-clockwise.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

Rgb = NDArray[np.uint8]

_TAG = 0x0112
_MOST_PARTS = 10_000
"""Segments or chunks of a file that are looked through."""
_LARGEST = 1 << 20
"""Bytes of EXIF that are read; a JPEG has 64 KiB at most."""


def upright(rgb: Rgb, way: int) -> Rgb:
    """A picture (height, width, 3) turned so that it is seen as it was meant."""
    if way >= 5:
        rgb = rgb.transpose(1, 0, 2)
    if way in (2, 3, 6, 7):
        rgb = rgb[:, ::-1]
    if way in (3, 4, 7, 8):
        rgb = rgb[::-1]
    return np.ascontiguousarray(rgb)


def way_of_frame(frame: Any) -> int:
    """The way of a decoded frame of a video (PyAV's), by its display matrix."""
    try:
        data = frame.side_data.get("DISPLAYMATRIX")
    except ValueError:  # other side data beside it of a kind that PyAV does not know
        return {0: 1, 90: 8, 180: 3, 270: 6}[round(frame.rotation / 90) * 90 % 360]
    return 1 if data is None else way_of_matrix(bytes(data))


def way_of_matrix(data: bytes) -> int:
    """The way of a display matrix of FFmpeg, nine int32: x' = a x + c y, y' = b x + d y."""
    if len(data) < 36:
        return 1
    a, b, _, c, d, *_ = struct.unpack("=9i", data[:36])
    if abs(a) + abs(d) >= abs(b) + abs(c):
        return {(False, False): 1, (True, False): 2, (True, True): 3, (False, True): 4}[
            a < 0, d < 0
        ]
    return {(False, False): 5, (True, False): 6, (True, True): 7, (False, True): 8}[c < 0, b < 0]


def way_of_image(path: Path) -> int:
    """The way of an image file, by its EXIF; 1 where it says none, or nothing that is one."""
    with path.open("rb") as file:
        head = file.read(12)
        file.seek(0)
        if head.startswith(b"\xff\xd8"):
            return _of_exif(_in_jpeg(file))
        if head.startswith(b"\x89PNG"):
            return _of_exif(_in_chunks(file, 8, ">I4s", b"eXIf", 4, 1))
        if head[:4] == b"RIFF" and head[8:] == b"WEBP":
            return _of_exif(_in_chunks(file, 12, "<4sI", b"EXIF", 0, 2))
    return 1


def _in_jpeg(file: BinaryIO) -> bytes:
    """What stands in a JPEG's segment of EXIF."""
    file.seek(2)
    for _ in range(_MOST_PARTS):
        marker = file.read(2)
        if len(marker) < 2 or marker[0] != 0xFF or marker[1] in (0xDA, 0xD9):
            return b""
        if marker[1] == 0xFF:  # a byte that fills up
            file.seek(-1, 1)
            continue
        size = file.read(2)
        if len(size) < 2:
            return b""
        length = int.from_bytes(size, "big") - 2
        if marker[1] == 0xE1:
            data = file.read(max(length, 0))
            if data.startswith(b"Exif\0\0"):
                return data
        else:
            file.seek(max(length, 0), 1)
    return b""


def _in_chunks(
    file: BinaryIO, start: int, head: str, wanted: bytes, after: int, even: int
) -> bytes:
    """What stands in a chunk of that name, in a PNG or a RIFF file.

    Args:
        start: where the chunks begin.
        head: what stands before each: its name and its length.
        wanted: the name.
        after: bytes behind each (a checksum).
        even: lengths are filled up to a multiple of it.
    """
    file.seek(start)
    for _ in range(_MOST_PARTS):
        fields = file.read(8)
        if len(fields) < 8:
            return b""
        pair = struct.unpack(head, fields)
        name, length = pair if isinstance(pair[0], bytes) else pair[::-1]
        if name == wanted:
            return file.read(min(length, _LARGEST))
        file.seek(length + length % even + after, 1)
    return b""


def _of_exif(data: bytes) -> int:
    """The orientation in EXIF: a TIFF file's first directory."""
    tiff = data.removeprefix(b"Exif\0\0")
    order = {b"II": "<", b"MM": ">"}.get(tiff[:2])
    if order is None or len(tiff) < 8:
        return 1
    (at,) = struct.unpack(f"{order}I", tiff[4:8])
    (entries,) = struct.unpack(f"{order}H", tiff[at : at + 2].ljust(2, b"\0"))
    for i in range(entries):
        entry = tiff[at + 2 + 12 * i : at + 14 + 12 * i]
        if len(entry) < 12:
            break
        tag, kind, count = struct.unpack(f"{order}HHI", entry[:8])
        if tag == _TAG and kind == 3 and count == 1:
            (way,) = struct.unpack(f"{order}H", entry[8:10])
            return int(way) if 1 <= way <= 8 else 1
    return 1
