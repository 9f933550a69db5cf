"""The plots of one hand in Rerun: angles with their limits and where they meet them, errors, status
and events.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.limits import SADDLE_FLEXION, Limits
from handtrack.hand.skeleton import FINGERS, PARENTS
from handtrack.tracking.track import Part, log_lines, mean_and_max
from handtrack.viewer import style
from handtrack.viewer.sending import Sender, indexes
from handtrack.viewer.shown import Shown
from handtrack.viewer.versions import draws_states

INSIDE, HELD, OUTSIDE = 0, 1, 2

_NEAR = np.deg2rad(0.5)
_OVER = np.deg2rad(0.1)
_CORNERS = 25
_RING = 0.28  # of the length of the bone that arrives at a joint
_LEAST_M, _MOST_M = 0.0055, 0.013


def limit_marks(limits: Limits, angles: NDArray[np.float64]) -> NDArray[np.uint8]:
    """INSIDE, HELD (within 0.5 degrees of a limit) or OUTSIDE (0.1 degrees and more).

    The two angles of a saddle share a mark, as they share an ellipse.

    Args:
        limits: the limits to look at.
        angles: (T, 20) [rad].

    Returns:
        (T, 20); INSIDE where an angle is NaN.
    """
    lower, upper = limits.lower, limits.upper
    room = np.minimum(angles - lower, upper - angles)
    flexion, abduction = SADDLE_FLEXION, SADDLE_FLEXION + 1
    saddles = np.stack([angles[:, flexion], angles[:, abduction]], -1)
    axes = np.where(
        saddles < 0,
        -np.stack([lower[flexion], lower[abduction]], -1),
        np.stack([upper[flexion], upper[abduction]], -1),
    )
    inside = 1 - np.sqrt(((saddles / axes) ** 2).sum(-1))
    room[:, flexion] = room[:, abduction] = inside * axes.min(-1)
    over = limits.violation(angles) if len(angles) else np.zeros_like(room)
    over[:, flexion] = over[:, abduction] = np.maximum(over[:, flexion], over[:, abduction])
    with np.errstate(invalid="ignore"):
        marks = np.where(room < _NEAR, HELD, INSIDE)
        return np.where(over > _OVER, OUTSIDE, marks).astype(np.uint8)


def rings(joints: NDArray[np.float64], at: NDArray[np.int64]) -> NDArray[np.float64]:
    """A ring about a joint, as on a finger: square to the bone that arrives there.

    Args:
        joints: (n, 21, 3) [m].
        at: (n,) a joint of each, not the wrist.

    Returns:
        (n, 25, 3) points of closed lines.
    """
    rows = np.arange(len(at))
    centre = joints[rows, at]
    bone = centre - joints[rows, PARENTS[at]]
    length = np.linalg.norm(bone, axis=-1, keepdims=True)
    along = bone / np.maximum(length, 1e-9)
    aside = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=-1)])
    aside /= np.maximum(np.linalg.norm(aside, axis=-1, keepdims=True), 1e-9)
    other = np.cross(along, aside)
    turn = np.linspace(0, 2 * np.pi, _CORNERS)[:, None]
    radius = np.clip(_RING * length, _LEAST_M, _MOST_M)[:, None]
    circle = np.cos(turn) * aside[:, None] + np.sin(turn) * other[:, None]
    return np.asarray(centre[:, None] + radius * circle)


class HandPlots:
    """Sends what is plotted of a hand: `begin` once, then `add` for every stretch of its frames.

    Args:
        sender: where to.
        hand: where in the recording, and of which run.
        limits: the limits to draw.
        light: on a light ground.
    """

    def __init__(self, sender: Sender, hand: Shown, limits: Limits, light: bool) -> None:
        self._sender, self._hand, self._limits, self._light = sender, hand, limits, light
        self._before = ("fitted", "")
        self._had_turns = False
        self._status = ""

    def begin(self) -> None:
        """Send what stays: colours and names."""
        import rerun as rr

        hand, track = self._hand, self._hand.track
        colours = style.angle_colours(hand.run, self._light)
        for finger, name in enumerate(FINGERS):
            entity = f"angles/{hand.topic}/{name}"
            labels = style.angle_labels(finger)
            bounds = np.rad2deg([self._limits.lower, self._limits.upper])[:, 4 * finger :][:, :4]
            least, most = (
                [f"{label}, {what} {v:.0f}" for label, v in zip(labels, row, strict=True)]
                for what, row in zip(("at least", "at most"), bounds, strict=True)
            )
            kinds = {"angles": (255, style.FILTERED_WIDTH, labels)}
            if track.filtered:
                raw = [f"{label}, raw" for label in labels]
                kinds["raw"] = (style.RAW_ALPHA, style.RAW_WIDTH, raw)
            kinds["limits"] = (style.LIMIT_ALPHA, style.LIMIT_WIDTH, least + most)
            for kind, (alpha, width, names) in kinds.items():
                lines = rr.SeriesLines(
                    colors=[(*colour[:3], alpha) for colour in colours] * (len(names) // 4),
                    widths=[width] * len(names),
                    names=names,
                )
                self._sender.static(f"{entity}/{kind}", lines)
        shown = style.ERRORS[: 2 + (track.truth is not None)]
        lines = rr.SeriesLines(
            colors=[style.toned(colour, self._light) for _, colour in shown],
            widths=[1.5] * len(shown),
            names=[name for name, _ in shown],
        )
        self._sender.static(f"errors/{hand.topic}", lines)
        if draws_states():
            states = rr.StateConfiguration(
                values=list(style.STATUS_COLOURS), colors=list(style.STATUS_COLOURS.values())
            )
            self._sender.static(f"status/{hand.topic}", states)

    def add(self, part: Part, marks: NDArray[np.uint8]) -> None:
        """Send the next frames, whose angles have these marks (T, 20)."""
        self._angles(part)
        self._outside(part, marks)
        self._errors(part)
        self._turns(part)
        self._states(part)
        self._lines(part)

    def _angles(self, part: Part) -> None:
        """The angles of each finger [deg], as fitted and after the filter, and their limits."""
        kinds = [("angles", part.angles)]
        if part.filtered:
            kinds.append(("raw", part.angles_raw))
        rows, ends = np.arange(len(part)), np.unique([0, len(part) - 1])
        for finger, name in enumerate(FINGERS):
            entity = f"angles/{self._hand.topic}/{name}"
            of_finger = slice(4 * finger, 4 * finger + 4)
            for kind, angles in kinds:
                degrees = np.rad2deg(angles[:, of_finger])
                self._sender.scalars(f"{entity}/{kind}", part, degrees, rows)
            limits = np.r_[self._limits.lower[of_finger], self._limits.upper[of_finger]]
            bounds = np.tile(np.rad2deg(limits), (len(ends), 1))
            self._sender.scalars(f"{entity}/limits", part, bounds, ends)

    def _outside(self, part: Part, marks: NDArray[np.uint8]) -> None:
        """The angles that are outside their limits, as points."""
        import rerun as rr

        for finger, name in enumerate(FINGERS):
            of_finger = slice(4 * finger, 4 * finger + 4)
            outside = marks[:, of_finger] == OUTSIDE
            found = np.flatnonzero(outside.any(1))
            if found.size:
                entity = f"angles/{self._hand.topic}/{name}/outside"
                points = rr.SeriesPoints(
                    colors=[style.OUTSIDE] * 4, marker_sizes=[2.5] * 4, names=["outside"] * 4
                )
                self._sender.static(entity, points)
                degrees = np.rad2deg(part.angles[found, of_finger])
                values = np.where(outside[found], degrees, np.nan)
                self._sender.scalars(entity, part, values, found)

    def _errors(self, part: Part) -> None:
        """Distances of the joints [mm]: fitted to observed, as far as used; filtered to true."""
        values = list(mean_and_max(np.where(part.rejected, np.nan, part.error)))
        if part.truth is not None:
            distance = np.linalg.norm(part.filtered_joints - part.truth, axis=-1)
            values.append(mean_and_max(distance)[0])
        millimetres = 1e3 * np.stack(values, 1)
        self._sender.scalars(f"errors/{self._hand.topic}", part, millimetres, np.arange(len(part)))

    def _turns(self, part: Part) -> None:
        """Where the hand was no longer fitted, and where found, as points among the angles."""
        import rerun as rr

        fitted = part.status == "fitted"
        before = np.r_[self._status in ("", "fitted"), fitted[:-1]]
        turns = np.stack([before & ~fitted, (fitted & ~before) | part.restart], 1)
        found = np.flatnonzero(turns.any(1))
        if not found.size:
            return
        values = np.where(turns[found], 0.0, np.nan)
        for finger in FINGERS:
            entity = f"angles/{self._hand.topic}/{finger}/events"
            if not self._had_turns:
                points = rr.SeriesPoints(
                    colors=[style.STATUS_COLOURS["lost"], style.STATUS_COLOURS["fitted"]],
                    marker_sizes=[style.TURN_SIZE] * 2,
                    names=["gone", "found"],
                )
                self._sender.static(entity, points)
            self._sender.scalars(entity, part, values, found)
        self._had_turns = True

    def _states(self, part: Part) -> None:
        """Where the status changes."""
        import rerun as rr

        status = part.status
        rows = np.flatnonzero(np.r_[status[:1] != self._status, status[1:] != status[:-1]])
        self._status = str(status[-1])
        if rows.size and draws_states():
            columns = rr.StateChange.columns(state=status[rows].tolist())
            self._sender.send(part, f"status/{self._hand.topic}", columns, rows)

    def _lines(self, part: Part) -> None:
        """The events, and changes of status, as lines of a log."""
        import rerun as rr

        lines = log_lines(part, self._before)
        self._before = (str(part.status[-1]), str(part.reason[-1]))
        if not lines:
            return
        time_ns = np.array([line.time_ns for line in lines], np.int64)
        # an event has only a time: its frame is the last one before it
        row = np.clip(np.searchsorted(part.time_ns, time_ns, "right") - 1, 0, None)
        levels = ["WARN" if line.level == "warning" else "INFO" for line in lines]
        # whose line it is matters only where two runs share a log
        whose = f"{self._hand.run_name}: " if self._hand.run_name else ""
        columns = rr.TextLog.columns(text=[whose + line.text for line in lines], level=levels)
        times = indexes(part.frame_index[row], time_ns, self._sender.origin)
        self._sender.recording.send_columns(f"log/{self._hand.topic}", times, columns)
