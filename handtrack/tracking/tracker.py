"""The tracker: frame by frame, each fit starting from the one before."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.deprecated import moved, old_positions
from handtrack.detectors.profile import Profile
from handtrack.errors import InputError, SettingsError
from handtrack.fitting import solver
from handtrack.hand.model import HandModel
from handtrack.kernels import workspace
from handtrack.tracking.block import AllWaiting, Block, FewWaiting, Fitted, Waiting
from handtrack.tracking.filter_input import Frames
from handtrack.tracking.filters import make_filter, warm_up
from handtrack.tracking.frame import TrackedFrame
from handtrack.tracking.gating import PLAIN, REJECTED, Gate, Verdict
from handtrack.tracking.settings import TrackerSettings

Array = NDArray[np.float64]

OLD_ORDER = (
    *("filter", "update", "min_joints", "coast_s", "process_noise", "couple", "lag"),
    *("noise_mm", "engine", "gate", "robust", "spread_mm", "collisions"),
)
"""In which older programs give options without their names."""
if not TYPE_CHECKING:
    __getattr__ = moved(__name__, {"track": "video.pictured"})


class Tracker:
    """Tracks one hand, one frame at a time.

    Every fit starts from the last raw fit; after frames that were lost it starts again, from
    the mean pose and from the last pose, and keeps the better. What the filter makes of a frame
    is never where a fit starts. Giving the frames of a sequence one by one is the same as `track`.
    """

    @old_positions(*OLD_ORDER)
    def __init__(
        self,
        model: HandModel,
        *,
        settings: TrackerSettings | Mapping[str, Any] | None = None,
        profile: Profile | None = None,
        **options: Any,
    ):
        """Args:
        model: the hand to fit.
        settings: how to track; the defaults if left out.
        profile: of the detector, by which joints are corrected before they are fitted; the hand
            is to have its landmarks (`Profile.on`).
        options: settings by their names (see `TrackerSettings`), such as filter="kalman", that
            replace these.

        Raises:
            SettingsError: an option is unknown, or a value makes no sense.
        """
        self.model = model
        self.chosen = TrackerSettings.of(settings, options)
        self._profile = profile
        estimates = self.chosen.filter.name not in ("none", "one-euro")
        meanwhile = partial(warm_up, self.chosen) if estimates else None
        self._program = solver.Program(self.chosen.fit, meanwhile=meanwhile)
        self._gate = Gate(self._program, model, self.chosen) if self.chosen.gate else None
        corrected = profile is not None and profile.correction is not None
        self._filter = make_filter(self.chosen, model, corrected)
        self._coast_ns = self.chosen.coast_ns
        lasting = self.chosen.lasting_deg
        self._lasting = np.square(np.deg2rad(lasting)) if lasting else None
        self.reset()

    @property
    def settings(self) -> dict[str, Any]:
        """The settings by name, as recorders store them; `chosen` has the object."""
        return self.chosen.to_dict()

    def reset(self) -> None:
        """Forget all frames seen, as if the tracker were new."""
        if self._filter is not None:
            self._filter.reset()
        if self._gate is not None:
            self._gate.reset()
        self._waiting = self._none_waiting()
        self._keep = solver.start_at(self.model)
        self._time_ns: int | None = None
        self._fitted_ns: int | None = None

    def step(
        self, joints: ArrayLike, time_ns: int, confidence: ArrayLike | None = None
    ) -> TrackedFrame:
        """Track the next frame.

        Args:
            joints: (21, 3) in the world [m]; NaN = missing. A frame without any joint is an
                ordinary input.
            time_ns: its time [ns], after the last frame's.
            confidence: (21,) weights, not negative; 1 by default.

        Returns:
            Poses, errors, status and reason of this frame.

        Raises:
            InputError: wrong shapes or values, or time that does not increase.
            SettingsError: the filter waits for later frames; there are `push` and `finish`.
        """
        if self.chosen.filter.waits:
            raise SettingsError(
                f"filter {self.chosen.filter.name} waits for later frames:"
                " give it frames by push(), and finish()"
            )
        return self.push(joints, time_ns, confidence)[0]

    def push(
        self, joints: ArrayLike, time_ns: int, confidence: ArrayLike | None = None
    ) -> list[TrackedFrame]:
        """As `step`, for any filter.

        Returns:
            The frames that are final now, in order: this one; or an earlier one, or none yet,
            where the filter waits.
        """
        observed, w = solver.observations(joints, confidence)
        blocks = self._advance(np.array((int(time_ns),), np.int64), observed, w)
        return [frame for block in blocks for frame in block.frames()]

    def finish(self) -> list[TrackedFrame]:
        """The frames that the filter has not given yet; it is as new then."""
        return [frame for block in self._rest() for frame in block.frames()]

    def _advance(self, times_ns: NDArray[np.int64], observed: Array, w: Array) -> list[Block]:
        """As `push`, of the next frames.

        Args:
            times_ns: (T,) increasing, one or more [ns].
            observed, w: (T, 21, 3) [m], NaN = missing, and (T, 21); they are kept, and missing
                joints made clear in them.
        """
        times = times_ns.tolist()
        if self._time_ns is not None and times[0] <= self._time_ns:
            raise InputError(
                f"time does not increase: the last frame was at {self._time_ns * 1e-9:.6f} s,"
                f" this one is at {times[0] * 1e-9:.6f} s"
            )
        if len(times) > 1:
            pauses = np.flatnonzero(np.diff(times_ns) > self._coast_ns)
            if pauses.size:
                t = int(pauses[0]) + 1
                before = self._advance(times_ns[:t], observed[:t], w[:t])
                return before + self._advance(times_ns[t:], observed[t:], w[t:])
        if self._time_ns is not None and times[0] - self._time_ns > self._coast_ns:
            # as after frames that were lost: the last pose is one start of two
            solver.forget(self._keep)
        seen = observed
        if self._profile is not None:
            seen = self._profile.corrected(observed, self.model.hand)
        results = solver.Results(len(times), full=False)
        model, least = self.model, self.chosen.min_joints
        given, verdicts = w, [PLAIN] * len(times)
        if self._gate is None:
            results.run(self._program, model, seen, w, self._keep, model.mean_angles, least)
        else:
            given = w.copy()
            verdicts = self._gate.run(results, times, seen, w, self._keep)
            given[np.isnan(seen[..., 0])] = 0.0
        if seen is not observed:
            observed[np.isnan(seen)] = np.nan
        self._time_ns = times[-1]
        fitted = self._fitted(times, times_ns, observed, given, results.rows, verdicts)
        steadied = None
        if self._filter is not None:
            steadied = self._filter.advance(Frames(times_ns, seen, w, results.rows))
        # gate and filter look at these again: whoever gets a frame may only read them
        for array in (observed, seen, given, results.rows, fitted.rejected):
            array.setflags(write=False)
        if steadied is None:
            none = np.zeros(len(fitted), np.bool_)
            return [Block(fitted, results.rows, none, self._lasting)]
        self._waiting.push(fitted)
        return [self._given(*steadied)] if len(steadied[0]) else []

    def _rest(self) -> Iterator[Block]:
        """As `finish`, some frames at a time."""
        if self._filter is None:
            return
        try:
            for steadied in self._filter.rest():
                if len(steadied[0]):
                    yield self._given(*steadied)
        finally:
            # whatever stopped it: they are not of the frames that come next
            self._waiting = self._none_waiting()

    def _none_waiting(self) -> Waiting:
        return AllWaiting() if self.chosen.filter.name == "rts" else FewWaiting()

    def _given(self, steady: workspace.Records, known: NDArray[np.bool_]) -> Block:
        """The next frames that wait, with what the filter makes of them."""
        steady.setflags(write=False)
        return Block(self._waiting.pop(len(steady)), steady, known, self._lasting)

    def _fitted(
        self,
        times: list[int],
        times_ns: NDArray[np.int64],
        observed: Array,
        given: Array,
        raw: workspace.Records,
        verdicts: list[Verdict],
    ) -> Fitted:
        """Frames, with what is to be said of them."""
        one = verdicts[0].rejected[None]
        rejected = one if len(times) == 1 else np.array([v.rejected for v in verdicts])
        restart = np.zeros(len(times), np.bool_)
        reasons = [""] * len(times)
        states = raw["state"].tolist()
        for t, fitted in enumerate((raw["objective"] >= 0.0).tolist()):
            time_ns, state, verdict, found = times[t], states[t], verdicts[t], ""
            if fitted:
                gone_ns = 0 if self._fitted_ns is None else time_ns - self._fitted_ns
                if gone_ns > self._coast_ns:
                    restart[t], found = True, f"found again after {1e-9 * gone_ns:.2f} s"
                self._fitted_ns = time_ns
            if found or state != workspace.CONVERGED or verdict is not PLAIN:
                why = self._why(state, int(raw["seen"][t]))
                reasons[t] = "; ".join(filter(None, (found, verdict.reason, why)))
                restart[t] |= verdict.restart
        return Fitted(times_ns, observed, given, raw, reasons, rejected, restart)

    def _why(self, state: int, seen: int) -> str:
        """The state of a fit in words."""
        if state == workspace.TOO_FEW:
            return f"{seen} of 21 joints observed, {self.chosen.min_joints} needed"
        if state == workspace.UNDERDETERMINED:
            return "the observed joints lie on a line"
        return "" if state in (workspace.CONVERGED, REJECTED) else solver.STATUS[state]
