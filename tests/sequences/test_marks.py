"""What sources write in place of missing joints, in joints, in truths, and beside them."""

from __future__ import annotations

import json

import numpy as np
import pytest
from test_joint_order import moving_hand

import handtrack as ht
from handtrack.sequences.marks import marked

MARKS = [0.0, -1.0, -1000.0, -999.0, 1e6, 9999.0, -0.001, float("inf"), float("-inf")]
NOT_SEEN = [(2, 8), (3, 8), (3, 12), (7, 0), (11, 4), (12, 20)]
UNITS = {"m": 1.0, "cm": 100.0, "mm": 1000.0}


def with_marks(joints: np.ndarray, mark: float) -> np.ndarray:
    out = joints.copy()
    for frame, joint in NOT_SEEN:
        out[frame, joint] = mark
    return out


def unseen(sequence: ht.Sequence) -> list[tuple[int, int]]:
    return [tuple(map(int, at)) for at in np.argwhere(~sequence.present)]


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("mark", MARKS)
def test_marks_in_joints_and_truth(tmp_path, mark, unit):
    joints = moving_hand(20)
    there = with_marks(joints * UNITS[unit], mark)
    np.savez(tmp_path / "a.npz", joints=there, truth=there, unit=unit, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert unseen(found) == NOT_SEEN
    assert np.argwhere(np.isnan(found.truth).any(-1)).tolist() == [list(at) for at in NOT_SEEN]
    assert any(note.startswith("6 joints at") for note in found.notes)
    assert any(note.startswith("6 true joints at") for note in found.notes)
    seen = found.present
    np.testing.assert_allclose(found.joints[seen], joints[seen], atol=1e-9)


@pytest.mark.parametrize("mark", [0.0, -1.0, -999.0])
def test_marks_in_the_truth_alone(tmp_path, mark):
    joints = moving_hand(20)
    truth = with_marks(joints, mark)
    np.savez(tmp_path / "a.npz", joints_m=joints, truth_m=truth, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert found.present.all()
    assert int(np.isnan(found.truth[..., 0]).sum()) == len(NOT_SEEN)


@pytest.mark.parametrize("root", [0, 9, 20])
def test_a_joint_that_the_others_are_given_relative_to_is_no_mark(tmp_path, root):
    joints = moving_hand(20)
    relative = joints - joints[:, root : root + 1]
    np.savez(tmp_path / "a.npz", joints_m=relative, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert found.present.all()
    relative[4:6, 7] = 0
    relative[8] = 0
    np.savez(tmp_path / "b.npz", joints_m=relative, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "b.npz")
    assert unseen(found) == [(4, 7), (5, 7), *((8, j) for j in range(21))]


@pytest.mark.parametrize("joint", [0, 4, 9])
def test_a_joint_at_the_origin_far_from_the_hand_is_a_mark_in_every_frame(tmp_path, joint):
    joints = moving_hand(20)
    joints[:, joint] = 0
    np.savez(tmp_path / "a.npz", joints_m=joints, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert (~found.present).any(0).nonzero()[0].tolist() == [joint]


def test_a_tip_never_seen_beside_a_wrist_at_the_origin(tmp_path):
    joints = moving_hand(20)
    joints = joints - joints[:, :1]
    joints[:, 4] = 0
    np.savez(tmp_path / "a.npz", joints_m=joints, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert (~found.present).any(0).nonzero()[0].tolist() == [4]


def test_whole_millimetres_are_equal_by_chance():
    joints = np.rint(moving_hand(20) * 1000 - [0, 0, 450])
    joints[5, 8] = joints[6, 12] = np.rint(joints[5, 7].mean())
    masks, said = marked([joints])
    assert not masks[0].any()
    assert said == ""


def test_one_mark_alone_is_seen_by_its_distance():
    joints = moving_hand(20) * 1000
    joints[5, 8] = 1e5
    masks, said = marked([joints])
    assert np.argwhere(masks[0]).tolist() == [[5, 8]]
    assert said == "100000, 100000, 100000"


def test_what_marks_one_hand_marks_the_other():
    joints = moving_hand(20)
    once = joints.copy()
    once[3, 8] = -999
    masks, _ = marked([with_marks(joints, -999.0), once])
    assert [int(m.sum()) for m in masks] == [6, 1]


@pytest.mark.parametrize("place", ["zeros", "off"])
def test_confidence_zero_is_missing(tmp_path, place):
    joints = moving_hand(20)
    confidence = np.ones(joints.shape[:2])
    wrong = joints.copy()
    for frame, joint in NOT_SEEN:
        wrong[frame, joint] = 0 if place == "zeros" else joints[frame, joint] + 0.05
        confidence[frame, joint] = 0
    record = {"joints": wrong.tolist(), "confidence": confidence.tolist(), "hand": "right"}
    (tmp_path / "a.json").write_text(json.dumps(record | {"fps": 30}))
    (found,) = ht.load(tmp_path / "a.json")
    assert unseen(found) == NOT_SEEN
    track = ht.track(found)
    assert ht.stability(track).overall.pa_mpjpe_mm.mean < 1.2


def test_a_frame_of_confidence_zero_is_missing(tmp_path):
    joints = moving_hand(20)
    confidence = (np.arange(20) % 5 > 0).astype(float)
    np.savez(tmp_path / "a.npz", joints_m=joints, confidence=confidence, fps=30, hand="right")
    (found,) = ht.load(tmp_path / "a.npz")
    assert found.present.any(1).tolist() == (confidence > 0).tolist()


def test_only_marks(tmp_path):
    for mark in (0.0, -1.0, -999.0):
        np.save(tmp_path / "a.npy", np.full((5, 21, 3), mark))
        with pytest.raises(ht.InputError, match="every joint is missing"):
            ht.load(tmp_path / "a.npy")
