"""Data sets for an audit: what can be read, what can once its unit or order is set right, and
what cannot."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from handtrack.errors import InputError
from handtrack.files.pictures import pictures_in
from handtrack.sequences.joint_order import OtherOrder
from handtrack.sequences.load import load, load_some
from handtrack.sequences.note import Note
from handtrack.sequences.sequence import Sequence, unique_names
from handtrack.sequences.size import WrongUnit


class Unread(NamedTuple):
    """A file that no sequence could be read of.

    Attributes:
        path: the file.
        error: why, in one line that names it.
        joints: whether it is one of joints, but damaged; else it is of another kind.
    """

    path: Path
    error: str
    joints: bool

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {"source": str(self.path), "error": self.error, "joints": self.joints}


class DataSet(NamedTuple):
    """What was read of data: sequences of different names, and the files that are none."""

    sequences: list[Sequence]
    unread: list[Unread]


def read_data(
    paths: Iterable[Path],
    detect: Callable[[Path], list[Sequence]] | None = None,
    **options: Any,
) -> DataSet:
    """The sequences of files and folders; a file that cannot be read does not end it.

    A file whose unit or joint order is clearly another than it says is read in that, with a
    note, which an audit tells as a fault of all its frames.

    Args:
        paths: files and folders.
        detect: finds hands in a video or in images.
        **options: of `load`.

    Raises:
        InputError: something is not there, or nothing can be read.
        SettingsError: as `load`.
    """
    sequences: list[Sequence] = []
    unread: list[Unread] = []
    first: InputError | None = None
    for path in paths:
        if not path.exists():
            raise InputError("no such file or folder", path)
        failed: list[tuple[Path, InputError, bool]] = []
        try:
            if detect is not None and pictures_in(path) is not None:
                found = detect(path)
            elif path.is_dir():
                found, passed_over = load_some(path, **options)
                failed = [(p.path, p.error, p.joints) for p in passed_over]
            else:
                found = load(path, **options)
            sequences += [s if s.source else replace(s, source=str(path)) for s in found]
        except InputError as error:
            failed = [(path, error, True)]
        for where, problem, joints in failed:
            first = first or problem
            try:
                sequences += _cured(where, problem, options)
            except InputError as final:
                unread.append(Unread(where, str(final), joints))
    if not sequences:
        raise first or InputError("no joint sequence found")
    return DataSet(unique_names(sequences), unread)


def _cured(path: Path, error: InputError, options: dict[str, Any]) -> list[Sequence]:
    """The sequences of a file that was refused, read as the error says.

    Raises:
        InputError: it says nothing of that, or that does not help; the first error.
    """
    if path.is_dir() and not isinstance(error, WrongUnit | OtherOrder):
        raise error
    if isinstance(error, WrongUnit) and error.fits is not None and options.get("unit") is None:
        cure, note = (
            {"unit": str(error.fits)},
            Note(f"taken for another unit: read in {error.fits}; {error}", "unit"),
        )
    elif isinstance(error, OtherOrder) and options.get("order") is None:
        cure, note = (
            {"order": error.order},
            Note(f"another joint order: read as {error.order}; {error}", "order"),
        )
    else:
        raise error
    try:
        found = load(path, **{**options, **cure})
    except InputError as second:
        # both may be another
        found = _cured(path, second, {**options, **cure})
    return [replace(s, source=s.source or str(path), notes=(*s.notes, note)) for s in found]
