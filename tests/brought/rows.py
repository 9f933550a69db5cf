"""A row of the table: a small file that someone might bring, and what must come of it."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from made_hands import Brought

import handtrack as ht

RIGHT, DOUBT, REFUSED = "right", "doubt", "refused"
TOLERANCE_M = 2e-6
"""Files hold micrometres."""


@dataclass(frozen=True)
class Row:
    """A file and its right value.

    Attributes:
        kind: of the issue: marks, first, stated, names, skeleton, degenerate, time, mirror, unseen.
        name: format and what is odd about it.
        make: writes the file (or folder) into a folder.
        brought: what should come out.
        expect: RIGHT: that; REFUSED: an error that `says` matches; DOUBT: an error or a note that
            `says` matches.
        says: what must be said, a regular expression; with RIGHT too, where it is not empty.
    """

    kind: str
    name: str
    make: Callable[[Path], Path]
    brought: Brought
    expect: str = RIGHT
    says: str = ""
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def id(self) -> str:
        return f"{self.kind}: {self.name}"


class Table(list[Row]):
    """Rows of one kind of file after another."""

    def add(
        self,
        kind: str,
        name: str,
        b: Brought,
        write: Callable[..., Path],
        file: str = "a.csv",
        expect: str = RIGHT,
        says: str = "",
        options: dict[str, Any] | None = None,
        **how: Any,
    ) -> None:
        def make(folder: Path) -> Path:
            return write(folder / file if file else folder, b, **how)

        self.append(Row(kind, name, make, b, expect, says, {**b.options, **(options or {})}))

    def text(
        self,
        kind: str,
        name: str,
        b: Brought,
        change: Callable[[str], str],
        write: Callable[..., Path],
        file: str = "a.csv",
        expect: str = RIGHT,
        says: str = "",
        **how: Any,
    ) -> None:
        """A row whose file is changed as text after it is written."""

        def make(folder: Path) -> Path:
            path = write(folder / file, b, **how)
            path.write_text(change(path.read_text()))
            return path

        self.append(Row(kind, name, make, b, expect, says, b.options))


def differences(sequences: list[ht.Sequence], b: Brought) -> list[str]:
    """What is not as it was brought: hands, joints, what is missing, frames a second."""
    wanted = {one.hand: one for one in b.each()}
    found = [s.hand for s in sequences]
    if sorted(found) != sorted(wanted):
        return [f"hands are {found}, expected {sorted(wanted)}"]
    return [d for s in sequences for d in _one(s, wanted[s.hand])]


def _one(sequence: ht.Sequence, b: Brought) -> list[str]:
    expected = b.expected
    found = np.where((sequence.confidence > 0)[..., None], sequence.joints, np.nan)
    if len(found) != len(expected):  # some formats leave out what was not seen
        found = found[np.isfinite(found).all(-1).any(1)]
        expected = expected[np.isfinite(expected).all(-1).any(1)]
    if found.shape != expected.shape:
        return [f"{sequence.hand}: {len(found)} frames, expected {len(expected)}"]
    out = []
    gone, should = np.isnan(found).any(-1), np.isnan(expected).any(-1)
    if (gone != should).any():
        n, lost = (should & ~gone).sum(), (gone & ~should).sum()
        out.append(f"{sequence.hand}: {n} joints should be missing, {lost} should not")
    both = ~gone & ~should
    off = np.abs(found[both] - expected[both]).max() if both.any() else np.inf
    if off > TOLERANCE_M:
        out.append(f"{sequence.hand}: {off * 1e3:.3f} mm off")
    if b.fps is not None and len(found) > 1:
        fps = 1e9 / float(np.median(np.diff(sequence.time_ns)))
        if abs(fps / b.fps - 1) > 0.02:
            out.append(f"{sequence.hand}: {fps:.4g} frames/s, expected {b.fps:g}")
    return out


def check(row: Row, folder: Path) -> str:
    """How the row came out: right, refused or warned; AssertionError where that is wrong."""
    path = row.make(folder)
    try:
        sequences = ht.load(path, **row.options)
    except ht.HandtrackError as error:
        said = str(error)
        assert row.expect != RIGHT, f"refused: {said}"
        assert "\n" not in said
        assert said.startswith(str(folder)), f"names no file: {said}"
        assert re.search(row.says, said), f"no word of {row.says!r}: {said}"
        return "refused"
    notes = " | ".join(note for s in sequences for note in s.notes)
    assert row.expect != REFUSED, f"not refused, said: {notes}"
    wrong = differences(sequences, row.brought)
    if row.expect == RIGHT:
        assert not wrong, f"{'; '.join(wrong)}; said: {notes}"
        assert re.search(row.says, notes), f"no word of {row.says!r}: {notes}"
        return "right"
    if not wrong:
        return "right"
    assert re.search(row.says, notes), f"no word of {row.says!r}: {notes}; {'; '.join(wrong)}"
    return "warned"
