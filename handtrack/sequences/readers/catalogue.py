"""What is read: a reader declares its formats in its own module, and they are found there.

Each module of this package may have FORMATS: what people need to know of them, from which the
tables of the documents are made (`python -m tools.docs.readme` puts one into the README), and how
their files are told from others. Whoever adds a reader adds a module, and touches no other.
"""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

if TYPE_CHECKING:
    from handtrack.sequences.readers.raw import Raw

Read = Callable[[bytes, Path], "list[Raw]"]
ReadHdf5 = Callable[[Any, Path], "list[Raw] | None"]


class Way(NamedTuple):
    """How a reader's files are told from others by what is in them, and read.

    Attributes:
        of: what `mine` looks at: "file", the first 512 bytes, of what is not read as a whole;
            "bytes", all of them; "text", from its first letter; "fields", a JSON object's.
        mine: whether they are, of that and the path; of fields, of these and the text.
        read: the file's sequences, of its bytes and path; of a "file", of its path alone.
    """

    of: Literal["file", "bytes", "text", "fields"]
    mine: Callable[[Any, Any], bool]
    read: Callable[..., list[Raw]]


@dataclass(frozen=True)
class Format:
    """What people need to know of one format, and how it is found.

    Attributes:
        name: the source, as its users call it.
        reads: the file or folder, and what of it is read.
        order: the joints' order (`handtrack.hand.skeleton.ORDERS`), or "by name".
        unit: of the file's positions, where the file does not say otherwise.
        hands: whose: "both", "one", "right", "by name" ...
        known_by: what tells it from other formats.
        needs: an option, a companion file or an extra of the package; "": nothing.
        kinds: readers of a file's content by the names that `load(format=)` knows them by.
        suffixes: endings of its files, which are looked into in a folder.
        numbered: names of files that make one sequence with others, and who reads these.
        ways: how it is told by what is in it; none: another format's reader finds it.
        hdf5: reader of an open HDF5 file, as h5py gives it; its answer is None where that is of
            another format.
    """

    name: str
    reads: str
    order: str
    unit: str
    hands: str
    known_by: str
    needs: str = ""
    kinds: Mapping[str, Read] = field(default_factory=dict)
    suffixes: tuple[str, ...] = ()
    numbered: tuple[re.Pattern[str], Callable[..., list[Raw]]] | None = None
    ways: tuple[Way, ...] = ()
    hdf5: ReadHdf5 | None = None


# read by `handtrack.video`
_PICTURES = (
    Format(
        "Videos, images",
        ".mp4, .mov, .mkv, .webm, .avi; .jpg, .png, .webp; a folder of images",
        "by MediaPipe",
        "m",
        "both",
        "file magic",
        'extra `video` (pip install "handtrack[video]")',
    ),
)


@cache
def formats() -> tuple[Format, ...]:
    """All formats, by name."""
    package = __name__.rpartition(".")[0]
    found = [*_PICTURES]
    for module in pkgutil.iter_modules(importlib.import_module(package).__path__):
        found += getattr(importlib.import_module(f"{package}.{module.name}"), "FORMATS", ())
    return tuple(sorted(found, key=lambda f: f.name.lower()))


@cache
def ways(of: str) -> tuple[Way, ...]:
    """How formats are told by that, see `Way`."""
    return tuple(way for f in formats() for way in f.ways if way.of == of)


@cache
def kinds() -> Mapping[str, Read]:
    """Readers of a file's content by the name of their format."""
    return dict(sorted(item for f in formats() for item in f.kinds.items()))


@cache
def numbered_names() -> tuple[tuple[re.Pattern[str], Callable[..., list[Raw]]], ...]:
    """Names of files that make one sequence with others, and who reads them."""
    return tuple(f.numbered for f in formats() if f.numbered is not None)


@cache
def suffixes() -> frozenset[str]:
    """Endings of files that are looked into in a folder."""
    return frozenset(s for f in formats() for s in f.suffixes)
