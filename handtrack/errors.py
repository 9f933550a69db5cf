"""The exceptions that handtrack raises for input it cannot use."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from typing import Any, Self

QUOTED = 200
"""Characters that an error quotes of a file, at most."""
# a word of that length is no word but a file's content
_LONG_WORD = re.compile(rf"\S{{{QUOTED + 1},}}")


def shown(value: object, limit: int = QUOTED) -> str:
    """A value of a file as an error quotes it: one line, cut where it is long.

    Args:
        value: text, or anything else, which is not written out further than that.
        limit: characters.
    """
    if isinstance(value, int) and value.bit_length() > 64:
        return f"a number of {value.bit_length()} bits"
    if isinstance(value, str | bytes):
        text = value[: limit + 1] if isinstance(value, str) else repr(value[:limit])
    elif isinstance(value, float | int | None):
        text = str(value)
    else:
        text = f"a {type(value).__name__}"
    text = printable(text)
    return text if len(text) <= limit else text[: limit - 1] + "…"


def printable(text: str) -> str:
    """The text with line ends, control characters and broken names of files escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class HandtrackError(Exception):
    """Base of every error that handtrack raises on purpose; its text is one line."""

    def __init__(self, message: object = ""):
        text = printable(str(message))
        super().__init__(_LONG_WORD.sub(lambda m: m[0][: QUOTED - 1] + "…", text))


class InputError(HandtrackError, ValueError):
    """A file or an array is not what was expected.

    Args:
        message: what was found and what was expected, in one line.
        path: the file it was found in, put in front of the message.
    """

    def __init__(self, message: str, path: str | Path | None = None):
        self.path = None if path is None else Path(path)
        super().__init__(message)
        if path is not None:
            self.args = (f"{printable(str(path))}: {self.args[0]}",)

    def retold(self, text: str, path: Path | None) -> Self:
        """The same error, of the same kind, in other words; `path` is the file that they name."""
        self.args, self.path = (printable(text),), path
        return self


class SettingsError(HandtrackError, ValueError):
    """An argument or a setting has a value that cannot be used."""


class ModelError(HandtrackError):
    """A hand model is inconsistent or lacks what was asked of it."""


class NoHandError(HandtrackError):
    """There is no hand in any picture: the job failed, the input is sound."""


def needed(module: str, what: str, extra: str) -> Any:
    """A module of a library that comes with one of the extras.

    Args:
        module: its name.
        what: what needs which library, as in "plots need matplotlib".
        extra: of ours that installs it.

    Raises:
        SettingsError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise SettingsError(f"{what}: pip install 'handtrack[{extra}]'") from None
