"""The tracker: frame by frame, each fit starting from the one before."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.deprecated import moved, old_positions
from handtrack.errors import InputError, SettingsError
from handtrack.fitting import solver
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_ANGLES
from handtrack.kernels import workspace
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
    __getattr__ = moved(__name__, {"track": "tracking.sequence_track"})


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
        **options: Any,
    ):
        """Args:
        model: the hand to fit.
        settings: how to track; the defaults if left out.
        options: settings by their names (see `TrackerSettings`), such as filter="kalman", that
            replace these.

        Raises:
            SettingsError: an option is unknown, or a value makes no sense.
        """
        self.model = model
        self.chosen = TrackerSettings.of(settings, options)
        estimates = self.chosen.filter.name not in ("none", "one-euro")
        meanwhile = partial(warm_up, self.chosen) if estimates else None
        self._program = solver.Program(self.chosen.fit, meanwhile=meanwhile)
        self._gate = Gate(self._program, model, self.chosen) if self.chosen.gate else None
        self._filter = make_filter(self.chosen, model)
        self._coast_ns = self.chosen.coast_ns
        self._lasting = np.square(np.deg2rad(self.chosen.lasting_deg or np.zeros(N_ANGLES)))
        self._waiting: deque[tuple[int, Array, Array, solver.Results, int, Verdict]] = deque()
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
        self._waiting.clear()
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
        return self._advance((int(time_ns),), observed, w)

    def finish(self) -> list[TrackedFrame]:
        """The frames that the filter has not given yet; it is as new then."""
        if self._filter is None:
            return []
        try:
            return self._given(*self._filter.finish())
        finally:
            # whatever stopped it: they are not of the frames that come next
            self._waiting.clear()

    def _advance(
        self, times_ns: list[int] | tuple[int, ...], observed: Array, w: Array
    ) -> list[TrackedFrame]:
        """Track the next frames: times (T,), joints (T, 21, 3), weights (T, 21).

        Joints and weights are kept, and missing joints made clear in them.
        """
        if self._time_ns is not None and times_ns[0] <= self._time_ns:
            raise InputError(
                f"time does not increase: the last frame was at {self._time_ns * 1e-9:.6f} s,"
                f" this one is at {times_ns[0] * 1e-9:.6f} s"
            )
        for t in range(1, len(times_ns)):
            if times_ns[t] - times_ns[t - 1] > self._coast_ns:
                before = self._advance(times_ns[:t], observed[:t], w[:t])
                return before + self._advance(times_ns[t:], observed[t:], w[t:])
        if self._time_ns is not None and times_ns[0] - self._time_ns > self._coast_ns:
            # as after frames that were lost: the last pose is one start of two
            solver.forget(self._keep)
        results = solver.Results(len(times_ns), full=False)
        model, least = self.model, self.chosen.min_joints
        given, verdicts = w, [PLAIN] * len(times_ns)
        if self._gate is None:
            results.run(self._program, model, observed, w, self._keep, model.mean_angles, least)
        else:
            given = w.copy()
            verdicts = self._gate.run(results, times_ns, observed, w, self._keep)
            given[np.isnan(observed[..., 0])] = 0.0
        self._time_ns = times_ns[-1]
        frames = (
            (time_ns, observed[t], given[t], results, t, verdicts[t])
            for t, time_ns in enumerate(times_ns)
        )
        steadied = None
        if self._filter is not None:
            inputs = Frames(np.array(times_ns), observed, w, results.rows)
            steadied = self._filter.advance(inputs)
        # gate and filter look at these again: whoever gets a frame may only read them
        observed.setflags(write=False)
        given.setflags(write=False)
        results.rows.setflags(write=False)
        if steadied is None:
            return [self._frame(*frame, None, False) for frame in frames]
        self._waiting.extend(frames)
        return self._given(*steadied)

    def _given(self, rows: workspace.Records, known: NDArray[np.bool_]) -> list[TrackedFrame]:
        """The next frames that wait, with what the filter makes of them."""
        rows.setflags(write=False)
        return [
            self._frame(*self._waiting.popleft(), row, known_)
            for row, known_ in zip(rows, known.tolist(), strict=True)
        ]

    def _frame(
        self,
        time_ns: int,
        observed: Array,
        w: Array,
        results: solver.Results,
        t: int,
        verdict: Verdict,
        filtered: np.void | None,
        known: bool,
    ) -> TrackedFrame:
        row = results.row(t)
        fitted = not math.isnan(row.objective)
        reason = ""
        if row.state == workspace.TOO_FEW:
            reason = f"{row.seen} of 21 joints observed, {self.chosen.min_joints} needed"
        elif row.state == workspace.UNDERDETERMINED:
            reason = "the observed joints lie on a line"
        elif row.state not in (workspace.CONVERGED, REJECTED):
            reason = solver.STATUS[row.state]
        reason = "; ".join(filter(None, (verdict.reason, reason)))
        restart = verdict.restart
        if fitted:
            gone_ns = 0 if self._fitted_ns is None else time_ns - self._fitted_ns
            if gone_ns > self._coast_ns:
                restart, found = True, f"found again after {1e-9 * gone_ns:.2f} s"
                reason = "; ".join(filter(None, (found, reason)))
            self._fitted_ns = time_ns
        steady = row if filtered is None else solver.Row(*filtered.item())
        variance = solver.variance_of(steady, row.variance)
        if self.chosen.lasting_deg:
            # residuals have what lasts in them too, so the two are not added
            variance = np.maximum(variance, self._lasting)
        return TrackedFrame(
            time_ns=time_ns,
            observed=observed,
            confidence=w,
            angles_raw=row.angles,
            angles=steady.angles,
            quaternion_raw=row.quaternion,
            quaternion=steady.quaternion,
            translation_raw=row.translation,
            translation=steady.translation,
            fitted_joints=row.joints,
            filtered_joints=steady.joints,
            angle_variance=variance,
            objective=row.objective,
            iterations=row.sweeps + row.steps,
            status="fitted" if fitted else "predicted" if known else "lost",
            reason=reason,
            rejected=verdict.rejected,
            restart=restart,
        )
