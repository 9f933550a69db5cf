"""handtrack.State: the arrays of some frames of a hand, and the messages that hold them.

To record another array: give it a field in `handtrack.proto`, compile that (see `schema.py`),
and add it to `States` and `ARRAYS`, with the format version that has it first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.files.long_arrays import Growing, GrowingTexts
from handtrack.hand.mano_pose import to_mano
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.mcap.frames import Layout, Rows, tag, varint
from handtrack.mcap.hand import Event, Head
from handtrack.mcap.schema import array_class
from handtrack.read_only import make_read_only

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class States:
    """Some frames of a tracked hand, T of them, as arrays that can only be read.

    Metres, radians, nanoseconds, quaternions wxyz (root to world). Where nothing was fitted
    (status "lost") poses and fitted joints are NaN.

    Attributes:
        time_ns: (T,) int64.
        frame_index: (T,) int64, frame numbers of the source.
        observed: (T, 21, 3) the joints given, NaN = missing.
        confidence: (T, 21) as given, 0 where missing.
        truth: (T, 21, 3) or None.
        angles_raw, angles: (T, 20) as fitted, and after the filter (equal without one).
        quaternion_raw, quaternion: (T, 4).
        translation_raw, translation: (T, 3).
        fitted_joints, filtered_joints: (T, 21, 3) of the raw and of the filtered pose.
        angle_variance: (T, 20) [rad^2] of the angles, the filter's where it has them (in files of
            older programs: of the raw angles); inf where nothing observes one.
        objective: (T,) sum of weighted squared distances [m^2] of the raw fit.
        iterations: (T,) sweeps and steps of the fitter.
        status: (T,) of "fitted", "predicted", "lost".
        reason: (T,) why, for every frame that is not plainly fitted; else "".
        rejected: (T, 21) joints that were seen, but are outliers and were not used; none by
            default.
        restart: (T,) frames where the hand was found anew, after it was gone for longer than a
            filter goes on, far from where it was, or in another pose: what was before says
            nothing of them. None by default.
    """

    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    observed: Array
    confidence: Array
    truth: Array | None
    angles_raw: Array
    angles: Array
    quaternion_raw: Array
    quaternion: Array
    translation_raw: Array
    translation: Array
    fitted_joints: Array
    filtered_joints: Array
    angle_variance: Array
    objective: Array
    iterations: NDArray[np.int64]
    status: NDArray[np.str_]
    reason: NDArray[np.str_]
    rejected: NDArray[np.bool_] = field(default=None)  # type: ignore[arg-type]
    restart: NDArray[np.bool_] = field(default=None)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        for name, shape in (("rejected", (len(self), N_JOINTS)), ("restart", (len(self),))):
            given = getattr(self, name)
            array = np.zeros(shape, bool) if given is None else np.asarray(given, dtype=bool)
            object.__setattr__(self, name, array)
        make_read_only(self)

    def __len__(self) -> int:
        return len(self.time_ns)

    def arrays(self) -> dict[str, Any]:
        """All of them by name."""
        return {of.name: getattr(self, of.name) for of in fields(States)}

    def landmarks_of(self, model: HandModel, filtered: bool = False) -> Array:
        """(T, 21, 3) where the raw or the filtered poses have the landmarks of the detector, which
        `observed` is compared with [m]; the joints where the model has none."""
        joints = self.filtered_joints if filtered else self.fitted_joints
        if not model.has_landmarks:
            return joints
        angles = self.angles if filtered else self.angles_raw
        turn = quaternion_to_matrix(self.quaternion if filtered else self.quaternion_raw)
        return joints + model.landmarks_from_joints(angles, turn)

    def error_of(self, model: HandModel) -> Array:
        """(T, 21) of each observed joint to the fitted (raw) landmark [m], NaN if missing."""
        return np.asarray(np.linalg.norm(self.landmarks_of(model) - self.observed, axis=-1))

    def skin_of(self, model: HandModel, frames: slice | NDArray[np.int64]) -> Array:
        """(n, V, 3) skin of the filtered poses of some frames [m], NaN in lost ones."""
        rotation = quaternion_to_matrix(self.quaternion[frames])
        return model.vertices(self.angles[frames], rotation, self.translation[frames])


@dataclass(frozen=True, eq=False, kw_only=True)
class Stretch(States):
    """Some frames of a hand, one after another, and what happened meanwhile.

    Attributes:
        head: what does not change of the hand.
        events: in order of time.
    """

    head: Head
    events: tuple[Event, ...] = ()

    @property
    def name(self) -> str:
        """The sequence's."""
        return self.head.name

    @property
    def hand(self) -> Hand:
        return self.head.hand

    @property
    def model(self) -> HandModel:
        return self.head.model

    @property
    def error(self) -> Array:
        """(T, 21) of each observed joint to the fitted (raw) landmark [m], NaN if missing."""
        return self.error_of(self.model)

    @property
    def settings(self) -> Mapping[str, Any]:
        return self.head.settings

    @property
    def filtered(self) -> bool:
        """Whether a filter made `angles` differ from `angles_raw`."""
        return self.head.filtered

    @property
    def faces(self) -> NDArray[np.int32]:
        """(F, 3) triangles of `vertices`."""
        return self.model.faces

    @property
    def n_vertices(self) -> int:
        """How many vertices `vertices` has."""
        return len(self.model.rest_vertices)

    def vertices(self, frames: slice | NDArray[np.int64]) -> Array:
        """(n, V, 3) skin of the filtered poses in the world [m], NaN in lost frames."""
        return self.skin_of(self.model, frames)


class ArrayField(NamedTuple):
    """A field of State that is an array of doubles.

    Attributes:
        number: of the of in the protobuf message.
        name: of the field, and of the attribute of `States`.
        shape: of one frame.
        since: the format version that has it first.
        before: what readers put in where an older file doesn't have it.
    """

    number: int
    name: str
    shape: tuple[int, ...]
    since: int = 1
    before: float = math.nan

    @property
    def size(self) -> int:
        """Numbers in a frame."""
        return math.prod(self.shape)


ARRAYS = (
    ArrayField(3, "observed", (21, 3)),
    ArrayField(4, "confidence", (21,)),
    ArrayField(5, "truth", (21, 3)),
    ArrayField(6, "angles_raw", (20,)),
    ArrayField(7, "angles", (20,)),
    ArrayField(8, "quaternion_raw", (4,)),
    ArrayField(9, "quaternion", (4,)),
    ArrayField(10, "translation_raw", (3,)),
    ArrayField(11, "translation", (3,)),
    ArrayField(12, "fitted_joints", (21, 3)),
    ArrayField(13, "filtered_joints", (21, 3)),
    ArrayField(14, "angle_variance", (20,)),
    ArrayField(21, "rejected", (21,), since=2, before=0.0),
    ArrayField(22, "restart", (), since=2, before=0.0),
)
"""`truth` is the only one that may be absent from all frames of a hand."""
SCALARS: dict[str, type] = {
    "time_ns": np.int64,
    "frame_index": np.int64,
    "objective": np.float64,
    "iterations": np.int64,
    "status": np.str_,
    "reason": np.str_,
}
"""The other fields, one value a frame."""
_IN_FILES = {"iterations": "sweeps"}
MARKS = ("rejected", "restart")
"""Those that are true or false, written as 1 or 0."""
_BLOCK = 1024  # frames decoded at a time


def encode_states(states: Any, frames: slice, model: HandModel) -> list[bytes]:
    """handtrack.State of each frame, as `state_rows`."""
    return [data for data in state_rows(states, frames, model).messages() if data is not None]


def state_rows(states: Any, frames: slice, model: HandModel) -> Rows:
    """handtrack.State of each frame.

    Args:
        states: `States`, or what has its attributes, as a Track.
        frames: which of them.
        model: the hand; a licensed one's poses are written as MANO's too.
    """
    layout = Layout().number(1, "time_ns").number(2, "frame_index")
    values: dict[str, NDArray[np.generic]] = {
        "time_ns": np.asarray(states.time_ns[frames], "<i8"),
        "frame_index": np.asarray(states.frame_index[frames], "<i8"),
        "objective": np.asarray(states.objective[frames], "<f8"),
        "sweeps": np.asarray(states.iterations[frames], "<i8"),
    }
    for of in ARRAYS:
        array = getattr(states, of.name)
        if array is not None:
            layout.numbers(of.number, of.name, of.size)
            values[of.name] = np.asarray(array[frames], "<f8")
    if model.licensed:
        for number, name, array in _mano(states, frames, model):
            layout.numbers(number, name, array.shape[1])
            values[name] = np.asarray(array, "<f8")
    layout.number(15, "objective").number(16, "sweeps")
    status, reason = states.status[frames].tolist(), states.reason[frames].tolist()
    known = {s: _text_field(17, s) for s in set(status)}
    tails = [known[s] + _text_field(18, r) for s, r in zip(status, reason, strict=True)]
    rows = layout.rows(len(status), **values)
    return Rows.whole(rows)._replace(tails=tails)


def _mano(states: Any, frames: slice, model: HandModel) -> list[tuple[int, str, Array]]:
    """Fields of the filtered poses as MANO's: number, name, (n, k), NaN where there is none."""
    angles, quaternion = states.angles[frames], states.quaternion[frames]
    translation = states.translation[frames]
    known = np.isfinite(np.hstack([angles, quaternion, translation])).all(1)
    pose, transl = np.full((len(angles), 48), np.nan), np.full((len(angles), 3), np.nan)
    rotation = quaternion_to_matrix(quaternion[known])
    mano = to_mano(model, angles[known], rotation, translation[known])
    pose[known], transl[known] = mano.values, mano.transl
    return [(19, "mano_pose", pose), (20, "mano_transl", transl)]


def _text_field(number: int, value: str) -> bytes:
    if not value:
        return b""
    data = value.encode("utf-8", "backslashreplace")
    return tag(number, 2) + varint(len(data)) + data


class StateDecoder:
    """Messages of one hand to `States`, one after another in bounded steps."""

    def __init__(self) -> None:
        self._kind = array_class("handtrack.State")
        self._waiting: list[Any] = []
        self._clear()

    def _clear(self) -> None:
        self._made: dict[str, Growing | GrowingTexts] = {
            of.name: Growing(of.shape, bool if of.name in MARKS else np.float64) for of in ARRAYS
        }
        for name, kind in SCALARS.items():
            self._made[name] = GrowingTexts() if kind is np.str_ else Growing((), kind)

    def add(self, data: bytes) -> None:
        """The next message.

        Raises:
            DecodeError: it is none.
            ValueError: an array of some message is not as long as it should be.
        """
        self._waiting.append(self._kind.FromString(data))
        if len(self._waiting) >= _BLOCK:
            self._decode()

    def take(self, has_truth: bool) -> States:
        """The frames added since the last call.

        Raises:
            ValueError: an array is not as long as it should be, or only some frames have a truth.
        """
        self._decode()
        arrays: dict[str, Any] = {name: made.whole() for name, made in self._made.items()}
        if not has_truth:
            arrays["truth"] = None
        elif len(arrays["truth"]) != len(arrays["time_ns"]):
            raise ValueError("only some frames have a truth")
        self._clear()
        return States(**arrays)

    def _decode(self) -> None:
        """Messages that wait, to a block of each array."""
        states, self._waiting = self._waiting, []
        for of in ARRAYS:
            parts = [getattr(state, of.name) for state in states]
            if of.name == "truth" and not any(parts):
                continue
            if of.since > 1 and not any(parts):
                # an older file
                parts = [np.full(of.size, of.before).tobytes()] * len(states)
            self._append(of.name, _rows(of, parts))
        for name in SCALARS:
            self._append(name, [getattr(state, _IN_FILES.get(name, name)) for state in states])

    def _append(self, name: str, values: Any) -> None:
        made = self._made[name]
        if isinstance(made, GrowingTexts):
            made.append(values)
        else:
            made.append(np.asarray(values, made.dtype))


def _rows(of: ArrayField, parts: Sequence[bytes]) -> Array:
    """(n, *shape) of a field's bytes in n messages."""
    size = 8 * of.size
    wrong = next((len(part) for part in parts if len(part) != size), None)
    if wrong is not None:
        raise ValueError(f"a state's {of.name} has {wrong / 8:g} numbers, expected {of.size}")
    return np.frombuffer(b"".join(parts), "<f8").reshape(-1, *of.shape)
