"""Clock: from times as a source writes them, of any unit and quality, to nanoseconds that
strictly increase.

A reader hands over `Stamps`: the values as they stand, what they are called, and the unit where
that name or the format states one. It judges nothing. `read_clock` then

- takes the unit that was stated, unless no camera has the rate that it makes; where none was
  stated, the one that makes 1 to 1000 frames a second (the value of a date says it too);
- puts right what can be put right: repeated, missing, exchanged and stray stamps, a clock that
  was set, clips one behind the other (`clock_repair`);
- says each of these in a note, and refuses the rest with the option that cures it.
"""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.sequences.clock_even import typical_step
from handtrack.sequences.clock_repair import Repaired, repaired
from handtrack.sequences.clock_text import NotTimeError, Numbers, as_numbers
from handtrack.sequences.note import Note

TimeUnit = Literal["s", "ms", "us", "ns"]
UNIT_NS: dict[TimeUnit, int] = {"s": 10**9, "ms": 10**6, "us": 10**3, "ns": 1}
"""One of each unit in nanoseconds."""
DEFAULT_FPS = 30.0
SLOWEST, FASTEST = 1.0, 1000.0
"""Frames a second that times of unknown unit may make."""
LEAST, MOST = 0.1, 1e4
"""Frames a second that times of a stated unit may make."""
FPS_RANGE = (1e-3, 1e5)
"""Frames a second that can be stated."""
MAX_NS = 2**62
"""Times beyond this (the year 2116) cannot be told from damage."""
_EPOCH_S = (9e8, 4.2e9)  # 1998 to 2103


def check_fps(fps: float | None) -> None:
    """Whether a caller's frame rate can be used.

    Raises:
        SettingsError: it is not above zero, not finite, or no rate of anything.
    """
    if fps is not None and not FPS_RANGE[0] <= fps <= FPS_RANGE[1]:
        raise SettingsError(f"fps is {fps:g}, expected a number above 0, at most {FPS_RANGE[1]:g}")


_CURE = "--fps N goes by the frames themselves"

Indices = NDArray[np.int64]


@dataclass(frozen=True)
class Stamps:
    """Times of frames as the source has them, not judged.

    Attributes:
        values: one a frame: numbers, None or NaN (missing), datetime64 or timedelta64, text
            (numbers, ISO 8601, `HH:MM:SS.mmm`, SMPTE timecode), objects or pairs of seconds and
            nanoseconds (ROS); an array or a list. Or one alone: when the first frame was.
        name: what the source calls them, for messages.
        unit: the unit that the name or the format states ("ms" of `time_ms`); None where it
            states none (`time`, `t`, `timestamp`, `stamp`). "frame" for numbers of frames.
        places: where each stands in the file ("line 3"), for messages; None: "frame 0" ...
    """

    values: Any
    name: str = "time"
    unit: TimeUnit | Literal["frame"] | None = None
    places: Items[str] | None = None

    def place(self, row: int) -> str:
        """Where the stamp of a row stands, for messages."""
        return f"frame {row}" if self.places is None else self.places[row]

    def take(self, rows: Items[int] | Indices) -> Stamps:
        """Those of some frames; one stamp for all stays."""
        places = self.places and [self.places[int(i)] for i in rows]
        if isinstance(self.values, np.ndarray) and self.values.ndim:
            part = self.values[np.asarray(rows, dtype=np.int64)]
            return replace(self, values=part, places=places)
        if isinstance(self.values, list | tuple):
            return replace(self, values=[self.values[int(i)] for i in rows], places=places)
        return self


class Clock(NamedTuple):
    """When frames were.

    Attributes:
        rows: (T,) which of the source's frames these are, in order of time: all of them.
        time_ns: (T,) int64, strictly increasing.
        notes: what was assumed or repaired, one line each.
        stated: whether the source (or the caller) says how fast time goes; False where a rate
            had to be assumed.
    """

    rows: Indices
    time_ns: Indices
    notes: tuple[str, ...]
    stated: bool


def read_clock(
    n: int,
    path: Path,
    stamps: Stamps | None = None,
    numbers: Indices | None = None,
    fps: float | None = None,
    given_fps: float | None = None,
    given_unit: TimeUnit | None = None,
) -> Clock:
    """The clock of n frames.

    Args:
        n: how many frames there are.
        path: the file, for messages.
        stamps: their times as the file has them.
        numbers: (n,) their numbers as the file has them.
        fps: the rate that the file states; any value, it is checked here.
        given_fps: the caller's rate, which replaces the file's times.
        given_unit: the caller's unit of the stamps.

    Raises:
        InputError: nothing sensible can be made of the times; with the option that helps.
    """
    count = np.arange(n) if numbers is None else np.asarray(numbers, dtype=np.int64)
    if given_fps is not None:
        return _by_rate(count, path, given_fps)
    notes: list[str] = []
    usable = stamps is not None
    rate = None if fps is None else _file_rate(float(fps), path, usable, notes)
    if stamps is not None:
        read = _numbers(stamps, n, path, rate)
        if read.values.ndim == 0:
            start = _start_ns(read, given_unit)
            clock = _by_rate(count, path, rate, [*notes, f"one {stamps.name} for {n} frames"])
            return clock._replace(time_ns=clock.time_ns - clock.time_ns[0] + start)
        useless = _useless(read, n, stamps.name)
        if not useless:
            return _by_stamps(stamps, read, path, numbers, rate, given_unit, notes)
        notes.append(useless)
    return _by_rate(count, path, rate, notes)


def _by_rate(count: Indices, path: Path, fps: float | None, notes: Items[str] = ()) -> Clock:
    """Frame i at i / fps seconds; 30 frames a second where nobody says."""
    notes = list(notes)
    if fps is None and len(count) > 1:
        notes.append(f"no time in the file: {DEFAULT_FPS:g} frames/s assumed (--fps)")
    seconds = count / (fps or DEFAULT_FPS)
    step = 1e9 / (fps or DEFAULT_FPS)
    time_ns = _checked_ns(seconds, 10**9, np.zeros(len(count), bool), path, "frame number")[0]
    if len(count) > 1 and not (np.diff(time_ns) > 0).all():
        made = repaired(time_ns, np.zeros(len(count), bool), step, None, "frame number", path)
        return Clock(made.rows, made.time_ns, (*notes, *made.notes), fps is not None)
    notes += _far(count)
    return Clock(np.arange(len(count)), time_ns, tuple(notes), fps is not None)


def _far(count: Indices) -> list[str]:
    """A note where frame numbers leap so far that it is another thing than frames left out."""
    steps = np.diff(count)
    if not len(steps) or steps.max() <= 1000 * max(np.median(steps), 1):
        return []
    at = int(np.argmax(steps))
    return [Note(f"frame numbers leap from {count[at]} to {count[at + 1]}", "time")]


def _by_stamps(
    stamps: Stamps,
    read: Numbers,
    path: Path,
    numbers: Indices | None,
    rate: float | None,
    given_unit: TimeUnit | None,
    notes: list[str],
) -> Clock:
    values, missing = read.values, read.missing
    step = typical_step(values, missing)
    known = values[~missing]
    unit, note = _unit(stamps, step, known, rate, given_unit, read.unit, path)
    notes += [note] if note else []
    if unit == "frame":
        clock = _by_rate(values.astype(np.int64), path, rate or DEFAULT_FPS, notes)
        return clock._replace(stated=rate is not None)
    factor = UNIT_NS[unit]
    time_ns, beyond = _checked_ns(values, factor, missing, path, stamps.name)
    missing = missing | beyond
    if rate is not None and len(values) > 1 and not 0.8 < rate * step * factor * 1e-9 < 1.25:
        text = (
            f"fps is {rate:g} in the file, {stamps.name} makes"
            f" {1e9 / (step * factor):.4g} frames/s: taken as {stamps.name} says"
        )
        notes.append(Note(text, "time"))
    made: Repaired = repaired(time_ns, missing, step * factor, numbers, stamps.name, path)
    return Clock(made.rows, made.time_ns, (*notes, *made.notes), True)


def _numbers(stamps: Stamps, n: int, path: Path, rate: float | None) -> Numbers:
    """The stamps as numbers, one a frame or one alone."""
    try:
        read = as_numbers(stamps.values, rate)
    except NotTimeError as error:
        place = "" if error.frame is None else f"{stamps.place(error.frame)}: "
        raise InputError(f"{place}{stamps.name} {error.problem} ({_CURE})", path) from None
    values = read.values
    if values.ndim == 2 and 1 in values.shape:
        read = read._replace(values=values.ravel(), missing=read.missing.ravel())
    if n == 1 and read.values.ndim == 0:
        read = read._replace(values=read.values[None], missing=read.missing[None])
    if read.values.ndim and read.values.shape != (n,):
        shape = f"{len(read.values)} stamps" if read.values.ndim == 1 else f"shape {values.shape}"
        raise InputError(f"{stamps.name} has {shape} for {n} frames ({_CURE})", path)
    return read


def _useless(read: Numbers, n: int, name: str) -> str:
    """Why stamps say nothing of time, or ""."""
    known = read.values[~read.missing]
    if not known.size:
        return f"{name} is missing in every frame"
    if n == 1:
        return ""
    if known.size == 1:
        return f"{name} is missing in all frames but one"
    if known.min() == known.max():
        return Note(f"{name} is the same in every frame ({known[0]:g})", "time")
    return ""


def _unit(
    stamps: Stamps,
    step: float,
    known: NDArray[Any],
    rate: float | None,
    given: TimeUnit | None,
    written: TimeUnit | None,
    path: Path,
) -> tuple[TimeUnit | Literal["frame"], str]:
    """The unit of stamps that go up by `step` a frame, and what to say of it."""
    stated = given or written or stamps.unit
    if stated is not None and (given or written or stated == "frame" or not step > 0):
        return stated, ""
    name = stamps.name
    whole = bool((known == np.round(known)).all())
    if not step > 0:
        return of_date(float(known[0])) or "s", ""
    if stated is not None and LEAST <= _fps(step, stated) <= MOST:
        return stated, ""
    found = _of_rate(step, rate, whole)
    if found is None and whole and step == 1 and (stated is None or stated in ("us", "ns")):
        found = "frame"
    date = of_date(float(np.median(known)))
    if found is None and date is not None and LEAST <= _fps(step, date) <= MOST:
        found = date
    if found is None:
        usual = [u for u in UNIT_NS if SLOWEST <= _fps(step, u) < FASTEST * (1 + 1e-9)]
        found = usual[-1] if usual else None
    if found is None and stated is not None and _fps(step, stated) < LEAST:
        # few frames with long gaps, as are found in clips of single pictures
        return stated, Note(f"{name} in {stated} makes {_fps(step, stated):.3g} frames/s", "time")
    if found is None:
        raise InputError(
            f"{name} goes up by {step:.4g} a frame, in no unit 1 to 1000 frames/s ({_CURE},"
            " --time-unit s|ms|us|ns says what they are)",
            path,
        )
    if found == "frame":
        at = "at the file's rate" if rate else f"{DEFAULT_FPS:g} frames/s assumed"
        return found, f"{name} counts frames: {at} (--fps, or --time-unit)"
    if stated is not None:
        text = (
            f"{name} in {stated} would make {_fps(step, stated):.3g} frames/s: read as {found},"
            f" {_fps(step, found):.4g} frames/s (--time-unit {stated} takes it at its word)"
        )
        return found, Note(text, "time")
    if found == "s":
        return found, ""
    why = "by the step between frames" if found != date else "by its date"
    doubt = ", or counts every other frame (--fps)" if whole and step in (2, 3) else ""
    return found, f"{name} read as {found}, {why}: {_fps(step, found):.4g} frames/s{doubt}"


def _fps(step: float, unit: TimeUnit) -> float:
    return 1e9 / (step * UNIT_NS[unit])


def _of_rate(step: float, rate: float | None, whole: bool) -> TimeUnit | Literal["frame"] | None:
    """The unit in which the step agrees with a stated rate."""
    if rate is None:
        return None
    fitting = [u for u in UNIT_NS if 0.8 < _fps(step, u) / rate < 1.25]
    if fitting:
        return fitting[0]
    return "frame" if whole and step == 1 else None


def of_date(value: float) -> TimeUnit | None:
    """The unit in which a value is a time of today, counted from 1970."""
    for unit, factor in UNIT_NS.items():
        if _EPOCH_S[0] < value * factor * 1e-9 < _EPOCH_S[1]:
            return unit
    return None


def _start_ns(read: Numbers, given: TimeUnit | None) -> int:
    """A single stamp [ns]; 0 where it says nothing."""
    value = read.values[()]
    if read.missing[()]:
        return 0
    unit = given or read.unit or of_date(float(value)) or "s"
    whole = read.values.dtype.kind == "i"
    ns = int(value) * UNIT_NS[unit] if whole else int(float(value) * UNIT_NS[unit])
    return ns if abs(ns) < MAX_NS else 0


def _checked_ns(
    values: NDArray[Any], factor: int, missing: NDArray[np.bool_], path: Path, name: str
) -> tuple[Indices, NDArray[np.bool_]]:
    """Values as int64 nanoseconds, and which of them are beyond `MAX_NS`."""
    limit = MAX_NS // factor
    beyond = ~missing & ~((values < limit) & (values > -limit))
    if (beyond | missing).all():
        raise InputError(f"{name} is too large for a time ({_CURE})", path)
    safe = np.where(beyond | missing, 0, values)
    if safe.dtype.kind == "i":
        return np.asarray(safe, dtype=np.int64) * factor, beyond
    # the order of the factors is that of all recordings so far
    return np.round(safe * (factor * 1e-9) * 1e9).astype(np.int64), beyond


def _file_rate(fps: float, path: Path, stamps: bool, notes: list[str]) -> float | None:
    """The rate a file states; unusable is an error, beside stamps only a note."""
    if FPS_RANGE[0] <= fps <= FPS_RANGE[1]:
        return fps
    problem = f"fps is {fps:g}, expected a number above 0, at most {FPS_RANGE[1]:g}"
    if not stamps:
        raise InputError(f"{problem} (--fps N says it)", path)
    notes.append(f"{problem}: not used")
    return None
