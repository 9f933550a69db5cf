"""What is written comes back exactly, whatever a Track holds."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_tracks import make_track, with_skin, without_skin
from recording_checks import differences, first_frames

from handtrack.errors import HandtrackError, InputError, SettingsError
from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.recording import write as mcap_write
from handtrack.recording.info import info
from handtrack.recording.read import read_mcap
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import STATUSES, Event, Track

INT64 = st.integers(-(2**63), 2**63 - 1)
JSON = st.recursive(
    st.none() | st.booleans() | INT64 | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)
# what UTF-8 can hold: no lone surrogates; NumPy drops NULs at the end of a text
TEXT = st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
ARRAY_TEXT = TEXT.map(lambda text: text.rstrip("\0"))


@st.composite
def tracks(draw: st.DrawFn) -> Track:
    """Any Track at all: arrays of random bits, so of every kind of NaN too."""
    n = draw(st.integers(0, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))

    def bits(*shape: int) -> Any:
        kind = draw(st.sampled_from(["bits", "nan", "inf", "zero", "plain"]))
        if kind == "bits":
            return rng.integers(0, 2**64, (n, *shape), np.uint64).view(np.float64)
        fill = {"nan": np.nan, "inf": np.inf, "zero": -0.0, "plain": 0.25}[kind]
        return np.full((n, *shape), fill)

    hand = draw(st.sampled_from(["left", "right"]))
    model = HandModel.default(hand).scaled(draw(st.floats(0.5, 2)))
    limits = Limits(draw(TEXT), model.limits.lower * 1.25, model.limits.upper / 3)
    model = dataclasses.replace(model, name=draw(TEXT), limits=limits)
    model = with_skin(model, 3, 2) if draw(st.booleans()) else without_skin(model)
    times = draw(st.lists(INT64, min_size=n, max_size=n, unique=True).map(sorted))
    events = st.builds(Event, INT64, st.sampled_from(["info", "warning"]), TEXT)
    return Track(
        name=draw(TEXT),
        hand=hand,
        time_ns=np.array(times, np.int64),
        frame_index=np.array(draw(st.lists(INT64, min_size=n, max_size=n)), np.int64),
        observed=bits(21, 3),
        confidence=bits(21),
        truth=bits(21, 3) if draw(st.booleans()) else None,
        angles_raw=bits(20),
        angles=bits(20),
        quaternion_raw=bits(4),
        quaternion=bits(4),
        translation_raw=bits(3),
        translation=bits(3),
        fitted_joints=bits(21, 3),
        filtered_joints=bits(21, 3),
        angle_variance=bits(20),
        objective=bits(),
        iterations=np.array(draw(st.lists(INT64, min_size=n, max_size=n)), np.int64),
        status=np.array(draw(st.lists(st.sampled_from(STATUSES), min_size=n, max_size=n)), np.str_),
        reason=np.array(draw(st.lists(ARRAY_TEXT, min_size=n, max_size=n)), np.str_),
        rejected=rng.random((n, 21)) < 0.3,
        restart=rng.random(n) < 0.3,
        model=model,
        settings=draw(st.dictionaries(st.text(), JSON, max_size=3)),
        version=draw(TEXT),
        source=draw(TEXT),
        subject=draw(TEXT),
        events=tuple(draw(st.lists(events, max_size=3))),
    )


@settings(max_examples=60, deadline=None)
@given(written=st.lists(tracks(), min_size=1, max_size=3), mesh=st.booleans())
def test_everything_survives(written: list[Track], mesh: bool, tmp_path_factory: Any) -> None:
    path = tmp_path_factory.mktemp("round") / "run.mcap"
    write_mcap(written, path, mesh=mesh)
    read = read_mcap(path)
    assert [differences(a, b) for a, b in zip(written, read, strict=True)] == [[]] * len(written)


@pytest.mark.parametrize("compression", ["lz4", "zstd", "none"])
def test_a_recording_over_many_chunks_and_batches(compression: str, tmp_path: Path) -> None:
    track = make_track(2 * mcap_write.BATCH + 7)
    assert write_mcap(track, tmp_path / "run.mcap", compression=compression).is_file()
    (read,) = read_mcap(tmp_path / "run.mcap")
    assert differences(track, read) == []


def test_two_hands_keep_their_order(two_hands: list[Track], tmp_path: Path) -> None:
    write_mcap(two_hands[::-1], tmp_path / "run.mcap")
    read = read_mcap(tmp_path / "run.mcap")
    assert [track.hand for track in read] == ["left", "right"]
    assert differences(two_hands[1], read[0]) == differences(two_hands[0], read[1]) == []


def test_arrays_that_are_views_or_of_another_type(tmp_path: Path) -> None:
    track = make_track(10)
    strided = dataclasses.replace(
        track,
        observed=np.asfortranarray(track.observed),
        iterations=np.repeat(track.iterations, 2)[::2],
        angles=np.ascontiguousarray(track.angles.T).T,
    )
    write_mcap(strided, tmp_path / "run.mcap")
    assert differences(track, read_mcap(tmp_path / "run.mcap")[0]) == []


def test_a_licensed_skin_is_not_in_the_file(tmp_path: Path) -> None:
    model = dataclasses.replace(with_skin(HandModel.default("right")), licensed=True, name="mano")
    track = make_track(30, model=model)
    path = write_mcap(track, tmp_path / "run.mcap", mesh=False, compression="none")
    (read,) = read_mcap(path)
    assert differences(track, read) == ["model.rest_vertices", "model.faces", "model.weights"]
    assert read.model.licensed
    assert len(read.model.rest_vertices) == len(read.model.weights) == 0
    data = path.read_bytes()
    for array in (model.rest_vertices, model.weights):
        assert array.tobytes()[:240] not in data
        assert array.astype(np.float32).tobytes()[:120] not in data


def test_a_path_that_utf8_cannot_hold_is_written_as_its_escape(tmp_path: Path) -> None:
    track = dataclasses.replace(make_track(3), source="odd\udcff.npz")
    write_mcap(track, tmp_path / "run.mcap")
    assert read_mcap(tmp_path / "run.mcap")[0].source == r"odd\udcff.npz"


def test_what_cannot_be_written_is_said(tmp_path: Path) -> None:
    path, track = tmp_path / "run.mcap", make_track(5)
    with pytest.raises(SettingsError, match="no track"):
        write_mcap([], path)
    with pytest.raises(SettingsError, match="lz4, zstd, none"):
        write_mcap(track, path, compression="gzip")
    with pytest.raises(SettingsError, match="does not increase"):
        write_mcap(dataclasses.replace(track, time_ns=np.zeros(5, np.int64)), path)
    with pytest.raises(SettingsError, match="settings of sample"):
        write_mcap(dataclasses.replace(track, settings={"x": object()}), path)
    with pytest.raises(InputError, match="no folder"):
        write_mcap(track, tmp_path / "nowhere" / "run.mcap")
    with pytest.raises(InputError, match="is a folder"):
        write_mcap(track, tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_leaves_nothing_and_keeps_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, track = tmp_path / "run.mcap", make_track(5)
    path.write_bytes(b"the recording of yesterday")

    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("handtrack.mcap.stream.McapStream.finish", full)
    with pytest.raises(HandtrackError, match="No space left"):
        write_mcap(track, path)
    monkeypatch.setattr("handtrack.mcap.stream.McapStream.finish", _interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_mcap(track, path)
    assert [file.name for file in tmp_path.iterdir()] == ["run.mcap"]
    assert path.read_bytes() == b"the recording of yesterday"


def _interrupted(_: object) -> None:
    raise KeyboardInterrupt


def test_the_end_of_a_track_is_a_track(tmp_path: Path) -> None:
    """A prefix written by itself reads as the same frames do within the whole."""
    track = make_track(30)
    write_mcap(track, tmp_path / "whole.mcap")
    write_mcap(first_frames(track, 12), tmp_path / "part.mcap")
    whole, part = read_mcap(tmp_path / "whole.mcap")[0], read_mcap(tmp_path / "part.mcap")[0]
    assert differences(first_frames(whole, 12), part) == []


def test_a_long_recording_is_on_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tracks = [make_track(400), make_track(300, "left", name="b", truth=False)]
    monkeypatch.setattr("handtrack.files.long_arrays.MOST", 0)
    monkeypatch.setattr("handtrack.recording.summary.ROWS", 100)
    path = write_mcap(tracks, tmp_path / "a.mcap", mesh="none")
    read = read_mcap(path)
    assert [differences(a, b) for a, b in zip(tracks, read, strict=True)] == [[], []]
    counted = [h["frames"] for h in info(path)["hands"].values()]
    assert counted == [400, 300]
    assert not any(track.observed.flags.owndata for track in read)
