"""Several clips in one file are cut where time begins again; a clock that was set is not cut."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht

TIME = np.arange(12) / 30


def table(path, joints, times, name="time_s", more=None):
    head = [name, *(more or {}), *(f"{a}{i}" for i in range(21) for a in "xyz")]
    extra = list((more or {}).values())
    rows = [
        ",".join(map(str, [times[i], *(e[i] for e in extra), *joints[i].ravel()]))
        for i in range(len(joints))
    ]
    path.write_text("\n".join([",".join(head), *rows]))
    return path


@pytest.fixture
def joined(right) -> np.ndarray:
    """Three clips of 12 frames, each in another place."""
    return np.concatenate([right + np.array(at) for at in ([0, 0, 0], [0.3, 0, 0], [0, 0.4, 0])])


@pytest.mark.parametrize(
    ("name", "times"),
    [
        ("time_s", np.tile(TIME, 3)),
        ("timestamp_ms", np.tile(TIME, 3) * 1e3),
        ("frame", np.tile(np.arange(12), 3)),
        # sessions of which each has another start
        ("time_s", np.concatenate([TIME + 7.2, TIME + 3.5, TIME + 0.4])),
    ],
)
def test_time_that_begins_again_cuts(tmp_path, joined, right, name, times):
    found = ht.load(table(tmp_path / "a.csv", joined, times, name), hand="right")
    assert [s.name for s in found] == ["a clip 1", "a clip 2", "a clip 3"]
    for k, s in enumerate(found):
        assert np.array_equal(s.joints, joined[12 * k : 12 * k + 12])
        assert np.allclose(np.diff(s.time_ns), 1e9 / 30, atol=1e6)
    (note,) = (n for s in found for n in s.notes if "cut into 3 clips" in n)
    assert "again at frame 12, 24" in note


def test_both_hands_are_cut_alike(tmp_path, joined):
    lines = [
        json.dumps({"time": t, "right": x.tolist(), "left": (x * [-1, 1, 1]).tolist()})
        for t, x in zip(np.tile(TIME, 3), joined, strict=True)
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(lines))
    found = ht.load(tmp_path / "a.jsonl")
    assert [(s.name, s.hand, len(s)) for s in found] == [
        (f"a clip {k} {hand}", hand, 12) for k in (1, 2, 3) for hand in ("left", "right")
    ]


def test_a_clip_without_a_hand_is_left_out(tmp_path, joined):
    joined[12:24] = np.nan
    found = ht.load(table(tmp_path / "a.csv", joined, np.tile(TIME, 3)), hand="right")
    assert [s.name for s in found] == ["a clip 1", "a clip 3"]


@pytest.mark.parametrize("by", [-3600, -0.6])
def test_a_clock_that_was_set_while_the_hand_moved_on_cuts_nothing(tmp_path, right, by):
    times = np.arange(40) / 30 + np.where(np.arange(40) >= 25, by, 0)
    drift = right[:1] + np.linspace(0, 0.05, 40)[:, None, None]
    (found,) = ht.load(table(tmp_path / "a.csv", drift, times), hand="right")
    assert len(found) == 40
    assert any("goes back" in note for note in found.notes)


def test_a_long_table_of_clips_is_cut(tmp_path, joined):
    rows = [(i % 12, j, *joined[i, j]) for i in range(36) for j in range(21)]
    text = "\n".join(["frame,joint,x,y,z", *(",".join(map(str, r)) for r in rows)])
    (tmp_path / "a.csv").write_text(text)
    found = ht.load(tmp_path / "a.csv", hand="right")
    assert [s.name for s in found] == [f"a clip {k} right" for k in (1, 2, 3)]
    assert np.array_equal(found[2].joints, joined[24:])
    # the same rows joint by joint are one clip of 12 frames
    (tmp_path / "b.csv").write_text(
        "\n".join(
            ["frame,joint,x,y,z"]
            + [f"{i},{j}," + ",".join(map(str, joined[i, j])) for j in range(21) for i in range(12)]
        )
    )
    (one,) = ht.load(tmp_path / "b.csv", hand="right")
    assert np.array_equal(one.joints, joined[:12])
