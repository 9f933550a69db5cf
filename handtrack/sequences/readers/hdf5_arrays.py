"""Reader of named arrays in HDF5, as in .npz (see `fields`), and of visionOS streams in them.

Texts of variable length lie somewhere in the file, as long as a number says for which the library
makes room before it looks: here it is looked at first.
"""

from __future__ import annotations

import mmap
import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.readers import visionpro
from handtrack.sequences.readers.both_hands import by_frame, of_sides, two_hands
from handtrack.sequences.readers.fields import RATES, UNIT_KEYS, from_fields
from handtrack.sequences.readers.hdf5_file import dataset, member, names_in, numbers
from handtrack.sequences.readers.raw import Raw
from handtrack.sequences.titles import is_hand_label, joints_key, of_side, time_unit

_LENGTH, _REFERENCE = struct.Struct("<I"), 16
"""A text's length, and where it lies: 16 bytes in all."""
_HEADER = struct.Struct("<BBHHH")
"""Of an attribute: version, flags, sizes of its name, type and shape."""
_SEARCHED = 256 * budget.MB
_DEFLATE = 1
_LONGEST = 200


def said(group: Any, name: str, path: Path) -> str:
    """A group's attribute as text, "" where there is none or it is something else.

    Raises:
        InputError: it is said to be larger than the file.
    """
    from h5py import h5a

    key = name.encode()
    if not h5a.exists(group.id, key):
        return ""
    attribute = h5a.open(group.id, key)
    size = path.stat().st_size
    if attribute.get_storage_size() > size:
        raise _too_long(attribute.get_storage_size(), name, path)
    if attribute.dtype.kind == "O":
        if attribute.shape not in ((), (1,)):
            return ""
        for length in _told(key, path):
            if length > size:
                raise _too_long(length, name, path)
        _refuse_endless(path)
    value = group.attrs[name]
    if getattr(value, "shape", None) == (1,):
        value = value[0]
    if isinstance(value, bytes):
        value = value.decode("utf-8", "replace")
    return value[:_LONGEST] if isinstance(value, str) else ""


_HEAP = struct.Struct("<4sB3xQ")
_HEAP_OBJECT = struct.Struct("<HH4xQ")


def _refuse_endless(path: Path) -> None:
    """Refuse a heap of texts with an object of no length, which HDF5 1.14 goes on from for ever."""
    if not 0 < path.stat().st_size <= _SEARCHED:
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for found in re.finditer(b"GCOL\x01\0\0\0", data):
            at = found.start()
            if at + _HEAP.size > len(data):
                return
            end = min(at + _HEAP.unpack_from(data, at)[2], len(data))
            at += _HEAP.size
            while at + _HEAP_OBJECT.size <= end:
                number, _, size = _HEAP_OBJECT.unpack_from(data, at)
                step = size if number == 0 else (_HEAP_OBJECT.size + size + 7) // 8 * 8 % 2**64
                if step == 0:
                    raise InputError("its heap of texts is damaged", path)
                at += step


def _told(key: bytes, path: Path) -> Iterator[int]:
    """The length of the text in each attribute of that name in the file."""
    if path.stat().st_size > _SEARCHED:
        return
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for found in re.finditer(re.escape(key) + b"\0", data):
            for back, versions in ((8, (1, 2)), (9, (3,))):
                begin = found.start() - back
                if begin < 0:
                    continue
                version, _, own, kind, shape = _HEADER.unpack_from(data, begin)
                if version not in versions or own != len(key) + 1:
                    continue
                pad = 8 if version == 1 else 1
                at = found.start() + sum(-(-n // pad) * pad for n in (own, kind, shape))
                if at + _LENGTH.size <= len(data):
                    yield _LENGTH.unpack_from(data, at)[0]


def texts(data: Any, name: str, path: Path) -> Any:
    """All of a data set of texts: an array of them, or one; None where it holds other things.

    Raises:
        InputError: they are said to be larger than the file, or packed in a way that is not read.
    """
    import h5py

    if h5py.check_string_dtype(data.dtype) is None:
        return None
    if data.dtype.kind == "O":
        size, total = path.stat().st_size, 0
        for piece in _pieces(data, name, path):
            for (length,) in struct.iter_unpack("<I12x", piece[: len(piece) // 16 * 16]):
                total += length
            if total > size:
                raise _too_long(total, name, path)
    found = data.asstr()[()]
    return found.astype(str) if getattr(found, "ndim", 0) else found


def _pieces(data: Any, name: str, path: Path) -> Iterator[bytes]:
    """The references of a data set, as they are stored."""
    if data.chunks is None:
        begin = data.id.get_offset()
        if begin is None:
            if data.size:
                raise InputError(f"{shown(name, 60)} is stored in a way that is not read", path)
            return
        with path.open("rb") as file:
            file.seek(begin)
            yield file.read(_REFERENCE * int(data.size))
        return
    created = data.id.get_create_plist()
    filters = [created.get_filter(i)[0] for i in range(created.get_nfilters())]
    if filters not in ([], [_DEFLATE]):
        raise InputError(f"{shown(name, 60)}: texts are packed in a way that is not read", path)
    places: list[tuple[int, ...]] = []
    data.id.chunk_iter(lambda info: places.append(info.chunk_offset))
    most = _REFERENCE
    for n in data.chunks:
        most *= n
    for place in places:
        mask, piece = data.id.read_direct_chunk(place)
        yield piece if mask or not filters else zlib.decompressobj().decompress(piece, most)


def _too_long(told: int, name: str, path: Path) -> InputError:
    return InputError(
        f"the HDF5 file is damaged: {shown(name, 60)} tells of {told} bytes of text, the file has"
        f" {path.stat().st_size}",
        path,
    )


_DEEPEST = 3
_FEWEST_FRAMES = 3


def read(file: Any, path: Path) -> list[Raw] | None:
    """The hands of an open HDF5 file's arrays; None where none is of joints.

    Raises:
        InputError: an array that does not fit.
    """
    found: list[tuple[str, list[Raw]]] = []
    stacked: set[str] = set()
    for group in _groups(file, path, 0):
        names = names_in(group, path)
        streams = visionpro.arrays(names)
        if streams and not found:
            arrays = {name: dataset(group, name, path) for name in names}
            return visionpro.from_arrays(
                {
                    k: _values(d, k, path)
                    for k, d in arrays.items()
                    if d is not None and d.ndim >= 1
                },
                path,
            )
        if group.parent.name in stacked:
            continue
        frames = _frames_in(group, path)
        if frames:
            stacked.add(group.name)
        elif not any(joints_key(name) for name in names):
            continue
        fields = _fields(group, path) | frames
        side = next((s for n in reversed(group.name.split("/")) if (s := of_side(n)[0])), None)
        if side is not None and not any(is_hand_label(name) for name in fields):
            fields["hand"] = side
        if not any(time_unit(name) is not None for name in fields):
            fields |= _times_above(group, path)
        parts = [own for part in of_sides(fields) for own in by_frame(part, path)]
        raws = [raw for part in parts for raw in two_hands(from_fields(part, path))]
        found.append((group.name.strip("/"), raws))
    several = len({raw.hand for _, raws in found for raw in raws}) < sum(len(r) for _, r in found)
    for name, raws in found if several and len(found) > 1 else ():
        for raw in raws:
            raw.name = f"{raw.name} {name}".strip()
    return [raw for _, raws in found for raw in raws] or None


def _fields(group: Any, path: Path) -> dict[str, Any]:
    """What a group holds and says, by name."""
    fields: dict[str, Any] = {k: v for k in group.attrs if (v := said(group, k, path))}
    for name in names_in(group, path):
        data = dataset(group, name, path)
        if data is None or data.dtype.kind not in "fiuSO":
            continue
        value = texts(data, name, path) if data.dtype.kind in "SO" else _values(data, name, path)
        if value is None:
            continue
        fields[name] = value.item() if getattr(value, "ndim", 1) == 0 else value
        if joints_key(name) is not None:  # what joints say of themselves
            own = {k.lower(): k for k in data.attrs}
            for key in (*UNIT_KEYS, *RATES, "order"):
                if key in own and key not in fields:
                    fields[key] = _attribute(data, own[key], path)
    return fields


def _attribute(data: Any, name: str, path: Path) -> Any:
    """A text or a number that an object says of itself; None of anything else."""
    kind = data.attrs.get_id(name).dtype.kind
    if kind in "OS":
        return said(data, name, path) or None
    value = np.ravel(data.attrs[name]) if kind in "iuf" else np.empty(0)
    return value[0].item() if value.size == 1 else None


_NUMBERED = re.compile(r"(.*?)(\d{1,12})")
_ONE_FRAME = ((N_JOINTS, 3), (3 * N_JOINTS,))


def _frames_in(group: Any, path: Path) -> dict[str, Any]:
    """The joints of groups that are a frame each, by their numbers; nothing of other groups."""
    names = names_in(group, path)
    numbered = [m for m in map(_NUMBERED.fullmatch, names) if m is not None]
    if len(numbered) < _FEWEST_FRAMES or len({m[1] for m in numbered}) > 1:
        return {}
    frames = {int(m[2]): member(group, m[0], path) for m in numbered}
    first = frames[min(frames)]
    keys = [k for k in names_in(first, path) if joints_key(k)] if hasattr(first, "keys") else []
    fields: dict[str, Any] = {}
    for key in keys:
        rows = np.full((len(frames), 3 * N_JOINTS), np.nan)
        for row, n in enumerate(sorted(frames)):
            own = frames[n]
            data = dataset(own, key, path) if hasattr(own, "keys") else None
            if data is None:
                continue
            if data.shape not in _ONE_FRAME:
                return {}
            rows[row] = numbers(data, key, path).ravel()
        fields[key] = rows
    return {**fields, "frame": np.array(sorted(frames))} if fields else {}


def _values(data: Any, name: str, path: Path) -> Any:
    """All of a data set; what is long stands in a file without a name."""
    return numbers(data, name, path) if data.dtype.kind == "f" and data.ndim > 1 else data[()]


def _times_above(group: Any, path: Path) -> dict[str, Any]:
    """Times and what else goes for all groups in one, of the nearest that has times."""
    while group.name != "/":
        group = group.parent
        for name in names_in(group, path):
            if time_unit(name) is None:
                continue
            data = dataset(group, name, path)
            if data is not None and data.dtype.kind in "fiu" and data.ndim == 1:
                return {name: data[()]}
    return {}


def _groups(group: Any, path: Path, depth: int) -> list[Any]:
    """A group and those in it."""
    found = [group]
    if depth < _DEEPEST:
        for name in names_in(group, path):
            inner = member(group, name, path)
            if hasattr(inner, "keys"):
                found += _groups(inner, path, depth + 1)
    return found
