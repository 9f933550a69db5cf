"""Blocks: frames of a hand, one after another, as arrays, on their way from fit to recorder."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.files.long_arrays import Growing, GrowingTexts
from handtrack.fitting import solver
from handtrack.hand.skeleton import N_JOINTS
from handtrack.kernels.workspace import RESULT, Records
from handtrack.mcap.hand import Event, Head
from handtrack.mcap.state import Stretch
from handtrack.tracking.frame import TrackedFrame

Array = NDArray[np.float64]


# not frozen: one is made for every frame of `Tracker.step`, and that takes a third of the time
@dataclass(eq=False, slots=True)
class Fitted:
    """Frames that are fitted; what the filter makes of them is not known yet.

    Attributes:
        times_ns: (n,) increasing [ns].
        observed, given: (n, 21, 3) [m] and (n, 21) joints and their weights.
        raw: (n,) RESULT, as `solver.Results` has them.
        reasons: of each frame, "" for nothing.
        rejected: (n, 21); restart: (n,), as in `States`.
    """

    times_ns: NDArray[np.int64]
    observed: Array
    given: Array
    raw: Records
    reasons: list[str]
    rejected: NDArray[np.bool_]
    restart: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.times_ns)

    @property
    def _columns(self) -> tuple[NDArray[Any], ...]:
        return self.times_ns, self.observed, self.given, self.raw, self.rejected, self.restart

    def part(self, of: slice) -> Fitted:
        """Some of the frames."""
        times, observed, given, raw, rejected, restart = (x[of] for x in self._columns)
        return Fitted(times, observed, given, raw, self.reasons[of], rejected, restart)

    @staticmethod
    def joined(parts: list[Fitted]) -> Fitted:
        """Frames one after another, of one part or more."""
        if len(parts) == 1:
            return parts[0]
        columns = zip(*(part._columns for part in parts), strict=True)
        times, observed, given, raw, rejected, restart = (np.concatenate(x) for x in columns)
        for array in (observed, given, raw, rejected):
            array.setflags(write=False)
        reasons = [reason for part in parts for reason in part.reasons]
        return Fitted(times, observed, given, raw, reasons, rejected, restart)


@dataclass(eq=False, slots=True)
class Block:
    """Frames that are final.

    Attributes:
        fitted: they, as they were fitted.
        steady: (n,) RESULT, what the filter makes of them; the raw rows without one.
        known: (n,) whether it knows a pose.
        lasting: (20,) what variances are at least, for what lasts in the errors [rad^2]; or None.
    """

    fitted: Fitted
    steady: Records
    known: NDArray[np.bool_]
    lasting: Array | None = None

    def __len__(self) -> int:
        return len(self.fitted)

    def part(self, of: slice) -> Block:
        """Some of the frames."""
        return Block(self.fitted.part(of), self.steady[of], self.known[of], self.lasting)

    @property
    def status(self) -> NDArray[np.str_]:
        """(n,) as in `States`."""
        seen = ~np.isnan(self.fitted.raw["objective"])
        return np.where(seen, "fitted", np.where(self.known, "predicted", "lost"))

    def arrays(self) -> dict[str, Any]:
        """All fields of `States` but frame numbers and truth, by name."""
        of, raw, steady = self.fitted, self.fitted.raw, self.steady
        return {
            "time_ns": of.times_ns,
            "observed": of.observed,
            "confidence": of.given,
            "angles_raw": raw["angles"],
            "angles": steady["angles"],
            "quaternion_raw": raw["quaternion"],
            "quaternion": steady["quaternion"],
            "translation_raw": raw["root"][:, 9:],
            "translation": steady["root"][:, 9:],
            "fitted_joints": raw["joints"],
            "filtered_joints": steady["joints"],
            "angle_variance": self._variance(steady["variance"], raw["variance"]),
            "objective": raw["objective"],
            "iterations": raw["sweeps"] + raw["steps"],
            "status": self.status,
            "reason": np.array(of.reasons, np.str_),
            "rejected": of.rejected,
            "restart": of.restart,
        }

    def _variance(self, steady: Array, raw: Array) -> Array:
        """(n, 20) of the angles, by the filter where it knows them."""
        variance = np.where(np.isnan(steady[..., :1]), raw, steady)
        # residuals have what lasts in them too, so the two are not added
        if self.lasting is not None:
            variance = np.maximum(variance, self.lasting)
        variance.setflags(write=False)
        return variance

    def _variance_of(self, steady: Array, raw: Array) -> Array:
        """As `_variance`, of one frame (20,)."""
        if self.lasting is not None:
            return self._variance(steady, raw)
        return raw if math.isnan(steady.item(0)) else steady

    def stretch(
        self,
        head: Head,
        frame_index: ArrayLike,
        truth: Array | None = None,
        events: list[Event] | tuple[Event, ...] = (),
    ) -> Stretch:
        """The frames as a stretch.

        Args:
            head: what does not change of the hand.
            frame_index, truth, events: as in `Track`.
        """
        return Stretch(
            frame_index=np.array(frame_index, np.int64),
            truth=truth,
            head=head,
            events=tuple(events),
            **self.arrays(),
        )

    def frames(self) -> list[TrackedFrame]:
        """The frames one by one."""
        return [self._frame(t) for t in range(len(self.fitted))]

    def _frame(self, t: int) -> TrackedFrame:
        of = self.fitted
        row = solver.Row(*of.raw.item(t))
        steady = row if self.steady is of.raw else solver.Row(*self.steady.item(t))
        fitted = not math.isnan(row.objective)
        return TrackedFrame.of(
            time_ns=of.times_ns.item(t),
            observed=of.observed[t],
            confidence=of.given[t],
            angles_raw=row.angles,
            angles=steady.angles,
            quaternion_raw=row.quaternion,
            quaternion=steady.quaternion,
            translation_raw=row.translation,
            translation=steady.translation,
            fitted_joints=row.joints,
            filtered_joints=steady.joints,
            angle_variance=self._variance_of(steady.variance, row.variance),
            objective=row.objective,
            iterations=row.sweeps + row.steps,
            status="fitted" if fitted else "predicted" if self.known[t] else "lost",
            reason=of.reasons[t],
            rejected=of.rejected[t],
            restart=of.restart.item(t),
        )


class Waiting(Protocol):
    """Frames whose filtered pose comes later."""

    def push(self, frames: Fitted) -> None:
        """More of them."""

    def pop(self, n: int) -> Fitted:
        """The next n."""


class FewWaiting:
    """Some frames that wait."""

    def __init__(self) -> None:
        self._parts: deque[Fitted] = deque()

    def push(self, frames: Fitted) -> None:
        """More of them."""
        self._parts.append(frames)

    def pop(self, n: int) -> Fitted:
        """The next n, one or more."""
        found: list[Fitted] = []
        while n > 0:
            first = self._parts.popleft()
            if len(first) > n:
                self._parts.appendleft(first.part(slice(n, None)))
                first = first.part(slice(0, n))
            found.append(first)
            n -= len(first)
        return Fitted.joined(found)


class AllWaiting:
    """All frames of a clip: they wait until it is complete, on disk where they are many."""

    def __init__(self) -> None:
        self._columns = (
            Growing((), np.int64),
            Growing((N_JOINTS, 3)),
            Growing((N_JOINTS,)),
            Growing((), RESULT),
            Growing((N_JOINTS,), np.bool_),
            Growing((), np.bool_),
        )
        self._reasons = GrowingTexts()
        self._done = 0

    def push(self, frames: Fitted) -> None:
        """More of them."""
        for column, array in zip(self._columns, frames._columns, strict=True):
            column.append(array)
        self._reasons.append(frames.reasons)

    def pop(self, n: int) -> Fitted:
        """The next n; no more can be pushed."""
        part = slice(self._done, self._done + n)
        self._done = part.stop
        found = [column.read(part) for column in self._columns]
        for array in found:
            array.setflags(write=False)
        times, observed, given, raw, rejected, restart = found
        reasons = self._reasons.read(part)
        return Fitted(times, observed, given, raw, reasons, rejected, restart)


class EventsOf:
    """What happened in the stretches of a hand, one after another: changes of status, hands found
    anew, joints newly rejected."""

    def __init__(self) -> None:
        self._status = ""
        self._rejected = np.zeros((1, N_JOINTS), np.bool_)

    def __call__(self, part: Stretch) -> list[Event]:
        """Those of the next frames, one or more."""
        status, rejected = part.status, part.rejected
        changed = status != np.concatenate([[self._status], status[:-1]])
        newly = (rejected & ~np.concatenate([self._rejected, rejected[:-1]])).any(1)
        self._status, self._rejected = str(status[-1]), rejected[-1:]
        events = []
        for t in np.flatnonzero(changed | part.restart | newly).tolist():
            level = "info" if status[t] == "fitted" else "warning"
            words = (str(status[t]) if changed[t] else "", str(part.reason[t]))
            events.append(Event(int(part.time_ns[t]), level, ": ".join(filter(None, words))))
        return events
