"""Hands in robots' logs: topics of poses, of markers, and named frames of TF."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from collections.abc import Sequence as Items
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.sequences.readers import cdr, foxglove, robot_messages
from handtrack.sequences.readers.message_rows import Ints, NoMessageError, Rows, by_layout
from handtrack.sequences.readers.raw import NotJointsError, Raw, stem
from handtrack.sequences.readers.robot_frames import Frames
from handtrack.sequences.readers.robot_messages import Message, Transforms, stamps
from handtrack.sequences.readers.robot_topics import Told, Topic

_LOGGED_MOST = np.iinfo(np.int64).max
_HELD_MOST = 8 * 10**6
"""Bytes of messages that wait to be read together."""

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
        return schema in foxglove.SCHEMAS
    return encoding == "flatbuffer" and schema == robot_messages.SCHEMA


def _ros2(schema: str) -> str:
    """ROS 1's names as ROS 2's."""
    return schema if "/msg/" in schema else schema.replace("/", "/msg/", 1)


def decode(
    messages: Items[bytes], schema: str, encoding: str, definition: bytes
) -> Iterator[tuple[Ints, Message]]:
    """Messages of a schema that is understood, in groups of one layout, with their numbers.

    Raises:
        NoMessageError: one is none.
    """
    if encoding == "json":
        return foxglove.json(messages, schema)
    text = definition.decode("utf-8", "replace") if encoding in ("cdr", "ros1") else ""

    def read(rows: Rows) -> Message:
        if encoding == "protobuf":
            return foxglove.protobuf(rows, schema, definition)
        if encoding == "flatbuffer":
            return robot_messages.hand_pose(rows)
        return _CDR[_ros2(schema)](cdr.Cdr(rows, encoding == "ros1"), text)

    return by_layout(messages, read)


@dataclass
class Channel:
    """Messages of one topic and schema that wait to be read.

    Attributes:
        log: that they are of.
        topic: theirs.
        schema, encoding, definition: theirs.
    """

    log: RobotLog
    topic: Topic
    schema: str
    encoding: str
    definition: bytes
    _numbers: list[int] = field(default_factory=list)
    _times: list[int] = field(default_factory=list)
    _messages: list[bytes] = field(default_factory=list)

    def add(self, log_time: int, data: bytes) -> None:
        """Take a message.

        Raises:
            InputError: it, or one before, does not fit its schema, with its topic and number.
        """
        if log_time > _LOGGED_MOST:
            raise self._wrong(len(self._times), f": log time {log_time} ns is beyond 64 bits")
        log = self.log
        self._numbers.append(log.number())
        self._times.append(log_time)
        self._messages.append(data)
        log.waiting += len(data)
        if log.waiting > _HELD_MOST:
            log.flush()

    def flush(self) -> None:
        """Read those that wait."""
        if not self._messages:
            return
        numbers, times = np.array(self._numbers), np.array(self._times, np.int64)
        try:
            for rows, message in decode(
                self._messages, self.schema, self.encoding, self.definition
            ):
                self.log.take(self.topic, numbers[rows], times[rows], message)
        except NoMessageError as error:
            why = f" is no {self.schema}: {shown(str(error), 80)}"
            raise self._wrong(error.number, why) from None
        self.topic.messages += len(self._messages)
        self._numbers, self._times, self._messages = [], [], []

    def _wrong(self, number: int, why: str) -> InputError:
        number += self.topic.messages
        return InputError(f"{self.topic.name}, message {number}{why}", self.log.path)


@dataclass
class RobotLog:
    """Messages of a log, taken one after the other.

    Attributes:
        path: of the log.
        waiting: bytes of messages that wait to be read.
    """

    path: Path
    waiting: int = 0
    _topics: dict[str, Topic] = field(default_factory=dict)
    _frames: Frames = field(default_factory=lambda: Frames())
    _channels: list[Channel] = field(default_factory=list)
    _numbers: Iterator[int] = field(default_factory=count)

    def channel(self, topic: str, schema: str, encoding: str, definition: bytes) -> Channel:
        """Where messages of a topic are put."""
        made = Channel(self, self._topic(topic), schema, encoding, definition)
        self._channels.append(made)
        return made

    def _topic(self, name: str) -> Topic:
        return self._topics.setdefault(name, Topic(name))

    def number(self) -> int:
        """A message's number, higher than those before."""
        return next(self._numbers)

    def flush(self) -> None:
        """Read the messages that wait."""
        self.waiting = 0
        for channel in self._channels:
            channel.flush()

    def put(self, topic: str, log_time: int, message: Message) -> None:
        """Take a message that is decoded already."""
        self.take(self._topic(topic), np.array([self.number()]), stamps(log_time), message)

    def take(self, of: Topic, numbers: Ints, logged: Ints, message: Message) -> None:
        """Take messages of one layout that are decoded."""
        if isinstance(message, Transforms):
            self._frames.add(message.transforms, numbers, logged, "static" in of.name)
        else:
            of.told.append(Told(numbers, logged, message))

    @property
    def topics(self) -> list[str]:
        """Topics of which messages were taken."""
        return sorted(self._topics)

    def hands(self) -> list[Raw]:
        """The hands in it; none where there are none.

        Raises:
            InputError: frames of which one is above itself.
        """
        self.flush()
        raws: list[Raw] = []
        for _, topic in sorted(self._topics.items()):
            raws += topic.hands(self.path)
        if not raws:
            for topic in self._topics.values():
                if topic.told:
                    self._frames.take(topic.name, topic.in_order())
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
