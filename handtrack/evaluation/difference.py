"""What differs between two tracks of the same hand: the numbers of `handtrack diff`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.rotations import matrix_to_vector, quaternion_to_matrix
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES
from handtrack.tracking.track import Track

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Change:
    """Absolute differences over the frames that both have; NaN where there are none."""

    mean: float
    max: float

    @staticmethod
    def of(values: Array) -> Change:
        known = values[np.isfinite(values)]
        if not known.size:
            return Change(float("nan"), float("nan"))
        return Change(float(known.mean()), float(known.max()))


@dataclass(frozen=True)
class Difference:
    """What differs between two tracks, after the filter.

    Attributes:
        name, hand: of the first.
        frames: of the first, of the second, and those that both have.
        same: every array is the same, to the bit.
        angles_deg: by the angle's name.
        joints_mm: by the joint's name, of the filtered joints.
        root_deg: turn between the two root frames.
        one_sided: common frames that only one of the two has a pose for.
        statuses: common frames whose status differs.
        settings: by name, what the first and the second have.
        bones_mm: largest difference of a bone's length between the two hands.
    """

    name: str
    hand: str
    frames: tuple[int, int, int]
    same: bool
    angles_deg: Mapping[str, Change]
    joints_mm: Mapping[str, Change]
    root_deg: Change
    one_sided: int
    statuses: int
    settings: Mapping[str, tuple[Any, Any]]
    bones_mm: float

    @property
    def worst_deg(self) -> float:
        """Largest difference of an angle [deg]; 0 without common poses."""
        return float(np.nan_to_num(max((c.max for c in self.angles_deg.values()), key=_known)))

    @property
    def worst_mm(self) -> float:
        """Largest difference of a joint [mm]; 0 without common poses."""
        return float(np.nan_to_num(max((c.max for c in self.joints_mm.values()), key=_known)))

    def within(self, degrees: float, millimetres: float) -> bool:
        """Whether all frames are common, and poses differ by no more."""
        whole = self.frames[0] == self.frames[1] == self.frames[2] and not self.one_sided
        return whole and self.worst_deg <= degrees and self.worst_mm <= millimetres

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; what is not known is None."""
        return {**_plain(asdict(self)), "worst_deg": self.worst_deg, "worst_mm": self.worst_mm}


def _known(value: float) -> float:
    return -1.0 if np.isnan(value) else value


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def difference(a: Track, b: Track) -> Difference:
    """What differs between two tracks; frames belong together by number, else by time.

    Raises:
        InputError: they are of different hands, or have no frame in common.
    """
    if a.hand != b.hand:
        raise InputError(f"{a.name} is a {a.hand} hand, {b.name} a {b.hand} one")
    i, j = _common(a, b)
    if not len(i):
        raise InputError(f"{a.name} and {b.name} have no frame in common")
    angles = np.abs(np.degrees(a.angles[i] - b.angles[j]))
    joints = np.linalg.norm(a.filtered_joints[i] - b.filtered_joints[j], axis=-1) * 1e3
    known = np.isfinite(a.angles[i]).all(1), np.isfinite(b.angles[j]).all(1)
    both = known[0] & known[1]
    turns = quaternion_to_matrix(a.quaternion[i][both]), quaternion_to_matrix(b.quaternion[j][both])
    relative = matrix_to_vector(np.swapaxes(turns[0], -1, -2) @ turns[1])
    turned = np.degrees(np.linalg.norm(relative, axis=-1))
    names = sorted({*a.settings, *b.settings})
    return Difference(
        name=a.name,
        hand=a.hand,
        frames=(len(a), len(b), len(i)),
        same=_same(a, b),
        angles_deg={name: Change.of(angles[:, k]) for k, name in enumerate(ANGLE_NAMES)},
        joints_mm={name: Change.of(joints[:, k]) for k, name in enumerate(JOINT_NAMES)},
        root_deg=Change.of(turned),
        one_sided=int((known[0] != known[1]).sum()),
        statuses=int((a.status[i] != b.status[j]).sum()),
        settings={
            name: (a.settings.get(name), b.settings.get(name))
            for name in names
            if a.settings.get(name) != b.settings.get(name)
        },
        bones_mm=float(np.abs(a.model.bone_lengths - b.model.bone_lengths).max() * 1e3),
    )


def _common(a: Track, b: Track) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    for x, y in ((a.frame_index, b.frame_index), (a.time_ns, b.time_ns)):
        if len(np.unique(x)) == len(x) and len(np.unique(y)) == len(y):
            _, i, j = np.intersect1d(x, y, assume_unique=True, return_indices=True)
            return i, j
    return np.arange(0), np.arange(0)


def _same(a: Track, b: Track) -> bool:
    for x, y in zip(a.arrays().values(), b.arrays().values(), strict=True):
        if (x is None) != (y is None):
            return False
        if x is not None and (
            x.shape != y.shape
            or (x.tolist() != y.tolist() if x.dtype.kind == "U" else x.tobytes() != y.tobytes())
        ):
            return False
    return True


def differences(a: Sequence[Track], b: Sequence[Track]) -> list[Difference]:
    """What differs between the hands of two recordings.

    Hands belong together by name and side, else by side, where only one is of that side.

    Args:
        a: the hands of one recording, as `read_mcap` gives them.
        b: those of the other.

    Returns:
        One difference for each hand, in the order of `a`.

    Raises:
        InputError: a hand has no counterpart, or as `difference`.
    """
    left = list(b)
    out = []
    for track in a:
        fitting = [t for t in left if (t.name, t.hand) == (track.name, track.hand)]
        sides = [t for t in left if t.hand == track.hand]
        if not fitting and len(sides) == sum(t.hand == track.hand for t in a) == 1:
            fitting = sides
        if not fitting:
            raise InputError(f"{track.name} ({track.hand}) is in one of the two only")
        out.append(difference(track, fitting[0]))
        left.remove(fitting[0])
    if left:
        raise InputError(f"{_names(left)} in one of the two only")
    return out


def _names(tracks: Iterable[Track]) -> str:
    names = [f"{t.name} ({t.hand})" for t in tracks]
    return f"{' and '.join(names)} {'is' if len(names) == 1 else 'are'}"
