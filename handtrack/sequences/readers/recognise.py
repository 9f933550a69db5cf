"""Finding the reader for a file by what is in it."""

from __future__ import annotations

import gzip
import zlib
from pathlib import Path

import msgspec

from handtrack.errors import InputError
from handtrack.sequences.readers import leap, numpy_file, panoptic, text_table
from handtrack.sequences.readers.json_file import is_lines, read_json, read_lines
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.raw import NotJointsError, Raw

MCAP_MAGIC = b"\x89MCAP"
NPY_MAGIC = b"\x93NUMPY"
ZIP_MAGIC = b"PK\x03\x04"
GZIP_MAGIC = b"\x1f\x8b"
# tars may also be compressed with these
BZ2_MAGIC, XZ_MAGIC = b"BZh", b"\xfd7zXZ"
_TAR_MAGIC_AT = 257


def read_file(path: Path, frames: tuple[int, int] | None = None) -> list[Raw]:
    """The sequences of one file, whatever it is.

    Args:
        path: an existing file.
        frames: source frame numbers (both included) that will be kept; readers that can skip
            the others do.

    Raises:
        NotJointsError: a whole file of which nothing is a hand.
        InputError: empty, damaged, cut short, or not as its format says.
    """
    try:
        with path.open("rb") as stream:
            head = stream.read(512)
            if not head:
                raise InputError("the file is empty", path)
            if head.startswith(MCAP_MAGIC):
                from handtrack.sequences.readers.mcap_file import read_mcap

                return read_mcap(path)
            if _is_tar(head) or head.startswith((BZ2_MAGIC, XZ_MAGIC)):
                return panoptic.read_tar(path, frames)
            if head.startswith(GZIP_MAGIC):
                return _read_gzip(path, frames)
            data = head + stream.read()
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", path) from None
    return read_bytes(data, path)


def read_bytes(data: bytes, path: Path) -> list[Raw]:
    """The sequences of a file's content; `path` names it.

    Raises:
        As `read_file`.
    """
    if data.startswith(NPY_MAGIC):
        return numpy_file.read_npy(data, path)
    if data.startswith(ZIP_MAGIC):
        return numpy_file.read_npz(data, path)
    if b"\0" in data[:512]:
        raise NotJointsError(
            "not a joint sequence: expected JSON, CSV, .npz, .npy, .mcap or a Panoptic .tar", path
        )
    start = data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1]
    if start in (b"{", b"["):
        return _read_json(data, path)
    return text_table.read_table(data, path)


def _read_json(data: bytes, path: Path) -> list[Raw]:
    if is_lines(data):
        return read_lines(data, path)
    if data.lstrip(b"\xef\xbb\xbf \t\r\n")[:1] == b"[":
        return read_json(data, path)
    fields = decode(data, dict[str, msgspec.Raw], path)
    if "people" in fields:
        return panoptic.read_file(data, path)
    if "frames" in fields:
        return leap.read_leap(data, path)
    return read_json(data, path)


def _is_tar(head: bytes) -> bool:
    return head[_TAR_MAGIC_AT : _TAR_MAGIC_AT + 5] == b"ustar"


def _read_gzip(path: Path, frames: tuple[int, int] | None) -> list[Raw]:
    try:
        with gzip.open(path) as stream:
            head = stream.read(512)
            if _is_tar(head):
                return panoptic.read_tar(path, frames)
            data = head + stream.read()
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"the gzip file is damaged or cut short ({error})", path) from None
    return read_bytes(data, path)
