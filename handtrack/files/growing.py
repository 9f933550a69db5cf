"""A file that grows under a temporary name, which survives whatever happens to its writer."""

from __future__ import annotations

import os
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import IO

from handtrack.errors import HandtrackError, InputError
from handtrack.files.whole import stamp, take_name

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
            reason = error.strerror or str(error)
            raise HandtrackError(f"{path}: cannot be written: {reason}") from error
