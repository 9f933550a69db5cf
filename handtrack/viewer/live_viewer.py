"""Hands into a running viewer, as they come or in the time in which they were recorded."""

from __future__ import annotations

import math
import re
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import HandtrackError, SettingsError
from handtrack.mcap.hand import Head
from handtrack.recording.parts import rows
from handtrack.tracking.track import Part
from handtrack.viewer import style
from handtrack.viewer.blueprint import Placed, blueprint, placed
from handtrack.viewer.eye import Seen, eye
from handtrack.viewer.hand_log import HandLog
from handtrack.viewer.key import log_key
from handtrack.viewer.picture_log import PictureView, log_pictures
from handtrack.viewer.process import answers, free_port, grpc_address, viewer, wait_for
from handtrack.viewer.rerun_log import application, logs_of
from handtrack.viewer.sending import forget_recordings, indexes, send_blueprint
from handtrack.viewer.shown import Shown, origin_ns, zero_of
from handtrack.viewer.style import Look

if TYPE_CHECKING:
    import rerun as rr

    from handtrack.tracking.frame import TrackedFrame
    from handtrack.tracking.tracker import Tracker

DEFAULT_ADDRESS = "rerun+http://127.0.0.1:9876/proxy"
"""Where a viewer that was started by `rerun` takes data."""
TICK_S = 1 / 30
"""How often a part is sent: the cost is per call, not per frame."""
_FLUSH_S = 10.0


@contextmanager
def connected(
    address: str, process: subprocess.Popen[bytes] | None = None, *, name: str = "live"
) -> Iterator[rr.RecordingStream]:
    """A recording whose content goes to a viewer.

    Args:
        address: the viewer's, as "rerun+http://127.0.0.1:9876/proxy", or HOST:PORT.
        process: the viewer's process, if it is ours: once that has ended nothing is sent.
        name: of what is shown; recordings of another name keep their layout.

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
    forget_recordings()
    recording = rr.RecordingStream(application(name))
    recording.connect_grpc(url if url.endswith("/proxy") else f"{url}/proxy")
    try:
        yield recording
        try:
            recording.flush(timeout_sec=_FLUSH_S)
        except (RuntimeError, TimeoutError, ValueError) as error:
            if process is None or process.poll() is None:
                raise HandtrackError(
                    f"the viewer at {host}:{port} takes no more: {error}"
                ) from error
    finally:
        recording.disconnect()


class LiveViewer:
    """A viewer that shows hands while they are tracked; a context manager.

        with LiveViewer() as viewer:
            for joints, time_ns in camera:
                viewer.step(tracker.step(joints, time_ns), tracker)

    What comes is sent 30 times a second, all that is there at once: a frame costs its share of
    a call. A viewer that is closed ends nothing: what follows is not shown.

    Args:
        connect: HOST:PORT of a viewer that runs already; "" for the one that `rerun` starts.
            None opens a window, which stays open until the block ends.
        mesh: show the skin.
        seen: joints that will come, as far as they are known: the viewer looks so that they
            are in view. Otherwise the eye goes along with the hand.
        light: draw on a light ground.
        pictures: names of cameras whose pictures will come.

    Raises:
        SettingsError: `connect` is no address.
        HandtrackError: there is no viewer, or none can be opened.
    """

    def __init__(
        self,
        connect: str | None = None,
        *,
        mesh: bool = True,
        seen: Sequence[Seen] = (),
        light: bool = False,
        pictures: Sequence[str] = (),
    ) -> None:
        self._connect, self._seen, self._pictures = connect, seen, pictures
        self._look = Look(mesh=mesh, light=light)
        self._stack = ExitStack()
        self._process: subprocess.Popen[bytes] | None = None
        self._recording: rr.RecordingStream | None = None
        self._hands: dict[str, HandLog] = {}
        self._shown: list[Shown] = []
        self._last: dict[str, Part] = {}
        self._origin: int | None = None
        self._began = False
        self._pictured = -math.inf
        self._views: set[str] = set()
        self._waiting: dict[str, list[tuple[TrackedFrame, Tracker, int]]] = {}
        self._counts: dict[str, int] = {}
        self._sent = -math.inf

    def __enter__(self) -> LiveViewer:
        with self._stack:
            address = self._connect or DEFAULT_ADDRESS
            if self._connect is None:
                port = free_port()
                window = viewer("--port", str(port), "--hide-welcome-screen")
                self._process = self._stack.enter_context(window)
                wait_for(self._process, port)
                address = grpc_address(port)
            self._recording = self._stack.enter_context(connected(address, self._process))
            self._stack = self._stack.pop_all()
        return self

    def __exit__(self, *error: Any) -> None:
        try:
            self.flush()
        finally:
            self._stack.close()

    @property
    def open(self) -> bool:
        """Whether the viewer is there, as far as that is known."""
        return self._process is None or self._process.poll() is None

    def step(self, frame: TrackedFrame, tracker: Tracker, name: str = "") -> None:
        """Show what `Tracker.step` said.

        Args:
            frame: its result.
            tracker: the tracker, for its model and settings.
            name: the hand's place in the viewer; "right" or "left" by default.
        """
        name = name or tracker.model.hand
        number = self._counts[name] = self._counts.get(name, 0) + 1
        self._waiting.setdefault(name, []).append((frame, tracker, number - 1))
        if time.monotonic() - self._sent >= TICK_S:
            self.flush()

    def flush(self) -> None:
        """Send what waits."""
        from handtrack.tracking.frame import stretch_of_frames

        for name, waiting in self._waiting.items():
            frames = [frame for frame, _, _ in waiting]
            tracker = waiting[0][1]
            numbers = [number for _, _, number in waiting]
            head = Head.of(tracker.model, name, tracker.settings)
            self.add(stretch_of_frames(frames, head, numbers), name)
        self._waiting.clear()
        self._sent = time.monotonic()

    def picture(
        self,
        name: str,
        jpeg: Callable[[], bytes],
        time_ns: int,
        index: int,
        joints: Mapping[str, NDArray[np.float64]],
    ) -> None:
        """Show what a camera sees; at most 15 a second are asked for and sent.

        Args:
            name: of the camera: one of those given at the beginning.
            jpeg: gives the picture as a JPEG file, when it is wanted.
            time_ns, index: its time, on the hands' clock, and its number.
            joints: of each hand that was seen in it, (21, 2) [px].
        """
        now = time.monotonic()
        if self._recording is None or not self.open or now - self._pictured < 2 * TICK_S:
            return
        self._pictured = now
        self._start(time_ns)
        times = np.array([index], np.int64), np.array([time_ns], np.int64)
        seen = {hand: {style.OBSERVED: points[None]} for hand, points in joints.items()}
        view = PictureView(name, times[1], times[0], lambda: iter([jpeg()]), seen)
        log_pictures(self._recording, [view], lambda f, t: indexes(f, t, self._origin), self._views)

    def _start(self, time_ns: int) -> None:
        """All is on the clock of what came first."""
        if not self._began:
            self._origin, self._began = zero_of([time_ns]), True

    def add(self, part: Part, name: str) -> None:
        """Show the next frames of the hand that is called so, in order of time."""
        if self._recording is None or not len(part) or not self.open:
            return
        if name not in self._hands:
            shown = Shown(part, name, number=len(self._shown))
            self._shown.append(shown)
            self._start(int(part.time_ns[0]))
            at = self._placed(part)
            arranged = blueprint(
                self._shown, self._look, follow=True, at=at, pictures=self._pictures
            )
            send_blueprint(self._recording, arranged)
            log_key(self._recording, self._shown, self._look.light)
            view = None if self._hands else at.view
            log = HandLog(self._recording, shown, self._origin, self._look, view)
            self._hands[name] = log
            log.begin()
        self._last[name] = part
        self._hands[name].add(part)

    def _placed(self, part: Part) -> Placed:
        """Where the eye is: it sees what will come, if that is known, with room if it is not."""
        if self._seen:
            return placed(self._shown, self._look, bool(self._pictures), seen=self._seen)
        seen = [Seen.of(hand) for hand in [*self._last.values(), part]]
        alone = len(seen) == 1
        return Placed(
            eye(seen, aspect=0.5, still=not alone, along=alone).farther(1.25 if alone else 1.6)
        )

    def wait(self) -> None:
        """Until the window is closed, or Ctrl-C; at once where the viewer is somebody else's."""
        self.flush()
        if self._process is not None:
            try:
                self._process.wait()
            except KeyboardInterrupt:
                # how a user says that it is enough
                return


def stream(
    recording: rr.RecordingStream,
    hands: Sequence[Shown],
    speed: float,
    look: Look | None = None,
    *,
    at: Placed | None = None,
    going_on: Callable[[], bool] = lambda: True,
) -> None:
    """Send hands in the time in which they were recorded, or so many times as fast.

    A frame is sent when its time has come, with all others that are due, 30 times a second.

    Args:
        recording: where to.
        hands: what to send.
        speed: 1 for recorded time, 2 for twice as fast.
        look: how.
        at: where the eye is, as the blueprint that was sent has it.
        going_on: False ends it.

    Raises:
        SettingsError: the speed is not positive.
    """
    if not 0 < speed < np.inf:
        raise SettingsError(f"the speed is {speed:g}, expected more than 0")
    origin = origin_ns([hand.track for hand in hands])
    logs = [
        log for log, _ in logs_of(recording, hands, look, (at or placed(hands, look)).view, origin)
    ]
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
