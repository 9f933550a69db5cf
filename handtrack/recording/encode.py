"""Frames of a Track as the bytes of MCAP messages, a batch of frames at a time."""

from __future__ import annotations

import json

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import SettingsError
from handtrack.hand.mano_pose import to_mano
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_quaternion, quaternion_to_matrix
from handtrack.hand.skeleton import (
    ANGLE_NAMES,
    JOINT_NAMES,
    N_ANGLES,
    N_PARTS,
    PART_JOINT,
    PART_NAMES,
)
from handtrack.mcap.layout import Layout, tag, timestamps, varint
from handtrack.mcap.schema import message_class
from handtrack.mcap.state_fields import ARRAYS
from handtrack.tracking.track import Event, Track

Array = NDArray[np.float64]
Times = NDArray[np.uint64]

_FLOAT32 = 7  # foxglove.PackedElementField.FLOAT32
_LOG_LEVEL = {"info": 2, "warning": 3}
_PART_PARENT = np.array([0] + [0 if i == 0 else 3 * f + i for f in range(5) for i in range(3)])


def text(value: str) -> str:
    """The text as it can be written: a lone surrogate (of an odd file name) as its escape."""
    return value.encode("utf-8", "backslashreplace").decode("utf-8")


def hand_message(track: Track) -> bytes:
    """handtrack.Hand: all of a Track that doesn't change.

    Raises:
        SettingsError: the settings are not plain JSON values, or the model is the other hand's.
    """
    if track.hand != track.model.hand:
        raise SettingsError(
            f"{track.name} is a {track.hand} hand with a {track.model.hand} hand's model"
        )
    try:
        settings = json.dumps(dict(track.settings))
    except (TypeError, ValueError) as error:
        raise SettingsError(f"settings of {track.name} cannot be written: {error}") from error
    model = track.model
    message = message_class("handtrack.Hand")(
        hand=track.hand,
        sequence_name=text(track.name),
        subject=text(track.subject),
        source=text(track.source),
        version=text(track.version),
        settings=settings,
        has_truth=track.truth is not None,
        joint_names=JOINT_NAMES,
        angle_names=ANGLE_NAMES,
    )
    out = message.model
    out.name, out.hand, out.licensed = text(model.name), model.hand, model.licensed
    out.limits_name = text(model.limits.name)
    out.thumb_twist = model.thumb_twist
    out.limits_lower.extend(model.limits.lower)
    out.limits_upper.extend(model.limits.upper)
    out.rest_joints.extend(model.rest_joints.ravel())
    out.axes.extend(model.axes.ravel())
    out.shape.extend(model.shape)
    out.faces.extend(track.faces.ravel())
    out.n_vertices = track.n_vertices
    if not model.licensed:
        out.rest_vertices.extend(model.rest_vertices.ravel())
        out.weights.extend(model.weights.ravel())
    return bytes(message.SerializeToString())


def state_messages(track: Track, frames: slice) -> list[bytes]:
    """handtrack.State of each frame."""
    layout = Layout().number(1, "time_ns").number(2, "frame_index")
    values: dict[str, NDArray[np.generic]] = {
        "time_ns": track.time_ns[frames].astype("<i8"),
        "frame_index": track.frame_index[frames].astype("<i8"),
        "objective": track.objective[frames].astype("<f8"),
        "sweeps": track.sweeps[frames].astype("<i8"),
    }
    for field in ARRAYS:
        array = getattr(track, field.name)
        if array is not None:
            layout.numbers(field.number, field.name, field.size)
            values[field.name] = array[frames].astype("<f8")
    if track.model.licensed:
        for number, name, array in _mano(track, frames):
            layout.numbers(number, name, array.shape[1])
            values[name] = array.astype("<f8")
    layout.number(15, "objective").number(16, "sweeps")
    status, reason = track.status[frames], track.reason[frames]
    rows = layout.rows(len(status), **values)
    return [
        row.tobytes() + _text_field(17, s) + _text_field(18, r)
        for row, s, r in zip(rows, status.tolist(), reason.tolist(), strict=True)
    ]


def _mano(track: Track, frames: slice) -> list[tuple[int, str, Array]]:
    """Fields of the filtered poses as MANO's: number, name, (n, k), NaN where there is none."""
    angles, quaternion = track.angles[frames], track.quaternion[frames]
    translation = track.translation[frames]
    known = np.isfinite(np.hstack([angles, quaternion, translation])).all(1)
    pose, transl = np.full((len(angles), 48), np.nan), np.full((len(angles), 3), np.nan)
    rotation = quaternion_to_matrix(quaternion[known])
    mano = to_mano(track.model, angles[known], rotation, translation[known])
    pose[known], transl[known] = mano.values, mano.transl
    return [(19, "mano_pose", pose), (20, "mano_transl", transl)]


def _text_field(number: int, value: str) -> bytes:
    if not value:
        return b""
    data = value.encode("utf-8", "backslashreplace")
    return tag(number, 2) + varint(len(data)) + data


def cloud_messages(times: Times, points: Array, frame_id: str = "world") -> list[bytes]:
    """foxglove.PointCloud of each frame, with no points where no point is finite.

    Args:
        times: (n,) log times [ns].
        points: (n, k, 3) [m]; written as float32, NaN for a point that is missing.
        frame_id: the frame the points are in.
    """
    identity = Layout().field(2, Layout().constant(tag(4, 1) + np.float64(1).tobytes()))
    head = Layout().timestamp(1).field(2, frame_id.encode()).field(3, identity).fixed32(4, 12)
    for i, axis in enumerate("xyz"):
        element = Layout().field(1, axis.encode()).fixed32(2, 4 * i).varint(3, _FLOAT32)
        head.field(5, element)
    heads = head.rows(len(times), **timestamps(times))
    with np.errstate(over="ignore", invalid="ignore"):
        data = np.ascontiguousarray(points, "<f4")
    data_tag = tag(6, 2) + varint(data[:1].nbytes)
    return [
        start.tobytes() + data_tag + frame.tobytes() if any_seen else start.tobytes()
        for start, frame, any_seen in zip(heads, data, known_rows(data).tolist(), strict=True)
    ]


def known_rows(points: NDArray[np.floating]) -> NDArray[np.bool_]:
    """(n,) whether any point of a row of points (n, k, 3) is finite."""
    finite = np.isfinite(points)
    # NumPy reduces over an axis of three slowly
    return np.asarray((finite[..., 0] & finite[..., 1] & finite[..., 2]).any(-1))


class TransformEncoder:
    """foxglove.FrameTransforms of a hand: world -> root -> palm -> the fingers' parts.

    A part's frame has its origin in the part's joint and, at rest, the root frame's axes;
    each finger part is given in the frame of the part before it.
    """

    def __init__(self, topic: str, model: HandModel) -> None:
        self._model = model
        names = [f"{topic}/{name}" for name in PART_NAMES]
        joints = model.rest_joints[PART_JOINT]
        root = _transform("world", topic, Layout().slot("translation", 27), "root")
        self._layout = Layout().field(1, root)
        for part, name in enumerate(names):
            parent = int(_PART_PARENT[part])
            offset = joints[part] - joints[parent] if part else joints[0]
            fixed = Layout(tagged(offset[None]).tobytes())
            transform = _transform(names[parent] if part else topic, name, fixed, str(part))
            self._layout.field(1, transform)

    def messages(self, times: Times, track: Track, frames: slice) -> list[bytes | None]:
        """One message a frame of the filtered pose; None where there is no pose."""
        angles, quaternion = track.angles[frames], track.quaternion[frames]
        translation = track.translation[frames]
        known = np.asarray(np.isfinite(np.hstack([angles, quaternion, translation])).all(1))
        with np.errstate(invalid="ignore"):
            rotations = self._model.rotations(np.where(known[:, None], angles, 0.0))
            parents = rotations[:, _PART_PARENT]
            local = matrix_to_quaternion(np.swapaxes(parents, -1, -2) @ rotations)
        values = {str(part): tagged(_xyzw(local[:, part])) for part in range(N_PARTS)}
        values |= {"root": tagged(_xyzw(quaternion)), "translation": tagged(translation)}
        rows = self._layout.rows(len(times), **timestamps(times), **values)
        return [row.tobytes() if ok else None for row, ok in zip(rows, known.tolist(), strict=True)]


def _transform(parent: str, child: str, translation: Layout, rotation: str) -> Layout:
    out = Layout().timestamp(1).field(2, parent.encode()).field(3, child.encode())
    return out.field(4, translation).field(5, Layout().slot(rotation, 36))


def _xyzw(quaternion: Array) -> Array:
    return np.roll(quaternion, -1, axis=-1)


def tagged(values: Array) -> NDArray[np.uint8]:
    """Rows (n, k) as the protobuf double fields 1..k: (n, 9 k) bytes."""
    n, k = values.shape
    out = np.empty((n, k, 9), np.uint8)
    out[..., 0] = [tag(i + 1, 1)[0] for i in range(k)]
    out[..., 1:] = np.ascontiguousarray(values, "<f8").view(np.uint8).reshape(n, k, 8)
    return out.reshape(n, 9 * k)


def joint_state_messages(times: Times, angles: Array) -> list[bytes]:
    """ROS 2 sensor_msgs/msg/JointState of each frame, in little-endian CDR.

    Args:
        times: (n,) log times [ns].
        angles: (n, 20) [rad].
    """
    body = Layout().slot("seconds", 4).slot("nanos", 4).constant(_cdr_string(""))
    _align(body, 4).constant(N_ANGLES.to_bytes(4, "little"))
    for name in ANGLE_NAMES:
        _align(body, 4).constant(_cdr_string(name))
    _align(body, 4).constant(N_ANGLES.to_bytes(4, "little"))
    _align(body, 8).slot("position", 8 * N_ANGLES)
    body.constant(bytes(8))  # no velocities, no efforts
    layout = Layout(b"\x00\x01\x00\x00").append(body)
    billion = np.uint64(1_000_000_000)
    # a ROS 2 stamp ends in 2038; the message's log time does not
    seconds = np.minimum(times // billion, np.uint64(2**31 - 1)).astype("<u4")
    rows = layout.rows(
        len(times),
        seconds=seconds,
        nanos=(times % billion).astype("<u4"),
        position=angles.astype("<f8"),
    )
    return [row.tobytes() for row in rows]


def _cdr_string(value: str) -> bytes:
    data = value.encode() + b"\0"
    return len(data).to_bytes(4, "little") + data


def _align(layout: Layout, size: int) -> Layout:
    return layout.constant(bytes(-layout.size % size))


def event_message(event: Event) -> bytes:
    """handtrack.Event."""
    message = message_class("handtrack.Event")(
        time_ns=event.time_ns, level=text(event.level), text=text(event.text)
    )
    return bytes(message.SerializeToString())


def log_message(time: int, level: str, line: str, name: str) -> bytes:
    """foxglove.Log of one line at a log time [ns]."""
    message = message_class("foxglove.Log")(
        level=_LOG_LEVEL.get(level, 0), message=text(line), name=name
    )
    message.timestamp.seconds, message.timestamp.nanos = divmod(time, 1_000_000_000)
    return bytes(message.SerializeToString())
