"""Messages encoded many at a time against the same messages written one by one."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest
from made_tracks import make_track

from handtrack.mcap.frames import Frames, Rows
from handtrack.mcap.stream import McapStream
from handtrack.recording.settings import RecordingSettings
from handtrack.recording.write import RecordingWriter
from handtrack.tracking.track import Track

CHUNK = 4000
"""Bytes, so that a few frames fill a chunk."""


def made(n: int, rng: np.random.Generator) -> dict[int, Rows]:
    """Messages of three channels: some missing, some short, some with a tail of their own."""
    rows = rng.integers(0, 256, (n, 40), np.uint8)
    sizes = np.where(rng.random(n) < 0.2, 12, 40)
    tails = [b"fitted" if rng.random() < 0.8 else b"lost: " * int(rng.integers(9)) for _ in sizes]
    return {
        1: Rows.whole(rows)._replace(tails=tails),
        2: Rows(rows[:, ::-1].copy(), np.where(rng.random(n) < 0.1, -1, sizes)),
        3: Rows.whole(rows[:, :9].copy(), rng.random(n) < 0.5),
    }


def stream(file: io.BytesIO) -> McapStream:
    out = McapStream(file, "none", CHUNK, 400)
    schema = out.schema("a", "protobuf", b"")
    for topic in "abc":
        out.channel(topic, "protobuf", schema)
    return out


@pytest.mark.parametrize("seed", range(8))
def test_the_file_is_that_of_messages_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    n, first = int(rng.integers(1, 200)), 2**32 - 5
    times = np.cumsum(rng.integers(0, 30, n)).astype(np.uint64) + np.uint64(2**64 - 10**6)
    columns = made(n, rng)
    at_once, one_by_one = io.BytesIO(), io.BytesIO()
    a, b = stream(at_once), stream(one_by_one)
    frames = Frames(times, np.arange(first, first + n, dtype=np.uint64), columns)
    cuts = np.unique(np.concatenate([[0, n], rng.integers(0, n, 3)]))
    for begin, end in zip(cuts[:-1].tolist(), cuts[1:].tolist(), strict=True):
        a.frames(frames, begin, end)
    lists = {channel: rows.messages() for channel, rows in columns.items()}
    for i, time in enumerate(times.tolist()):
        for channel, found in lists.items():
            if (data := found[i]) is not None:
                b.message(channel, time, (first + i) & 0xFFFFFFFF, data)
    a.finish()
    b.finish()
    assert (a.counts, a.bytes) == (b.counts, b.bytes)
    assert decoded(at_once) == decoded(one_by_one)
    assert indexed(at_once) == indexed(one_by_one)


def decoded(file: io.BytesIO) -> list[tuple[int, int, int, bytes]]:
    from mcap.reader import make_reader

    reader = make_reader(io.BytesIO(file.getvalue()), validate_crcs=True)
    found = reader.iter_messages(log_time_order=False)
    return [(c.id, m.sequence, m.log_time, m.data) for _, c, m in found]


def indexed(file: io.BytesIO) -> tuple[Any, ...]:
    """Chunks, with where they say that their messages are."""
    from mcap.records import Chunk, MessageIndex
    from mcap.stream_reader import StreamReader

    chunks: list[Any] = []
    for record in StreamReader(io.BytesIO(file.getvalue()), emit_chunks=True).records:
        if isinstance(record, Chunk):
            chunks.append((record.message_start_time, record.message_end_time, record.data, {}))
        elif isinstance(record, MessageIndex):
            chunks[-1][3][record.channel_id] = list(map(tuple, record.records))
    return tuple(chunks)


def test_rows_among_more_frames() -> None:
    rows = Rows.whole(np.array([[1], [2]], np.uint8))._replace(tails=[b"x", b""])
    assert rows.among(4, np.array([1, 3])).messages() == [None, b"\1x", None, b"\2"]
    assert Rows.of([b"abc", b""]).messages() == [b"abc", b""]


def written(tracks: list[Track]) -> list[tuple[int, int, int, bytes]]:
    file = io.BytesIO()
    contents = RecordingSettings.of("none", "none", False, None)
    writer = RecordingWriter(file, [(t.name, t.hand) for t in tracks], 0, contents)
    sources: list[Any] = []
    for i, track in enumerate(tracks):
        sources += writer.hand(i, track.head, 0).messages(track)
    writer.add(sources)
    writer.finish()
    return decoded(file)


def test_hands_at_the_same_times_come_one_after_another() -> None:
    tracks = [make_track(30, name="a"), make_track(30, name="b")]
    found = [(time, channel > 10) for channel, _, time, _ in written(tracks)]
    assert found[4:] == sorted(found[4:])  # after what does not change of the two
    assert {second for _, second in found} == {False, True}
