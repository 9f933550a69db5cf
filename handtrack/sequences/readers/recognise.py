"""Finding the reader for a file by what is in it."""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from handtrack.errors import InputError, SettingsError, shown
from handtrack.files import budget
from handtrack.files.collecting import no_collecting
from handtrack.sequences.readers import (
    bvh,
    c3d_file,
    freemocap,
    freihand,
    keypoints_2d,
    leap,
    numpy_file,
    panoptic,
    panoptic_tar,
    pickled,
    text_table,
    trc,
)
from handtrack.sequences.readers.hdf5_file import HDF5_MAGIC, read_hdf5
from handtrack.sequences.readers.interhand import is_interhand, read_interhand
from handtrack.sequences.readers.json_file import from_value, is_lines, read_json, read_lines
from handtrack.sequences.readers.jsontext import as_utf8, decode, one_after_another
from handtrack.sequences.readers.landmark_lines import is_landmark_line, read_landmark_lines
from handtrack.sequences.readers.parquet_file import PARQUET_MAGIC, read_parquet
from handtrack.sequences.readers.raw import NotJointsError, Raw
from handtrack.sequences.readers.rosbag import BAG_MAGIC, BAG_MARK, SQLITE_MAGIC, read_bag

MCAP_MAGIC = b"\x89MCAP"
NPY_MAGIC = b"\x93NUMPY"
ZIP_MAGIC = b"PK\x03\x04"
PICKLE_START = b"\x80"
GZIP_MAGIC = b"\x1f\x8b"
# tars may also be compressed with these
BZ2_MAGIC, XZ_MAGIC = b"BZh", b"\xfd7zXZ"
_TAR_MAGIC_AT = 257
_BLANK = b"\xef\xbb\xbf \t\r\n"


def read_file(
    path: Path, frames: tuple[int, int] | None = None, kind: str | None = None
) -> list[Raw]:
    """The sequences of one file, whatever it is.

    Args:
        path: an existing file.
        frames: source frame numbers (both included) that will be kept; readers that can skip
            the others do.
        kind: a name of `FORMATS`; None: by what is in the file.

    Raises:
        NotJointsError: a whole file of which nothing is a hand.
        InputError: empty, damaged, cut short, or not as its format says.
    """
    with budget.opened(path) as stream:
        head = stream.read(512)
        if not head:
            raise InputError("the file is empty", path)
        if head.startswith(MCAP_MAGIC):
            from handtrack.sequences.readers.mcap_file import read_mcap

            return read_mcap(path)
        if head.startswith((BAG_MAGIC, SQLITE_MAGIC)) or BAG_MARK in head:
            return read_bag(path)
        if head.startswith(HDF5_MAGIC):
            return read_hdf5(path)
        if head.startswith(PARQUET_MAGIC):
            return read_parquet(path)
        if _is_tar(head) or head.startswith((BZ2_MAGIC, XZ_MAGIC)):
            return panoptic_tar.read_tar(path, frames)
        if head.startswith(GZIP_MAGIC):
            return _read_gzip(path, frames, kind)
        if head.startswith(ZIP_MAGIC) and kind is None and path.is_file():
            # its members are read one by one, not the file as a whole
            budget.check(path.stat().st_size, path)
            return freemocap.with_unit(numpy_file.read_npz(path, path), path)
        data = budget.rest(stream, path, head)
    return read_bytes(data, path, kind)


def read_bytes(data: bytes, path: Path, kind: str | None = None) -> list[Raw]:
    """The sequences of a file's content; `path` names it.

    Raises:
        As `read_file`.
    """
    if kind is not None:
        return FORMATS[kind](data, path)
    return freemocap.with_unit(_by_content(data, path), path)


def _by_content(data: bytes, path: Path) -> list[Raw]:
    if data.startswith(NPY_MAGIC):
        return numpy_file.read_npy(data, path)
    if data.startswith(ZIP_MAGIC):
        return numpy_file.read_npz(data, path)
    # protocols 0 and 1 have no mark of their own
    named = path.suffix in (".pkl", ".pickle")
    if (named or data[:1] == PICKLE_START) and data[-1:] == b".":
        return pickled.read_pickle(data, path)
    if c3d_file.is_c3d(data):
        return c3d_file.read_c3d(data, path)
    data = as_utf8(data).lstrip(b"\0")
    if not data or b"\0" in data[:512]:
        raise NotJointsError(
            "not a joint sequence: expected JSON, CSV, .npz, .npy, .mcap or a Panoptic .tar", path
        )
    if data.lstrip(_BLANK).startswith(trc.START):
        return trc.read_trc(data, path)
    if data.lstrip(_BLANK).startswith(bvh.START):
        return bvh.read_bvh(data, path)
    start = data.lstrip(_BLANK)[:5]
    if start[:1] in (b"{", b"[") or start.strip() == b"null":
        with no_collecting():
            return _read_json(data, path)
    if is_landmark_line(data):
        return read_landmark_lines(data, path)
    return text_table.read_table(data, path)


def check_format(kind: str | None) -> None:
    """Refuse a format that has no reader.

    Raises:
        SettingsError: it is none of `FORMATS`.
    """
    if kind is not None and kind not in FORMATS:
        raise SettingsError(f"unknown format {kind!r}, expected one of {', '.join(FORMATS)}")


def _read_json(data: bytes, path: Path) -> list[Raw]:
    if freihand.FILE_NAME.fullmatch(path.name):
        return freihand.read_freihand(data, path)
    if is_lines(data):
        return read_lines(data, path)
    if data.lstrip(_BLANK)[:1] != b"{":
        return read_json(data, path)
    try:
        fields = decode(data, dict[str, msgspec.Raw], path)
    except InputError:
        several = one_after_another(data)
        if several is None:
            raise
        return from_value(several, path)
    if "people" in fields:
        if b"keypoints_" in bytes(fields["people"]):
            return keypoints_2d.read_one(decode(data, dict[str, Any], path), path)
        return panoptic.read_file(data, path)
    if "frames" in fields and leap.is_leap(data):
        return leap.read_leap(data, path)
    if is_interhand(fields):
        return read_interhand(data, path)
    return read_json(data, path)


def _read_any_json(data: bytes, path: Path) -> list[Raw]:
    return read_lines(data, path) if is_lines(data) else read_json(data, path)


FORMATS: dict[str, Callable[[bytes, Path], list[Raw]]] = {
    "panoptic": panoptic.read_file,
    "freihand": freihand.read_freihand,
    "ho3d": pickled.read_pickle,
    "frankmocap": pickled.read_pickle,
    "mano": numpy_file.read_npz,
    "dexycb": numpy_file.read_npz,
    "interhand": read_interhand,
    "assemblyhands": read_interhand,
    "webxr": _read_any_json,
    "openxr": _read_any_json,
    "leap": leap.read_leap,
    "fpha": text_table.read_table,
    "trc": trc.read_trc,
    "bvh": bvh.read_bvh,
    "c3d": c3d_file.read_c3d,
}
"""Readers of a file's content by the name of their format."""


def _is_tar(head: bytes) -> bool:
    return head[_TAR_MAGIC_AT : _TAR_MAGIC_AT + 5] == b"ustar"


def _read_gzip(path: Path, frames: tuple[int, int] | None, kind: str | None) -> list[Raw]:
    try:
        with gzip.open(path) as stream:
            head = stream.read(512)
            if _is_tar(head):
                return panoptic_tar.read_tar(path, frames)
            data = head + budget.unpacked(stream, path, path.stat().st_size)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(
            f"the gzip file is damaged or cut short ({shown(str(error), 120)})", path
        ) from None
    return read_bytes(data, path, kind)
