"""A file that cannot be written is told in the system's words, whoever wrote it."""

from __future__ import annotations

import errno
import os

import pytest

from handtrack.errors import HandtrackError
from handtrack.files.whole import whole_file

_PYARROWS = "Error writing bytes to file. Detail: [errno 28] No space left on device"
ERRORS = {
    "the system's": OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)),
    "pyarrow's": OSError(_PYARROWS),
    "pyarrow's with a number": OSError(errno.ENOSPC, _PYARROWS),
}


@pytest.mark.parametrize("error", ERRORS.values(), ids=list(ERRORS))
def test_a_full_disk_is_told_in_few_words(error, tmp_path):
    path = tmp_path / "a.csv"

    def write() -> None:
        with whole_file(path) as part:
            part.write_text("half")
            raise error

    with pytest.raises(HandtrackError, match=rf"a\.csv: cannot be written: {os.strerror(28)}$"):
        write()
    assert not list(tmp_path.iterdir())
