"""UmeTrack's hand (Han et al. 2022): joints of its angles, by the profile of a hand.

A profile is the JSON that comes with HOT3D (`umetrack_hand_user_profile.json`) or UmeTrack
(`generic_hand_model.json`): the rest positions and axes of 20 hinges, four for each finger from
the thumb, and 21 landmarks with the bones that move them. It is a left hand at the wrist's frame;
a right hand is its mirror image in x.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.files.long_arrays import by_blocks
from handtrack.hand.rotations import about_axis
from handtrack.hand.skeleton import ORDERS
from handtrack.hand.units import METRES, Unit
from handtrack.sequences.readers.companions import Companions
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.raw import Array, Raw

PROFILE_NAMES = ("umetrack_hand_user_profile.json", "generic_hand_model.json")
N_HINGES, N_LANDMARKS, N_FRAMES = 20, 21, 17
_PER_FINGER = 4
_BLOCK = 1024
_LARGEST = 50_000_000
# our joint i is landmark _LANDMARKS[i]; the thumb's two first hinges do not meet in a CMC joint
_LANDMARKS = ORDERS["umetrack"]


@dataclass(frozen=True, eq=False)
class Profile:
    """A hand of UmeTrack.

    Attributes:
        axes: (20, 3) unit axes of the hinges at rest.
        places: (20, 3) points on them [m].
        landmarks: (21, 3) at rest [m].
        weights: (21, 17) of the frames that move them: root, wrist, three of each finger.
    """

    axes: Array
    places: Array
    landmarks: Array
    weights: Array

    def joints(self, angles: Array) -> Array:
        """Left-hand joints in the wrist's frame.

        Args:
            angles: (T, 20) [rad].

        Returns:
            (T, 21, 3) [m], in this project's order; the thumb's CMC is NaN, as in UmeTrack.
        """
        there = np.array(_LANDMARKS) >= 0

        def of_some(some: Array) -> Array:
            out = np.full((len(some), N_LANDMARKS, 3), np.nan)
            out[:, there] = self._landmarks(some)[:, np.array(_LANDMARKS)[there]]
            return out

        return by_blocks(of_some, angles, rows=_BLOCK)

    def _landmarks(self, angles: Array) -> Array:
        """All fingers at once; frames stand last, so that sums over axes are long."""
        n = len(angles)
        turned = about_axis(np.broadcast_to(self.axes, (n, N_HINGES, 3)), angles)
        turns = np.ascontiguousarray(np.moveaxis(turned, 0, -1))
        moves = self.places[:, :, None] - _times(turns, self.places[:, :, None])
        turns = turns.reshape(-1, _PER_FINGER, 3, 3, n)
        moves = moves.reshape(-1, _PER_FINGER, 3, n)
        rotation = np.broadcast_to(np.eye(3)[..., None], (N_FRAMES, 3, 3, n)).copy()
        shift = np.zeros((N_FRAMES, 3, n))
        r, s = turns[:, 0], moves[:, 0]
        for k in range(1, _PER_FINGER):
            s = s + _times(r, moves[:, k])
            r = np.stack([_times(r, turns[:, k, :, j]) for j in range(3)], axis=2)
            rotation[k + 1 :: 3], shift[k + 1 :: 3] = r, s
        out = np.zeros((N_LANDMARKS, 3, n))
        for mark, frame in np.argwhere(self.weights):  # one or two frames move a landmark
            moved = _times(rotation[frame], self.landmarks[mark, :, None]) + shift[frame]
            out[mark] += self.weights[mark, frame] * moved
        return np.moveaxis(out, -1, 0)


def _times(turns: Array, places: Array) -> Array:
    """(..., 3, n) places (..., 3, n) turned by (..., 3, 3, n)."""
    out = turns[..., 0, :] * places[..., None, 0, :]
    out += turns[..., 1, :] * places[..., None, 1, :]
    out += turns[..., 2, :] * places[..., None, 2, :]
    return out


@dataclass(frozen=True, eq=False)
class Angles:
    """UmeTrack's angles of T frames, from which a profile makes joints.

    Attributes:
        values: (T, 20) [rad], NaN where the hand was not seen.
        rotation, translation: (T, 3, 3) and (T, 3) [m]: from the wrist's frame to the world.
        profile: the hand's, where the source has it.
    """

    values: Array
    rotation: Array | None = None
    translation: Array | None = None
    takes: str = "profile"
    profile: Profile | None = None

    def resolved(self, raw: Raw, companions: Companions) -> list[Raw]:
        """The hand with its joints.

        Raises:
            InputError: there is no profile, or it is none.
        """
        path = companions.profile or (None if self.profile else beside(raw.path))
        profile = self.profile if path is None else load_profile(path)
        if profile is None:
            raise InputError(
                "holds UmeTrack's joint angles, from which a hand's profile makes joints: none of"
                f" {', '.join(PROFILE_NAMES)} stands beside it (--profile FILE says where it is)",
                raw.path,
            )
        joints = profile.joints(np.nan_to_num(self.values))
        if raw.hand == "right":
            joints = joints * np.array([-1.0, 1.0, 1.0])
        if self.rotation is not None and self.translation is not None:
            joints = joints @ self.rotation.transpose(0, 2, 1) + self.translation[:, None]
        joints[~np.isfinite(self.values).all(1)] = np.nan
        return [replace(raw, joints=joints, unit="m", order="handtrack", pending=None)]


def beside(path: Path) -> Path | None:
    """The profile in the folder of a file; None where there is none."""
    folder = path if path.is_dir() else path.parent
    return next((p for name in PROFILE_NAMES if (p := folder / name).is_file()), None)


@lru_cache(8)
def _loaded(path: Path, changed: int) -> Profile:
    return read_profile(budget.read(path, _LARGEST), path)


def load_profile(path: Path) -> Profile:
    """A file's profile.

    Raises:
        InputError: it is not there, or none.
    """
    try:
        changed = path.stat().st_mtime_ns
    except OSError as error:
        raise InputError(f"--profile: {error.strerror or error}", path) from None
    return _loaded(path, changed)


def read_profile(data: bytes, path: Path) -> Profile:
    """A profile's content, under `hand_model` or as it is; lengths in mm, as UmeTrack has them,
    or in m, whichever makes a hand.

    Raises:
        InputError: no JSON, or no profile.
    """
    whole = decode(data, dict[str, msgspec.Raw], path)
    if "hand_model" in whole:
        whole = decode(bytes(whole["hand_model"]), dict[str, msgspec.Raw], path)
    axes = _numbers(whole, "joint_rotation_axes", 3, path)
    places = _numbers(whole, "joint_rest_positions", 3, path)
    landmarks = _numbers(whole, "landmark_rest_positions", 3, path)
    bones = _numbers(whole, "landmark_rest_bone_indices", None, path)
    parts = _numbers(whole, "landmark_rest_bone_weights", None, path)
    enough = len(axes) >= N_HINGES and len(places) >= N_HINGES and len(landmarks) == N_LANDMARKS
    if not enough or bones.shape != parts.shape or len(bones) != N_LANDMARKS:
        raise InputError(
            f"is no profile of UmeTrack: {len(axes)} axes and {len(landmarks)} landmarks,"
            f" expected {N_HINGES} and {N_LANDMARKS}",
            path,
        )
    if not ((bones >= 0) & (bones < N_FRAMES)).all():
        raise InputError(f"a landmark's bone is none of 0 to {N_FRAMES - 1}", path)
    weights = np.zeros((N_LANDMARKS, N_FRAMES))
    # of bones that are named twice the last weight counts, unless it is 0
    for column in range(bones.shape[1]):
        rows = np.flatnonzero(parts[:, column])
        weights[rows, bones[rows, column].astype(np.int64)] = parts[rows, column]
    lengths = np.linalg.norm(axes[:N_HINGES], axis=1)
    if not (lengths > 0.5).all():
        raise InputError("an axis of a joint has no length", path)
    metres = METRES[_unit(landmarks, path)]
    return Profile(
        axes[:N_HINGES] / lengths[:, None],
        places[:N_HINGES] * metres,
        landmarks * metres,
        weights,
    )


def _unit(landmarks: Array, path: Path) -> Unit:
    """The unit in which wrist to middle knuckle is a palm."""
    palm = float(np.linalg.norm(landmarks[11] - landmarks[5]))
    unit: Unit
    for unit in ("mm", "cm", "m"):
        if 0.03 < palm * METRES[unit] < 0.2:
            return unit
    raise InputError(f"a profile's palm of {palm:.3g} is none in mm, cm or m", path)


def _numbers(whole: dict[str, Any], name: str, width: int | None, path: Path) -> Array:
    if name not in whole:
        there = shown(", ".join(list(whole)[:6]))
        raise InputError(f"is no profile of UmeTrack: no {name} in it, but {there}", path)
    given = decode(bytes(whole[name]), Any, path)
    try:
        array = np.array(given, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        array = np.zeros(0)
    if array.ndim != 2 or not np.isfinite(array).all() or width not in (None, array.shape[1]):
        raise InputError(f"{name} is no table of numbers", path)
    if np.abs(array).max(initial=0.0) > 1e4:
        raise InputError(f"{name} holds {np.abs(array).max():.3g}: nothing of a hand", path)
    return array
