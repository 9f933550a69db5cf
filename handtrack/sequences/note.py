"""Note: a line for the user about what was read, with what it is about."""

from __future__ import annotations

from typing import Literal

About = Literal["unit", "order", "time", ""]


class Note(str):
    """A line of text, which any string is too, that says what it is about.

    Attributes:
        about: what the reader cured or doubts; "" for all else.
        frames: where, as frames of the file from 0 on; none for all of it.
    """

    about: About
    frames: tuple[int, ...]

    def __new__(cls, text: str, about: About = "", frames: tuple[int, ...] = ()) -> Note:
        note = super().__new__(cls, text)
        note.about, note.frames = about, frames
        return note

    @staticmethod
    def of(text: str) -> Note:
        """A line, as a note about nothing unless it is one."""
        return text if isinstance(text, Note) else Note(text)

    def renamed(self, old: str, new: str) -> Note:
        """The same, with a file's name in it put right."""
        return Note(self.replace(old, new), self.about, self.frames)
