"""What other programs draw of a recording: Foxglove, Rerun and ROS 2 know these messages."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.capsules import add_capsule, add_skin_material, joint_capsules
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_quaternion
from handtrack.hand.skeleton import (
    ANGLE_NAMES,
    N_ANGLES,
    N_PARTS,
    PART_JOINT,
    PART_NAMES,
    PART_PARENT,
)
from handtrack.mcap.frames import Layout, Rows, Times, tag, timestamps, varint
from handtrack.mcap.hand import text
from handtrack.mcap.schema import message_class

Array = NDArray[np.float64]

_FLOAT32 = 7  # foxglove.PackedElementField.FLOAT32
SKIN = (226, 178, 148)
"""Its colour, red, green, blue."""
_POINT = 29  # bytes of a Point3 in a list: tag, length, three tagged doubles
_LOG_LEVEL = {"info": 2, "warning": 3}


def cloud_rows(times: Times, points: Array, frame_id: str = "world") -> Rows:
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
    begun = head.size
    with np.errstate(over="ignore", invalid="ignore"):
        data = np.ascontiguousarray(points, "<f4")
    head.numbers(6, "points", math.prod(points.shape[1:]), 4)
    rows = head.rows(len(times), **timestamps(times), points=data)
    return Rows(rows, np.where(known_rows(data), head.size, begun))


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
            parent = int(PART_PARENT[part])
            offset = joints[part] - joints[parent] if part else joints[0]
            fixed = Layout(tagged(offset[None]).tobytes())
            transform = _transform(names[parent] if part else topic, name, fixed, str(part))
            self._layout.field(1, transform)

    def rows(self, times: Times, states: Any, frames: slice) -> Rows:
        """One message a frame of the filtered pose; none where there is no pose."""
        angles, quaternion = states.angles[frames], states.quaternion[frames]
        translation = states.translation[frames]
        known = np.asarray(np.isfinite(np.hstack([angles, quaternion, translation])).all(1))
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # of any model
            rotations = self._model.rotations(np.where(known[:, None], angles, 0.0))
            parents = rotations[:, PART_PARENT]
            local = matrix_to_quaternion(np.swapaxes(parents, -1, -2) @ rotations)
        values = {str(part): tagged(_xyzw(local[:, part])) for part in range(N_PARTS)}
        values |= {"root": tagged(_xyzw(quaternion)), "translation": tagged(translation)}
        return Rows.whole(self._layout.rows(len(times), **timestamps(times), **values), known)


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


class SceneEncoder:
    """foxglove.SceneUpdate messages of one hand: an entity with one list of triangles.

    Args:
        topic: of the hand; names the entity.
        faces: (F, 3) triangles.
        vertices: how many there are.
    """

    def __init__(self, topic: str, faces: NDArray[np.int32], vertices: int) -> None:
        colour = np.array(SKIN, np.float64) / 255
        triangles = Layout()
        triangles.field(1, Layout().field(2, tag(4, 1) + np.float64(1).tobytes()))
        triangles.slot("points", vertices * _POINT)
        triangles.field(3, tagged(np.append(colour, 1.0)[None]).tobytes())
        triangles.field(5, faces.astype("<u4").tobytes())
        entity = Layout().timestamp(1).field(2, b"world").field(3, topic.encode())
        self._layout = Layout().field(2, entity.field(12, triangles))
        self._gone = Layout().field(1, Layout().timestamp(1).field(3, topic.encode()))

    def rows(self, times: Times, vertices: NDArray[np.float64]) -> Rows:
        """One message a frame; where the skin is not known, the entity's deletion.

        Args:
            times: (n,) log times [ns].
            vertices: (n, V, 3) in the world [m].
        """
        n, count = vertices.shape[:2]
        points = np.empty((n, count, _POINT), np.uint8)
        points[..., :2] = np.frombuffer(tag(2, 2) + varint(_POINT - 2), np.uint8)
        points[..., 2:] = tagged(vertices.reshape(-1, 3)).reshape(n, count, _POINT - 2)
        stamps = timestamps(times)
        known = known_rows(vertices)
        gone = self._gone.rows(n, **stamps)
        tails = [b"" if ok else row.tobytes() for row, ok in zip(gone, known.tolist(), strict=True)]
        shown = self._layout.rows(n, **stamps, points=points)
        return Rows(shown, np.where(known, self._layout.size, 0), tails)


def joint_state_rows(times: Times, angles: Array) -> Rows:
    """ROS 2 sensor_msgs/msg/JointState of each frame, in little-endian CDR.

    Args:
        times: (n,) log times [ns].
        angles: (n, 20) [rad].
    """
    body = Layout().slot("seconds", 4).slot("nanos", 4).constant(cdr_string(""))
    _align(body, 4).constant(N_ANGLES.to_bytes(4, "little"))
    for name in ANGLE_NAMES:
        _align(body, 4).constant(cdr_string(name))
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
        position=np.asarray(angles, "<f8"),
    )
    return Rows.whole(rows)


def cdr_string(value: str) -> bytes:
    """A string in CDR."""
    data = value.encode() + b"\0"
    return len(data).to_bytes(4, "little") + data


def _align(layout: Layout, size: int) -> Layout:
    return layout.constant(bytes(-layout.size % size))


def log_message(time: int, level: str, line: str, name: str) -> bytes:
    """foxglove.Log of one line at a log time [ns]."""
    message = message_class("foxglove.Log")(
        level=_LOG_LEVEL.get(level, 0), message=text(line), name=name
    )
    message.timestamp.seconds, message.timestamp.nanos = divmod(time, 1_000_000_000)
    return bytes(message.SerializeToString())


def robot_description(topic: str, model: HandModel) -> bytes:
    """std_msgs/msg/String, in little-endian CDR, of a URDF whose links are the frames of
    `TransformEncoder`: those move it, so its joints only say which link hangs on which.

    Args:
        topic: of the hand; names the frames.
        model: the hand, with or without a skin.
    """
    robot = Element("robot", name=topic)
    add_skin_material(robot)
    SubElement(robot, "link", name=topic)
    capsules = joint_capsules(model)
    names = [f"{topic}/{name}" for name in PART_NAMES]
    for part, name in enumerate(names):
        link = SubElement(robot, "link", name=name)
        for capsule in capsules[PART_JOINT[part]]:
            add_capsule(link, "visual", capsule)
        joint = SubElement(robot, "joint", name=f"{name}_frame", type="floating")
        SubElement(joint, "parent", link=names[PART_PARENT[part]] if part else topic)
        SubElement(joint, "child", link=name)
    return b"\x00\x01\x00\x00" + cdr_string(tostring(robot, encoding="unicode"))


AGAIN_NS = 1_000_000_000
"""A skin that is gone is taken away, and written again, at most so often [ns]."""
_SHARED = 0.3
"""A part that moves a corner by at least this much has its triangle, so that bends have no gaps."""
_ALL = 1  # foxglove.SceneEntityDeletion.ALL


class PartSkinEncoder:
    """foxglove.SceneUpdate messages of one hand, whose entities follow the frames of its parts.

    The pieces are stiff: at the bends they overlap, where the skin itself is smooth.

    Args:
        topic: of the hand; its frames are those of `TransformEncoder`.
        model: the hand, with a skin.
    """

    def __init__(self, topic: str, model: HandModel) -> None:
        self._layout = Layout()
        colour = tagged(np.append(np.array(SKIN, np.float64) / 255, 1.0)[None]).tobytes()
        origin = Layout().field(2, tag(4, 1) + np.float64(1).tobytes())
        for part in range(N_PARTS):
            points, faces = piece(model, part)
            if not len(faces):
                continue
            triangles = Layout().field(1, origin).fields(2, tagged(points))
            triangles.field(3, colour).field(5, faces.astype("<u4").tobytes())
            name = f"{topic}/{PART_NAMES[part]}".encode()
            entity = Layout().timestamp(1).field(2, name).field(3, name).varint(5, 1)
            self._layout.field(2, entity.field(12, triangles))
        self._gone = Layout().field(1, Layout().timestamp(1).varint(2, _ALL))
        self._shown, self._since = False, -AGAIN_NS

    def messages(self, times: Sequence[int], known: Sequence[bool]) -> dict[int, bytes]:
        """What is to be written with some of the next frames: by their places among these.

        Args:
            times: (n,) log times [ns].
            known: (n,) whether the hand is there.
        """
        out: dict[int, bytes] = {}
        for i, (time, there) in enumerate(zip(times, known, strict=True)):
            if there == self._shown or (self._shown and time - self._since < AGAIN_NS):
                continue
            layout = self._layout if there else self._gone
            out[i] = layout.rows(1, **timestamps(np.array([time], np.uint64))).tobytes()
            self._shown = there
            self._since = time if there else self._since
        return out


def piece(model: HandModel, part: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The skin that moves with a part: (V', 3) vertices in its frame [m], (F', 3) triangles."""
    corners = model.weights[model.faces, part]
    strongest = model.weights.argmax(1)[model.faces] == part
    faces = model.faces[(corners >= _SHARED).any(1) | strongest.any(1)]
    used, numbered = np.unique(faces, return_inverse=True)
    points = model.rest_vertices[used] - model.rest_joints[PART_JOINT[part]]
    return points, numbered.reshape(-1, 3).astype(np.int32)
