"""Hands in robots' logs: topics of poses, of markers, and named frames of TF."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.names import joint_name, without_hand, words
from handtrack.sequences.readers import cdr, robot_messages
from handtrack.sequences.readers.both_hands import two_hands
from handtrack.sequences.readers.fields import JOINT_COUNTS, PAIRS
from handtrack.sequences.readers.mcap_json import message_stamps
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw, stem
from handtrack.sequences.readers.robot_frames import FEWEST, Frames, columns_of
from handtrack.sequences.readers.robot_messages import Marker, Message, Poses, Transforms
from handtrack.sequences.readers.robot_messages import turn_of as _turn_of

_LISTS = (6, 7, 8)  # markers of cubes, spheres and points
_SINGLE = (1, 2, 3)  # of a cube, a sphere, a cylinder
_TEXT = 9
_ADDED = 0
_LOGGED_MOST = np.iinfo(np.int64).max

_CDR: dict[str, Callable[[cdr.Cdr, str], Message]] = {
    "geometry_msgs/msg/PoseArray": lambda c, _: cdr.poses(c),
    "geometry_msgs/msg/PoseStamped": lambda c, _: cdr.placed(c),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda c, _: cdr.placed(c),
    "geometry_msgs/msg/PointStamped": lambda c, _: cdr.placed(c),
    "foxglove_msgs/msg/PosesInFrame": lambda c, _: cdr.posed(c),
    "visualization_msgs/msg/MarkerArray": cdr.markers,
    "visualization_msgs/msg/Marker": cdr.marker,
    "tf2_msgs/msg/TFMessage": lambda c, _: cdr.transforms(c),
    "geometry_msgs/msg/TransformStamped": lambda c, _: cdr.transform(c),
    # a time and a frame's name, as in a header
    "foxglove_msgs/msg/FrameTransforms": lambda c, _: cdr.transforms(c),
    "foxglove_msgs/msg/FrameTransform": lambda c, _: cdr.transform(c),
}


def understood(schema: str, encoding: str) -> bool:
    """Whether messages of such a schema and encoding may hold hands."""
    if encoding in ("cdr", "ros1"):
        return _ros2(schema) in _CDR
    if encoding in ("protobuf", "json"):
        return schema in robot_messages.SCHEMAS
    return encoding == "flatbuffer" and schema == robot_messages.SCHEMA


def _ros2(schema: str) -> str:
    """ROS 1's names as ROS 2's."""
    return schema if "/msg/" in schema else schema.replace("/", "/msg/", 1)


def decode(data: bytes, schema: str, encoding: str, definition: bytes) -> Message:
    """A message of a schema that is understood.

    Raises:
        ValueError, TypeError, KeyError, struct.error, IndexError: it is none.
    """
    if encoding in ("cdr", "ros1"):
        text = definition.decode("utf-8", "replace")
        return _CDR[_ros2(schema)](cdr.Cdr(data, encoding == "ros1"), text)
    if encoding == "protobuf":
        return robot_messages.protobuf(data, schema, definition)
    if encoding == "json":
        return robot_messages.json(data, schema)
    return robot_messages.hand_pose(data)


@dataclass
class RobotLog:
    """Messages of a log, taken one after the other.

    Attributes:
        path: of the log.
    """

    path: Path
    _topics: dict[str, _Topic] = field(default_factory=dict)
    _frames: Frames = field(default_factory=lambda: Frames())

    def add(
        self, topic: str, log_time: int, data: bytes, schema: str, encoding: str, definition: bytes
    ) -> None:
        """Take a message.

        Raises:
            InputError: it does not fit its schema, with its topic and number.
        """
        of = self._topics.setdefault(topic, _Topic(topic))
        of.messages += 1
        try:
            message = decode(data, schema, encoding, definition)
        except (ValueError, TypeError, KeyError, IndexError, OverflowError, struct.error) as error:
            raise InputError(
                f"{topic}, message {of.messages - 1} is no {schema}: {shown(str(error), 80)}",
                self.path,
            ) from None
        if log_time > _LOGGED_MOST:
            raise InputError(
                f"{topic}, message {of.messages - 1}: log time {log_time} ns is beyond 64 bits",
                self.path,
            )
        self._take(of, log_time, message)

    def put(self, topic: str, log_time: int, message: Message) -> None:
        """Take a message that is decoded already."""
        of = self._topics.setdefault(topic, _Topic(topic))
        of.messages += 1
        self._take(of, log_time, message)

    def _take(self, of: _Topic, log_time: int, message: Message) -> None:
        several = message.transforms if isinstance(message, Transforms) else (message,)
        if any(abs(m.stamp or 0) > _LOGGED_MOST for m in several):
            raise InputError(
                f"{of.name}, message {of.messages - 1}: its stamp is beyond 64 bits", self.path
            )
        if isinstance(message, Transforms):
            self._frames.add(message.transforms, log_time, "static" in of.name)
        else:
            of.add(message, log_time)

    @property
    def topics(self) -> list[str]:
        """Topics of which messages were taken."""
        return sorted(self._topics)

    def hands(self) -> list[Raw]:
        """The hands in it; none where there are none.

        Raises:
            InputError: frames of which one is above itself.
        """
        raws: list[Raw] = []
        for _, topic in sorted(self._topics.items()):
            raws += topic.hands(self.path)
        if not raws:
            for topic in self._topics.values():
                self._frames.take(topic.name, topic.found, topic.logged)
            raws = self._frames.hands(self.path)
        labels = Counter(raw.hand for raw in raws)
        for raw in raws:
            raw.name = stem(self.path)
            if raw.hand is None or labels[raw.hand] > 1:
                raw.name += f" {raw.subject}"
            raw.subject, raw.tagged = "", len(raws) > 1
        return raws

    def check(self) -> list[Raw]:
        """The hands in it.

        Raises:
            NotJointsError: there are none, with what there is.
        """
        raws = self.hands()
        if not raws:
            said = [t.about() for _, t in sorted(self._topics.items())]
            raise NotJointsError(
                "no hand in its messages: expected topics of 21, 25 or 26 poses or markers, or"
                f" frames or topics named as joints; found {'; '.join(filter(None, said[:6]))}",
                self.path,
            )
        return raws


@dataclass
class _Topic:
    """A topic of poses or markers."""

    name: str
    messages: int = 0
    logged: list[int] = field(default_factory=list)
    found: list[Poses] = field(default_factory=list)

    def add(self, message: Poses, log_time: int) -> None:
        self.found.append(message)
        self.logged.append(log_time)

    def about(self) -> str:
        if not self.found:
            return f"{self.name} (frames)"
        count = Counter(len(m.places) or len(m.markers) for m in self.found).most_common(1)[0][0]
        return f"{self.name} ({count} {'markers' if self.found[0].markers else 'poses'})"

    def hands(self, path: Path) -> list[Raw]:
        """The hands of this topic; none where its lists are of no hand's length."""
        if any(m.markers for m in self.found):
            return self._of_markers(path)
        sizes = Counter(len(m.places) for m in self.found if len(m.places))
        if not sizes:
            return []
        size = sizes.most_common(1)[0][0]
        if size not in (*JOINT_COUNTS, *PAIRS):
            return []
        joints = np.full((len(self.found), size, 3), np.nan)
        for i, message in enumerate(self.found):
            if len(message.places) == size:
                joints[i] = message.places
            elif len(message.places):
                raise InputError(
                    f"{self.name}, message {i} has {len(message.places)} poses, others {size}", path
                )
        return two_hands(self._raw(joints, path, side_in(self.name, self.found[0].frame)))

    def _raw(self, joints: Array, path: Path, hand: Hand | None, order: str | None = None) -> Raw:
        own = [m.stamp for m in self.found]
        return Raw(
            joints,
            path,
            stem(path),
            hand=hand,
            unit="m",
            order=order,
            stamps=message_stamps(list(own), self.logged),
            subject=self.name.strip("/").replace("/", " "),
        )

    def _of_markers(self, path: Path) -> list[Raw]:
        """Markers by their names, or else by their numbers."""
        kept: dict[Hand | None, dict[int, dict[str, Array]]] = {}
        for i, message in enumerate(self.found):
            for hand, places in _marked(message.markers, self.name).items():
                kept.setdefault(hand, {})[i] = places
        raws = []
        for hand, by_message in kept.items():
            names = list(dict.fromkeys(n for places in by_message.values() for n in places))
            columns = columns_of(names)
            if columns is None:
                continue
            width = max(columns.values()) + 1 if columns else 0
            named = not all(n.isdigit() for n in names)
            joints = np.full((len(self.found), N_JOINTS if named else width, 3), np.nan)
            for i, places in by_message.items():
                for name, place in places.items():
                    if name in columns:
                        joints[i, columns[name]] = place
            raws.append(self._raw(joints, path, hand, "handtrack" if named else None))
        return raws


def _marked(markers: tuple[Marker, ...], topic: str) -> dict[Hand | None, dict[str, Array]]:
    """Places by hand and by name, or number, of one message."""
    found: dict[Hand | None, dict[str, Array]] = {}
    for marker in markers:
        if marker.action != _ADDED:
            continue
        hand = side_in(marker.space, marker.text, topic, marker.frame)
        places = found.setdefault(hand, {})
        if marker.kind in _LISTS and len(marker.points) in JOINT_COUNTS:
            turn = _turn_of(marker.pose)
            turn = turn if np.isfinite(turn).all() else np.eye(3)
            at = marker.points @ turn.T + marker.pose[:3]
            places |= {str(i): p for i, p in enumerate(at)}
        elif marker.kind in _SINGLE:
            named = (t for t in (marker.text, marker.space) if joint_name(words(t)) is not None)
            text = next((t for t in named if _says_which(t)), None)
            places[text or str(marker.number)] = marker.pose[:3]
    return {hand: places for hand, places in found.items() if len(places) >= FEWEST}


def _says_which(text: str) -> bool:
    """Whether a marker's name is of one joint, and not of a hand or a finger's number."""
    said = joint_name(words(text))
    return said is not None and not said.weak and (said.finger is not None or said.number is None)


def side_in(*texts: str) -> Hand | None:
    """The hand that the first text which names one names."""
    return next(
        (hand for text in texts if (hand := without_hand(words(text))[0]) is not None), None
    )
