"""Reading a clip where it is needed: on this machine, or out of a store or an archive."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import Any, NamedTuple

import numpy as np

from handtrack.batching.clip import Clip
from handtrack.batching.store import filesystem, is_remote, tried
from handtrack.errors import InputError
from handtrack.sequences.load import load
from handtrack.sequences.note import Note
from handtrack.sequences.readers.folder import sources
from handtrack.sequences.sequence import Sequence

_PIECE = 1 << 20


class Read(NamedTuple):
    """What was read of a clip.

    Attributes:
        sequences: its hands.
        digest: of the files' content.
    """

    sequences: list[Sequence]
    digest: str


def read_clip(clip: Clip, reading: Mapping[str, Any]) -> Read:
    """The sequences of a clip.

    Raises:
        InputError: it is not there, cannot be read, or nothing is left of it.
        StoreError: the store that it is in does not answer.
    """
    with at_hand(clip.path, clip.group) as files:
        first = files[0]
        options = dict(reading)
        given = {name: getattr(clip, name) for name in ("hand", "fps", "unit", "order")}
        options |= {name: value for name, value in given.items() if value is not None}
        # numbered files are read as their folder; what else is in there belongs to other clips
        where = first.parent if clip.group else first
        with _as_from(clip.path, where):
            sequences = load(where, **options)
        found = content_digest(files)
    shown = clip.path
    sequences = [
        replace(
            s,
            source=shown,
            subject=clip.subject or s.subject,
            notes=tuple(Note.of(note).renamed(str(where), shown) for note in s.notes),
        )
        for s in sequences
    ]
    return Read([part for s in sequences if (part := _cut(s, clip)) is not None], found)


@contextmanager
def _as_from(path: str, where: Path) -> Iterator[None]:
    """Errors name a file as the user knows it, not the copy of it that is read."""
    try:
        yield
    except InputError as error:
        text = str(error)
        if str(where) not in text or str(where) == path:
            raise
        # a Path would make one slash of the two in a URL
        raise error.retold(text.replace(str(where), path), None) from None


def read_truth(clip: Clip, reading: Mapping[str, Any]) -> list[Sequence]:
    """The true joints that a clip names; a file with observed and true joints has the true.

    Raises:
        InputError: as `read_clip`.
    """
    if clip.truth is None:
        return []
    kept = {name: reading[name] for name in ("mano", "mano_tips", "max_size") if name in reading}
    with at_hand(clip.truth, False) as files, _as_from(clip.truth, files[0]):
        found = load(files[0], **kept)
    return [replace(s, joints=s.joints if s.truth is None else s.truth) for s in found]


@contextmanager
def at_hand(path: str, group: bool) -> Iterator[list[Path]]:
    """The files of a clip on this machine, copied here if they are elsewhere.

    Raises:
        InputError: nothing is there.
        StoreError: the store that it is in does not answer.
    """
    if not is_remote(path):
        here = Path(path)
        if not here.exists():
            raise InputError("no such file or folder", path)
        if not group:
            yield [here]
            return
        with _alone(_members(here)) as files:
            yield files
        return
    fs, key = _opened(path)
    with tempfile.TemporaryDirectory(prefix="handtrack-") as folder:
        here = Path(folder)

        def fetched() -> list[Path]:
            keys = [key]
            if group:
                keys = group_keys(fs, key)
            elif fs.isdir(key):
                return _fetched_folder(fs, key, here)
            # sequences are called after the folders that they come from
            folder = here / (PurePosixPath(key).parent.name or "clip")
            folder.mkdir(exist_ok=True)
            made = [folder / PurePosixPath(k).name for k in keys]
            for k, file in zip(keys, made, strict=True):
                fs.get_file(k, str(file))
            return made

        try:
            found = tried(path, fetched)
        except FileNotFoundError:
            raise InputError("no such file or folder", path) from None
        yield found


def _fetched_folder(fs: Any, key: str, here: Path) -> list[Path]:
    folder = here / (PurePosixPath(key).name or "clip")
    for k in fs.find(key):
        file = folder / str(k).removeprefix(key).lstrip("/")
        file.parent.mkdir(parents=True, exist_ok=True)
        fs.get_file(k, str(file))
    return [folder]


@lru_cache(maxsize=8)
def _archive(place: str) -> tuple[Any, str]:
    # an archive's table of contents is read once
    return filesystem(place)


def _opened(path: str) -> tuple[Any, str]:
    inside, two, archive = path.partition("::")
    if not two:
        return filesystem(path)
    scheme, _, member = inside.partition("://")
    fs, _ = _archive(f"{scheme}://::{archive}")
    return fs, member


def group_keys(fs: Any, key: str) -> list[str]:
    """All numbered files in a store that make one clip with the one of that name."""
    from handtrack.batching.found import grouped

    folder, _, first = key.rpartition("/")
    names = [PurePosixPath(k).name for k in fs.ls(folder, detail=False)]
    members = next((g for g in grouped(names) if g[0] == first), [first])
    return [f"{folder}/{name}" for name in members]


def _members(first: Path) -> list[Path]:
    """The files of this machine that belong to a numbered one."""
    for source in sources(first.parent):
        if source.folder == first.parent and source.names[0] == first.name:
            return [source.folder / name for name in source.names]
    return [first]


@contextmanager
def _alone(files: list[Path]) -> Iterator[list[Path]]:
    """The files in a folder with nothing else in it."""
    with tempfile.TemporaryDirectory(prefix="handtrack-") as folder:
        # named as the folder that they come from: sequences are called after it
        here = Path(folder) / files[0].absolute().parent.name
        here.mkdir()
        for file in files:
            (here / file.name).symlink_to(file.absolute())
        yield [here / file.name for file in files]


def content_digest(files: list[Path]) -> str:
    """A short name for what is in files and folders."""
    made = hashlib.blake2b(digest_size=12)
    for file in files:
        inside = sorted(p for p in file.rglob("*") if p.is_file()) if file.is_dir() else [file]
        for path in inside:
            made.update(path.name.encode() + b"\0")
            with path.open("rb") as stream:
                while piece := stream.read(_PIECE):
                    made.update(piece)
    return made.hexdigest()


def _cut(sequence: Sequence, clip: Clip) -> Sequence | None:
    """The part between the clip's times; None where no joint is left of it."""
    if clip.start is None and clip.end is None:
        return sequence
    seconds = (sequence.time_ns - sequence.time_ns[0]) * 1e-9
    end = np.inf if clip.end is None else clip.end
    keep = (seconds >= (clip.start or 0.0)) & (seconds <= end)
    if not sequence.present[keep].any():
        return None
    return sequence.at(keep)
