"""What the command line shows while it works: a bar, and that code is being compiled."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from handtrack.tracking.settings import TrackerSettings

COMPILING = "compiling the fitter, once on this machine (about 15 s) ..."


@contextmanager
def compiling_said(quiet: bool) -> Iterator[None]:
    """Say so, once and on one line, when code is really being compiled inside the block."""
    if quiet:
        yield
        return
    from numba.core import event

    events: Any = event

    class Listener(events.Listener):  # type: ignore[misc]
        said = False

        def on_start(self, event: Any) -> None:
            if not self.said:
                self.said = True
                click.echo(COMPILING, err=True)

        def on_end(self, event: Any) -> None: ...

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


@contextmanager
def progress_shown(total: int, quiet: bool, doing: str = "tracking") -> Iterator[Progress]:
    """A bar of so many frames on stderr, for people at a terminal."""
    if quiet or not sys.stderr.isatty():
        yield Progress()
        return
    from rich.console import Console
    from rich.progress import Progress as Bars

    with Bars(console=Console(stderr=True), transient=True) as bars:
        yield _Bar(bars, total, doing)
