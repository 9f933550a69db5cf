"""Tracking as it happens: pictures or joints come, hands are shown and recorded at once."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.calibrate import Calibration
from handtrack.calibration.online import OnlineCalibration
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import BONES, HANDS, N_JOINTS, Hand
from handtrack.live.lines import LiveFrame
from handtrack.live.sinks import Sink
from handtrack.live.sources import Newest
from handtrack.mcap.hand import Event
from handtrack.tracking.frame import TrackedFrame
from handtrack.tracking.tracker import Tracker
from handtrack.video.detector import Detector
from handtrack.video.hand_tracks import HandTracks
from handtrack.video.media import Picture

Array = NDArray[np.float64]

CALIBRATION_S = 4.0
"""So much of a hand is seen before it is calibrated [s]."""
AHEAD_S = 0.5
"""Frames that come so much sooner than they were seen come from a file [s]."""
MIN_BONES = 5
"""A hand's size is not taken from fewer bones."""


@dataclass
class LiveCount:
    """What came of a live session.

    Attributes:
        frames: how many were tracked.
        dropped: how many the source had to drop.
        seen: frames in which each hand was fitted.
        latency_s: from each frame's coming to its being recorded and shown [s].
        published_s: from each frame's coming to its being sent on [s].
        bad: lines that were wrong and left out.
    """

    frames: int = 0
    dropped: int = 0
    seen: dict[Hand, int] = field(default_factory=dict)
    latency_s: list[float] = field(default_factory=list)
    published_s: list[float] = field(default_factory=list)
    bad: int = 0

    def to_dict(self) -> dict[str, Any]:
        """As plain values; latencies in milliseconds."""
        median, p95 = _ms(self.latency_s)
        told: dict[str, Any] = {
            "frames": self.frames,
            "dropped": self.dropped,
            "bad": self.bad,
            "fitted": dict(self.seen),
            "latency_ms": {"median": median, "p95": p95},
        }
        if self.published_s:
            median, p95 = _ms(self.published_s)
            told["published"] = {"frames": len(self.published_s), "median": median, "p95": p95}
        return told

    @property
    def sentence(self) -> str:
        """All of it in one line."""
        total = self.frames + self.dropped
        share = f" ({100.0 * self.dropped / total:.1f} %)" if self.dropped else ""
        hands = ", ".join(f"{hand} hand in {n:,}" for hand, n in self.seen.items()) or "no hand"
        median, p95 = _ms(self.latency_s)
        late = f"; latency {median:.1f} ms, p95 {p95:.1f}" if self.frames else ""
        if self.published_s:
            median, p95 = _ms(self.published_s)
            late += f", to the publisher {median:.1f} ms, p95 {p95:.1f}"
        bad = f", {self.bad:,} bad" if self.bad else ""
        return f"{self.frames:,} frames, {self.dropped:,} dropped{share}{bad}: {hands}{late}"


def _ms(seconds: list[float]) -> tuple[float, float]:
    """Median and 95th percentile [ms]."""
    if not seconds:
        return 0.0, 0.0
    median, p95 = np.percentile(seconds, [50, 95])
    return round(1e3 * float(median), 2), round(1e3 * float(p95), 2)


def from_pictures(
    queue: Newest[Picture],
    detector: Detector,
    show: Callable[[Picture, dict[Hand, Array]], None] | None = None,
) -> Iterator[LiveFrame]:
    """The hands in pictures, as they come.

    Args:
        queue: where they wait.
        detector: what finds hands in them.
        show: is told each picture, and the joints (21, 2) of the hands in it [px].
    """
    tracks = HandTracks()
    for picture in queue:
        came = time.monotonic()
        found = tracks.named(tracks.add(detector.detect(picture.rgb, picture.time_ns)))
        seen = {hand: d for hand, d in found.items() if d.world is not None}
        if show is not None:
            show(picture, {hand: d.image for hand, d in found.items()})
        yield LiveFrame(
            picture.time_ns,
            picture.index,
            {hand: np.asarray(d.world) for hand, d in seen.items()},
            {hand: np.full(N_JOINTS, d.score) for hand, d in seen.items()},
            came,
        )


def run_live(
    frames: Iterable[LiveFrame],
    make_tracker: Callable[[Hand, float], Tracker],
    sinks: Iterable[Sink],
    *,
    recalibrated: Callable[[HandModel], Tracker] | None = None,
    waits: bool = False,
    dropped: Callable[[], int] = lambda: 0,
    publish: Callable[[TrackedFrame, Hand, int], None] | None = None,
) -> LiveCount:
    """Track frames as they come, until they end or Ctrl-C.

    A hand is tracked from when it is first seen well enough to tell its size; from then on a
    frame in which it is missing is one of its frames, too.

    Args:
        frames: they.
        make_tracker: makes a hand's tracker, for a hand whose bones are so many times as long
            as the default model's.
        sinks: where each tracked frame goes.
        recalibrated: makes the tracker of a hand that was calibrated, beside the tracking, from
            its first `CALIBRATION_S` seconds. None: the hand stays as it is made.
        waits: whether the source waits for the tracker: then frames that come sooner than they
            were seen, as from a file, wait for the calibrated hand.
        dropped: says how many frames the source dropped so far.
        publish: sends a frame on, before it goes anywhere else.
    """
    trackers: dict[Hand, Tracker] = {}
    waiting: dict[Hand, deque[tuple[int, float]]] = {hand: deque() for hand in HANDS}
    count = LiveCount()
    targets = list(sinks)

    def give(hand: Hand, tracked: Iterable[TrackedFrame]) -> None:
        """Frames that are final, of which a filter may have made them wait."""
        for one in tracked:
            count.seen[hand] = count.seen.get(hand, 0) + (one.status == "fitted")
            index, came = waiting[hand].popleft()
            if publish is not None:
                publish(one, hand, index)
                count.published_s.append(time.monotonic() - came)
            for sink in targets:
                sink.take(one, trackers[hand], index)

    def better(hand: Hand, time_ns: int, wait: bool) -> None:
        """The calibrated hand, once it is there, in place of the one before."""
        model = calibrations[hand].model(wait)
        if model is not None and recalibrated is not None:
            give(hand, trackers[hand].finish())
            trackers[hand] = recalibrated(model)
            text = f"hand calibrated for good, from {CALIBRATION_S:g} s of it"
            for sink in targets:
                sink.say(hand, Event(time_ns, "info", text))

    calibrations: dict[Hand, _Beside] = {}
    pace = _Pace()
    nothing, none = np.full((N_JOINTS, 3), np.nan), np.zeros(N_JOINTS)
    try:
        for frame in frames:
            for hand in HANDS:
                joints = frame.joints.get(hand)
                if hand not in trackers:
                    size = None if joints is None else size_of(joints, hand)
                    if size is None:
                        continue
                    trackers[hand] = make_tracker(hand, size)
                    if recalibrated is not None:
                        calibrations[hand] = _Beside(trackers[hand].model)
                seen = joints is not None
                if hand in calibrations:
                    if joints is not None:
                        calibrations[hand].take(joints, frame.time_ns, frame.confidence[hand])
                    better(hand, frame.time_ns, waits and pace.ahead(frame))
                waiting[hand].append((frame.index, frame.came))
                if frame.note:
                    for sink in targets:
                        sink.say(hand, Event(frame.time_ns, "warning", frame.note))
                new = trackers[hand].push(
                    nothing if joints is None else joints,
                    frame.time_ns,
                    frame.confidence[hand] if seen else none,
                )
                give(hand, new)
            count.frames += 1
            count.latency_s.append(time.monotonic() - frame.came)
    except KeyboardInterrupt:
        # how a user says that it is enough
        pass
    for hand, tracker in trackers.items():
        give(hand, tracker.finish())
    count.dropped = dropped()
    return count


class _Pace:
    """How fast frames come, beside how fast they were seen."""

    def __init__(self) -> None:
        self._first: LiveFrame | None = None

    def ahead(self, frame: LiveFrame) -> bool:
        """Whether the frame comes before the moment at which it was seen, as told by the first."""
        if self._first is None:
            self._first = frame
        seen_s = (frame.time_ns - self._first.time_ns) * 1e-9
        return seen_s > frame.came - self._first.came + AHEAD_S


class _Beside:
    """A hand's calibration in a thread of its own, so that no frame waits for it."""

    def __init__(self, prior: HandModel) -> None:
        self._online = OnlineCalibration(prior, looks_s=(CALIBRATION_S,))
        self._pool = ThreadPoolExecutor(1)
        self._asked: deque[Future[Calibration | None]] = deque()
        self._done = False

    def take(self, joints: Array, time_ns: int, confidence: Array) -> None:
        """The next frame."""
        if not self._done:
            self._asked.append(self._pool.submit(self._online.take, joints, time_ns, confidence))

    def model(self, wait: bool = False) -> HandModel | None:
        """The calibrated hand, once: when it has just been found; of all frames so far, or, not to
        wait, of those that are done."""
        while self._asked and (wait or self._asked[0].done()):
            found = self._asked.popleft().result()
            if found is not None and not self._done:
                self._done = True
                self._asked.clear()
                self._pool.shutdown(wait=False)
                return found.model
        return None


def size_of(joints: Array, hand: Hand) -> float | None:
    """How many times as large a hand (21, 3) is as the default one; None if hardly seen."""
    parent, child = np.array(BONES).T
    lengths = np.linalg.norm(joints[child] - joints[parent], axis=1)
    seen = np.isfinite(lengths)
    if seen.sum() < MIN_BONES:
        return None
    return float(np.median(lengths[seen] / HandModel.default(hand).bone_lengths[seen]))
