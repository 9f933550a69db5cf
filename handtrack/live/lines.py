"""Joints as they come in JSON lines, read as `handtrack track` reads them from a file."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.skeleton import Hand
from handtrack.live.sources import Newest
from handtrack.sequences.assemble import Given, assemble
from handtrack.sequences.clock import Stamps, read_clock
from handtrack.sequences.readers.found import is_blank
from handtrack.sequences.readers.jsontext import blanks_as_null, decode
from handtrack.sequences.readers.landmark_lines import LandmarkLines, is_text_line
from handtrack.sequences.readers.record_places import stamps_of
from handtrack.sequences.readers.records import read_records
from handtrack.sequences.readers.spelling import in_small_letters

Array = NDArray[np.float64]
_SECOND = 10**9
_JSON = (b"{", b"[", b"n")
_WAITING = 1000
"""So many lines in which nothing was seen wait for the first that says what time is."""


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """The hands at one moment.

    Attributes:
        time_ns: on the source's clock.
        index: the frame's number in the source.
        joints: (21, 3) of each hand that was seen [m], NaN = missing.
        confidence: (21,) of each.
        came: when it came in, by `time.monotonic` [s].
        note: what was done to its time, the first time that it is done.
    """

    time_ns: int
    index: int
    joints: dict[Hand, Array]
    confidence: dict[Hand, Array]
    came: float
    note: str = ""


@dataclass(eq=False)
class _Line:
    """What a line holds, before its time is known."""

    index: int
    where: Path
    came: float
    joints: dict[Hand, Array]
    confidence: dict[Hand, Array]
    stamps: Stamps | None

    @property
    def stamp(self) -> Any:
        return None if self.stamps is None else self.stamps.values[0]


_JUDGED, _JUDGED_EVERY = 100, 30
"""Whether joints are a hand's in their order is asked of the first lines, then of every so
many: it takes far longer than all the rest of a line."""


def refuse(error: InputError) -> None:
    """What a line that is wrong does unless told otherwise: it ends all."""
    raise error


@dataclass
class BadLines:
    """Counts lines that are wrong, and tells of the first.

    Attributes:
        count: how many came.
        first: what was wrong with the first.
        say: is told of the first.
    """

    say: Callable[[str], None]
    count: int = 0
    first: InputError | None = None

    def __call__(self, error: InputError) -> None:
        """The next one."""
        if self.first is None:
            self.first = error
            self.say(f"left out: {error}; further ones are counted")
        self.count += 1


def from_lines(
    queue: Newest[bytes],
    source: str,
    given: Given | None = None,
    hand: Hand | None = None,
    wrong: Callable[[InputError], None] = refuse,
) -> Iterator[LiveFrame]:
    """Joints in JSON lines, in any form that `handtrack track` reads from a .jsonl file, or in
    lines of text such as `Right landmarks:, 63 numbers` (`landmark_lines`).

    A line without a time is stamped with when it comes. A line in which nothing was seen is a
    frame; what time is in is told by the first two lines that have one, where its name is silent.

    Args:
        queue: the lines.
        source: named in messages.
        given: unit and joint order, where the lines do not say.
        hand: which hand it is, where they do not say; right by default.
        wrong: is given what is wrong with a line, which is left out.

    A stamp that comes again or goes back a little is put behind the one before; after a clock
    that was set, time goes on as if it had not been. The first frame with such a time says so.

    Raises:
        InputError: a line that is no frame of joints, or whose time is none, if `wrong` does.
    """
    clock = _Clock()
    waiting: list[_Line] = []
    for n, (value, where) in enumerate(_values(queue, source, wrong)):
        try:
            read = _read(value, n, time.monotonic(), where, given or Given(), hand)
            known = clock.knows([*waiting, read][-_WAITING:])
        except InputError as error:
            wrong(error)
            continue
        waiting = [*waiting, read][-_WAITING:]
        if known:
            yield from clock.frames(waiting, wrong)
            waiting = []
    if waiting:
        yield from clock.frames(waiting, wrong)


def _values(
    queue: Newest[bytes], source: str, wrong: Callable[[InputError], None]
) -> Iterator[tuple[Any, Path]]:
    """What lines hold, JSON or text, and where each is."""
    where = Path(source)
    text = LandmarkLines(where)
    for n, line in enumerate(queue):
        where = Path(f"{source}, line {n + 1}")
        try:
            if line.lstrip()[:1] in _JSON or not (text.begun or is_text_line(line)):
                found = [in_small_letters(decode(line, Any, where))]
            else:
                text.where = where
                found = text.take(line)
        except InputError as error:
            wrong(error)
            continue
        for frame in found:
            yield frame, where
    for frame in text.rest():
        yield frame, where


def _read(value: Any, n: int, came: float, where: Path, given: Given, hand: Hand | None) -> _Line:
    read = _Line(n, where, came, {}, {}, stamps_of([value], ["the line"]))
    (value,) = blanks_as_null([value])
    if is_blank(value):
        return read
    for raw in read_records([value], ["the line"], where):
        side: Hand = raw.hand or hand or "right"
        read.stamps = read.stamps or raw.stamps
        raw.stamps = None
        if np.isfinite(raw.joints).any():
            sequence = assemble(raw, given, judge=n < _JUDGED or n % _JUDGED_EVERY == 0)
            if sequence.present.any():
                read.joints[side] = sequence.joints[0]
                read.confidence[side] = sequence.confidence[0]
    return read


class _Clock:
    """Times of lines, in the unit that two of them tell."""

    def __init__(self) -> None:
        self._begun = time.monotonic()
        self._factor: float | None = None
        self._reference: tuple[float, int] | None = None
        self._last: int | None = None
        self._step = _SECOND // 30
        self._set_ns = 0
        self._told: set[str] = set()

    def knows(self, waiting: list[_Line]) -> bool:
        """Whether the times of the lines that wait can be told."""
        if self._reference is not None:
            return waiting[-1].stamps is None or self._tells(waiting)
        stamped = [line for line in waiting if line.stamps is not None]
        if not stamped:
            return bool(waiting[-1].joints)
        return self._tells(stamped)

    def _tells(self, stamped: list[_Line]) -> bool:
        """Whether the unit of stamps is known, or two of them tell it."""
        last = stamped[-1]
        if self._factor is not None or last.stamps is None or last.stamps.unit is not None:
            return True
        if isinstance(last.stamp, bool) or not isinstance(last.stamp, int | float):
            return True
        values = [s.stamp for s in stamped if s.stamps is not None]
        if len(values) < 2 or not values[-1] > values[-2]:
            return len(values) > 1
        pair = Stamps(values[-2:], last.stamps.name)
        first, second = read_clock(2, last.where, pair).time_ns
        step = float(second - first) / (values[-1] - values[-2])
        self._factor = 10.0 ** round(np.log10(step))
        return True

    def frames(
        self, waiting: list[_Line], wrong: Callable[[InputError], None]
    ) -> Iterator[LiveFrame]:
        """The lines with their times; those without stamps by when they came."""
        stamped: dict[int, int] = {}
        for line in list(waiting):
            try:
                if line.stamps is not None:
                    stamped[line.index] = self._stamped(line)
            except InputError as error:
                waiting = [other for other in waiting if other is not line]
                wrong(error)
        first = next((line for line in waiting if line.stamps is not None), None)
        if first is not None and self._reference is None:
            self._reference = (first.came, stamped[first.index])
        came, at = self._reference or (self._begun, 0)
        self._reference = (came, at)
        for line in waiting:
            if line.stamps is None:
                time_ns = at + round((line.came - came) * 1e9)
                if self._last is not None:  # lines that come together
                    time_ns = max(time_ns, self._last + 1 - self._set_ns)
            else:
                time_ns = stamped[line.index]
                self._reference = came, at = line.came, time_ns
            time_ns, note = self._increasing(time_ns + self._set_ns)
            yield LiveFrame(time_ns, line.index, line.joints, line.confidence, line.came, note)

    def _increasing(self, time_ns: int) -> tuple[int, str]:
        """A time behind the last one, and what was done to it if that is new."""
        last, note = self._last, ""
        if last is not None and time_ns > last:
            self._step = min(time_ns - last, _SECOND)
        elif last is not None and last - time_ns < _SECOND:
            note = "a stamp does not increase: such frames follow the one before closely"
            time_ns = last + max(self._step // 4, 1)
        elif last is not None:
            note = f"the clock was set back by {1e-9 * (last - time_ns):.1f} s: time goes on"
            self._set_ns += last + self._step - time_ns
            time_ns = last + self._step
        kind = note[:11]
        told = kind in self._told
        self._told.add(kind)
        self._last = time_ns
        return time_ns, "" if told else note

    def _stamped(self, line: _Line) -> int:
        stamp = line.stamp
        if self._factor is not None and isinstance(stamp, int | float):
            # whole numbers keep all their digits
            factor = self._factor
            return stamp * round(factor) if isinstance(stamp, int) else round(stamp * factor)
        return int(read_clock(1, line.where, line.stamps).time_ns[0])
