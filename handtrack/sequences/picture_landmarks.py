"""Hands in pictures as other programs stored them: landmarks in x and y, which load() refuses."""

from __future__ import annotations

from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files import budget
from handtrack.hand.skeleton import JOINT_NAMES, Hand
from handtrack.sequences.assemble import anything_seen, check_settings, without_marks
from handtrack.sequences.clock import TimeUnit, read_clock
from handtrack.sequences.joint_order import stated_order
from handtrack.sequences.picture import is_share
from handtrack.sequences.readers.folder import sources
from handtrack.sequences.readers.pictures import AT_ZERO, flat
from handtrack.sequences.readers.raw import Array, NoFramesError, NotJointsError, Raw
from handtrack.sequences.readers.recognise import check_format, read_file

_FAR = 1e5
"""[px] Nothing is so far outside of a picture."""


@dataclass(frozen=True, eq=False)
class PictureLandmarks:
    """One hand in the T pictures of one camera.

    Attributes:
        points: (T, 21, 2) x to the right and y down, in pixels, or as shares of the picture's width
            and height; NaN where not seen.
        depth: (T, 21) how much farther than the wrist a landmark is, as MediaPipe guesses it, in
            the unit of x; None: nothing says it.
        sure: (T, 21) 0..1, 0 where not seen.
        shares: whether points are shares of the picture's sides.
        time_ns, frame_index: (T,) int64; timed: whether the source says how fast time goes.
        hand: None: nothing tells it.
        name, source: as in a Sequence.
        notes: what the user should know.
    """

    points: Array
    depth: Array | None
    sure: Array
    shares: bool
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    timed: bool
    hand: Hand | None
    name: str
    source: str
    notes: tuple[str, ...] = ()

    @property
    def extent(self) -> tuple[int, int] | None:
        """(width, height) [px] that holds all points; None of shares."""
        if self.shares:
            return None
        width, height = np.ceil(np.nanmax(self.points, axis=(0, 1))) + 1
        return int(width), int(height)

    def pixels(self, size: tuple[int, int]) -> Array:
        """(T, 21, 2) [px] in pictures of a size (width, height)."""
        return self.points * np.array(size, dtype=np.float64) if self.shares else self.points

    def relief(self, size: tuple[int, int]) -> Array | None:
        """(T, 21, 3) [px] with the guessed depth, as a camera far away would see the hand; None
        where nothing says it."""
        if self.depth is None:
            return None
        depth = self.depth * (size[0] if self.shares else 1)
        return np.concatenate([self.pixels(size), depth[..., None]], axis=-1)


def load_picture_landmarks(
    path: str | PathLike[str],
    *,
    order: str | None = None,
    fps: float | None = None,
    frames: tuple[int, int] | None = None,
    format: str | None = None,
    time_unit: str | None = None,
    max_size: str | int | None = None,
) -> list[PictureLandmarks]:
    """Hands in pictures from a file or a folder: MediaPipe's, OpenPose's, mmpose's, COCO's, tables.

    Args:
        path, order, fps, frames, format, time_unit, max_size: as `load`.

    Returns:
        At least one sequence: of each hand of each person.

    Raises:
        InputError: as `load`; or it holds joints in space.
        SettingsError: as `load`.
    """
    where = Path(path)
    given = check_settings(None, order, fps, time_unit)
    check_format(format)
    if not where.exists():
        raise InputError("no such file or folder", where)
    with budget.limited(max_size):
        raws = _raws(where, frames, format)
    raws = [_as_picture(raw) for raw in raws]
    found = [
        _landmarks(raw, given.order, given.fps, given.time_unit)
        for raw in without_marks(raws)
        if anything_seen(raw)
    ]
    if not found:
        raise InputError("every landmark is missing", where)
    return found if frames is None else _cut(found, frames, where)


def _raws(path: Path, frames: tuple[int, int] | None, kind: str | None) -> list[Raw]:
    if not path.is_dir():
        return read_file(path, frames, kind)
    found: list[Raw] = []
    for source in sources(path):
        try:
            found += source.read(frames, kind)
        except NotJointsError:
            continue
    if not found:
        raise InputError("no landmarks found", path)
    return found


def _as_picture(raw: Raw) -> Raw:
    """The same, whose z is known to be depth, or confidence of places of which only x and y are
    known.

    Raises:
        InputError: joints in space.
    """
    if raw.picture:
        return raw
    there = np.asarray(np.isfinite(raw.joints).all(-1))
    seen = raw.joints[there]
    if len(seen) and raw.unit is None:
        wide, z = float(np.median(np.ptp(seen[:, :2], axis=0))), seen[:, 2]
        if not z.any():
            return flat(raw)
        wrist = raw.joints[there[:, 0], 0, 2]
        if len(wrist) and np.abs(wrist).max() < AT_ZERO * wide:
            return replace(raw, picture="deep")
        if raw.confidence is None and z.min() >= 0 and z.max() <= 1 and wide > 20:
            note = "the third number of each landmark was taken as its confidence"
            sure = np.nan_to_num(raw.joints[..., 2])
            return replace(flat(raw), confidence=sure, notes=(*raw.notes, note))
    raise InputError(
        "holds joints in space, not landmarks in a picture: leave --camera, --image-size and --fov"
        " out",
        raw.path,
    )


def _landmarks(
    raw: Raw, order: str | None, fps: float | None, unit: TimeUnit | None
) -> PictureLandmarks:
    picks = np.array(stated_order(raw, order))
    clock = read_clock(len(raw.joints), raw.path, raw.stamps, raw.frame_index, raw.fps, fps, unit)
    # as slices, which copy nothing, where all are taken as they are
    own = np.array_equal(picks, np.arange(raw.joints.shape[1]))
    joints = raw.joints if own else np.where((picks < 0)[:, None], np.nan, raw.joints[:, picks])
    rows = clock.rows
    if not np.array_equal(rows, np.arange(len(joints))):
        joints = joints[rows]
    points = joints[..., :2]
    there = np.isfinite(points[..., 0]) & np.isfinite(points[..., 1])
    if np.abs(points).max(where=there[..., None], initial=0.0) > _FAR:
        t, j = np.argwhere(there & (np.abs(np.nan_to_num(points)).max(-1) > _FAR))[0]
        raise InputError(
            f"frame {t}: {JOINT_NAMES[j]} is at {points[t, j, 0]:.3g}, {points[t, j, 1]:.3g},"
            " expected a place in a picture",
            raw.path,
        )
    sure = there.astype(np.float64)
    if raw.confidence is not None:
        given = raw.confidence
        whole = given[:, None] if given.ndim == 1 else given[:, picks]
        sure = np.asarray(sure * np.clip(np.nan_to_num(whole[clock.rows], nan=1.0), 0, 1))
    index = np.arange(len(raw.joints)) if raw.frame_index is None else raw.frame_index
    return PictureLandmarks(
        points=np.where((sure > 0)[..., None], points, np.nan),
        depth=joints[..., 2] if raw.picture == "deep" else None,
        sure=sure,
        shares=is_share(points),
        time_ns=clock.time_ns,
        frame_index=np.asarray(index, dtype=np.int64)[clock.rows],
        timed=clock.stated,
        hand=raw.hand,
        name=raw.name,
        source=str(raw.path),
        notes=(*raw.notes, *clock.notes),
    )


def _cut(
    found: list[PictureLandmarks], frames: tuple[int, int], path: Path
) -> list[PictureLandmarks]:
    parts = []
    for one in found:
        keep = (one.frame_index >= frames[0]) & (one.frame_index <= frames[1])
        if (one.sure[keep] > 0).any():
            depth = None if one.depth is None else one.depth[keep]
            part = replace(one, points=one.points[keep], depth=depth, sure=one.sure[keep])
            times, index = one.time_ns[keep], one.frame_index[keep]
            parts.append(replace(part, time_ns=times, frame_index=index))
    if not parts:
        raise NoFramesError(f"no landmark in frames {frames[0]}:{frames[1]}", path)
    return parts
