"""From what a reader found to a Sequence: joint order, unit, missing joints, time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS, ORDER_JOINTS, ORDERS
from handtrack.sequences.clock import UNIT_NS, Clock, TimeUnit, check_fps, read_clock
from handtrack.sequences.readers.raw import METRES, Array, Raw, Unit
from handtrack.sequences.sequence import Sequence

FARTHEST = 1e6
"""[m] No hand is farther from the origin; damaged numbers are."""
_BY_COUNT = {21: "handtrack", 25: "webxr", 26: "openxr"}


@dataclass(frozen=True)
class Given:
    """What the caller said of the source; None: as the source says.

    Attributes:
        unit: unit of the joints.
        order: a name of `skeleton.ORDERS`.
        fps: frames per second, instead of the source's times.
        time_unit: of the source's times.
    """

    unit: Unit | None = None
    order: str | None = None
    fps: float | None = None
    time_unit: TimeUnit | None = None


def assemble(raw: Raw, given: Given) -> Sequence:
    """The sequence of one hand, in metres and this project's order; its size is not checked.

    Its hand is the source's label, or "right" for now where there is none.

    Raises:
        InputError: joints that do not fit the order, an unknown order in the file, joints far
            from everything, or anything that `Sequence` refuses.
    """
    notes = list(raw.notes)
    pick = _order(raw, given)
    joints, n_missing = _without_marks(raw.joints)
    joints = joints[:, pick]
    if n_missing:
        notes.append(f"{n_missing} joints at exactly 0, 0, 0 or -1, -1, -1 were taken as missing")
    unit = unit_of(raw, given)
    joints = joints * METRES[unit]
    _check_reach(joints, raw)
    confidence = raw.confidence
    if confidence is not None:
        confidence = (
            np.repeat(confidence[:, None], N_JOINTS, axis=1)
            if confidence.ndim == 1
            else confidence[:, pick]
        )
    clock = _clock(raw, given)
    notes += clock.notes
    rows = clock.rows
    truth = None if raw.truth is None else raw.truth[:, pick] * METRES[unit]
    return Sequence(
        time_ns=clock.time_ns,
        joints=joints[rows],
        confidence=None if confidence is None else confidence[rows],  # type: ignore[arg-type]
        hand=raw.hand or "right",
        frame_index=None if raw.frame_index is None else raw.frame_index[rows],  # type: ignore[arg-type]
        truth=None if truth is None else truth[rows],
        timed=clock.stated,
        numbered=raw.frame_index is not None,
        name=raw.name,
        source=str(raw.path),
        subject=raw.subject,
        notes=tuple(notes),
    )


def unit_of(raw: Raw, given: Given) -> Unit:
    """The unit taken: the caller's, else the source's, else metres."""
    return given.unit or raw.unit or "m"


def anything_seen(raw: Raw) -> bool:
    """Whether any joint is there in any frame."""
    return bool(np.isfinite(_without_marks(raw.joints)[0]).all(-1).any())


def _order(raw: Raw, given: Given) -> NDArray[np.int64]:
    """(21,) which of the source's joints are ours."""
    n = raw.joints.shape[1]
    name = given.order or raw.order or _BY_COUNT.get(n)
    if name is None or name not in ORDERS:
        raise InputError(
            f"joint order {name!r} is unknown, known are {', '.join(ORDERS)}", raw.path
        )
    if ORDER_JOINTS[name] != n:
        raise InputError(
            f"a frame has {n} joints, the order {name} has {ORDER_JOINTS[name]}", raw.path
        )
    return np.array(ORDERS[name])


def _check_reach(joints: Array, raw: Raw) -> None:
    far = np.isfinite(joints) & (np.abs(joints) > FARTHEST)
    if far.any():
        frame, joint, axis = np.argwhere(far)[0]
        raise InputError(
            f"frame {frame}: {JOINT_NAMES[joint]} is at {joints[frame, joint, axis]:.3g} m",
            raw.path,
        )


def _without_marks(joints: Array) -> tuple[Array, int]:
    """Joints with NaN where the source marked them missing, and how many it marked.

    Sources write 0, 0, 0 or -1, -1, -1. One joint alone may truly be there (the wrist of joints
    given relative to it); two of a hand cannot be at one place.
    """
    joints = np.array(joints, dtype=np.float64)
    marked = np.zeros(joints.shape[:2], dtype=bool)
    for mark in (0.0, -1.0):
        at_mark = (joints == mark).all(-1)
        marked |= at_mark & (at_mark.sum(1, keepdims=True) > 1)
    joints[marked] = np.nan
    return joints, int(marked.sum())


def _clock(raw: Raw, given: Given) -> Clock:
    if raw.time_ns is not None and given.fps is None:
        return Clock(np.arange(len(raw.joints)), raw.time_ns, (), True)
    return read_clock(
        len(raw.joints),
        raw.path,
        raw.stamps,
        raw.frame_index,
        raw.fps,
        given.fps,
        given.time_unit,
    )


def check_settings(
    unit: str | None, order: str | None, fps: float | None, time_unit: str | None = None
) -> Given:
    """The caller's settings, checked.

    Raises:
        SettingsError: an unknown unit, order or unit of time, with those that are known, or an
            unusable fps.
    """
    known = next((u for u in METRES if u == unit), None)
    if unit is not None and known is None:
        raise SettingsError(f"unknown unit {unit!r}, expected one of {', '.join(METRES)}")
    if order is not None and order not in ORDERS:
        raise SettingsError(f"unknown joint order {order!r}, expected one of {', '.join(ORDERS)}")
    of_time = next((u for u in UNIT_NS if u == time_unit), None)
    if time_unit is not None and of_time is None:
        raise SettingsError(
            f"unknown unit of time {time_unit!r}, expected one of {', '.join(UNIT_NS)}"
        )
    check_fps(fps)
    return Given(known, order, None if fps is None else float(fps), of_time)
