"""The sequences in a folder: what is read, what belongs together, what is passed over."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import msgspec

from handtrack.errors import InputError
from handtrack.files import budget
from handtrack.sequences.readers import keypoints_2d, panoptic
from handtrack.sequences.readers.catalogue import numbered_names, suffixes
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.raw import Raw
from handtrack.sequences.readers.recognise import read_file
from handtrack.sequences.readers.rosbag import METADATA, is_bag
from handtrack.sequences.readers.single_frames import read_single_frames, together

_NOT_DATA = ("readme", "license", "licence", "copying", "changelog", "notice")
# Panoptic's bodies and faces, thousands of files beside the hands
_OTHER_PANOPTIC = ("body3DScene_", "faceRecon3D_")


@dataclass(frozen=True)
class Source:
    """What makes one recording: a file, or the numbered files of a folder.

    Attributes:
        folder: where the files are.
        names: the files.
        people: whether several are Panoptic's frames, and not single frames of another kind.
    """

    folder: Path
    names: tuple[str, ...]
    people: bool = True

    def read(self, frames: tuple[int, int] | None = None, kind: str | None = None) -> list[Raw]:
        """Its sequences; arguments and errors as `recognise.read_file`."""
        paths = [self.folder / name for name in self.names]
        for name, read in numbered_names():
            if name.fullmatch(self.names[0]):
                return read(paths, self.folder, frames)
        if not self.people:
            return read_single_frames(paths, self.folder, frames)
        if len(paths) > 1 or panoptic.FILE_NAME.fullmatch(self.names[0]):
            return panoptic.read_files(paths, self.folder, frames)
        return read_file(paths[0], frames, kind)


def sources(folder: Path) -> Iterator[Source]:
    """Every source in a folder and the folders in it, sorted by path; hidden ones are skipped."""
    for here, names in _folders(folder):
        if is_bag(here):
            yield Source(here, (METADATA,))
            continue
        data = sorted(n for n in names if may_be_data(n))
        single = together((n for n in data if not _is_numbered(n)), here)
        single = [group for group in single if not _is_of_people(group[0], here)]
        taken = {name for group in single for name in group}
        for group in single:
            yield Source(here, tuple(group), people=False)
        for group in _groups([n for n in data if n not in taken], here):
            yield Source(here, tuple(group))


def _folders(folder: Path) -> Iterator[tuple[Path, list[str]]]:
    """Folders with the names of what is in them that is no folder; links to folders are not
    followed, as they may lead back."""
    waiting = [folder]
    while waiting:
        here = waiting.pop()
        try:
            with os.scandir(here) as entries:
                inside = sorted(
                    (e.name, e.is_dir(follow_symlinks=False), e.is_dir()) for e in entries
                )
        except OSError as error:
            raise InputError(f"cannot be read: {error.strerror or error}", here) from error
        below = [name for name, is_folder, _ in inside if is_folder and not name.startswith(".")]
        waiting += [here / name for name in reversed(below)]
        yield here, [name for name, _, leads_to_one in inside if not leads_to_one]


def is_ignored(name: str) -> bool:
    """Whether a file of that name is never looked at: hidden, a README, a body or a face."""
    return name.startswith((".", *_OTHER_PANOPTIC)) or name.lower().startswith(_NOT_DATA)


def may_be_data(name: str) -> bool:
    """Whether a file of that name is looked into."""
    lower = name.lower()
    if is_ignored(name):
        return False
    # other endings (videos, pictures, notes) are not looked into; pickles of other names are models
    return os.path.splitext(lower)[1] in suffixes() or _is_numbered(name)


def _is_numbered(name: str) -> bool:
    """Whether files of that name make a sequence with others by their format."""
    return any(pattern.fullmatch(name) for pattern, _ in numbered_names())


def together_by_name(names: list[str]) -> list[list[str]]:
    """Files of a folder that is not at hand, as far as their names tell: those of formats with
    numbered files together, all others alone."""
    groups: list[list[str]] = []
    for pattern in (*(pattern for pattern, _ in numbered_names()), panoptic.FILE_NAME):
        together = [name for name in names if pattern.fullmatch(name)]
        names = [name for name in names if not pattern.fullmatch(name)]
        groups += _by_video(together)
    return groups + [[name] for name in names]


def _by_video(names: list[str]) -> list[list[str]]:
    """OpenPose's files by the video that they name; those of other formats are all of one."""
    groups: dict[str | None, list[str]] = {}
    for name in names:
        groups.setdefault(keypoints_2d.openpose_prefix(name), []).append(name)
    return list(groups.values())


def _groups(names: list[str], here: Path) -> Iterator[list[str]]:
    """Single files, and the numbered files of a sequence together."""
    numbered: dict[str, list[str]] = {}
    for pattern, _ in numbered_names():
        together = [name for name in names if pattern.fullmatch(name)]
        if together:
            taken = set(together)
            names = [name for name in names if name not in taken]
            yield from _by_video(together)
    for name in names:
        prefix = panoptic.prefix(name)
        if prefix is None:
            yield [name]
        else:
            numbered.setdefault(prefix, []).append(name)
    for members in numbered.values():
        if _is_of_people(members[0], here):
            yield members
        else:
            yield from ([name] for name in members)


def _is_of_people(name: str, here: Path) -> bool:
    """Whether it is a Panoptic frame, by its name or under another one."""
    if panoptic.FILE_NAME.fullmatch(name):
        return True
    if panoptic.prefix(name) is None:
        return False
    path = here / name
    try:
        return "people" in decode(budget.read(path), dict[str, msgspec.Raw], path)
    except InputError:
        return False  # read by itself it will say what is wrong
