"""Files that appear whole or not at all."""

from __future__ import annotations

import itertools
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from handtrack.errors import HandtrackError, InputError

_NUMBER = itertools.count(1)

Stamp = tuple[int, int, int] | None
"""What tells whether a file is still the same: its number, time and size; None: there is none."""


def stamp(path: Path) -> Stamp:
    """What the file with that name is now."""
    try:
        found = path.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns, found.st_size


def take_name(part: Path, path: Path, before: Stamp) -> None:
    """Give a complete file its name, unless somebody else has written that file meanwhile.

    Args:
        part: its name until then.
        path: its name in the end.
        before: `stamp(path)` from when it was begun.

    Raises:
        HandtrackError: there is another file by now; both stay.
        OSError: it cannot be renamed.
    """
    if stamp(path) != before:
        raise HandtrackError(
            f"{path}: something else has written this file meanwhile; what belongs here is complete"
            f" in {part}"
        )
    part.replace(path)


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """The path to write to: it takes the name `path` when the block ends, and not before.

    Until then it is `NAME.<process>-<number>.part` beside it, which goes if the block fails. A
    file that is there already stays until it is replaced.

    Raises:
        InputError: the folder is missing, or the path is a folder.
        HandtrackError: an OSError came out of the block (a full disk, no permission), or
            something else has written the file meanwhile: then the part stays.
    """
    if path.is_dir():
        raise InputError("is a folder, expected the name of a file to write", path)
    if not path.parent.is_dir():
        raise InputError(f"cannot be written: there is no folder {path.parent}", path)
    part = path.with_name(f"{path.name}.{os.getpid()}-{next(_NUMBER)}.part")
    before, complete = stamp(path), False
    try:
        yield part
        complete = True
        take_name(part, path, before)
    except OSError as error:
        complete = False
        reason = error.strerror or str(error)
        raise HandtrackError(f"{path}: cannot be written: {reason}") from error
    finally:
        if not complete:
            # where nothing can be written there is nothing to remove
            with suppress(OSError):
                part.unlink(missing_ok=True)
