"""The exceptions that handtrack raises for input it cannot use."""

from __future__ import annotations

from pathlib import Path


class HandtrackError(Exception):
    """Base of every error that handtrack raises on purpose; its text is one line."""


class InputError(HandtrackError):
    """A file or an array is not what was expected.

    Args:
        message: what was found and what was expected, in one line.
        path: the file it was found in, put in front of the message.
    """

    def __init__(self, message: str, path: str | Path | None = None):
        self.path = None if path is None else Path(path)
        super().__init__(message if path is None else f"{path}: {message}")


class SettingsError(HandtrackError):
    """An argument or a setting has a value that cannot be used."""


class ModelError(HandtrackError):
    """A hand model is inconsistent or lacks what was asked of it."""
