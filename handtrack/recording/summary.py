"""The numbers at the end of a recording, from which `info` tells a large file in no time."""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from typing import Annotated, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import shown
from handtrack.files.long_arrays import ROWS, blocks
from handtrack.hand.skeleton import Hand
from handtrack.mcap.hand import Head
from handtrack.mcap.state import States
from handtrack.tracking.track import STATUSES, Part

SUMMARY = "handtrack.summary"

_PER_DECADE = 400

_Count = Annotated[int, msgspec.Meta(ge=0)]
_Length = Annotated[float, msgspec.Meta(ge=0)] | None


class _Errors(msgspec.Struct):
    """How far joints are from those fitted [mm]."""

    mean: _Length
    median: _Length
    p95: _Length
    max: _Length


class _Hand(msgspec.Struct):
    """What `HandSummary.values` gives."""

    name: str
    hand: Hand
    model: str
    frames: _Count
    fitted: _Count
    predicted: _Count
    lost: _Count
    events: _Count
    warnings: _Count
    first_ns: int | None
    last_ns: int | None
    fps: _Length
    error_mm: dict[str, _Errors]

    def __post_init__(self) -> None:
        if self.frames != self.fitted + self.predicted + self.lost:
            raise ValueError("the frames are not those fitted, predicted and lost")
        first, last = self.first_ns, self.last_ns
        if (first is None or last is None) if self.frames else (first, last) != (None, None):
            raise ValueError(f"{self.frames} frames, from {first} ns to {last} ns")
        if first is not None and last is not None and not -(2**63) <= first <= last < 2**63:
            raise ValueError(f"frames from {first} ns to {last} ns")


class _Summary(msgspec.Struct):
    """What `summary_record` writes as JSON."""

    hands: dict[str, _Hand]
    bytes: dict[str, _Count]
    metadata: dict[str, str]


class RunningSpread:
    """Mean, quantiles and maximum of many numbers, in memory that does not grow.

    Quantiles come from bins on a logarithmic scale and are right to 0.3 %.
    """

    def __init__(self) -> None:
        # 1e-9 and less to 1e9 and more
        self._bins = np.zeros(18 * _PER_DECADE, np.int64)
        self._sum, self._max, self.count = 0.0, 0.0, 0

    def add(self, values: NDArray[np.float64]) -> None:
        """Add numbers (n,), none negative; what is not finite is left out."""
        values = values[np.isfinite(values)]
        if not len(values):
            return
        with np.errstate(divide="ignore"):
            place = np.floor((np.log10(values) + 9) * _PER_DECADE)
        place = np.clip(place, 0, len(self._bins) - 1).astype(np.int64)
        self._bins += np.bincount(place, minlength=len(self._bins))
        with np.errstate(over="ignore"):
            self._sum += float(values.sum())
        self._max = max(self._max, float(values.max()))
        self.count += len(values)

    @property
    def mean(self) -> float | None:
        """None where nothing was added, or it is beyond all numbers."""
        return self._sum / self.count if self.count and np.isfinite(self._sum) else None

    @property
    def maximum(self) -> float | None:
        return self._max if self.count else None

    def quantile(self, part: float) -> float | None:
        """The number below which so large a part of them lies."""
        if not self.count:
            return None
        place = int(np.searchsorted(np.cumsum(self._bins), part * self.count))
        value = float(10.0 ** ((place + 0.5) / _PER_DECADE - 9))
        return min(value, self._max)


class HandSummary:
    """Counts and errors of one hand, gathered as its frames come."""

    def __init__(self, head: Head) -> None:
        self._head = head
        self._counts = dict.fromkeys(STATUSES, 0)
        self._events = dict.fromkeys(("info", "warning"), 0)
        self._errors = {"observed": RunningSpread(), "truth": RunningSpread()}
        self._intervals = RunningSpread()
        self._first: int | None = None
        self._last = 0

    def add(self, part: Part) -> None:
        """The next frames."""
        for event in part.events:
            self._events[event.level] = self._events.get(event.level, 0) + 1
        if not len(part):
            return
        for frames in blocks(len(part)):
            self._count(part if len(part) <= ROWS else _some(part, frames))
        times = part.time_ns
        if self._first is None:
            self._first = int(times[0])
        else:
            times = np.concatenate([[self._last], times])
        self._last = int(times[-1])
        # modulo 2^64, so right for every pair of int64
        self._intervals.add(np.diff(times.astype(np.uint64)).astype(np.float64))

    def _count(self, part: States) -> None:
        for status in STATUSES:
            self._counts[status] += int((part.status == status).sum())
        shown = part.landmarks_of(self._head.model)
        self._errors["observed"].add(_frame_errors(shown, part.observed))
        if part.truth is not None:
            self._errors["truth"].add(_frame_errors(part.fitted_joints, part.truth))

    def values(self) -> dict[str, Any]:
        """Plain values for JSON: counts, times [ns], rate [1/s], errors [mm]."""
        head, interval = self._head, self._intervals.quantile(0.5)
        return {
            "name": head.name,
            "hand": head.hand,
            "model": head.model.name,
            "frames": sum(self._counts.values()),
            **self._counts,
            "events": sum(self._events.values()),
            "warnings": self._events["warning"],
            "first_ns": self._first,
            "last_ns": None if self._first is None else self._last,
            "fps": None if not interval else 1e9 / interval,
            "error_mm": {name: _millimetres(s) for name, s in self._errors.items() if s.count},
        }


def _some(part: Part, frames: slice) -> States:
    arrays = part.arrays()
    cut: dict[str, Any] = {n: None if a is None else a[frames] for n, a in arrays.items()}
    return States(**cut)


def _frame_errors(fitted: NDArray[np.float64], joints: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) mean distance [m] over the joints of each frame that are there."""
    with np.errstate(invalid="ignore", over="ignore"):
        distance = np.linalg.norm(fitted - joints, axis=-1)
    there = np.isfinite(distance)
    count = there.sum(1)
    total = np.where(there, distance, 0.0).sum(1)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _millimetres(spread: RunningSpread) -> dict[str, float | None]:
    values = {
        "mean": spread.mean,
        "median": spread.quantile(0.5),
        "p95": spread.quantile(0.95),
        "max": spread.maximum,
    }
    return {name: _scaled(value) for name, value in values.items()}


def _scaled(metres: float | None) -> float | None:
    """In millimetres; None where that is beyond all numbers."""
    return None if metres is None or not np.isfinite(metres * 1e3) else metres * 1e3


def summary_record(
    hands: Mapping[str, Any], sizes: Mapping[str, int], metadata: Mapping[str, Mapping[str, str]]
) -> dict[str, str]:
    """The values of the metadata record `SUMMARY`, with a checksum of their own.

    Args:
        hands: values of every hand by its topic.
        sizes: bytes of every topic before compression.
        metadata: all other metadata records by name, whose checksums it holds.
    """
    checks = {name: _checksum(values) for name, values in metadata.items()}
    text = json.dumps({"hands": hands, "bytes": sizes, "metadata": checks})
    return {"json": text, "crc32": _checksum({"json": text})}


def read_summary(metadata: Mapping[str, Mapping[str, str]]) -> dict[str, Any]:
    """What `summary_record` made, from all metadata records of a file.

    Raises:
        ValueError: a record is damaged, or says what cannot be.
    """
    text = metadata[SUMMARY].get("json", "")
    if _checksum({"json": text}) != metadata[SUMMARY].get("crc32"):
        raise ValueError(f"the checksum of the metadata record {SUMMARY!r} differs")
    try:
        summary = msgspec.json.decode(text, type=_Summary)
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ValueError(f"the metadata record {SUMMARY!r}: {error}") from error
    others = {name: values for name, values in metadata.items() if name != SUMMARY}
    for name in {*others, *summary.metadata}:
        if name not in others or _checksum(others[name]) != summary.metadata.get(name):
            raise ValueError(f"the checksum of the metadata record {shown(name)!r} differs")
    values: dict[str, Any] = msgspec.to_builtins(summary)
    return values


def _checksum(values: Mapping[str, str]) -> str:
    return f"{zlib.crc32(json.dumps(dict(values), sort_keys=True).encode()):08x}"
