"""The hands in a recording: its messages, as they are met, to arrays."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from pathlib import Path
from typing import IO, TYPE_CHECKING

from handtrack.errors import HandtrackError, InputError, shown
from handtrack.mcap.hand import Event, Head, decode_event, decode_hand
from handtrack.mcap.state import StateDecoder, Stretch
from handtrack.mcap.walk import Found, Place, Walk

if TYPE_CHECKING:
    from mcap.records import Channel

METADATA = "handtrack"
"""The metadata record of every recording, before all messages."""
HAND, STATE, EVENT = "handtrack.Hand", "handtrack.State", "handtrack.Event"
OURS = (HAND, STATE, EVENT)
VERSIONS = (1, 2)
"""Format versions that can be read: all that were ever written."""


class HandDecoder:
    """Collects the messages of one hand.

    Args:
        topic: of the hand, such as "/right".
        path: of the file, for errors.
        first: number of the first frame that is wanted; None for whichever comes first.
    """

    def __init__(self, topic: str, path: Path, first: int | None = 0) -> None:
        self.topic, self._path = topic, path
        self._first = first
        self.frames = first or 0
        """Number of the next frame."""
        self.here = 0
        """Frames since the last `take`."""
        self._described: bytes | None = None
        self._events: dict[int, Event] = {}
        self._states = StateDecoder()

    def add(self, schema: str, sequence: int, data: bytes) -> None:
        """The next message.

        Raises:
            InputError: it does not fit, or one is missing before it.
        """
        from google.protobuf.message import DecodeError

        try:
            if schema == HAND:
                self._described = data
                self.__dict__.pop("head", None)
            elif schema == EVENT:
                event = decode_event(data)
                if self._events.setdefault(sequence, event) != event:
                    raise self._wrong(f"{self.topic}: there are two events {sequence}")
            else:
                self._count(sequence)
                self._states.add(data)
        except DecodeError as error:
            raise self._wrong(f"a {schema} message cannot be decoded: {error}") from error
        except InputError:
            raise
        except ValueError as error:
            raise self._wrong(str(error)) from error

    def _count(self, sequence: int) -> None:
        if self._first is None:
            self._first = self.frames = sequence
        if sequence != self.frames & 0xFFFFFFFF:
            raise self._wrong(
                f"frame {self.frames} of a hand is missing, the next one is {sequence}"
            )
        self.frames += 1
        self.here += 1

    def _wrong(self, message: str) -> InputError:
        return InputError(message, self._path)

    @cached_property
    def head(self) -> Head:
        """What does not change of the hand.

        Raises:
            InputError: the file does not say what hand this is, or what it says cannot be.
        """
        from google.protobuf.message import DecodeError

        if self._described is None:
            raise self._wrong(f"{self.topic}/model is missing, nothing says what hand this is")
        try:
            return decode_hand(self._described)
        except DecodeError as error:
            raise self._wrong(f"a {HAND} message cannot be decoded: {error}") from error
        except (ValueError, RecursionError, HandtrackError) as error:
            raise self._wrong(f"{shown(self.topic)}/model: {error}") from error

    def take(self) -> Stretch:
        """The frames and events read since the last call.

        Raises:
            InputError: as `head`, or frames do not fit.
        """
        head = self.head
        try:
            states = self._states.take(head.has_truth)
        except ValueError as error:
            raise self._wrong(f"{self.topic}: {error}") from error
        events = tuple(event for _, event in sorted(self._events.items()))
        self._events, self.here = {}, 0
        return Stretch(**states.arrays(), head=head, events=events)


class Hands:
    """The hands in the messages of a file, as they are met."""

    def __init__(self, walk: Walk, first: int | None = 0) -> None:
        self._walk, self._first = walk, first
        self._hands: dict[str, HandDecoder] = {}

    @property
    def all(self) -> list[HandDecoder]:
        """In the order in which they were met."""
        return list(self._hands.values())

    def read(
        self,
        places: list[Place] | None = None,
        schemas: tuple[str, ...] = OURS,
        times: tuple[int, int] = (0, 2**64 - 1),
        stream: IO[bytes] | None = None,
    ) -> None:
        """Messages of those schemas and log times, as `Walk.messages`.

        Raises:
            InputError: as that does, or a message does not fit.
        """
        walk = self._walk

        def wanted(channel: Channel) -> bool:
            return walk.schema_of(channel) in schemas

        for found in walk.messages(wanted, places, stream):
            if times[0] <= found.time <= times[1]:
                self.add(found)

    def add(self, found: Found) -> None:
        """A message, if it is one of ours.

        Raises:
            InputError: it does not fit.
        """
        walk = self._walk
        channel = walk.channels[found.channel]
        schema = walk.schema_of(channel)
        if schema not in OURS:
            return
        topic = channel.topic.rpartition("/")[0]
        hand = self._hands.get(topic)
        if hand is None:
            hand = self._hands[topic] = HandDecoder(topic, walk.path, self._first)
        hand.add(schema, found.sequence, found.data)

    def check(self) -> None:
        """Whether this is one of our recordings, of a version that can be read.

        Raises:
            InputError: it is not.
        """
        walk = self._walk
        if METADATA not in walk.metadata and not self._hands:
            about = f"; {walk.cut}" if walk.cut else ""
            topics = listed(c.topic for c in walk.channels.values())
            raise InputError(f"not a recording of handtrack, it has {topics}{about}", walk.path)
        if METADATA not in walk.metadata:
            raise InputError(f"the metadata record {METADATA!r} is missing", walk.path)
        check_version(walk.metadata[METADATA], walk.path)


def check_version(about: Mapping[str, str], path: Path) -> None:
    """Whether a recording whose metadata is that can be read.

    Raises:
        InputError: it is of another format version.
    """
    version = about.get("format_version")
    known = [str(number) for number in VERSIONS]
    if version in known:
        return
    reason = f"format version {shown(version)}, this handtrack reads {' and '.join(known)}"
    if version and version.isdecimal() and int(version) > max(VERSIONS):
        by = about.get("version")
        reason += f": a later handtrack wrote it{f', {shown(by)}' if by else ''}; install that one"
    raise InputError(reason, path)


def listed(topics: Iterable[str]) -> str:
    """Names of a file's topics for a message."""
    return shown(", ".join(sorted(topics)) or "no topics")


def is_recording(path: Path) -> bool:
    """Whether it is one of ours, and not another MCAP file.

    Raises:
        InputError: it cannot be read, or is no MCAP file.
    """
    walk = Walk(path)
    # our metadata stands before the first message
    next(walk.messages(lambda channel: True), None)
    return METADATA in walk.metadata
