"""Times as they are written: numbers, dates, times of day, timecodes, pairs of ROS."""

from __future__ import annotations

import re
from collections.abc import Sequence as Items
from datetime import UTC, datetime
from itertools import pairwise
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

MISSING = {"", "nan", "na", "n/a", "null", "none", "nat", "-"}
_LARGEST = 2**62

_UNITS: dict[str, Literal["s", "ms", "us", "ns"]] = {
    "s": "s",
    "sec": "s",
    "ms": "ms",
    "us": "us",
    "µs": "us",
    "ns": "ns",
}
_NUMBER = re.compile(r"([-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:e[-+]?\d+)?)\s*(s|sec|ms|us|µs|ns)?")
_DAY = re.compile(
    r"(?:(?P<y>\d{4})[-/.](?P<m>\d{1,2})[-/.](?P<d>\d{1,2})"
    r"|(?P<a>\d{1,2})[-/.](?P<b>\d{1,2})[-/.](?P<year>\d{4}))[t ,]+"
)
_CLOCK = re.compile(
    r"(?:(?P<h>\d{1,3}):)?(?P<m>\d{1,2}):(?P<s>\d{1,2})(?:[.,](?P<f>\d{1,12}))?"
    r"\s*(?P<half>am|pm)?\s*(?P<zone>z|utc|gmt|[-+]\d{2}:?(?:\d{2})?)?"
)
_TIMECODE = re.compile(r"(\d{1,2}):(\d{2}):(\d{2})([:;.])(\d{2,3})")
_RATES = (24, 25, 30, 48, 50, 60, 100, 120, 240)
_SECONDS = ("sec", "secs", "seconds", "s")
_NANOS = ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds", "ns")


class NotTimeError(ValueError):
    """Something that is no time.

    Attributes:
        frame: where it is; None: everywhere.
        problem: what it is and what was expected.
    """

    def __init__(self, frame: int | None, problem: str) -> None:
        super().__init__(problem)
        self.frame, self.problem = frame, problem


class Numbers(NamedTuple):
    """Times as numbers.

    Attributes:
        values: (n,) or () of int64 or float64; 0 where missing.
        missing: the same shape.
        unit: where the way they are written says it.
    """

    values: NDArray[Any]
    missing: NDArray[np.bool_]
    unit: Literal["s", "ms", "us", "ns"] | None = None


def as_numbers(given: Any, rate: float | None) -> Numbers:
    """Times in any of the ways that `Stamps` allows, as numbers.

    Args:
        given: they.
        rate: frames per second, for timecodes; None: from the timecodes.

    Raises:
        NotTimeError: something in them is no time.
    """
    if isinstance(given, np.ndarray) or np.isscalar(given):
        array = np.asarray(given)
        if array.dtype.kind in "Mm":
            return _of_dates(array)
        if array.dtype.kind in "fiu":
            return _of_array(array)
        if array.dtype.kind == "S":
            array = np.char.decode(array, "utf-8", "replace")
        given = array.tolist()
    if not isinstance(given, list | tuple):
        given = [given]
        read = as_numbers(given, rate)
        return read._replace(values=read.values[0], missing=read.missing[0])
    return _of_list(given, rate)


def _of_dates(array: NDArray[Any]) -> Numbers:
    missing = np.isnat(array)
    unit = f"{array.dtype.kind}8[ns]"
    coarse = array.astype(f"{array.dtype.kind}8[s]").astype(np.int64)
    beyond = np.abs(coarse) > _LARGEST // 10**9
    missing = missing | beyond
    zero = np.zeros((), unit)
    return Numbers(np.where(missing, zero, array).astype(unit).astype(np.int64), missing, "ns")


def _of_array(array: NDArray[Any]) -> Numbers:
    if array.dtype.kind == "f":
        values = array.astype(np.float64)
        missing = ~np.isfinite(values)
        return _pairs(Numbers(np.where(missing, 0.0, values), missing))
    missing = np.zeros(array.shape, bool)
    if array.dtype.kind == "u":
        missing = array > _LARGEST
    else:
        array = array.astype(np.int64)
        missing = (array > _LARGEST) | (array < -_LARGEST)
    return _pairs(Numbers(np.where(missing, 0, array).astype(np.int64), missing))


def _pairs(read: Numbers) -> Numbers:
    """(n, 2) seconds and nanoseconds as nanoseconds; anything else as it is."""
    values = read.values
    if values.ndim != 2 or values.shape[1] != 2 or values.dtype.kind != "i":
        return read
    if not ((values[:, 1] >= 0) & (values[:, 1] < 10**9)).all():
        return read
    seconds = values[:, 0]
    beyond = np.abs(seconds) > _LARGEST // 10**9
    missing = read.missing.any(1) | beyond
    return Numbers(np.where(missing, 0, seconds) * 10**9 + values[:, 1], missing, "ns")


def _of_list(given: Items[Any], rate: float | None) -> Numbers:
    plain = _of_plain(given)
    if plain is not None:
        return plain
    present = [v for v in given if not _absent(v)]
    if any(isinstance(v, str) for v in present):
        texts = [None if _absent(v) else str(v).strip().lower() for v in given]
        return _of_texts(texts, rate)
    if any(isinstance(v, datetime) for v in present):
        return _of_texts([None if _absent(v) else str(v).lower() for v in given], rate)
    if any(isinstance(v, dict | list | tuple) for v in present):
        whole = [None if _absent(v) else _pair_ns(v, i) for i, v in enumerate(given)]
        return _whole(whole, "ns")
    for i, value in enumerate(given):
        if not _absent(value) and (
            isinstance(value, bool) or not isinstance(value, int | float | np.number)
        ):
            raise NotTimeError(i, f"is {str(value)[:40]!r}, expected a time")
    if all(isinstance(v, int | np.integer) for v in present):
        return _whole([None if _absent(v) else int(v) for v in given], None)
    values = np.array([np.nan if _absent(v) else _float(v) for v in given])
    return _of_array(values)


def _of_plain(given: Items[Any]) -> Numbers | None:
    """Numbers of one type and nothing else."""
    types = set(map(type, given))
    if types not in ({int}, {float}):
        return None
    try:
        values = np.array(given, np.int64 if types == {int} else np.float64)
    except OverflowError:
        return None
    if values.dtype.kind == "f":
        return _of_array(values)
    missing = (values > _LARGEST) | (values < -_LARGEST)
    return Numbers(np.where(missing, 0, values), missing)


def _float(value: Any) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("nan")


def _absent(value: Any) -> bool:
    if value is None or (isinstance(value, str) and value.strip().lower() in MISSING):
        return True
    return isinstance(value, float | np.floating) and not np.isfinite(value)


def _whole(values: Items[int | None], unit: Literal["s", "ms", "us", "ns"] | None) -> Numbers:
    """Whole numbers with all their digits; what 63 bits cannot hold is missing."""
    good = [v is not None and abs(v) <= _LARGEST for v in values]
    kept = [v if ok and v is not None else 0 for v, ok in zip(values, good, strict=True)]
    return Numbers(np.array(kept, dtype=np.int64), ~np.array(good, dtype=bool), unit)


def _pair_ns(value: Any, frame: int) -> int:
    """{"sec": 1, "nanosec": 5} or [1, 5] in nanoseconds."""
    parts: list[Any] = []
    if isinstance(value, dict):
        names = {str(k).lower(): v for k, v in value.items()}
        for keys in (_SECONDS, _NANOS):
            parts.append(next((names[k] for k in keys if k in names), None))
    elif isinstance(value, list | tuple) and len(value) == 2:
        parts = list(value)
    if len(parts) != 2 or not all(
        isinstance(p, int | float | np.number)
        and not isinstance(p, bool)
        and abs(float(p) if isinstance(p, np.number) else p) <= _LARGEST  # and no NaN
        for p in parts
    ):
        raise NotTimeError(frame, f"is {str(value)[:40]}, expected sec and nanosec")
    seconds = parts[0]
    whole = int(seconds) * 10**9 if seconds == int(seconds) else int(seconds * 1e9)
    return whole + int(parts[1])


def _of_texts(texts: Items[str | None], rate: float | None) -> Numbers:
    """Texts, all of them written in one way, which the first decides."""
    first = next(t for t in texts if t is not None)
    if _NUMBER.fullmatch(first):
        return _of_number_texts(texts)
    timecode = _TIMECODE.fullmatch(first)
    # HH:MM:SS.mmm is a time of day, HH:MM:SS:FF and HH:MM:SS;FF and .FF among them a timecode
    if timecode is not None and timecode[4] != ".":
        return _of_timecodes(texts, rate)
    values: list[int | None] = []
    for i, text in enumerate(texts):
        values.append(None if text is None else _moment_ns(text))
        if text is not None and values[-1] is None:
            like = "" if text == first else f" like {first[:40]!r}"
            raise NotTimeError(i, f"is {text[:40]!r}, expected a time{like}")
    return _whole(values, "ns")


def _of_number_texts(texts: Items[str | None]) -> Numbers:
    values: list[Any] = []
    units: set[str | None] = set()
    for i, text in enumerate(texts):
        match = None if text is None else _NUMBER.fullmatch(text)
        if text is not None and match is None:
            raise NotTimeError(i, f"is {text[:40]!r}, expected a number")
        if match is None:
            values.append(None)
            continue
        units.add(match[2])
        digits = match[1].replace(",", ".")
        # nanoseconds of today do not fit in a float
        values.append(int(digits) if re.fullmatch(r"[-+]?\d{1,30}", digits) else float(digits))
    if len(units) > 1:
        raise NotTimeError(None, "has a unit in some frames and another or none in others")
    read = _of_list(values, None)
    unit = units.pop()
    return read._replace(unit=None if unit is None else _UNITS[unit])


def _moment_ns(text: str) -> int | None:
    """A date with a time, or a time of day, in nanoseconds; None: it is none."""
    day = _DAY.match(text)
    clock = _CLOCK.fullmatch(text[day.end() :] if day else text)
    if clock is None:
        return None
    seconds = int(clock["h"] or 0) * 3600 + int(clock["m"]) * 60 + int(clock["s"])
    if clock["half"]:
        seconds += 3600 * (12 * (clock["half"] == "pm") - 12 * (int(clock["h"] or 0) == 12))
    if clock["zone"] and clock["zone"][0] in "+-":
        digits = clock["zone"][1:].replace(":", "").ljust(4, "0")
        offset = int(digits[:2]) * 3600 + int(digits[2:]) * 60
        seconds -= offset if clock["zone"][0] == "+" else -offset
    if day is not None:
        try:
            seconds += int(_midnight(day).timestamp())
        except (ValueError, OverflowError):
            return None
    return seconds * 10**9 + int((clock["f"] or "0")[:9].ljust(9, "0"))


def _midnight(day: re.Match[str]) -> datetime:
    if day["y"]:
        return datetime(int(day["y"]), int(day["m"]), int(day["d"]), tzinfo=UTC)
    a, b = int(day["a"]), int(day["b"])
    # day and month cannot always be told apart; within a clip it makes no difference
    month, of_month = (b, a) if b <= 12 else (a, b)
    return datetime(int(day["year"]), month, of_month, tzinfo=UTC)


def _of_timecodes(texts: Items[str | None], rate: float | None) -> Numbers:
    """SMPTE timecodes; with ";" numbers are dropped so that 29.97 frames/s keep pace."""
    parts: list[tuple[int, ...] | None] = []
    drop = False
    for i, text in enumerate(texts):
        match = None if text is None else _TIMECODE.fullmatch(text)
        if text is not None and match is None:
            raise NotTimeError(i, f"is {text[:40]!r}, expected a timecode HH:MM:SS:FF")
        drop = drop or (match is not None and match[4] == ";")
        parts.append(None if match is None else tuple(int(match[k]) for k in (1, 2, 3, 5)))
    largest = max(p[3] for p in parts if p is not None)
    nominal = round(rate) if rate is not None and rate > largest else None
    nominal = nominal or next((r for r in _RATES if r > largest and (r >= 30 or not drop)), 1000)
    if rate is None or round(rate) != nominal:
        # the frames of a second are only known where one was full
        full = any(a and b and a[2] != b[2] for a, b in pairwise(parts))
        nominal = nominal if full or nominal >= 30 else 30
        rate = nominal / 1.001 if drop else float(nominal)
    values: list[int | None] = []
    for part in parts:
        if part is None:
            values.append(None)
            continue
        hours, minutes, seconds, frame = part
        total = nominal * (3600 * hours + 60 * minutes + seconds) + frame
        if drop:
            passed = 60 * hours + minutes
            total -= round(nominal / 15) * (passed - passed // 10)
        values.append(round(total / rate * 1e9))
    return _whole(values, "ns")
