"""Files that appear whole or not at all, at once or as they grow."""

from __future__ import annotations

import itertools
import os
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

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
        raise HandtrackError(f"{path}: cannot be written: {_why(error)}") from error
    finally:
        if not complete:
            # where nothing can be written there is nothing to remove
            with suppress(OSError):
                part.unlink(missing_ok=True)


_SYNC_S = 1.0


class PartFile:
    """NAME.part beside NAME until `complete`; NAME.2.part where that is there already.

    So what an earlier, stopped run left is never written over.

    Attributes:
        path: the name in the end.
        part: the name until then.
        stream: to write to.

    Raises:
        InputError: the folder is missing, or the path is a folder.
        HandtrackError: the file cannot be made.
    """

    def __init__(self, path: Path) -> None:
        if path.is_dir():
            raise InputError("is a folder, expected the name of a file to write", path)
        if not path.parent.is_dir():
            raise InputError(f"cannot be written: there is no folder {path.parent}", path)
        self.path, self._before = path, stamp(path)
        self.part, self.stream = _opened(path)
        self._syncing: threading.Thread | None = None
        self._synced = time.monotonic()
        self._failed: OSError | None = None

    def sync_soon(self) -> None:
        """Have what was written put onto the disk, once a second, while the caller goes on.

        Raises:
            OSError: that failed the last time.
        """
        if self._failed is not None:
            raise self._failed
        if time.monotonic() - self._synced < _SYNC_S or self._busy:
            return
        self._synced = time.monotonic()
        self._syncing = threading.Thread(target=self._sync, daemon=True)
        self._syncing.start()

    @property
    def _busy(self) -> bool:
        return self._syncing is not None and self._syncing.is_alive()

    def _sync(self) -> None:
        try:
            os.fsync(self.stream.fileno())
        except OSError as error:
            self._failed = error

    def complete(self) -> None:
        """Everything was written: onto the disk with it, and give it its name.

        Raises:
            OSError: that failed; the part stays.
            HandtrackError: something else has written the file meanwhile; the part stays.
        """
        self.stream.flush()
        os.fsync(self.stream.fileno())
        self.close()
        take_name(self.part, self.path, self._before)

    def close(self) -> None:
        """Close the file and leave it under the name it has."""
        if self._syncing is not None:
            self._syncing.join()
        # a full disk was told before
        with suppress(OSError):
            self.stream.close()

    def remove(self) -> None:
        """Close the file and delete it."""
        self.close()
        self.part.unlink(missing_ok=True)


def _opened(path: Path) -> tuple[Path, IO[bytes]]:
    number = 1
    while True:
        part = path.with_name(f"{path.name}.{'' if number == 1 else f'{number}.'}part")
        try:
            return part, part.open("xb")
        except FileExistsError:
            number += 1
        except OSError as error:
            raise HandtrackError(f"{path}: cannot be written: {_why(error)}") from error


def _why(error: OSError) -> str:
    """In the system's words; some libraries put their own about them."""
    inside = re.search(r"\[errno (\d+)\]", str(error), re.IGNORECASE)
    if inside:
        return os.strerror(int(inside[1]))
    return error.strerror or str(error)
