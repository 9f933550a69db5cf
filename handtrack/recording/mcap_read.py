"""MCAP files to Tracks: whole files, files cut short, and files that still grow."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from handtrack.errors import InputError
from handtrack.recording.hand_reader import OURS, VERSIONS, HandReader
from handtrack.recording.mcap_walk import MAGIC, Walk, opened
from handtrack.recording.mcap_write import METADATA
from handtrack.recording.stored_skin import StoredSkin
from handtrack.tracking.track import Track


def read_tracks(path: Path) -> list[Track]:
    """The Tracks of a file; see `handtrack.recording.mcap_io.read_mcap`."""
    walk = Walk(path)
    hands = Hands(walk)
    hands.read()
    hands.check()
    tracks = [hands.take(hand) for hand in hands.all]
    if walk.cut:
        if not any(len(track) for track in tracks):
            raise InputError(f"{walk.cut}, no frame is whole", path)
        last = max(t.time_ns[-1] - t.time_ns[0] for t in tracks if len(t)) * 1e-9
        frames = max(len(track) for track in tracks)
        warnings.warn(f"{path}: {walk.cut}; read {frames} whole frames, {last:.2f} s", stacklevel=3)
    return tracks


def follow_tracks(path: Path, poll_s: float, timeout_s: float) -> Iterator[Track]:
    """The Tracks of a file that grows; see `handtrack.recording.mcap_io.follow_mcap`."""
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
            hands.read(stream)
            if any(hand.here for hand in hands.all):
                hands.check()
            yield from (hands.take(hand) for hand in hands.all if hand.here)
        hands.check()


class Hands:
    """The hands in the messages of a file, as they are met."""

    def __init__(self, walk: Walk) -> None:
        self._walk, self._hands = walk, dict[str, HandReader]()

    @property
    def all(self) -> list[HandReader]:
        """In the order in which they were met."""
        return list(self._hands.values())

    def read(self, stream: IO[bytes] | None = None) -> None:
        """All messages that are there, as `Walk.messages`.

        Raises:
            InputError: as that does, or a message does not fit.
        """
        walk = self._walk
        for found in walk.messages(lambda schema: schema in OURS, stream):
            channel = walk.channels[found.channel]
            topic = channel.topic.rpartition("/")[0]
            hand = self._hands.get(topic)
            if hand is None:
                hand = self._hands[topic] = HandReader(topic, walk.path)
            hand.add(walk.schemas[channel.schema_id], found.sequence, found.data)

    def check(self) -> None:
        """Whether this is one of our recordings, of a version that can be read.

        Raises:
            InputError: it is not.
        """
        walk = self._walk
        if METADATA not in walk.metadata and not self._hands:
            topics = ", ".join(sorted(c.topic for c in walk.channels.values())) or "no topics"
            about = f"; {walk.cut}" if walk.cut else ""
            raise InputError(f"not a recording of handtrack, it has {topics}{about}", walk.path)
        if METADATA not in walk.metadata:
            raise InputError(f"the metadata record {METADATA!r} is missing", walk.path)
        version = walk.metadata[METADATA].get("format_version")
        known = [str(number) for number in VERSIONS]
        if version not in known:
            raise InputError(
                f"format version {version}, this handtrack reads {' and '.join(known)}", walk.path
            )

    def take(self, hand: HandReader) -> Track:
        """What came of a hand since the last time, with the skin that the file holds."""
        mesh = f"{hand.topic}/mesh"
        if not hand.licensed or all(c.topic != mesh for c in self._walk.channels.values()):
            return hand.take()
        return hand.take(StoredSkin(self._walk.path, mesh, hand.frames, *hand.skin_size))
