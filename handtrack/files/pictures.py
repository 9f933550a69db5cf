"""Which files are pictures: told from their first bytes, without what reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

Kind = Literal["video", "image", "images"]
_VIDEO_BOXES = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip")
_STILLS = (b"avif", b"avis", b"heic", b"heix", b"mif1")


def pictures_in(path: Path) -> Kind | None:
    """What a path holds, by content: a video, an image, a folder of images; None: none of it."""
    if path.is_dir():
        return "images" if images_in(path) else None
    if not path.is_file():
        return None
    with path.open("rb") as stream:
        head = stream.read(16)
    if head.startswith((b"\xff\xd8\xff", b"\x89PNG\r\n\x1a\n", b"BM")) or (
        head[:4] == b"RIFF" and head[8:12] == b"WEBP"
    ):
        return "image"
    if head[4:8] in _VIDEO_BOXES and head[8:12] not in _STILLS:
        return "video"
    if head.startswith(b"\x1aE\xdf\xa3") or (head[:4] == b"RIFF" and head[8:12] == b"AVI "):
        return "video"
    return None


def images_in(folder: Path) -> list[Path]:
    """The folder's images; none where it holds other files as well."""
    files = sorted(p for p in folder.iterdir() if p.is_file() and not p.name.startswith("."))
    return files if all(pictures_in(p) == "image" for p in files) else []
