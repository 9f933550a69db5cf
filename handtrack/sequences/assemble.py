"""From what a reader found to a Sequence: joint order, unit, missing joints, time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.files.long_arrays import blocks, by_blocks
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS
from handtrack.hand.units import METRES, METRIC, Unit
from handtrack.sequences.clock import UNIT_NS, Clock, TimeUnit, check_fps, read_clock
from handtrack.sequences.joint_order import AXIS_MAJOR, check_order, ordered_by_axis, read_order
from handtrack.sequences.marks import marked, without_coincident
from handtrack.sequences.picture import Picture, is_share
from handtrack.sequences.readers.pictures import refuse_picture
from handtrack.sequences.readers.raw import Array, Raw
from handtrack.sequences.repeated_rows import without_repeats
from handtrack.sequences.sequence import Sequence
from handtrack.sequences.size import palm_length
from handtrack.sequences.skeleton_check import Picks

FARTHEST = 1e6
"""[m] No hand is farther from the origin; damaged numbers are."""
_NOWHERE = 1e3 * FARTHEST
_ALIKE = (0.7, 1.4)
"""Sizes of one hand, as joints and as truth have them, differ by less than this."""
NO_SIZE = (
    "landmarks in the picture stand beside the joints, but not how large it is: --image-size WxH"
    " says it, and both are fitted together"
)
Mirror = Literal["x", "y", "z"]
_OURS = tuple(range(N_JOINTS))
_MIRRORED: dict[Mirror | None, Array] = {
    None: np.ones(3),
    "x": np.array([-1.0, 1.0, 1.0]),
    "y": np.array([1.0, -1.0, 1.0]),
    "z": np.array([1.0, 1.0, -1.0]),
}


@dataclass(frozen=True)
class Given:
    """What the caller said of the source; None: as the source says.

    Attributes:
        unit: unit of the joints.
        order: a name of `skeleton.ORDERS`, `AXIS_MAJOR`, or the places of our joints.
        fps: frames per second, instead of the source's times.
        time_unit: of the source's times.
        mirror: axis whose sign is changed, for sources whose world is left-handed.
        image_size: (width, height) [px] of the pictures that joints were found in.
    """

    unit: Unit | None = None
    order: str | None = None
    fps: float | None = None
    time_unit: TimeUnit | None = None
    mirror: Mirror | None = None
    image_size: tuple[int, int] | None = None


def assemble(raw: Raw, given: Given, judge: bool = True) -> Sequence:
    """The sequence of one hand, in metres and this project's order; its size is not checked.

    Its hand is the source's label, or "right" for now where there is none.

    Args:
        raw: the source.
        given: what the caller says of it.
        judge: check the joints' order against what a hand can be.

    Raises:
        NotJointsError: places in a picture.
        InputError: those of MediaPipe, joints that do not fit the order, an unknown order in the
            file, joints far from everything, or anything that `Sequence` refuses.
    """
    refuse_picture(raw)
    raw = without_repeats(raw)
    if given.order == AXIS_MAJOR:
        truth = None if raw.truth is None else ordered_by_axis(raw.truth)
        raw = replace(raw, joints=ordered_by_axis(raw.joints), truth=truth)
    _check_numbers(raw)
    reading = read_order(raw, given.order, judge)
    notes = [*raw.notes, *reading.notes]
    pick = np.array(reading.picks)
    unit = unit_of(raw, given)
    to_metres = METRES[unit] * _MIRRORED[given.mirror]
    joints = raw.joints
    if reading.picks != _OURS or (to_metres != 1).any():
        joints = by_blocks(lambda part: _picked(part, reading.picks) * to_metres, joints)
    _check_reach(joints, raw)
    joints, coincident = without_coincident(joints)
    notes += coincident
    confidence = raw.confidence
    if confidence is not None:
        confidence = (
            np.repeat(confidence[:, None], N_JOINTS, axis=1)
            if confidence.ndim == 1
            else np.where(pick < 0, 0.0, confidence[:, pick])
        )
    clock = _clock(raw, given)
    notes += clock.notes
    rows = clock.rows
    truth = None
    if raw.truth is not None:
        truth, _ = without_coincident(_picked(raw.truth, reading.picks) * to_metres)
        truth, other = _in_its_unit(truth, joints, unit)
        notes += other
    picture, of_picture = _picture(raw, given, reading.picks, rows)
    notes += of_picture
    return Sequence(
        time_ns=clock.time_ns,
        joints=_taken(joints, rows),
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
        detector=raw.detector,
        picture=picture,
    )


def _taken(joints: Array, rows: NDArray[np.int64]) -> Array:
    """The joints of some frames; where they are all, and in order, as they are."""
    if len(rows) == len(joints) and (np.diff(rows) == 1).all():
        return joints
    return by_blocks(lambda part: joints[part], rows)


def _picture(
    raw: Raw, given: Given, picks: Picks, rows: NDArray[np.int64]
) -> tuple[Picture | None, list[str]]:
    """What the picture shows of joints, where its size is known; else what would say it."""
    if raw.shown is None or given.mirror is not None:
        return None, []
    size = given.image_size or raw.shown.size
    if size is None:
        return None, [NO_SIZE]
    pick = np.array(picks)
    points = np.where((pick < 0)[:, None], np.nan, raw.shown.points[rows][:, pick])
    if is_share(points):
        points = points * np.array(size, dtype=np.float64)
    seen = np.isfinite(points).all(-1)
    sure = seen.astype(np.float64)
    if raw.confidence is not None:
        told = raw.confidence[rows]
        whole = told[:, None] if told.ndim == 1 else told[:, pick]
        sure = np.where(seen, np.clip(np.nan_to_num(whole, nan=1.0), 0, 1), 0.0)
    return Picture(points, np.asarray(sure), size), []


def _in_its_unit(truth: Array, joints: Array, unit: Unit) -> tuple[Array, list[str]]:
    """True joints [m], where they were stored in another unit than the joints; and a note."""
    times = palm_length(truth) / palm_length(joints)
    for other, metres in METRIC.items():
        factor = METRES[unit] / metres
        if factor != 1 and _ALIKE[0] < times / factor < _ALIKE[1]:
            return truth / factor, [f"true joints read as {other}, the joints as {unit}, by size"]
    return truth, []


def unit_of(raw: Raw, given: Given) -> Unit:
    """The unit taken: the caller's, else the source's, else metres."""
    return given.unit or raw.unit or "m"


def without_marks(raws: list[Raw]) -> list[Raw]:
    """The hands of one source, with NaN for joints that are marked as missing or not trusted.

    Marks are judged over all of them, truths included; a joint of confidence 0 is missing.
    """
    arrays = [raw.joints for raw in raws] + [r.truth for r in raws if r.truth is not None]
    masks, marks = marked(arrays)
    truths = iter(masks[len(raws) :])
    out = []
    for raw, mask in zip(raws, masks, strict=False):
        notes = []
        if mask.any():
            notes.append(f"{mask.sum()} joints at {marks} were taken as missing")
        if raw.confidence is not None:
            distrusted = np.zeros_like(mask) | (raw.confidence.reshape(len(mask), -1) == 0)
            distrusted &= ~mask & np.isfinite(raw.joints).all(-1)
            if distrusted.any():
                notes.append(f"{distrusted.sum()} joints of confidence 0 were taken as missing")
            if distrusted.any() and (mask | distrusted)[np.isfinite(raw.joints).all(-1)].all():
                raise InputError(
                    "confidence is 0 for every joint in every frame, so none counts as seen:"
                    " leave the confidence out where it was not measured",
                    raw.path,
                )
            mask = mask | distrusted
        truth = raw.truth
        if truth is not None:
            in_truth = next(truths)
            if in_truth.any():
                notes.append(f"{in_truth.sum()} true joints at {marks} were taken as missing")
            truth = np.where(in_truth[..., None], np.nan, truth)
        joints = raw.joints
        if mask.any():
            joints = by_blocks(lambda x, of: np.where(of[..., None], np.nan, x), joints, mask)
        out.append(replace(raw, joints=joints, truth=truth, notes=(*raw.notes, *notes)))
    return out


def anything_seen(raw: Raw) -> bool:
    """Whether any joint is there in any frame."""
    return any(np.isfinite(raw.joints[p]).all(-1).any() for p in blocks(len(raw.joints)))


def _picked(joints: Array, picks: Picks) -> Array:
    """(T, 21, 3) our joints of a source's, NaN where it has none."""
    places = np.array(picks)
    return np.where((places < 0)[:, None], np.nan, joints[:, places])


def _check_numbers(raw: Raw) -> None:
    """Numbers that are no place in any unit, whose squares may be no numbers any more."""
    far_parts = [
        part for part in blocks(len(raw.joints)) if (np.abs(raw.joints[part]) > _NOWHERE).any()
    ]
    for part in far_parts:
        infinite = np.isinf(raw.joints[part])
        if infinite.any():
            t = part.start + np.argwhere(infinite)[0, 0]
            raise InputError(f"frame {t}: a joint is infinite", raw.path)
    for part in far_parts:
        some = raw.joints[part].reshape(part.stop - part.start, -1, 3)
        t, j, _ = np.argwhere(np.abs(some) > _NOWHERE)[0]
        value = some[t, j]
        t += part.start
        raise InputError(
            f"frame {t}: joint {j} is at {', '.join(f'{x:.3g}' for x in value)},"
            " expected a place near a hand",
            raw.path,
        )


def _check_reach(joints: Array, raw: Raw) -> None:
    for part in blocks(len(joints)):
        far = np.abs(joints[part]) > FARTHEST
        if not far.any():
            continue
        frame, joint, axis = np.argwhere(far)[0] + (part.start, 0, 0)
        raise InputError(
            f"frame {frame}: {JOINT_NAMES[joint]} is at {joints[frame, joint, axis]:.3g} m",
            raw.path,
        )


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
    unit: str | None,
    order: str | None,
    fps: float | None,
    time_unit: str | None = None,
    mirror: str | None = None,
    image_size: tuple[int, int] | None = None,
) -> Given:
    """The caller's settings, checked.

    Raises:
        SettingsError: an unknown unit, order, unit of time or axis, with those that are known,
            or an unusable fps or size of pictures.
    """
    known = next((u for u in METRES if u == unit), None)
    if unit is not None and known is None:
        raise SettingsError(f"unknown unit {unit!r}, expected one of {', '.join(METRES)}")
    check_order(order)
    of_time = next((u for u in UNIT_NS if u == time_unit), None)
    if time_unit is not None and of_time is None:
        raise SettingsError(
            f"unknown unit of time {time_unit!r}, expected one of {', '.join(UNIT_NS)}"
        )
    axis = next((a for a in _MIRRORED if a == mirror), None)
    if mirror is not None and axis is None:
        raise SettingsError(f"mirror is {mirror!r}, expected x, y or z")
    check_fps(fps)
    if image_size is not None and (len(image_size) != 2 or not min(image_size) > 0):
        raise SettingsError(f"image_size is {image_size}, expected (width, height)")
    rate = None if fps is None else float(fps)
    return Given(known, order, rate, of_time, axis, image_size)
