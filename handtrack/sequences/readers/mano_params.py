"""Reader of MANO parameters: .npz, and FreiHAND's `*_mano.json`; joints need the user's MANO.

    poses | pose   (T, 48): global orientation and 15 joints, rotation vectors [rad]; or (T, 3 + n)
                   with n < 45 principal components
    global_orient (T, 3) and hand_pose (T, 45) or (T, n); or matrices (T, 1, 3, 3), (T, 15, 3, 3)
    betas | shape   (S,) or (T, S);   transl | trans   (3,) or (T, 3) [m]
    flat_hand_mean   whether zero is the flat hand, or the file's mean pose
    hand, fps, time_ns, frame_index, name, subject   as in other .npz files

A file that does not say flat_hand_mean is taken as smplx takes it in its layers: rotation vectors
and matrices from the flat hand, principal components from the mean pose.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.sequences.readers.fields import from_fields
from handtrack.sequences.readers.jsontext import decode as decode_json
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw

_POSES, _ORIENTS, _HANDS = ("poses", "pose"), ("global_orient",), ("hand_pose",)
_BETAS, _MOVES = ("betas", "shape"), ("transl", "trans")
_LARGEST = 1e4
_FREIHAND = 61
_BLOCK = 1000
"""Frames whose vertices are in memory at once."""


@dataclass(frozen=True, eq=False)
class ManoValues:
    """Parameters of T frames, for a MANO to decode.

    Attributes:
        orient: (T, 3) rotation vectors [rad].
        pose: (T, 45) rotation vectors, or (T, n) principal components.
        components: whether they are principal components.
        flat: whether zero is the flat hand, else the mean pose.
        betas: (S,) or (T, S).
        transl: (T, 3) or (3,) [m].
    """

    orient: Array
    pose: Array
    components: bool
    flat: bool
    betas: Array
    transl: Array


def is_mano(fields: Mapping[str, Any]) -> bool:
    """Whether named arrays are MANO parameters."""
    shaped = any(key in fields for key in _BETAS)
    whole = any(key in fields and (shaped or np.shape(fields[key])[-1:] == (48,)) for key in _POSES)
    return whole or all(any(k in fields for k in names) for names in (_ORIENTS, _HANDS))


def from_named(fields: Mapping[str, Any], path: Path) -> list[Raw]:
    """The one sequence of named arrays, its joints still to be decoded.

    Raises:
        InputError: arrays that do not belong together.
    """
    pose = _first(fields, _POSES)
    if pose is not None:
        both = np.atleast_2d(_numbers(pose, path, "poses"))
        if both.ndim != 2 or not 3 < both.shape[1] <= 48:
            raise InputError(f"poses have shape {both.shape}, expected (frames, 48)", path)
        orient, hand = both[:, :3], both[:, 3:]
    else:
        orient = _vectors(fields["global_orient"], path, "global_orient", 1)
        hand = _vectors(fields["hand_pose"], path, "hand_pose", 15)
    n = len(hand)
    if n == 0:
        raise InputError("poses of no frame", path)
    if len(orient) != n or orient.shape[1] != 3:
        raise InputError(f"{len(orient)} global orientations for {n} poses", path)
    components = hand.shape[1] < 45
    said = fields.get("flat_hand_mean")
    if said is not None and np.size(said) != 1:
        raise InputError("flat_hand_mean must be true or false", path)
    flat = not components if said is None else bool(np.ravel(said)[0])
    betas, move = _first(fields, _BETAS), _first(fields, _MOVES)
    values = ManoValues(
        orient,
        hand,
        components,
        flat,
        np.zeros(10) if betas is None else _numbers(betas, path, "betas"),
        np.zeros(3) if move is None else _numbers(move, path, "transl"),
    )
    known = ("hand", "fps", "time_ns", "time_s", "time", "frame_index", "frame", "name", "subject")
    rest = {key: fields[key] for key in known if key in fields}
    raw = from_fields(rest | {"joints_m": np.full((n, 21, 3), np.nan)}, path)
    raw.mano = values
    if said is None:
        taken = "the flat hand" if flat else "MANO's mean pose"
        raw.notes = (*raw.notes, f"flat_hand_mean is not said: poses taken from {taken}")
    return [raw]


def read_freihand_mano(data: bytes, path: Path) -> list[Raw]:
    """FreiHAND's parameters: 48 pose values from the mean pose and 10 shape coefficients.

    The root's place is stored in pixels; the hands stand at MANO's origin here.

    Raises:
        InputError: not a list of 61 numbers each.
    """
    listed = decode_json(data, list[list[list[float]]], path)
    if any(len(row) != 1 or len(row[0]) != _FREIHAND for row in listed):
        raise InputError(f"holds a frame of another shape than (1, {_FREIHAND})", path)
    rows = np.array(listed, dtype=np.float64)
    if rows.ndim != 3 or rows.shape[1:] != (1, _FREIHAND):
        raise InputError(f"holds numbers of shape {rows.shape}, expected (frames, 1, 61)", path)
    rows = rows[:, 0]
    raw = Raw(np.full((len(rows), 21, 3), np.nan), path, path.stem, hand="right", unit="m")
    raw.mano = ManoValues(rows[:, :3], rows[:, 3:48], False, False, rows[:, 48:58], np.zeros(3))
    raw.notes = ("FreiHAND's pictures are unrelated: the frames are no motion",)
    return [raw]


def decoded(raw: Raw, mano: Path | None, tips: str, hand: str) -> Raw:
    """The same with the joints that a MANO makes of its parameters.

    Args:
        raw: what a reader found; without parameters it is returned as it is.
        mano: the user's MANO files.
        tips: the set of fingertip vertices.
        hand: the caller's choice, which counts where the file does not say.

    Raises:
        NotJointsError: no MANO is given.
        InputError: the hand is not known, or the parameters do not fit.
    """
    if raw.mano is None:
        return raw
    if mano is None:
        raise NotJointsError(
            "holds MANO parameters: their joints need your MANO files (--mano DIR)", raw.path
        )
    from handtrack.hand.mano import MANO
    from handtrack.hand.mano_pose import decode

    _check_sizes(raw.mano, raw.path)
    side: Hand | None = raw.hand or next((h for h in HANDS if h == hand), None)
    side = side or next((h for h in HANDS if h in raw.path.name.lower()), None)
    if side is None:
        raise InputError("does not say which hand's parameters: choose --hand left|right", raw.path)
    model = MANO.load(mano, side, tips=tips)
    values = raw.mano
    pose = values.pose
    if values.components:
        pose = model.hand_pose(pose, flat_hand_mean=values.flat)
    elif not values.flat:
        pose = pose + model.hands_mean
    both = np.concatenate([values.orient, pose], 1)
    joints = np.empty((len(both), N_JOINTS, 3))
    try:
        betas = _each(values.betas, len(both), "betas")
        move = _each(values.transl, len(both), "transl")
        for start in range(0, len(both), _BLOCK):  # each with its vertices
            part = slice(start, start + _BLOCK)
            joints[part] = decode(model, both[part], betas[part], move[part])[0]
    except (InputError, ValueError) as error:
        raise InputError(f"MANO parameters: {shown(str(error))}", raw.path) from None
    raw.joints, raw.unit, raw.order, raw.hand = joints, "m", "handtrack", side
    return raw


def _check_sizes(values: ManoValues, path: Path) -> None:
    """No turn, component, coefficient or place of a hand is that large."""
    for name in ("orient", "pose", "betas", "transl"):
        given = getattr(values, name)
        # not(<=): NaN is refused as well
        if given.size and not np.abs(given).max() <= _LARGEST:
            raise InputError(
                f"MANO parameters: {name} holds {np.abs(given).max():.3g},"
                f" expected numbers up to {_LARGEST:g}",
                path,
            )


def _each(values: Array, n: int, name: str) -> Array:
    """Values of each of n frames, which may be the same ones for all."""
    rows = np.atleast_2d(values)
    if len(rows) not in (1, n) or rows.ndim != 2:
        raise InputError(f"{name} have shape {values.shape} for {n} frames")
    return np.broadcast_to(rows, (n, rows.shape[1]))


def _first(fields: Mapping[str, Any], names: tuple[str, ...]) -> Any:
    return next((fields[name] for name in names if name in fields), None)


def _numbers(value: Any, path: Path, what: str) -> Array:
    array = np.asarray(value)
    if array.dtype.kind not in "fiu" or not np.isfinite(array).all():
        raise InputError(f"{what} must be finite numbers", path)
    return array.astype(np.float64)


def _vectors(value: Any, path: Path, what: str, joints: int) -> Array:
    """(T, 3 joints) rotation vectors from vectors or matrices, or (T, n) components as they are."""
    array = _numbers(value, path, what)
    if array.size == 0:
        raise InputError(f"{what} is empty", path)
    if array.shape[-2:] == (3, 3) and array.ndim >= 3:
        if array.size % (9 * joints):
            raise InputError(f"{what} has shape {array.shape}, no {joints} matrices a frame", path)
        from handtrack.hand.rotations import matrix_to_vector

        return np.asarray(matrix_to_vector(array.reshape(-1, joints, 3, 3)).reshape(-1, 3 * joints))
    flat = np.atleast_2d(array)
    if flat.ndim == 3:
        flat = flat.reshape(len(flat), -1)
    if flat.ndim != 2 or flat.shape[1] > 3 * joints:
        raise InputError(f"{what} has shape {array.shape}, expected (frames, {3 * joints})", path)
    return flat
