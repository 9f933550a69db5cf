"""Hands into a running viewer, as they come or in the time in which they were recorded."""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

import numpy as np

from handtrack.errors import HandtrackError, SettingsError
from handtrack.hand.limits import Limits
from handtrack.recording.hand_log import HandLog
from handtrack.recording.rerun_log import APPLICATION
from handtrack.recording.shown import Shown, origin_ns
from handtrack.recording.viewer import answers
from handtrack.recording.window import rows

if TYPE_CHECKING:
    import rerun as rr
    import rerun.blueprint as rrb

DEFAULT_ADDRESS = "rerun+http://127.0.0.1:9876/proxy"
"""Where a viewer that was started by `rerun` takes data."""
TICK_S = 1 / 30
"""How often a part is sent: the cost is per call, not per frame."""
_FLUSH_S = 10.0


@contextmanager
def connected(address: str, arranged: rrb.Blueprint) -> Iterator[rr.RecordingStream]:
    """A recording whose content goes to a viewer.

    Args:
        address: the viewer's, as "rerun+http://127.0.0.1:9876/proxy", or HOST:PORT.
        arranged: how it is to be shown.

    Raises:
        SettingsError: that is no address.
        HandtrackError: no viewer answers there, or it stopped listening.
    """
    import rerun as rr

    found = re.fullmatch(r"(?:rerun\+https?://)?([^/:]+):(\d{1,5})(?:/proxy)?", address)
    if found is None:
        raise SettingsError(f"{address} is no address of a viewer, expected HOST:PORT")
    host, port = found[1], int(found[2])
    if not answers(host, port):
        raise HandtrackError(f"no viewer answers at {host}:{port}: start one with `rerun`")
    url = address if address.startswith("rerun") else f"rerun+http://{host}:{port}"
    recording = rr.RecordingStream(APPLICATION)
    recording.connect_grpc(url if url.endswith("/proxy") else f"{url}/proxy")
    try:
        recording.send_blueprint(arranged)
        yield recording
        try:
            recording.flush(timeout_sec=_FLUSH_S)
        except (RuntimeError, TimeoutError, ValueError) as error:
            raise HandtrackError(f"the viewer at {host}:{port} takes no more: {error}") from error
    finally:
        recording.disconnect()


def stream(
    recording: rr.RecordingStream,
    hands: Sequence[Shown],
    speed: float,
    *,
    mesh: bool = True,
    limits: Limits | None = None,
    going_on: Callable[[], bool] = lambda: True,
) -> None:
    """Send hands in the time in which they were recorded, or so many times as fast.

    A frame is sent when its time has come, with all others that are due, 30 times a second.

    Args:
        recording: where to.
        hands: what to send.
        speed: 1 for recorded time, 2 for twice as fast.
        mesh, limits: as in `HandLog`.
        going_on: False ends it.

    Raises:
        SettingsError: the speed is not positive.
    """
    if not 0 < speed < np.inf:
        raise SettingsError(f"the speed is {speed:g}, expected more than 0")
    origin = origin_ns([hand.track for hand in hands])
    logs = [HandLog(recording, hand, origin, mesh, limits) for hand in hands]
    for log in logs:
        log.begin()
    known = [hand.track.time_ns for hand in hands if len(hand.track)]
    if not known:
        return
    first, last = min(int(t[0]) for t in known), max(int(t[-1]) for t in known)
    sent = [0] * len(hands)
    began = time.monotonic()
    while going_on():
        now = first + (time.monotonic() - began) * speed * 1e9
        for i, (log, hand) in enumerate(zip(logs, hands, strict=True)):
            due = int(np.searchsorted(hand.track.time_ns, now, "right"))
            if due > sent[i]:
                log.add(rows(hand.track, slice(sent[i], due)))
                sent[i] = due
        if now >= last:
            return
        time.sleep(TICK_S)
