"""Damage outside of the chunks: index, summary and metadata are checked, or not believed."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from made_tracks import make_track
from recording_checks import read_or_error

from handtrack.errors import InputError
from handtrack.mcap.index import read_index
from handtrack.mcap.stream import McapStream
from handtrack.mcap.walk import open_chunk
from handtrack.recording import write
from handtrack.recording.info import info
from handtrack.recording.read import read_mcap
from handtrack.recording.write import write_mcap
from tools.bench import damage


@pytest.mark.parametrize("compression", damage.COMPRESSIONS)
def test_whatever_is_damaged_what_is_read_is_right_or_told(compression: str) -> None:
    """Whole, by a range through the index, by `info` and by `recover`; the tool runs thousands."""
    counts, wrong = damage.study(compression, 25, seed=3)
    assert wrong == []
    assert counts["range: the same"] > 5
    assert counts["range: error"] > 20
    assert counts["whole: warned"] > 1


@pytest.mark.parametrize("bit", range(8))
def test_a_chunk_that_is_something_else_by_now(bit: int, tmp_path: Path) -> None:
    """The kind of a chunk's record flipped: it was passed over, and a range was silently short."""
    path = tmp_path / "a.mcap"
    track = make_track(100, lost=slice(0))
    write_mcap(track, path, mesh=False)
    index = read_index(path)
    assert index is not None
    data = bytearray(path.read_bytes())
    for place in (index.between(0, 2**63)[0], index.between(0, 2**63)[-1]):
        flipped = bytearray(data)
        flipped[place.offset] ^= 1 << bit
        path.write_bytes(flipped)
        for start, end in ((None, 1_000_000_000), (2_500_000_000, None)):
            read = read_or_error(path, start, end)
            keep = (track.time_ns >= (start or 0)) & (track.time_ns <= (end or 2**62))
            if not isinstance(read, str):
                assert read[0].time_ns.tolist() == track.time_ns[keep].tolist()
        assert isinstance(read_or_error(path), str)


def _with_summary(path: Path, change: Callable[[dict[str, Any]], Any]) -> Path:
    """A recording whose summary says something else, all checksums right."""
    from handtrack.recording import summary

    honest = summary.summary_record

    def record(*arguments: Any) -> dict[str, str]:
        values = json.loads(honest(*arguments)["json"])
        changed = change(values)
        text = json.dumps(values if changed is None else changed)
        return {"json": text, "crc32": summary._checksum({"json": text})}

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write, "summary_record", record)
        return write_mcap(make_track(12, lost=slice(5, 8)), path, mesh=False)


def _hand(name: str, value: Any) -> Callable[[dict[str, Any]], Any]:
    return lambda values: values["hands"]["right"].__setitem__(name, value)


LIES: dict[str, Callable[[dict[str, Any]], Any]] = {
    "a list": lambda values: [values],
    "nothing": lambda values: {},
    "no hands": lambda values: values.__setitem__("hands", None),
    "hands in a list": lambda values: values.__setitem__("hands", [1]),
    "a hand of text": lambda values: values["hands"].__setitem__("right", "x"),
    "bytes of text": lambda values: values["bytes"].__setitem__("/right/state", "many"),
    "no checksums": lambda values: values.__setitem__("metadata", 3),
    "frames of text": _hand("frames", "12"),
    "fewer frames": _hand("frames", -1),
    "other counts": _hand("fitted", 12),
    "no beginning": _hand("first_ns", None),
    "the end first": _hand("last_ns", -5),
    "a huge time": _hand("last_ns", 10**30),
    "a rate of text": _hand("fps", "30"),
    "errors in a list": _hand("error_mm", [1, 2]),
    "an error of text": _hand("error_mm", {"observed": {"mean": "x"}}),
    "a third hand": _hand("hand", "both"),
    "a name of numbers": _hand("name", 5),
    "many warnings": _hand("warnings", [0]),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_summary_that_says_what_cannot_be(lie: str, tmp_path: Path) -> None:
    """Its checksum is right: `info` reads the messages instead, and says so."""
    path = _with_summary(tmp_path / "a.mcap", LIES[lie])
    with pytest.warns(
        UserWarning, match="its summary cannot be used, so all of it is read"
    ) as told:
        about = info(path)
    assert "\n" not in str(told[0].message)
    hand = about["hands"]["right"]
    assert (hand["frames"], hand["lost"], hand["first_ns"]) == (12, 3, 0)
    read = read_or_error(path, 0, 100_000_000)
    assert isinstance(read, str)
    assert "its summary is damaged" in read
    assert len(read) < 500 + len(str(path))


@pytest.mark.parametrize("text", ["x" * 10_000, "1.5", "", "١", "5", "-" + "9" * 5_000, "nan"])
def test_a_time_offset_that_is_none(text: str, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with pytest.MonkeyPatch.context() as patch:
        honest = write.RecordingWriter._record

        def record(self: Any, name: str, values: dict[str, str]) -> None:
            honest(self, name, values | ({"time_offset_ns": text} if name == "handtrack" else {}))

        patch.setattr(write.RecordingWriter, "_record", record)
        write_mcap(make_track(5, lost=slice(0)), path, mesh=False)
    with pytest.raises(InputError, match=r"time_offset_ns is .* expected a whole number") as told:
        read_mcap(path, start_ns=0)
    assert len(str(told.value)) < 400 + len(str(path))


def test_a_chunk_that_would_fill_the_memory() -> None:
    """What it claims is looked at before it is opened, and while it is."""
    import lz4.frame
    import zstandard

    zeros = bytes(50_000_000)
    for name, packed in (
        (b"lz4", lz4.frame.compress(zeros)),
        (b"zstd", zstandard.compress(zeros)),
        (b"zstd", zstandard.ZstdCompressor(write_content_size=False).compress(zeros)),
    ):
        for claimed in (0, 1000, 2**40):
            head = struct.pack("<QQQII", 0, 0, claimed, 0, len(name)) + name
            with pytest.raises(ValueError, match="a chunk"):
                open_chunk(head + struct.pack("<Q", len(packed)) + packed)


def test_errors_quote_little_of_a_file(tmp_path: Path) -> None:
    def fill(writer: McapStream) -> None:
        schema = writer.schema("Image", "jsonschema", b"{}")
        for i in range(60):
            channel = writer.channel(f"/camera/{i}/\n\x1b[31m" + "x" * 100, "json", schema)
            writer.message(channel, 1, 0, b"{}")

    path = tmp_path / "x.mcap"
    with path.open("wb") as stream:
        made = McapStream(stream, "lz4", 1000)
        fill(made)
        made.finish()
    for look in (read_mcap, info):
        with pytest.raises(InputError, match="it has /camera/") as told:
            look(path)
        assert len(str(told.value)) < 300 + len(str(path))
        assert str(told.value).isprintable()
