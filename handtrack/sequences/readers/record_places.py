"""Where records stand in a file, in words, which are only made where an error needs them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload


class Places(Sequence[str]):
    """The places of records: a word and each one's number.

    Args:
        word: what is counted: "line", "frame".
        numbers: of the records.
    """

    def __init__(self, word: str, numbers: Sequence[int]):
        self._word, self._numbers = word, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    @overload
    def __getitem__(self, at: int) -> str: ...

    @overload
    def __getitem__(self, at: slice) -> Places: ...

    def __getitem__(self, at: int | slice) -> str | Places:
        if isinstance(at, slice):
            return Places(self._word, self._numbers[at])
        return f"{self._word} {self._numbers[at]}"


class Picked(Sequence[str]):
    """Some of the places.

    Args:
        places: all of them.
        rows: which.
    """

    def __init__(self, places: Sequence[str], rows: Sequence[int]):
        self._places, self._rows = places, rows

    def __len__(self) -> int:
        return len(self._rows)

    @overload
    def __getitem__(self, at: int) -> str: ...

    @overload
    def __getitem__(self, at: slice) -> Picked: ...

    def __getitem__(self, at: int | slice) -> str | Picked:
        if isinstance(at, slice):
            return Picked(self._places, self._rows[at])
        return self._places[self._rows[at]]
