"""What a recording says of itself, reading a stretch of it, and recovering a broken one."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_tracks import make_track, with_skin
from recording_checks import differences, first_frames, messages

from handtrack.errors import InputError, SettingsError
from handtrack.hand.model import HandModel
from handtrack.mcap.index import read_index
from handtrack.recording.info import info
from handtrack.recording.read import read_mcap
from handtrack.recording.recorder import McapRecorder
from handtrack.recording.recover import recover
from handtrack.recording.settings import MeshChoice
from handtrack.recording.summary import RunningSpread
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track

DATA = Path(__file__).parent / "data"


def without_end(path: Path) -> bytes:
    """A file as its writer leaves it if it is stopped after the last chunk."""
    data = path.read_bytes()
    return data[: data.rindex(bytes([15, 4, 0, 0, 0, 0, 0, 0, 0]))]


def test_info_of_the_index_and_of_the_messages_agree(
    two_hands: list[Track], tmp_path: Path
) -> None:
    path = write_mcap(two_hands, tmp_path / "a.mcap", mesh="every 2", compression="zstd")
    whole = info(path)
    assert whole["complete"]
    (tmp_path / "cut.mcap").write_bytes(without_end(path))
    cut = info(tmp_path / "cut.mcap")
    assert not cut["complete"]
    assert (whole["note"], cut["note"][:16]) == ("", "it ends in the m")
    (tmp_path / "cut.mcap").write_bytes(path.read_bytes()[:-60])
    assert info(tmp_path / "cut.mcap")["note"] == "all of its data is there, but not its index"
    for name in ("format_version", "version", "mesh", "compression", "hands", "chunks"):
        assert cut[name] == whole[name], name
    assert cut["topics"] == whole["topics"]
    counts = {
        topic: (len(rows), sum(len(r[2]) for r in rows)) for topic, rows in messages(path).items()
    }
    told = {topic: (of["messages"], of["bytes"]) for topic, of in whole["topics"].items()}
    assert told == counts


def test_info_says_what_is_in_the_track(track: Track, recording: Path) -> None:
    about = info(recording)
    hand = about["hands"]["right"]
    assert (hand["name"], hand["hand"], hand["model"]) == ("sample", "right", "default")
    assert hand["settings"] == dict(track.settings)
    assert hand["frames"] == len(track)
    assert {s: hand[s] for s in ("fitted", "predicted", "lost")} == {
        s: int((track.status == s).sum()) for s in ("fitted", "predicted", "lost")
    }
    assert (hand["first_ns"], hand["last_ns"]) == (track.time_ns[0], track.time_ns[-1])
    assert hand["fps"] == pytest.approx(30, rel=3e-3)
    assert (hand["events"], hand["warnings"]) == (2, 1)
    errors = np.nanmean(track.error[track.status != "lost"], axis=1) * 1e3
    told = hand["error_mm"]["observed"]
    assert told["mean"] == pytest.approx(errors.mean())
    assert told["max"] == pytest.approx(errors.max())
    assert told["median"] == pytest.approx(np.median(errors), rel=0.02)
    assert "truth" in hand["error_mm"]
    json.dumps(about, allow_nan=False)


def test_info_reads_only_the_end(recording: Path, tmp_path: Path) -> None:
    """All chunks are overwritten, and it does not notice."""
    index = read_index(recording)
    assert index is not None
    data = bytearray(recording.read_bytes())
    expected = info(recording)
    for place in index.between(0, 2**64 - 1):
        data[place.offset : place.offset + place.length] = bytes(place.length)
    path = tmp_path / "x.mcap"
    path.write_bytes(data)
    assert info(path) | {"path": ""} == expected | {"path": ""}


def test_info_of_version_1() -> None:
    about = info(DATA / "version1.mcap")
    assert about["format_version"] == "1"
    assert [hand["frames"] for hand in about["hands"].values()] == [8, 4]


def test_spread_against_numpy() -> None:
    values = np.random.default_rng(0).lognormal(-6, 1, 5000)
    spread = RunningSpread()
    for part in np.array_split(np.append(values, [np.nan, np.inf]), 7):
        spread.add(part)
    assert spread.count == 5000
    assert spread.mean == pytest.approx(values.mean())
    assert spread.maximum == values.max()
    for part in (0.01, 0.5, 0.95, 1.0):
        assert spread.quantile(part) == pytest.approx(np.quantile(values, part), rel=2e-2)
    assert RunningSpread().mean is RunningSpread().quantile(0.5) is None


@pytest.mark.parametrize("stretches", [False, True])
def test_a_stretch_of_time(stretches: bool, tmp_path: Path) -> None:
    """By the index of a file: the same as of the whole, cut."""
    tracks = [make_track(300), make_track(280, "left", start_ns=-700_000_000, lost=slice(9, 12))]
    if stretches:
        names = [(t.name, t.hand) for t in tracks]
        path = tmp_path / "a.mcap"
        with McapRecorder(path, hands=names, start_ns=-700_000_000) as recorder:
            for hand, track in enumerate(tracks):
                recorder.add(track, hand)
    else:
        path = write_mcap(tracks, tmp_path / "a.mcap")
    index = read_index(path)
    assert index is not None
    for first, last in ((2.0, 3.0), (-1.0, 0.1), (7.9, 99.0), (50.0, 60.0), (3.0, 2.0)):
        a, b = int(first * 1e9), int(last * 1e9)
        read = read_mcap(path, start_ns=a, end_ns=b)
        for track, part in zip(tracks, read, strict=True):
            keep = (track.time_ns >= a) & (track.time_ns <= b)
            np.testing.assert_array_equal(part.time_ns, track.time_ns[keep])
            np.testing.assert_array_equal(part.angles, track.angles[keep])
            assert part.events == tuple(e for e in track.events if a <= e.time_ns <= b)
    some = index.between(2_700_000_000, 3_700_000_000)
    assert 0 < len(some) <= len(index.chunks) / 3
    late = read_mcap(path, start_ns=9_000_000_000)[0]
    np.testing.assert_array_equal(late.angles, tracks[0].angles[tracks[0].time_ns >= 9_000_000_000])


def test_a_stretch_of_a_file_without_an_index(
    recording: Path, track: Track, tmp_path: Path
) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(without_end(recording))
    with pytest.warns(UserWarning, match="ends in the middle"):
        (read,) = read_mcap(path, start_ns=500_000_000, end_ns=1_000_000_000)
    keep = (track.time_ns >= 500_000_000) & (track.time_ns <= 1_000_000_000)
    np.testing.assert_array_equal(read.angles, track.angles[keep])
    old = read_mcap(DATA / "version1.mcap", start_ns=100_000_000, end_ns=200_000_000)
    assert old[0].time_ns.tolist() == [
        100_000_000,
        133_333_333,
        166_666_667,
        200_000_000,
    ]


def test_stored_skins_of_a_stretch(tmp_path: Path) -> None:
    model = dataclasses.replace(with_skin(HandModel.default("right")), licensed=True, name="mano")
    track = make_track(200, model=model)
    path = write_mcap(track, tmp_path / "a.mcap")
    (read,) = read_mcap(path, start_ns=3_000_000_000, end_ns=4_000_000_000)
    keep = (track.time_ns >= 3_000_000_000) & (track.time_ns <= 4_000_000_000)
    expected = track.vertices(np.flatnonzero(keep)).astype(np.float32)
    np.testing.assert_array_equal(read.vertices(), expected)
    np.testing.assert_array_equal(read.vertices(slice(3, 7)), expected[3:7])


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("full", MeshChoice()),
        ("none", MeshChoice(every=0)),
        ("quantised", MeshChoice(quantised=True)),
        ("every 5", MeshChoice(every=5)),
        ("every:5", MeshChoice(every=5)),
        ("quantised,every:3", MeshChoice(quantised=True, every=3)),
        (True, MeshChoice()),
        (False, MeshChoice(every=0)),
    ],
)
def test_choices_of_the_mesh(text: Any, expected: MeshChoice) -> None:
    assert MeshChoice.of(text) == expected
    assert MeshChoice.of(str(expected)) == expected


@pytest.mark.parametrize(
    "text", ["", "half", "every", "every 0", "every x", "every 1.5", "full none"]
)
def test_choices_that_are_none(text: str) -> None:
    with pytest.raises(SettingsError, match="every N"):
        MeshChoice.of(text)


def test_quantised_and_every_nth_mesh(track: Track, tmp_path: Path) -> None:
    path = write_mcap(track, tmp_path / "a.mcap", mesh="quantised,every:7")
    rows = messages(path)["/right/mesh"]
    times = track.time_ns[::7].tolist()
    assert [row[0] for row in rows] == times
    full = messages(write_mcap(track, tmp_path / "b.mcap"))["/right/mesh"]
    exact = {row[0]: row[2] for row in full}
    size = 12 * track.n_vertices
    for time, _, data in rows:
        if len(data) < size:
            continue
        a, b = (np.frombuffer(d[-size:], "<f4").reshape(-1, 3) for d in (data, exact[time]))
        assert np.abs(a - b).max() <= 0.0000611
        assert (a * 8192 == np.rint(a * 8192)).all()


def test_recovering_what_is_whole(two_hands: list[Track], tmp_path: Path) -> None:
    path = write_mcap(two_hands, tmp_path / "a.mcap", compression="zstd")
    found = recover(path, tmp_path / "b.mcap")
    assert (found.note, found.lost_bytes, found.frames) == ("", 0, 90)
    read = read_mcap(tmp_path / "b.mcap")
    assert [differences(a, b) for a, b in zip(two_hands, read, strict=True)] == [[], []]
    assert info(tmp_path / "b.mcap")["hands"] == info(path)["hands"]
    a, b = messages(path), messages(tmp_path / "b.mcap")
    assert {t: [m[::2] for m in rows] for t, rows in a.items()} == {
        t: [m[::2] for m in rows] for t, rows in b.items()
    }


@pytest.mark.parametrize("how", ["cut", "flipped"])
def test_recovering_what_is_broken(how: str, track: Track, recording: Path, tmp_path: Path) -> None:
    data = bytearray(recording.read_bytes())
    at = len(data) * 3 // 4
    if how == "cut":
        del data[at:]
    else:
        data[at] ^= 1
    broken = tmp_path / "broken.mcap"
    broken.write_bytes(data)
    found = recover(broken, tmp_path / "b.mcap")
    assert ("ends in the middle" if how == "cut" else "damaged at byte") in found.note
    assert 0 < found.frames < len(track)
    assert 0 < found.lost_bytes < len(data)
    (read,) = read_mcap(tmp_path / "b.mcap")
    assert differences(first_frames(track, found.frames), read) in ([], ["events"])
    assert info(tmp_path / "b.mcap")["hands"]["right"]["frames"] == found.frames


def test_what_cannot_be_recovered(track: Track, recording: Path, tmp_path: Path) -> None:
    target = tmp_path / "b.mcap"
    with pytest.raises(InputError, match="another name"):
        recover(recording, recording)
    short = tmp_path / "short.mcap"
    for size, message in ((0, "empty"), (7, "not an MCAP"), (300, "no topics|no frame is whole")):
        short.write_bytes(recording.read_bytes()[:size])
        with pytest.raises(InputError, match=message):
            recover(short, target)
    assert not target.exists()
    with pytest.raises(InputError, match="no such file"):
        recover(tmp_path / "nowhere.mcap", target)
    assert len(track) == len(read_mcap(recording)[0])
