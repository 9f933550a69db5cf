"""MCAP files to Tracks: whole files, files cut short, and files that still grow."""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.mcap.chunk import Place
from handtrack.mcap.index import McapIndex, read_index
from handtrack.mcap.walk import MAGIC, Found, Walk, opened
from handtrack.recording.hand_reader import OURS, VERSIONS, HandReader
from handtrack.recording.stored_skin import StoredSkin
from handtrack.recording.summary import SUMMARY, read_summary
from handtrack.recording.window import between
from handtrack.recording.write import METADATA
from handtrack.tracking.track import Track

_INT64 = np.iinfo(np.int64)


def read_tracks(path: Path, start_ns: int | None, end_ns: int | None) -> list[Track]:
    """The Tracks of a file; see `handtrack.recording.tracks.read_mcap`."""
    part = start_ns is not None or end_ns is not None
    first, last = _INT64.min if start_ns is None else start_ns, end_ns
    last = _INT64.max if last is None else last
    index = read_index(path) if part else None
    if index is not None and SUMMARY in index.metadata:
        with Walk(path).telling("its summary is damaged"):
            # metadata is outside of the chunks, which have checksums of their own
            read_summary(index.metadata)
        return _indexed(index, first, last)
    walk = Walk(path)
    hands = Hands(walk)
    hands.read()
    hands.check()
    tracks = [hands.take(hand) for hand in hands.all]
    if walk.cut:
        if not any(len(track) for track in tracks):
            raise InputError(f"{walk.cut}, no frame is whole", path)
        seconds = max(t.time_ns[-1] - t.time_ns[0] for t in tracks if len(t)) * 1e-9
        frames = max(len(track) for track in tracks)
        warnings.warn(
            f"{path}: {walk.cut}; read {frames} whole frames, {seconds:.2f} s", stacklevel=3
        )
    return [between(track, first, last) for track in tracks] if part else tracks


def _indexed(index: McapIndex, first: int, last: int) -> list[Track]:
    """The tracks, with what has times first..last [ns]."""
    walk = index.walk()
    hands = Hands(walk, first=None)
    hands.check()
    offset = _time_offset(index)
    times = max(first - offset, 0), min(max(last - offset, -1), 2**64 - 1)
    models = [begin for name, begin in index.begins.items() if name.startswith(f"{METADATA}/")]
    with walk.telling("its index is damaged"):
        places = sorted({index.at(begin) for begin in models})
    hands.read(places, schemas=OURS[:1])
    wanted = index.between(*times) if times[0] <= times[1] else []
    hands.read(wanted, schemas=OURS[1:], times=times)
    return [hands.take(hand, wanted) for hand in hands.all]


def _time_offset(index: McapIndex) -> int:
    """What was taken from the times of the recording, so that none is negative [ns].

    Raises:
        InputError: the file does not say so.
    """
    text = index.metadata[METADATA].get("time_offset_ns", "0")
    # a few digits more than any time has: int() is slow with many
    if not re.fullmatch(r"0|-[0-9]{1,19}", text) or int(text) < _INT64.min:
        raise InputError(
            f"metadata time_offset_ns is {shown(repr(text))}, expected a whole number of"
            " nanoseconds that is not positive",
            index.path,
        )
    return int(text)


def follow_tracks(path: Path, poll_s: float, timeout_s: float) -> Iterator[Track]:
    """The Tracks of a file that grows; see `handtrack.recording.tracks.follow_mcap`."""
    walk = Walk(path)
    hands = Hands(walk)
    size, since = 0, time.monotonic()
    # the file stays open: it is renamed when it is complete
    with opened(path) as stream:
        while not walk.done:
            now = stream.seek(0, 2)
            if now == size:
                if time.monotonic() - since > timeout_s:
                    return
                time.sleep(poll_s)
                continue
            size, since = now, time.monotonic()
            if size < len(MAGIC):
                continue
            hands.read(stream=stream)
            if any(hand.here for hand in hands.all):
                hands.check()
            yield from (hands.take(hand) for hand in hands.all if hand.here)
        hands.check()


def listed(topics: Iterable[str]) -> str:
    """Names of a file's topics for a message."""
    return shown(", ".join(sorted(topics)) or "no topics")


class Hands:
    """The hands in the messages of a file, as they are met."""

    def __init__(self, walk: Walk, first: int | None = 0) -> None:
        self._walk, self._first = walk, first
        self._hands: dict[str, HandReader] = {}

    @property
    def all(self) -> list[HandReader]:
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
        for found in walk.messages(lambda schema: schema in schemas, places, stream):
            if times[0] <= found.time <= times[1]:
                self.add(found)

    def add(self, found: Found) -> None:
        """A message, if it is one of ours.

        Raises:
            InputError: it does not fit.
        """
        walk = self._walk
        channel = walk.channels[found.channel]
        schema = walk.schemas.get(channel.schema_id, "")
        if schema not in OURS:
            return
        topic = channel.topic.rpartition("/")[0]
        hand = self._hands.get(topic)
        if hand is None:
            hand = self._hands[topic] = HandReader(topic, walk.path, self._first)
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
        version = walk.metadata[METADATA].get("format_version")
        known = [str(number) for number in VERSIONS]
        if version not in known:
            raise InputError(
                f"format version {shown(version)}, this handtrack reads {' and '.join(known)}",
                walk.path,
            )

    def take(self, hand: HandReader, places: list[Place] | None = None) -> Track:
        """What came of a hand since the last time, with the skin that the file holds.

        Args:
            hand: one of `all`.
            places: of the chunks with its skin; everywhere if left out.
        """
        mesh, path = f"{hand.topic}/mesh", self._walk.path
        if not hand.licensed or all(c.topic != mesh for c in self._walk.channels.values()):
            return hand.take()
        frames = hand.frames - hand.here, hand.frames
        return hand.take(StoredSkin(path, mesh, frames, *hand.skin_size, places))
