"""What `track` is given: files, folders, patterns; joints and pictures; what is passed over."""

from __future__ import annotations

import glob
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from handtrack.cli.inputs import Reading
from handtrack.cli.outputs import names_of
from handtrack.errors import HandtrackError, InputError

if TYPE_CHECKING:
    from handtrack import Sequence
    from handtrack.cli.cameras import Lens
    from handtrack.video.placing import Seen

FEW_IMAGES = 20
"""More images than these beside other files of a folder are not taken for pictures of hands."""
_MAGIC = "*?["


@dataclass(eq=False)
class Item:
    """What one recording is made of.

    Attributes:
        source: the file or folder that it is named after.
        folder: the folder that the user named, if it is one of several in it.
        name: of its recording among those of the folder.
        pictures: what was seen in it, once it is read.
        lens: what the user says of the one camera that saw it.
    """

    source: Path
    folder: Path | None = None
    name: str = ""
    pictures: list[Seen] = field(default_factory=list)
    lens: Lens | None = None
    _sequences: list[Sequence] | None = None

    @property
    def files(self) -> list[str]:
        """What it is read from."""
        if self._sequences is None:
            return [str(self.source)]
        return [s.source for s in self._sequences if s.source]

    @property
    def unread(self) -> bool:
        """Whether it is pictures that nobody has looked at yet."""
        return self._sequences is None

    @property
    def in_motion(self) -> bool:
        """Whether its frames follow one another, as those of unrelated images do not."""
        return not (self.pictures and self.pictures[0].found.still)

    @property
    def frames(self) -> int:
        """How many there are to be tracked, as far as it is known."""
        return sum(map(len, self._sequences or ()))

    def read(self, reading: Reading, quiet: bool) -> list[Sequence]:
        """Its sequences; of pictures once they are looked at.

        Raises:
            HandtrackError: nothing to be tracked is in it.
        """
        if self._sequences is None:
            from handtrack.video.placing import Seen

            found = reading.detect(self.source, quiet)
            lens = self.lens
            self.pictures = [
                Seen.alone(found, None if lens is None else lens.camera(found.size, found.source))
            ]
            self._sequences = [through(s, lens) for s in reading.labelled(found)]
            reading.say_notes(self._sequences, quiet)
        return self._sequences

    def seen_through(self, lens: Lens) -> Item:
        """The same, of whose camera the user says something."""
        own = self._sequences
        sequences = None if own is None else [through(s, lens) for s in own]
        return replace(self, lens=lens, _sequences=sequences)

    @staticmethod
    def of(sequences: list[Sequence], source: Path, pictures: list[Seen] | None = None) -> Item:
        """An item that is read already."""
        return Item(source, pictures=pictures or [], _sequences=sequences)


def through(sequence: Sequence, lens: Lens | None) -> Sequence:
    """A sequence, its picture taken with the lens that the user says."""
    picture = sequence.picture
    if lens is None or picture is None:
        return sequence
    camera = lens.camera(picture.size, sequence.source)
    return replace(sequence, picture=replace(picture, camera=camera, lens=lens.known))


@dataclass(frozen=True)
class Skipped:
    """What is not tracked.

    Attributes:
        path: it.
        reason: why, without the path.
        bad: whether it should have been: it was named, or it is damaged.
    """

    path: Path
    reason: str
    bad: bool = True

    @staticmethod
    def of(path: Path, error: HandtrackError, bad: bool = True) -> Skipped:
        """Because of an error that came of it."""
        return Skipped(path, str(error).removeprefix(f"{path}: "), bad)


@dataclass
class Given:
    """What was found in the inputs."""

    items: list[Item] = field(default_factory=list)
    skipped: list[Skipped] = field(default_factory=list)


def items_of(inputs: Iterable[Path], reading: Reading, quiet: bool) -> Given:
    """What is to be tracked of the inputs; joints are read here, pictures when it is their turn.

    Args:
        inputs: files, folders, and patterns that no shell has expanded.
        reading: how to read them.
        quiet: print nothing.

    Raises:
        InputError: nothing is left; of a single input what is wrong with it.
    """
    found = Given()
    paths = list(dict.fromkeys(path for given in inputs for path in _expanded(given)))
    for path in paths:
        try:
            _add(found, path, reading, quiet)
        except InputError as error:
            if len(paths) == 1:
                raise
            found.skipped.append(Skipped.of(path, error))
    if not found.items:
        reasons = [f"{skip.path}: {skip.reason}" for skip in found.skipped]
        raise InputError(f"nothing to track in {len(paths)} inputs: {'; '.join(reasons[:3])}")
    return found


def have_pictures(inputs: Iterable[Path], reading: Reading) -> bool:
    """Whether all inputs are videos, images, folders of these, or joints with what one camera's
    pictures show of them."""
    from handtrack.files.pictures import pictures_in

    for path in (path for given in inputs for path in _expanded(given)):
        if not path.exists():
            return False
        if pictures_in(path) is not None or (path.is_dir() and _pictures_below(path)[0]):
            continue
        try:
            if not all(s.picture is not None for s in reading.load(path, quiet=True)):
                return False
        except InputError:
            return False
    return True


def _expanded(path: Path) -> list[Path]:
    """What a pattern stands for, as a shell has it; other paths as they are."""
    if path.exists() or not any(sign in str(path) for sign in _MAGIC):
        return [path]
    return [Path(name) for name in sorted(glob.glob(str(path), recursive=True))] or [path]


def _add(found: Given, path: Path, reading: Reading, quiet: bool) -> None:
    from handtrack.files.pictures import pictures_in

    if not path.is_dir() or pictures_in(path) is not None:
        if path.exists() and pictures_in(path) is not None:
            reading.check_pictures(path)
            found.items.append(Item(path))
        else:
            found.items += _by_source(reading.load(path, quiet), path)
        return
    pictures, skipped = _pictures_below(path)
    sequences: list[Sequence] = []
    try:
        sequences, passed_over = reading.load_folder(path, quiet)
        skipped += [Skipped.of(p.path, p.error, p.joints) for p in passed_over]
    except InputError:
        if not pictures:
            raise
    pictures, beside = _without_stills(pictures)
    items = _by_source(sequences, path) + [Item(p) for p in pictures]
    if len(items) > 1:
        for item, name in zip(items, names_of([i.source for i in items]), strict=True):
            item.folder, item.name = path, name
    found.items += items
    found.skipped += [*skipped, *beside]


def _by_source(sequences: list[Sequence], path: Path) -> list[Item]:
    groups: dict[str, list[Sequence]] = {}
    for sequence in sequences:
        groups.setdefault(sequence.source, []).append(sequence)
    return [Item.of(group, Path(source or path)) for source, group in groups.items()]


def _folders(folder: Path) -> Iterator[Path]:
    yield folder
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.is_symlink() and not path.name.startswith("."):
            yield from _folders(path)


def _pictures_below(folder: Path) -> tuple[list[Path], list[Skipped]]:
    """Videos, images and folders of images in a folder and those in it; and other files, that no
    reader would look at."""
    from handtrack.files.pictures import pictures_in
    from handtrack.sequences.readers.folder import is_ignored, may_be_data

    pictures, skipped = [], []
    for here in _folders(folder):
        if pictures_in(here) == "images":
            pictures.append(here)
            continue
        files = [p for p in sorted(here.iterdir()) if p.is_file() and not is_ignored(p.name)]
        for file in files:
            if pictures_in(file) is not None:
                pictures.append(file)
            elif not may_be_data(file.name):
                skipped.append(Skipped(file, "neither joints nor a picture", bad=False))
    return pictures, skipped


def _without_stills(pictures: list[Path]) -> tuple[list[Path], list[Skipped]]:
    """Without images of which many lie beside other files, as the pictures of data sets do."""
    from handtrack.files.pictures import pictures_in

    count = Counter(p.parent for p in pictures if pictures_in(p) == "image")
    reason = "one of many images beside other files: name it to have it tracked"
    gone = [p for p in pictures if count[p.parent] > FEW_IMAGES and pictures_in(p) == "image"]
    return [p for p in pictures if p not in gone], [Skipped(p, reason, bad=False) for p in gone]
