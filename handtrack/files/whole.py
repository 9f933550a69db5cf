"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from handtrack.errors import HandtrackError, InputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """The path to write to: it takes the name `path` when the block ends, and not before.

    Until then it is `NAME.<process>.part` beside it, which goes if the block fails. A file
    that is there already stays until it is replaced.

    Raises:
        InputError: the folder is missing, or the path is a folder.
        HandtrackError: an OSError came out of the block (a full disk, no permission).
    """
    if path.is_dir():
        raise InputError("is a folder, expected the name of a file to write", path)
    if not path.parent.is_dir():
        raise InputError(f"cannot be written: there is no folder {path.parent}", path)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    complete = False
    try:
        yield part
        part.replace(path)
        complete = True
    except OSError as error:
        reason = error.strerror or str(error)
        raise HandtrackError(f"{path}: cannot be written: {reason}") from error
    finally:
        if not complete:
            part.unlink(missing_ok=True)
