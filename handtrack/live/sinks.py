"""Where tracked frames go as they come: into a recording, into a viewer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import HANDS, Hand
from handtrack.mcap.hand import Event, Head
from handtrack.recording.recorder import McapRecorder
from handtrack.recording.settings import RecordingSettings
from handtrack.tracking.block import EventsOf
from handtrack.tracking.frame import TrackedFrame, stretch_of_frames
from handtrack.tracking.tracker import Tracker
from handtrack.video.media import Picture
from handtrack.viewer.live_viewer import LiveViewer

Array = NDArray[np.float64]

NAME, CALIBRATED = "live", "live calibrated"
RECORD_NS = 300_000_000
"""So much time waits to be written together [ns]."""
CAMERA = "camera"
"""The name of a camera's pictures in the viewer."""


class Sink(Protocol):
    """Where tracked frames go: a recording, a viewer."""

    def take(self, frame: TrackedFrame, tracker: Tracker, index: int) -> None:
        """The next frame of the tracker's hand."""

    def say(self, hand: Hand, event: Event) -> None:
        """Something happened to a hand."""


class RecorderSink:
    """Into an MCAP recording, a fraction of a second at a time; a context manager.

    Both hands have their places in it from the beginning, before and after they are calibrated,
    as a hand in a recording does not change; one that never comes takes none.
    """

    def __init__(
        self,
        path: Path,
        source: str,
        recording: RecordingSettings,
        config: Mapping[str, Any] | None = None,
    ) -> None:
        """Args:
        path, recording: as of `McapRecorder`.
        source: what is tracked.
        config: the file of options that was used, to be told among the settings.
        """
        self._source, self._config = source, config or {}
        self._waiting: dict[Hand, list[tuple[TrackedFrame, int]]] = {}
        self._trackers: dict[Hand, Tracker] = {}
        self._happened: dict[Hand, EventsOf] = {}
        self._events: dict[Hand, list[Event]] = {}
        self._names = dict.fromkeys(HANDS, NAME)
        hands = [(name, hand) for name in (NAME, CALIBRATED) for hand in HANDS]
        self._recorder = McapRecorder(path, hands=hands, recording=recording)

    def take(self, frame: TrackedFrame, tracker: Tracker, index: int) -> None:
        hand = tracker.model.hand
        waiting = self._waiting.setdefault(hand, [])
        if self._trackers.get(hand, tracker) is not tracker:
            # what was said is about the new hand
            said = self._events.pop(hand, [])
            if waiting:
                self._write(hand)
            self._events[hand] = said
            self._names[hand] = CALIBRATED
            waiting = self._waiting[hand] = []
        waiting.append((frame, index))
        self._trackers[hand] = tracker
        if frame.time_ns - waiting[0][0].time_ns >= RECORD_NS:
            self._write(hand)

    def say(self, hand: Hand, event: Event) -> None:
        self._events.setdefault(hand, []).append(event)

    def _write(self, hand: Hand) -> None:
        frames = [frame for frame, _ in self._waiting[hand]]
        tracker = self._trackers[hand]
        model = tracker.model
        settings = {**tracker.settings, "limits": model.limits.name, "model": model.name}
        if self._config:
            settings["config"] = dict(self._config)
        part = stretch_of_frames(
            frames,
            Head.of(model, self._names[hand], settings, source=self._source),
            [index for _, index in self._waiting[hand]],
        )
        happened = self._happened.setdefault(hand, EventsOf())(part)
        part = replace(part, events=(*self._events.pop(hand, []), *happened))
        self._waiting[hand] = []
        later = len(HANDS) * (self._names[hand] == CALIBRATED)
        self._recorder.add(part, HANDS.index(hand) + later)

    def __enter__(self) -> RecorderSink:
        return self

    def __exit__(self, kind: type[BaseException] | None, *rest: Any) -> None:
        with self._recorder:
            for hand, waiting in self._waiting.items():
                if waiting and not self._recorder.closed:
                    self._write(hand)
            if kind is not None:
                self._recorder.stop()


class ViewerSink:
    """Into a `LiveViewer`."""

    def __init__(self, viewer: LiveViewer) -> None:
        self._viewer = viewer

    def see(self, picture: Picture, joints: dict[Hand, Array]) -> None:
        """What the camera sees."""
        from handtrack.video.viewer_pictures import jpeg_of, scale_of

        scale = scale_of(picture.rgb.shape[1])
        self._viewer.picture(
            CAMERA,
            lambda: jpeg_of(picture.rgb),
            picture.time_ns,
            picture.index,
            {hand: scale * image for hand, image in joints.items()},
        )

    def take(self, frame: TrackedFrame, tracker: Tracker, index: int) -> None:
        self._viewer.step(frame, tracker)

    def say(self, hand: Hand, event: Event) -> None: ...
