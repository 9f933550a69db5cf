"""MCAP files to Tracks: whole files, files cut short, and files that still grow."""

from __future__ import annotations

import math
import re
import time
import warnings
from collections.abc import Iterator, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, SettingsError, shown
from handtrack.mcap.hands import EVENT, HAND, METADATA, STATE, HandDecoder, Hands
from handtrack.mcap.index import McapIndex, read_index
from handtrack.mcap.schema import message_class
from handtrack.mcap.walk import MAGIC, Place, Walk, opened
from handtrack.recording.info import info
from handtrack.recording.parts import between, pick
from handtrack.recording.summary import SUMMARY, read_summary
from handtrack.tracking.track import Track, track_of

_INT64 = np.iinfo(np.int64)


def read_mcap(
    path: str | Path, *, start_ns: int | None = None, end_ns: int | None = None
) -> list[Track]:
    """Read the tracks of an MCAP file of any format version, in the order written.

    All of a Track comes back exactly, to the bit; of a licensed model (MANO) not its template,
    which the file doesn't hold, but the skins that it does.

    A file whose writer was stopped is read up to its last whole chunk, with a UserWarning
    that says how much that is.

    Args:
        path: the file.
        start_ns, end_ns: first and last time wanted [ns], on the recording's clock; a complete
            file is read only there.

    Raises:
        InputError: there is no such file, it is not such a recording, it is damaged (with
            the place), or nothing of it is whole.
    """
    path = Path(path)
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
    tracks = [_taken(hand, walk) for hand in hands.all]
    if walk.cut:
        if not any(len(track) for track in tracks):
            raise InputError(f"{walk.cut}, no frame is whole", path)
        seconds = max(t.time_ns[-1] - t.time_ns[0] for t in tracks if len(t)) * 1e-9
        frames = max(len(track) for track in tracks)
        warnings.warn(
            f"{path}: {walk.cut}; read {frames} whole frames, {seconds:.2f} s", stacklevel=2
        )
    return [between(track, first, last) for track in tracks] if part else tracks


def read_part(
    path: str | Path,
    hand: str | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
) -> list[Track]:
    """`pick` from a recording; of a complete file only what is asked for is read.

    Raises:
        InputError: as `read_mcap`.
        SettingsError: as `pick`.
    """
    if start_s is None and end_s is None:
        return pick(read_mcap(path), hand)
    spans = [(h["first_ns"], h["last_ns"]) for h in info(path)["hands"].values() if h["frames"]]
    if not spans:
        raise SettingsError("there are no frames in the recording")
    span = min(first for first, _ in spans), max(last for _, last in spans)
    # a nanosecond more on either side: `pick` is exact
    start = None if start_s is None else span[0] + math.floor(start_s * 1e9) - 1
    end = None if end_s is None else span[0] + math.ceil(end_s * 1e9) + 1
    return pick(read_mcap(path, start_ns=start, end_ns=end), hand, start_s, end_s, span)


def follow_mcap(
    path: str | Path, *, poll_s: float = 0.1, timeout_s: float = 10.0
) -> Iterator[Track]:
    """Read a recording while it is written.

    Args:
        path: the part that a `McapRecorder` writes (`recorder.part`), or any recording.
        poll_s: how often to look for more [s].
        timeout_s: how long to wait for more [s]; the writer may be dead.

    Yields:
        The next frames of a hand, as a Track, until the recording is complete or nothing
        comes any more.

    Raises:
        InputError: as `read_mcap`.
    """
    path = Path(path)
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
            yield from (_taken(hand, walk) for hand in hands.all if hand.here)
        hands.check()


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
    hands.read(places, schemas=(HAND,))
    wanted = index.between(*times) if times[0] <= times[1] else []
    hands.read(wanted, schemas=(STATE, EVENT), times=times)
    return [_taken(hand, walk, wanted) for hand in hands.all]


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


def _taken(hand: HandDecoder, walk: Walk, places: list[Place] | None = None) -> Track:
    """What came of a hand since the last time, with the skin that the file holds.

    Args:
        hand: it.
        walk: of its file.
        places: of the chunks with its skin; everywhere if left out.
    """
    topic, first = f"{hand.topic}/mesh", hand.frames - hand.here
    stretch = hand.take()
    head = stretch.head
    if not head.model.licensed or all(c.topic != topic for c in walk.channels.values()):
        return track_of([stretch])
    span = first, hand.frames
    skin = StoredSkin(walk.path, topic, span, head.n_vertices, head.faces, places)
    return track_of([stretch], skin)


class StoredSkin:
    """The /HAND/mesh topic of a file, as `handtrack.tracking.track.Skin`.

    Args:
        path: the file.
        topic: the mesh's.
        frames: numbers of the first frame and of the one after the last.
        n_vertices: of the skin.
        faces: (F, 3) triangles.
        places: of the chunks to look in; everywhere if left out.
    """

    def __init__(
        self,
        path: Path,
        topic: str,
        frames: tuple[int, int],
        n_vertices: int,
        faces: NDArray[np.int32],
        places: Sequence[Place] | None = None,
    ) -> None:
        self._path, self._topic, self._frames, self._places = path, topic, frames, places
        self.n_vertices, self.faces = n_vertices, faces

    def vertices(self, frames: slice | NDArray[np.int64]) -> NDArray[np.float64]:
        """(n, V, 3) in the world [m], NaN where none was recorded.

        Raises:
            InputError: the file is not there any more, or is damaged.
        """
        return self._all[frames].astype(np.float64)

    @cached_property
    def _all(self) -> NDArray[np.float32]:
        first, end = self._frames
        out = np.full((end - first, self.n_vertices, 3), np.nan, np.float32)
        cloud = message_class("foxglove.PointCloud")
        index = None if self._places is None else read_index(self._path)
        walk = Walk(self._path) if index is None else index.walk()
        for found in walk.messages(lambda channel: channel.topic == self._topic, self._places):
            frame = found.sequence - first
            if not 0 <= frame < len(out):
                continue
            points = np.frombuffer(cloud.FromString(found.data).data, "<f4")
            if len(points) not in (0, 3 * self.n_vertices):
                raise InputError(
                    f"a mesh of {self._topic} has {len(points) / 3:g} vertices,"
                    f" expected {self.n_vertices}",
                    self._path,
                )
            if len(points):
                out[frame] = points.reshape(-1, 3)
        return out
