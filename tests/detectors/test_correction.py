"""Errors that go with the pose: learnt from some people, taken off others' landmarks."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import handtrack as ht
from handtrack.detectors.chosen import told
from handtrack.detectors.correction import N_BENDS, Correction, Palms, bends
from handtrack.detectors.profile import IN_SPACE, Noise, Profile, load_profile, save_profile
from handtrack.errors import InputError
from handtrack.evaluation.landmarks import Seen, estimate_profile
from handtrack.evaluation.metrics import pa_mpjpe
from handtrack.hand.rotations import vector_to_matrix
from handtrack.recording.read import read_mcap
from handtrack.recording.retrack import retrack
from handtrack.recording.write import write_mcap
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.tracker import Tracker

FRAMES = 40
SMALL = np.full(21, 1e-3)
TURN = vector_to_matrix(np.array([0.3, -0.8, 0.5]))


def person(seed: int, hand: str = "right") -> tuple[Sequence, np.ndarray]:
    """A hand of its own size; its detector halves how far the tips bend from the mean."""
    rng = np.random.default_rng(seed)
    model = ht.HandModel.default(hand).scaled(rng.uniform(0.9, 1.1))
    way, phase = rng.uniform(1, 4, 20), rng.uniform(0, 6, 20)
    share = 0.5 + 0.45 * np.sin(way * np.arange(FRAMES)[:, None] / 15 + phase)
    low, high = model.limits.lower, model.limits.upper
    angles = model.limits.clamp(low + share * (high - low))
    turn = np.repeat(vector_to_matrix(rng.normal(0, 0.5, 3))[None], FRAMES, 0)
    shift = rng.normal(0, 0.1, (FRAMES, 3))
    truth, still = (model.joints(a, turn, shift) for a in (angles, 0.0 * angles))
    seen = truth.copy()
    for tip in (4, 8, 12, 16, 20):
        seen[:, tip - 1 : tip + 1] += 0.4 * (still - truth)[:, tip - 1 : tip + 1]
    seen += rng.normal(0, 5e-4, seen.shape)
    time_ns = np.arange(FRAMES) * 33_333_333
    return Sequence(time_ns, seen, hand=hand, subject=f"p{seed}", name=f"c{seed}"), truth


@pytest.fixture(scope="module")
def found() -> Profile:
    clips = [Seen.of(*person(s, ("right", "left")[s % 2])) for s in range(8)]
    return estimate_profile(clips, "found")


def test_unknown_people_come_nearer_than_by_offsets(found):
    assert found.evidence["corrected_mm"] < 0.9 * found.evidence["with_mm"]
    sequence, truth = person(50)
    offsets_only = replace(found, correction=None)
    off = {}
    for name, profile in (("corrected", found), ("offsets", offsets_only)):
        seen = Seen.of(sequence.corrected(profile), truth)
        off[name] = pa_mpjpe(seen.joints, seen.landmarks(found.offsets)).mean()
    assert off["corrected"] < 0.6 * off["offsets"]
    # the noise is that of people left out, not of those it was learnt from
    assert found.noise.total.mean() > 0.5 * off["corrected"] / np.sqrt(3)


def test_few_people_show_no_correction():
    clips = [Seen.of(*person(s)) for s in range(3)]
    assert estimate_profile(clips, "few").correction is None


def test_a_correction_goes_with_the_hand(found):
    joints = person(60)[0].joints
    moved = joints @ TURN.T * 1.2 + [0.3, 0.2, -0.1]
    expected = found.corrected(joints, "right") @ TURN.T * 1.2 + [0.3, 0.2, -0.1]
    np.testing.assert_allclose(found.corrected(moved, "right"), expected, atol=1e-12)
    mirror = np.array([-1.0, 1.0, 1.0])
    left = found.corrected(joints * mirror, "left")
    np.testing.assert_allclose(left, found.corrected(joints, "right") * mirror, atol=1e-12)


def test_missing_joints_and_strays(found):
    joints = person(61)[0].joints
    whole = found.corrected(joints, "right")
    holes = joints.copy()
    holes[0, 8] = np.nan  # a tip
    holes[1, 5] = np.nan  # of the palm
    holes[2, [3, 4, 7, 8, 12, 16]] = np.nan
    holes[3] = np.nan
    seen = found.corrected(holes, "right")
    np.testing.assert_array_equal(np.isnan(seen), np.isnan(holes))
    np.testing.assert_array_equal(seen[1:4], holes[1:4])
    others = np.delete(np.arange(21), 8)
    assert np.linalg.norm(seen[0, others] - whole[0, others], axis=-1).max() < 0.03
    np.testing.assert_array_equal(seen[4:], whole[4:])
    stray = joints.copy()
    stray[0, 8] += [0.0, 0.0, 5.0]
    assert np.linalg.norm(found.corrected(stray, "right")[0, others] - whole[0, others]).max() < 0.2


def test_frame_by_frame_is_the_same_to_the_bit(found):
    sequence = person(62)[0]
    hand = found.on(ht.HandModel.default())
    tracker = Tracker(hand, profile=found)
    single = [
        tracker.step(j, t) for j, t in zip(sequence.joints, sequence.time_ns.tolist(), strict=True)
    ]
    other = Tracker(hand, profile=found)
    (block,) = other._advance(
        sequence.time_ns.copy(), sequence.joints.copy(), sequence.confidence.copy()
    )
    np.testing.assert_array_equal([f.angles for f in single], block.arrays()["angles"])
    # what is written is what was seen
    np.testing.assert_array_equal([f.observed for f in single], sequence.joints)


def test_through_a_file_a_recording_and_back(found, tmp_path):
    path = save_profile(found, tmp_path / "p.json")
    again = load_profile(path)
    np.testing.assert_allclose(again.correction.slope, found.correction.slope, atol=6e-5)
    np.testing.assert_allclose(
        again.correction.finger.slope, found.correction.finger.slope, atol=6e-5
    )
    assert len(path.read_text().splitlines()) < 600
    sequence, truth = person(63)
    track = ht.track(sequence, detector=str(path))
    before, after = (pa_mpjpe(j, truth).mean() for j in (sequence.joints, track.filtered_joints))
    assert after < 0.6 * before
    np.testing.assert_array_equal(track.observed, sequence.joints)
    assert "errors are to those as detected" in told(track.settings)
    write_mcap([track], tmp_path / "a.mcap")
    (stored,) = read_mcap(tmp_path / "a.mcap")
    np.testing.assert_array_equal(retrack(stored).angles, track.angles)


def test_a_file_without_fingers_corrects_by_places_alone(found, tmp_path):
    content = json.loads(save_profile(found, tmp_path / "p.json").read_text())
    del content["correction"]["finger"]
    (tmp_path / "old.json").write_text(json.dumps(content))
    joints = person(64)[0].joints
    rounded = load_profile(tmp_path / "p.json")
    alone = replace(rounded.correction, finger=None)
    old = load_profile(tmp_path / "old.json").corrected(joints, "right")
    np.testing.assert_array_equal(old, alone.of(joints, "right"))
    assert np.abs(old - rounded.corrected(joints, "right")).max() > 1e-3


def test_bends_are_of_the_own_finger():
    joints = person(65)[0].joints
    whole = bends(joints)
    assert whole.shape == (FRAMES, 5, N_BENDS)
    pointing = whole[..., :12].reshape(FRAMES, 5, 4, 3)
    np.testing.assert_allclose(np.linalg.norm(pointing, axis=-1), 1.0)
    np.testing.assert_allclose(whole[..., 12], whole[..., 0] ** 2)
    np.testing.assert_allclose(whole[..., -1], whole[..., 11] ** 2)
    holes = joints.copy()
    holes[:, 8] = np.nan  # the index finger's tip
    np.testing.assert_array_equal(np.isnan(bends(holes)).any((0, 2)), [0, 1, 0, 0, 0])
    moved = joints.copy()
    moved[:, 12] += 0.01
    np.testing.assert_array_equal((bends(moved) != whole).any((0, 2)), [0, 0, 1, 0, 0])


WRONG = {
    "no slope": (lambda c: c.pop("slope"), "correction.slope"),
    "short row": (lambda c: c["slope"]["wrist"][1].pop(), "slope.wrist expects 3 rows of 63"),
    "text": (lambda c: c["slope"]["wrist"][1].__setitem__(4, "x"), "expected a number"),
    "mean": (lambda c: c["mean"].pop("thumb_tip"), "another joint set"),
    "spread": (lambda c: c["spread"]["thumb_tip"].__setitem__(0, -1), "negative"),
    "no finger": (lambda c: c["finger"].pop("ring"), "correction.finger.ring is missing"),
    "short bend": (lambda c: c["finger"]["thumb"]["mean"].pop(), "thumb.mean expects 90 numbers"),
    "few rows": (lambda c: c["finger"]["index"]["slope"].pop(), "slope expects 12 rows of 90"),
    "bend's spread": (lambda c: c["finger"]["index"]["spread"].__setitem__(3, -1), "negative"),
}


@pytest.mark.parametrize("what", WRONG)
def test_wrong_corrections_are_refused(found, tmp_path, what):
    path = save_profile(found, tmp_path / "p.json")
    content = json.loads(path.read_text())
    spoil, message = WRONG[what]
    spoil(content["correction"])
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=message):
        load_profile(path)


def test_no_palm_has_no_frame():
    palms = Palms.of(np.zeros((1, 21, 3)), "right")
    assert np.isnan(palms.axes).any()
    still = Correction(*np.zeros((3, 21, 3)), np.zeros((63, 63)))
    joints = np.zeros((1, 21, 3))
    profile = Profile("p", "p", IN_SPACE, np.zeros((21, 3)), Noise(SMALL, SMALL, SMALL, 0.1))
    assert profile.corrected(joints, "right") is joints
    np.testing.assert_array_equal(still.of(joints, "right"), joints)
