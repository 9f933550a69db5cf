"""What is shown of one recording or several: parts, names, clocks, marks of limits."""

from __future__ import annotations

import dataclasses
import itertools
from pathlib import Path

import numpy as np
import pytest
from made_tracks import make_track
from recording_checks import differences

from handtrack.errors import SettingsError
from handtrack.hand.limits import preset
from handtrack.hand.skeleton import ANGLE_NAMES
from handtrack.recording.parts import pick, rows
from handtrack.recording.read import read_part
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track
from handtrack.viewer.hand_plots import HELD, INSIDE, OUTSIDE, limit_marks
from handtrack.viewer.shown import Run, counterpart, later, on_one_clock, origin_ns, shown


def joined(parts: list[Track]) -> Track:
    arrays = {
        f.name: np.concatenate([getattr(part, f.name) for part in parts])
        for f in dataclasses.fields(Track)
        if isinstance(getattr(parts[0], f.name), np.ndarray)
    }
    events = tuple(event for part in parts for event in part.events)
    return dataclasses.replace(parts[0], **arrays, events=events)


@pytest.mark.parametrize("cuts", [(0, 1, 60), (0, 20, 21, 26, 60), (0, 59, 60), (0, 60)])
def test_parts_make_up_the_whole(track: Track, cuts: tuple[int, ...]) -> None:
    early = dataclasses.replace(track.events[0], time_ns=-5)
    late = dataclasses.replace(track.events[0], time_ns=10**12)
    track = dataclasses.replace(track, events=(early, *track.events, late))
    parts = [rows(track, slice(a, b)) for a, b in itertools.pairwise(cuts)]
    assert not differences(joined(parts), track)


def test_a_stretch_of_time(track: Track) -> None:
    other = later(make_track(30, "left"), 1_000_000_000)
    first, second = pick([track, other], None, 1.0, 1.5)
    for found, start in ((first, 30), (second, 0)):
        assert found.time_ns[0] == 1_000_000_000
        assert len(found) == 16
        assert found.frame_index[0] == 100 + start
    # the left hand begins where the right one's stretch has ended
    (only,) = pick([track, other], None, None, 0.9)
    assert only.hand == "right"
    assert [e.text for e in only.events] == [
        "hand lost: no joints",
        "hand found again after 6 frames",
    ]
    assert pick([track], None, 0.7, 0.8)[0].events == ()


def test_a_stretch_of_a_file(track: Track, tmp_path: Path) -> None:
    tracks = [track, later(make_track(30, "left"), 1_000_000_000)]
    path = write_mcap(tracks, tmp_path / "x.mcap", mesh=False)
    for start, end in ((None, None), (0.5, None), (None, 0.9), (1.2, 1.5), (-3.0, 9.0)):
        found, expected = read_part(path, None, start, end), pick(tracks, None, start, end)
        assert [differences(a, b) for a, b in zip(found, expected, strict=True)] == [[]] * len(
            found
        )
    with pytest.raises(SettingsError, match=r"the recording is 1\.967 s long"):
        read_part(path, "left", 3.0)


def test_a_stretch_without_frames_is_refused(track: Track) -> None:
    for start, end, message in (
        (2.0, 1.0, "from 2 s to 1 s is empty"),
        (5.0, None, "the recording is 1.967 s long"),
        (None, -1.0, "no frames in that part"),
    ):
        with pytest.raises(SettingsError, match=message):
            pick([track], None, start, end)
    with pytest.raises(SettingsError, match="no left hand in the recording, only right"):
        pick([track], "left")


def test_names_and_counterparts() -> None:
    right, left, again = make_track(3), make_track(3, "left"), make_track(3)
    hands = shown([Run("A run", [right, left]), Run("b", [left, right]), Run("a-run", [again])])
    topics = ["a_run_right", "a_run_left", "b_left", "b_right", "a_run_2_right"]
    assert [hand.topic for hand in hands] == topics
    assert [hand.run for hand in hands] == [0, 0, 1, 1, 2]
    found = [counterpart(hand, hands) for hand in hands]
    assert [f and f.topic for f in found] == [
        None,
        None,
        "a_run_left",
        "a_run_right",
        "a_run_right",
    ]
    assert [hand.topic for hand in shown([Run("x", [right, left])])] == ["right", "left"]


def test_of_several_people_only_the_same_is_a_counterpart() -> None:
    people = [make_track(3, name="p0"), make_track(3, name="p1")]
    hands = shown([Run("a", people), Run("b", [people[1], make_track(3, name="p2")])])
    found = counterpart(hands[2], hands)
    assert found is not None
    assert found.track is people[1]
    assert counterpart(hands[3], hands) is None


def test_clocks() -> None:
    early, within = make_track(60), later(make_track(60), 1_000_000_000)
    runs, moved = on_one_clock([Run("a", [early]), Run("b", [within])])
    assert not moved
    assert runs[1].tracks[0] is within
    after = later(make_track(60), 3_600_000_000_000)
    runs, moved = on_one_clock([Run("a", [early]), Run("b", [after, later(after, 5)])])
    assert moved
    assert [t.time_ns[0] for run in runs for t in run.tracks] == [0, 0, 5]
    assert runs[1].tracks[0].events == early.events
    assert origin_ns([early, within]) == 0
    assert origin_ns([make_track(3, start_ns=1_700_000_000 * 10**9)]) is None


def test_marks_of_limits() -> None:
    limits = preset("li2021")
    pip, flexion = ANGLE_NAMES.index("index_pip_flexion"), ANGLE_NAMES.index("index_mcp_flexion")
    abduction = flexion + 1

    def mark(**degrees: float) -> tuple[int, int, int]:
        angles = np.full((1, 20), np.deg2rad(3.0))
        for name, value in degrees.items():
            angles[0, ANGLE_NAMES.index(name)] = np.deg2rad(value)
        marks = limit_marks(limits, angles)[0]
        others = np.delete(marks, [pip, flexion, abduction])
        assert (others == INSIDE).all()
        return int(marks[pip]), int(marks[flexion]), int(marks[abduction])

    assert mark(index_pip_flexion=50) == (INSIDE, INSIDE, INSIDE)
    assert mark(index_pip_flexion=99.6) == (HELD, INSIDE, INSIDE)
    assert mark(index_pip_flexion=100.05) == (HELD, INSIDE, INSIDE)
    assert mark(index_pip_flexion=100.2) == (OUTSIDE, INSIDE, INSIDE)
    assert mark(index_pip_flexion=-0.2) == (OUTSIDE, INSIDE, INSIDE)
    # the saddle's ellipse: 85 and 10 degrees are its half axes
    on = {"index_mcp_flexion": 85 * np.cos(0.7), "index_mcp_abduction": 10 * np.sin(0.7)}
    assert mark(**on) == (INSIDE, HELD, HELD)
    assert mark(**{name: 0.9 * value for name, value in on.items()}) == (INSIDE,) * 3
    assert mark(**{name: 1.05 * value for name, value in on.items()}) == (INSIDE, OUTSIDE, OUTSIDE)
    assert (limit_marks(limits, np.full((2, 20), np.nan)) == INSIDE).all()
    assert limit_marks(limits, np.empty((0, 20))).shape == (0, 20)
