"""What the command line shows while it works: a bar, and that code is being compiled."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from handtrack.tracking.settings import TrackerSettings

COMPILING = "compiling {part}, once on this machine (about {seconds} s) ..."
STILL = "still compiling: {count} functions in {seconds:.0f} s"
_STILL_S = 10.0
"""So often while it lasts."""
_PARTS = (
    (("smoother.lag", "drift_smoother.lag"), "the smoother with a fixed lag", 15),
    (("smoother", "drift_smoother"), "the smoother", 15),
    (("drift",), "the filter of noise that lasts", 15),
    (
        (
            *("kalman", "filter", "motion_noise", "joint_noise", "motion_evidence"),
            *("measurement", "one_euro", "pose_information.information"),
        ),
        "the filter",
        15,
    ),
    (("li2021",), "the paper's updates", 10),
    (("image_fit", "pixel_objective"), "the fit to pictures", 10),
    (("collisions",), "the collisions", 5),
)
_FITTER = ("the fitter", 15)
_EVERY_S = 60.0
"""In a log a line so often says where the work is."""


def _part(module: str, function: str) -> tuple[str, int]:
    """Which part of the machine code a kernel is of, and about how long that compiles."""
    name = f"{module.rpartition('.')[2]}.{function}"
    found = ((part, s) for starts, part, s in _PARTS if name.startswith(starts))
    return next(found, _FITTER)


@contextmanager
def compiling_said(quiet: bool) -> Iterator[None]:
    """Say so, on one line for each part, when code is really compiled in the block; and every ten
    seconds that it goes on."""
    if quiet:
        yield
        return
    from numba.core import event

    events: Any = event

    class Listener(events.Listener):  # type: ignore[misc]
        def __init__(self) -> None:
            self.said: set[str] = set()
            self.within = 0
            self.functions: set[str] = set()
            self.start = self.told = 0.0

        def on_start(self, event: Any) -> None:
            of = event.data
            self._still(f"{of.get('module', '')}.{of.get('qualname', '')}")
            self.within += 1
            if self.within > 1:  # what a function calls is compiled with it
                return
            part, seconds = _part(str(of.get("module", "")), str(of.get("qualname", "")))
            # what a filter is made of belongs to the fitter, which stands before it
            if part not in self.said and not (part == _FITTER[0] and self.said):
                self.said.add(part)
                click.echo(COMPILING.format(part=part, seconds=seconds), err=True)

        def on_end(self, event: Any) -> None:
            self.within -= 1

        def _still(self, function: str) -> None:
            now = time.monotonic()
            if not self.functions:
                self.start = self.told = now
            self.functions.add(function)
            if now - self.told >= _STILL_S:
                self.told, so_far = now, {"count": len(self.functions), "seconds": now - self.start}
                click.echo(STILL.format(**so_far), err=True)

    listener = Listener()
    events.register("numba:run_pass", listener)
    try:
        yield
    finally:
        events.unregister("numba:run_pass", listener)


def warm_up(settings: TrackerSettings) -> None:
    """Have the machine code ready that tracking by these settings needs."""
    from handtrack.fitting import fit
    from handtrack.hand.model import HandModel
    from handtrack.tracking.tracker import Tracker

    hand = HandModel.default()
    tracker = Tracker(hand, settings=settings)
    tracker.push(hand.rest_joints, 0)
    tracker.finish()
    fit.warm_up()  # what calibration takes


class Progress:
    """Where the work is; this one shows nothing."""

    def frames(self, done: int) -> None:
        """So many frames of this sequence are done."""

    def next(self, frames: int) -> None:
        """A sequence of so many frames is done."""

    def says(self, what: str) -> None:
        """What is going on."""


class _Bar(Progress):
    """A progress bar."""

    def __init__(self, bar: Any, total: int, doing: str) -> None:
        self._bar, self._before = bar, 0
        self._task = bar.add_task(doing, total=total)

    def frames(self, done: int) -> None:
        self._bar.update(self._task, completed=self._before + done)

    def next(self, frames: int) -> None:
        self._before += frames
        self.frames(0)

    def says(self, what: str) -> None:
        self._bar.update(self._task, description=what)


class _Log(Progress):
    """A line a minute."""

    def __init__(self, total: int, doing: str) -> None:
        self._total, self._doing, self._before = total, doing, 0
        self._start = self._said = time.monotonic()

    def frames(self, done: int) -> None:
        now = time.monotonic()
        if now - self._said < _EVERY_S:
            return
        self._said, at = now, self._before + done
        of = f" of {self._total:,}" if self._total >= at else ""
        minutes, seconds = divmod(round(now - self._start), 60)
        click.echo(f"{self._doing}: {at:,}{of} frames in {minutes}:{seconds:02d} min", err=True)

    def next(self, frames: int) -> None:
        self._before += frames
        self.frames(0)

    def says(self, what: str) -> None:
        self._doing = what


@contextmanager
def progress_shown(total: int, quiet: bool, doing: str = "tracking") -> Iterator[Progress]:
    """A bar of so many frames on stderr for people at a terminal, a line a minute in a log."""
    if quiet:
        yield Progress()
        return
    if not sys.stderr.isatty():
        yield _Log(total, doing)
        return
    from rich.console import Console
    from rich.progress import Progress as Bars

    with Bars(console=Console(stderr=True), transient=True) as bars:
        yield _Bar(bars, total, doing)


_LEAST_S = 0.05
"""Less than that is not told."""
_began = time.perf_counter()


def begin() -> None:
    """A command begins now."""
    global _began
    _began = time.perf_counter()


class Times:
    """Seconds by what they were spent with; what is inside of something else counts once.

    What went before it was made, since the command began, is `starting`.
    """

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {"starting": time.perf_counter() - _began}
        self._inner = 0.0

    @contextmanager
    def during(self, what: str) -> Iterator[None]:
        """Count the time inside the block, without that of blocks in it."""
        start, before, self._inner = time.perf_counter(), self._inner, 0.0
        try:
            yield
        finally:
            spent = time.perf_counter() - start
            self.add(what, spent - self._inner)
            self._inner = before + spent

    def add(self, what: str, seconds: float) -> None:
        """Count seconds."""
        self.seconds[what] = self.seconds.get(what, 0.0) + seconds

    def move(self, seconds: float, source: str, to: str) -> None:
        """Count seconds of one thing as another's."""
        self.add(source, -seconds)
        self.add(to, seconds)

    @property
    def wall(self) -> float:
        """Since the command began [s]."""
        return time.perf_counter() - _began

    def to_dict(self) -> dict[str, float]:
        """All of them [s], and `total`; what is not named is `other`."""
        total = self.wall
        named = {what: round(spent, 3) for what, spent in self.seconds.items()}
        other = total - sum(self.seconds.values())
        return {**named, "other": round(max(other, 0.0), 3), "total": round(total, 3)}

    def said(self) -> str:
        """ "2.31 s: reading 0.21, fitting 1.60 ...", the longest first."""
        found = self.to_dict()
        total, rest = found.pop("total"), found.pop("other")
        parts = sorted(found.items(), key=lambda part: -part[1])
        told = ", ".join(f"{what} {spent:.2f}" for what, spent in parts if spent >= _LEAST_S)
        if rest >= _LEAST_S:
            told += f", the rest {rest:.2f}" if told else f"the rest {rest:.2f}"
        return f"{total:.2f} s{f': {told}' if told else ''}"
