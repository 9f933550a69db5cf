"""What `track --live` shows."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from handtrack.errors import SettingsError

if TYPE_CHECKING:
    from handtrack import Sequence
    from handtrack.mcap.state import Stretch

_Command = TypeVar("_Command", bound=Callable[..., Any])
connect_option = click.option(
    "--connect",
    metavar="[HOST:PORT]",
    is_flag=False,
    flag_value="",
    help="Send to a viewer that runs already, by default on this machine.",
)


def live_options(command: _Command) -> _Command:
    """Give a command the options that `live_view` takes."""
    command = connect_option(command)
    return click.option("--live", is_flag=True, help="Show the hand while it is tracked.")(command)


class Live:
    """Shows nothing.

    Attributes:
        seconds: time spent with showing [s].
    """

    seconds = 0.0

    def parts(
        self, sequence: Sequence, record: Callable[[Stretch], None]
    ) -> Callable[[Stretch], None]:
        """What gets the parts of a sequence's track: they are recorded, and shown."""
        return record

    def wait(self, quiet: bool) -> None:
        """Until the viewer is closed."""


class _Viewer(Live):
    """Shows what is tracked in a viewer, until the command ends."""

    def __init__(self, connect: str | None, sequences: list[Sequence], mesh: bool) -> None:
        from handtrack.mcap.hand import hand_topics
        from handtrack.viewer.eye import Seen
        from handtrack.viewer.live_viewer import LiveViewer

        # of a viewer that was closed rerun would complain line by line
        os.environ.setdefault("RUST_LOG", "off")
        names = hand_topics((s.name, s.hand) for s in sequences)
        # hands that were put back are sequences anew
        self._names = {(s.name, s.hand): n for s, n in zip(sequences, names, strict=True)}
        self._own = connect is None
        seen = [Seen(s.hand, s.joints) for s in sequences]
        viewer = LiveViewer(connect, mesh=mesh, seen=seen)
        self._viewer: Any = click.get_current_context().with_resource(viewer)

    def parts(
        self, sequence: Sequence, record: Callable[[Stretch], None]
    ) -> Callable[[Stretch], None]:
        name = self._names[sequence.name, sequence.hand]

        def both(part: Stretch) -> None:
            record(part)
            start = time.perf_counter()
            self._viewer.add(part, name)
            self.seconds += time.perf_counter() - start

        return both

    def wait(self, quiet: bool) -> None:
        if self._own and self._viewer.open and not quiet:
            click.echo("the viewer stays until its window is closed; Ctrl-C ends it", err=True)
        self._viewer.wait()


def check_live(live: bool, connect: str | None) -> None:
    """Whether the values of `live_options` go together.

    Raises:
        SettingsError: `connect` is given without `live`.
    """
    if connect is not None and not live:
        raise SettingsError("--connect belongs to --live")


def live_view(live: bool, connect: str | None, sequences: list[Sequence], mesh: bool) -> Live:
    """What shows the hands that are tracked.

    Args:
        live, connect: the values of `live_options`.
        sequences: all that will be tracked.
        mesh: show the skin.

    Raises:
        SettingsError: `connect` is no address.
        HandtrackError: there is no viewer, or none can be opened.
    """
    if not live:
        return Live()
    return _Viewer(connect, sequences, mesh)
