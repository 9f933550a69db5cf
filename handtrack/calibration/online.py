"""A subject's hand from frames as they come."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.calibration.calibrate import Calibration, calibrate
from handtrack.calibration.material import MIN_SEEN
from handtrack.calibration.settings import MIN_FRAMES
from handtrack.errors import InputError, SettingsError
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

LOOKS_S = (2.0, 5.0, 10.0)
"""After how much of a hand has been seen it is calibrated [s]; the last time is final."""
# a pause is not a time in which a hand was seen
_LONGEST_NS = 100_000_000


class OnlineCalibration:
    """Starts from the prior, improves over the first seconds, then stays.

    It depends on the frames alone, so that the same stream gives the same hand: that of
    `calibrate` on the frames so far. A calibration takes some tenths of a second.

        online = OnlineCalibration(model)
        for joints, time_ns in frames:
            if found := online.take(joints, time_ns):
                tracker = Tracker(found.model)
            frame = tracker.step(joints, time_ns)

    Attributes:
        model: the hand so far.
        said: (time [ns], one line) of each moment at which it changed.
        frozen: it will not change any more.
    """

    def __init__(self, model: HandModel, looks_s: tuple[float, ...] = LOOKS_S):
        """Args:
        model: the prior.
        looks_s: after how many seconds of the hand to calibrate, increasing.

        Raises:
            SettingsError: looks_s do not increase from above 0.
        """
        if not looks_s or any(b <= a for a, b in zip((0.0, *looks_s), looks_s, strict=False)):
            raise SettingsError(f"looks_s is {looks_s}, expected increasing times above 0 s")
        self._prior = model
        self._looks_ns = [round(look * 1e9) for look in looks_s]
        self.reset()

    def reset(self) -> None:
        """Forget the frames, and the hand."""
        self.model = self._prior
        self.said: list[tuple[int, str]] = []
        self._times: list[int] = []
        self._joints: list[Array] = []
        self._confidence: list[Array] = []
        self._seen_ns = self._done = 0

    @property
    def frozen(self) -> bool:
        """Whether the last look has been taken."""
        return self._done == len(self._looks_ns)

    def take(
        self, joints: ArrayLike, time_ns: int, confidence: ArrayLike | None = None
    ) -> Calibration | None:
        """Take in a frame.

        Args:
            joints: (21, 3) [m]; NaN = missing. Frames with fewer than 12 joints do not count.
            time_ns: its time [ns], after the last frame's.
            confidence: (21,) in 0..1; 1 by default.

        Returns:
            The new calibration where this frame brings one, else None.

        Raises:
            InputError: wrong shapes or values, or time that does not increase.
        """
        if self.frozen:
            return None
        given = np.array(joints, dtype=np.float64)
        if given.shape != (N_JOINTS, 3):
            raise InputError(f"joints have shape {given.shape}, expected (21, 3)")
        if self._times and time_ns <= self._times[-1]:
            raise InputError(f"time does not increase: {self._times[-1]} ns and then {time_ns} ns")
        if np.isfinite(given).all(1).sum() < MIN_SEEN:
            return None
        if self._times:
            self._seen_ns += min(time_ns - self._times[-1], _LONGEST_NS)
        weights = np.ones(N_JOINTS) if confidence is None else np.array(confidence, np.float64)
        self._times.append(int(time_ns))
        self._joints.append(given)
        self._confidence.append(weights)
        if self._seen_ns < self._looks_ns[self._done] or len(self._times) < MIN_FRAMES:
            return None
        self._done += 1
        sequence = Sequence(
            time_ns=np.array(self._times),
            joints=np.array(self._joints),
            confidence=np.array(self._confidence),
            hand=self._prior.hand,
        )
        found = calibrate(self._prior, sequence)
        self.model = found.model
        last = self._done == len(self._looks_ns)
        until = "for good" if last else "for now"
        self.said.append(
            (int(time_ns), f"hand calibrated {until}, from {self._seen_ns * 1e-9:.1f} s of it")
        )
        if last:
            self._times, self._joints, self._confidence = [], [], []
        return found
