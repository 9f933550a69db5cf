"""Reader of named arrays in HDF5, as in .npz (see `fields`), and of visionOS streams in them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from handtrack.sequences.readers import visionpro
from handtrack.sequences.readers.both_hands import by_frame, of_sides, two_hands
from handtrack.sequences.readers.fields import from_fields
from handtrack.sequences.readers.hdf5_file import dataset, member, names_in
from handtrack.sequences.readers.hdf5_texts import said, texts
from handtrack.sequences.readers.raw import Raw
from handtrack.sequences.titles import joints_key

_DEEPEST = 3


def read(file: Any, path: Path) -> list[Raw] | None:
    """The hands of an open HDF5 file's arrays; None where none is of joints.

    Raises:
        InputError: an array that does not fit.
    """
    for group in _groups(file, path, 0):
        names = names_in(group, path)
        streams = visionpro.arrays(names)
        if streams:
            arrays = {name: dataset(group, name, path) for name in names}
            return visionpro.from_arrays(
                {k: d[()] for k, d in arrays.items() if d is not None and d.ndim >= 1}, path
            )
        if not any(joints_key(name) for name in names):
            continue
        fields: dict[str, Any] = {k: v for k in group.attrs if (v := said(group, k, path))}
        for name in names:
            data = dataset(group, name, path)
            if data is None or data.dtype.kind not in "fiuSO":
                continue
            value = texts(data, name, path) if data.dtype.kind in "SO" else data[()]
            if value is None:
                continue
            fields[name] = value.item() if getattr(value, "ndim", 1) == 0 else value
        parts = [own for part in of_sides(fields) for own in by_frame(part, path)]
        return [raw for part in parts for raw in two_hands(from_fields(part, path))]
    return None


def _groups(group: Any, path: Path, depth: int) -> list[Any]:
    """A group and those in it."""
    found = [group]
    if depth < _DEEPEST:
        for name in names_in(group, path):
            inner = member(group, name, path)
            if hasattr(inner, "keys"):
                found += _groups(inner, path, depth + 1)
    return found
