"""Hands that were exchanged for some frames are put back, and none that were not."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.sequences.identity import repair_identity
from tools.make.panoptic import FPS, make, write

ROOT = Path(__file__).resolve().parent.parent.parent
DATA = ROOT.parent / "shared" / "data"


LEFT_RIGHT = [(0, 1)]
PEOPLE = [(0, 2), (1, 3)]
SAME_HAND = [(1, 3)]


def hands(seed=1, frames=90, people=2, drop=0.05, noise_mm=5.0):
    """Both hands of some people, with noise and missing joints."""
    _, joints = make(frames, noise_mm, people, seed)
    time_ns = np.rint(np.arange(frames) * 1e9 / FPS).astype(np.int64)
    rng = np.random.default_rng(seed)
    out = []
    for (person, hand), x in joints.items():
        x = np.where(rng.random((frames, 21, 1)) < drop, np.nan, x / 100)
        who = {"subject": f"person{person}", "name": f"person{person} {hand}", "source": "file"}
        confidence = rng.uniform(0.5, 1.0, (frames, 21))
        out.append(ht.Sequence(time_ns, x, confidence, hand=hand, **who))
    return out


def exchanged(sequences, pairs, frames):
    out = list(sequences)
    for i, j in pairs:
        for to, of in ((i, j), (j, i)):
            joints, confidence = out[to].joints.copy(), out[to].confidence.copy()
            joints[frames] = sequences[of].joints[frames]
            confidence[frames] = sequences[of].confidence[frames]
            out[to] = replace(out[to], joints=joints, confidence=confidence)
    return out


def same(a, b):
    return len(a) == len(b) and all(
        np.array_equal(x.joints, y.joints, equal_nan=True)
        and np.array_equal(x.confidence, y.confidence)
        and np.array_equal(x.time_ns, y.time_ns)
        and np.array_equal(x.frame_index, y.frame_index)
        for x, y in zip(a, b, strict=True)
    )


@pytest.mark.parametrize("frames", [slice(40, 41), slice(30, 37), slice(0, 5), slice(86, 90)])
@pytest.mark.parametrize("pairs", [LEFT_RIGHT, PEOPLE, SAME_HAND])
def test_exchanged_frames_are_put_back_to_the_bit(pairs, frames):
    true = hands()
    given = exchanged(true, pairs, frames)
    assert not same(given, true)
    repaired = repair_identity(given)
    assert same(repaired, true)
    touched = {k for pair in pairs for k in pair}
    for k, sequence in enumerate(repaired):
        assert len(sequence.remarks) == (k in touched)
    first, last = frames.start, frames.stop - 1
    (i, j) = pairs[0]
    (remark,) = repaired[i].remarks
    assert (remark.first_ns, remark.last_ns) == tuple(true[i].time_ns[[first, last]])
    where = f"frame {first}" if first == last else f"frames {first} to {last}"
    assert remark.text == f"exchanged with {true[j].name}: {where} put back"


def test_several_exchanges_in_one_source():
    true = hands()
    given = exchanged(true, LEFT_RIGHT, slice(20, 24))
    given = exchanged(given, PEOPLE, slice(30, 32))
    given = exchanged(given, LEFT_RIGHT, slice(70, 80))
    repaired = repair_identity(given)
    assert same(repaired, true)
    assert [len(s.remarks) for s in repaired] == [3, 3, 1, 1]


def test_a_single_hand_under_the_others_name():
    true = hands(people=1)
    left, right = (s.joints.copy() for s in true)
    # the left hand is not found, and the right one is called left
    left[50:54], right[50:54] = right[50:54], np.nan
    given = [replace(s, joints=x) for s, x in zip(true, (left, right), strict=True)]
    repaired = repair_identity(given)
    assert np.isnan(repaired[0].joints[50:54]).all()
    np.testing.assert_array_equal(repaired[1].joints, true[1].joints)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise_mm", [0.0, 10.0])
def test_nothing_is_exchanged_where_nothing_was(seed, noise_mm):
    true = hands(seed, drop=0.15, noise_mm=noise_mm)
    # people who come and go
    true[2] = replace(
        true[2], joints=np.where(np.arange(90)[:, None, None] < 35, np.nan, true[2].joints)
    )
    gone = true[1].joints.copy()
    gone[20:26] = np.nan
    true[1] = replace(true[1], joints=gone)
    for before, after in zip(true, repair_identity(true), strict=True):
        assert after is before


def test_single_joints_that_jump_exchange_nothing():
    true = hands()
    rng = np.random.default_rng(0)
    for k, s in enumerate(true):
        jumped = rng.random((len(s), 21, 1)) < 0.05
        true[k] = replace(s, joints=s.joints + 0.2 * jumped * rng.normal(size=s.joints.shape))
    assert all(a is b for a, b in zip(repair_identity(true), true, strict=True))


def test_what_stays_exchanged_is_taken_as_said():
    given = exchanged(hands(people=1), LEFT_RIGHT, slice(30, 75))
    assert all(a is b for a, b in zip(repair_identity(given), given, strict=True))


def test_hands_without_a_place_of_their_own_are_left_alone():
    given = exchanged(hands(people=1), LEFT_RIGHT, slice(30, 34))
    given = [replace(s, joints=s.joints - np.nanmean(s.joints, 1, keepdims=True)) for s in given]
    assert all(a is b for a, b in zip(repair_identity(given), given, strict=True))


def test_sources_are_looked_at_apart():
    left, right = exchanged(hands(people=1), LEFT_RIGHT, slice(30, 34))
    given = [left, replace(right, source="another")]
    assert all(a is b for a, b in zip(repair_identity(given), given, strict=True))


def test_times_that_only_one_hand_has():
    true = hands(people=1)
    # the right hand has no row where it was not found
    left, right = (s.joints.copy() for s in true)
    left[50:53] = right[50:53]
    kept = np.delete(np.arange(90), [50, 51, 52])
    given = [
        replace(true[0], joints=left),
        replace(
            true[1],
            time_ns=true[1].time_ns[kept],
            joints=right[kept],
            confidence=true[1].confidence[kept],
            frame_index=kept,
            truth=right[kept],
        ),
    ]
    repaired = repair_identity(given)
    assert np.isnan(repaired[0].joints[50:53]).all()
    np.testing.assert_array_equal(repaired[1].joints, true[1].joints)
    np.testing.assert_array_equal(repaired[1].frame_index, np.arange(90))
    np.testing.assert_array_equal(repaired[1].truth[kept], right[kept])
    assert np.isnan(repaired[1].truth[50:53]).all()


def test_the_track_says_what_was_put_back():
    true = hands(people=1, drop=0.0, noise_mm=2.0)
    repaired = repair_identity(exchanged(true, LEFT_RIGHT, slice(30, 34)))
    track = ht.track(repaired[1])
    text = "exchanged with person0 left: frames 30 to 33 put back"
    assert [e.time_ns for e in track.events if e.text == text] == [true[1].time_ns[30]]
    assert [reason == text for reason in track.reason] == [30 <= t < 34 for t in range(90)]
    assert np.abs(track.error).max() < 0.02


def test_from_files_to_the_command_line(tmp_path, capsys):
    from handtrack.cli import run

    _, joints = make(60, 2.0, 1, 3)
    a, b = joints[0, "left"], joints[0, "right"]
    a[20:25], b[20:25] = b[20:25].copy(), a[20:25].copy()
    folder = write(tmp_path, joints, 3)
    arguments = ["track", str(folder), "-o", str(tmp_path / "a.mcap"), "--no-mesh"]
    assert run(arguments) == 0
    said = capsys.readouterr().err
    assert said.count("repaired: ") == 2
    assert "frames 20721 to 20725 put back" in said
    repaired = ht.read_mcap(tmp_path / "a.mcap")
    assert any("20721 to 20725 put back" in e.text for e in repaired[0].events)
    assert run([*arguments, "--no-repair", "--overwrite"]) == 0
    assert "repaired" not in capsys.readouterr().err
    left = ht.read_mcap(tmp_path / "a.mcap")[0]
    assert np.abs(np.diff(left.observed[:, 0], axis=0)).max() > 0.1
    assert np.abs(np.diff(repaired[0].observed[:, 0], axis=0)).max() < 0.1


@pytest.mark.skipif(not DATA.exists(), reason="no ../shared/data")
def test_real_hands():
    claps = ht.load(DATA / "leap" / "three-claps.json")
    assert all(a is b for a, b in zip(repair_identity(claps), claps, strict=True))
    # every one of these was looked at: the hands are at each other's place, and back
    for hand in (None, "swap"):
        ego = repair_identity(ht.load(DATA / "ego_mcap", hand=hand))
        texts = [remark.text.partition(": ")[2] for remark in ego[0].remarks]
        assert texts == ["frames 160 to 162 put back", "frames 1156 to 1159 put back"]
    step = np.linalg.norm(np.diff(ego[0].joints, axis=0), axis=-1)
    assert np.nanmedian(step[1159]) < 0.06
