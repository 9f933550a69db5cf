"""Files that are cut, flipped or foreign: a correct prefix or one clear error, nothing else."""

from __future__ import annotations

import json
import random
import struct
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from made_tracks import make_track
from recording_checks import differences, first_frames, read_or_error

from handtrack.errors import InputError
from handtrack.mcap import stream as mcap_stream
from handtrack.mcap.schema import message_class
from handtrack.recording import write as mcap_write
from handtrack.recording.info import info
from handtrack.recording.read import read_mcap
from handtrack.recording.recover import recover
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track


@pytest.fixture
def small_chunks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_write, "CHUNK_BYTES", 12_000)


@pytest.fixture
def written(small_chunks: None, tmp_path: Path) -> tuple[Track, bytes]:
    track = make_track(40, lost=slice(5, 8))
    return track, write_mcap(track, tmp_path / "run.mcap", mesh=False).read_bytes()


def is_prefix(read: list[Track] | str, track: Track) -> bool:
    """Whether what was read is the track's beginning, exactly; events may be fewer."""
    if isinstance(read, str) or len(read) != 1:
        return False
    expected = first_frames(track, len(read[0]))
    wrong = differences(expected, read[0])
    events = read[0].events
    return wrong in ([], ["events"]) and events == track.events[: len(events)]


def test_every_truncation(written: tuple[Track, bytes], tmp_path: Path) -> None:
    track, data = written
    path, lengths = tmp_path / "cut.mcap", []
    for size in sorted({*np.linspace(0, len(data) - 1, 110, dtype=int).tolist(), 8, 9, 17}):
        path.write_bytes(data[:size])
        read = read_or_error(path)
        if isinstance(read, str):
            assert read.startswith(f"{path}: ")
            assert "\n" not in read
            lengths.append(0)
        else:
            assert is_prefix(read, track)
            lengths.append(len(read[0]))
    assert lengths == sorted(lengths)
    assert lengths[0] == 0
    assert lengths[-1] == len(track)
    assert len(set(lengths)) > 5


def test_a_cut_file_says_how_much_is_left(written: tuple[Track, bytes], tmp_path: Path) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(written[1][: len(written[1]) // 2])
    with pytest.warns(UserWarning, match=r"ends in the middle.*read \d+ whole frames, 0\.\d+ s"):
        read_mcap(path)


@pytest.mark.parametrize("compression", ["lz4", "zstd", "none"])
def test_flipped_bits(compression: str, small_chunks: None, tmp_path: Path) -> None:
    track = make_track(15, lost=slice(5, 8))
    data = write_mcap(track, tmp_path / "a.mcap", mesh=False, compression=compression).read_bytes()
    path, rng = tmp_path / "flipped.mcap", random.Random(1)
    errors = 0
    for _ in range(250):
        flipped = bytearray(data)
        flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(flipped)
        read = read_or_error(path)
        errors += isinstance(read, str)
        assert isinstance(read, str) or is_prefix(read, track)
    assert errors > 100


@pytest.mark.parametrize("kind", ["cut", "flipped"])
def test_info_and_recovery_of_damaged_files(
    kind: str, written: tuple[Track, bytes], tmp_path: Path
) -> None:
    """Numbers that are right, of the whole or of a beginning; a clean file; or one clear error."""
    track, data = written
    path, clean, rng = tmp_path / "damaged.mcap", tmp_path / "clean.mcap", random.Random(2)
    path.write_bytes(data)
    whole = info(path)
    kept = set()
    for _ in range(60):
        damaged = bytearray(data)
        if kind == "cut":
            del damaged[rng.randrange(len(data)) :]
        else:
            damaged[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        path.write_bytes(damaged)
        with suppress(InputError):
            told = info(path)
            if told["complete"]:
                assert told == whole
            for hand in told["hands"].values():
                assert hand["frames"] <= len(track)
                assert hand["settings"] == dict(track.settings)
        with suppress(InputError):
            found = recover(path, clean)
            assert is_prefix(read_mcap(clean), track)
            assert info(clean)["hands"]["right"]["frames"] == found.frames
            assert found.note or found.frames == len(track)
            kept.add(found.frames)
    assert len(kept) > 5


def test_the_places_where_flips_hurt_most(small_chunks: None, tmp_path: Path) -> None:
    """The header, a chunk's head and the end mark, byte for byte."""
    track = make_track(12, lost=slice(5, 8))
    data = write_mcap(track, tmp_path / "a.mcap", mesh=False).read_bytes()
    chunk = data.index(b"lz4") - 45
    end = data.rindex(bytes([15, 4, 0, 0, 0, 0, 0, 0, 0]))
    path = tmp_path / "flipped.mcap"
    for at in (*range(60), *range(chunk, chunk + 60), *range(end, end + 13)):
        for bit in (0, 2, 7):
            flipped = bytearray(data)
            flipped[at] ^= 1 << bit
            path.write_bytes(flipped)
            read = read_or_error(path)
            assert isinstance(read, str) or is_prefix(read, track)


def test_damage_names_the_file_and_the_place(written: tuple[Track, bytes], tmp_path: Path) -> None:
    data = bytearray(written[1])
    data[len(data) // 2] ^= 1
    path = tmp_path / "flipped.mcap"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"flipped\.mcap: damaged at byte \d+: "):
        read_mcap(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b"hello", "not an MCAP file"),
        (b"\x89MCAP0\r\n", "no topics"),
        (b"\x89MCAP0\r\n" + b"\xff" * 100, "no topics"),
    ],
)
def test_foreign_bytes(content: bytes, message: str, tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_mcap(path)


def test_no_file_and_a_folder(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"x\.mcap: there is no such file"):
        read_mcap(tmp_path / "x.mcap")
    with pytest.raises(InputError, match="cannot be read"):
        read_mcap(tmp_path)


def _file(path: Path, fill: Callable[[mcap_stream.McapStream], None]) -> Path:
    with path.open("wb") as stream:
        writer = mcap_stream.McapStream(stream, "lz4", 1000)
        fill(writer)
        writer.finish()
    return path


def test_a_recording_of_something_else(tmp_path: Path) -> None:
    def fill(writer: mcap_stream.McapStream) -> None:
        channel = writer.channel("/camera", "json", writer.schema("Image", "jsonschema", b"{}"))
        writer.message(channel, 1, 0, b"{}")

    path = _file(tmp_path / "x.mcap", fill)
    with pytest.raises(InputError, match="not a recording of handtrack, it has /camera"):
        read_mcap(path)


def test_a_later_format(tmp_path: Path) -> None:
    path = _file(tmp_path / "x.mcap", lambda w: w.metadata("handtrack", {"format_version": "7"}))
    with pytest.raises(InputError, match="format version 7, this handtrack reads 1 and 2: a later"):
        read_mcap(path)


def test_information_of_a_later_format_is_refused_as_its_tracks_are(tmp_path: Path) -> None:
    about = {"format_version": "3", "version": "0.9"}
    path = _file(tmp_path / "x.mcap", lambda w: w.metadata("handtrack", about))
    with pytest.raises(InputError, match=r"a later handtrack wrote it, 0\.9; install that one$"):
        info(path)


def test_the_metadata_is_missing(tmp_path: Path) -> None:
    def fill(writer: mcap_stream.McapStream) -> None:
        channel = writer.channel(
            "/right/event", "protobuf", writer.schema("handtrack.Event", "protobuf", b"")
        )
        writer.message(channel, 0, 0, b"")

    with pytest.raises(InputError, match="the metadata record 'handtrack' is missing"):
        read_mcap(_file(tmp_path / "x.mcap", fill))


def _with_states(path: Path, states: list[bytes], model: bytes | None) -> Path:
    def fill(writer: mcap_stream.McapStream) -> None:
        writer.metadata("handtrack", {"format_version": "1"})
        hand, state = (writer.schema(f"handtrack.{n}", "protobuf", b"") for n in ("Hand", "State"))
        if model is not None:
            writer.message(writer.channel("/right/model", "protobuf", hand), 0, 0, model)
        channel = writer.channel("/right/state", "protobuf", state)
        for i, data in enumerate(states):
            writer.message(channel, i, i, data)

    return _file(path, fill)


def test_files_that_keep_the_container_but_not_the_contract(tmp_path: Path) -> None:
    from handtrack.mcap.hand import encode_hand
    from handtrack.mcap.state import encode_states

    track, path = make_track(3, lost=slice(0, 0)), tmp_path / "x.mcap"
    hand, states = encode_hand(track.head), encode_states(track, slice(None), track.model)
    assert differences(track, read_mcap(_with_states(path, states, hand))[0]) == ["events"]

    def error(states: list[bytes], model: bytes | None) -> str:
        read = read_or_error(_with_states(path, states, model))
        assert isinstance(read, str)
        return read

    assert "/right/model is missing" in error(states, None)
    assert "cannot be decoded" in error([b"\x0a\xff\xff"], hand)
    short = message_class("handtrack.State").FromString(states[1])
    del short.angles[3:]
    assert "angles has 3 numbers, expected 20" in error([short.SerializeToString()], hand)
    short = message_class("handtrack.State").FromString(states[1])
    del short.truth[:]
    assert "truth has 0 numbers" in error([states[0], short.SerializeToString()], hand)

    changed = message_class("handtrack.Hand").FromString(hand)
    changed.joint_names[1] = "elbow"
    assert "another order" in error(states, changed.SerializeToString())
    changed = message_class("handtrack.Hand").FromString(hand)
    changed.settings = "[]"
    assert "no JSON object" in error(states, changed.SerializeToString())
    changed.settings = "{"
    assert "/right/model: " in error(states, changed.SerializeToString())
    changed = message_class("handtrack.Hand").FromString(hand)
    changed.model.axes[0] = 7.0
    assert "unit length" in error(states, changed.SerializeToString())
    changed = message_class("handtrack.Hand").FromString(hand)
    del changed.model.rest_joints[1:]
    assert "/right/model: " in error(states, changed.SerializeToString())


def test_a_frame_cut_out_of_the_middle(tmp_path: Path) -> None:
    from handtrack.mcap.hand import encode_hand
    from handtrack.mcap.state import encode_states

    track = make_track(3)

    def fill(writer: mcap_stream.McapStream) -> None:
        writer.metadata("handtrack", {"format_version": "1"})
        hand, state = (writer.schema(f"handtrack.{n}", "protobuf", b"") for n in ("Hand", "State"))
        writer.message(writer.channel("/a/model", "protobuf", hand), 0, 0, encode_hand(track.head))
        channel = writer.channel("/a/state", "protobuf", state)
        for i, data in enumerate(encode_states(track, slice(None), track.model)):
            if i != 1:
                writer.message(channel, i, i, data)

    with pytest.raises(InputError, match="frame 1 of a hand is missing, the next one is 2"):
        read_mcap(_file(tmp_path / "x.mcap", fill))


def test_a_chunk_whose_content_lies(tmp_path: Path) -> None:
    """A checksum that fits, around records that do not."""
    body = struct.pack("<BQ", 5, 10**6) + b"x" * 50
    chunk = struct.pack("<QQQI", 0, 0, len(body), zlib.crc32(body)) + struct.pack("<I", 0)
    chunk += struct.pack("<Q", len(body)) + body
    for inside in (chunk, chunk.replace(struct.pack("<Q", 10**6), struct.pack("<Q", 50))):
        fixed = bytearray(inside)
        inner = bytes(fixed[-len(body) :])
        fixed[24:28] = struct.pack("<I", zlib.crc32(inner))
        path = tmp_path / "x.mcap"
        record = struct.pack("<BQ", 6, len(fixed)) + bytes(fixed)
        path.write_bytes(b"\x89MCAP0\r\n" + record)
        with pytest.raises(InputError, match="damaged at byte 8"):
            read_mcap(path)


def test_metadata_says_what_made_the_file(recording: Path) -> None:
    from mcap.reader import make_reader

    with recording.open("rb") as stream:
        records = {r.name: r.metadata for r in make_reader(stream).iter_metadata()}
    assert list(records) == ["handtrack", "handtrack/right", "handtrack.summary"]
    head, hand = records["handtrack"], records["handtrack/right"]
    assert head["format_version"] == "2"
    assert head["version"] == "0.1.0"
    assert head["time_offset_ns"] == "0"
    assert head["mesh"] == "full"
    assert json.loads(head["hands"]) == {"right": "sample"}
    assert (hand["model"], hand["limits"]) == ("default", "anatomical")
    assert json.loads(hand["settings"])["filter"] == "kalman"
