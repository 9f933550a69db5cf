"""Tables with a row for each joint, and cells that hold a whole place or a whole hand."""

import numpy as np
import pytest
from long_rows import MEDIAPIPE, STYLES, rows, same, text

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES

COLUMNS = [
    "landmark",
    "landmark_id",
    "joint_name",
    "marker",
    "Joint",
    "keypoint index",
    "id",
    "name",
]


@pytest.mark.parametrize("style", STYLES)
def test_joints_by_number_or_name(read, right, style):
    (sequence,) = read(text("frame,landmark,x,y,z", rows(right, STYLES[style])))
    same(sequence, right)
    assert sequence.numbered
    assert sequence.hand == "right"


@pytest.mark.parametrize("column", COLUMNS)
def test_any_name_of_the_joints_column(read, right, column):
    for names in (STYLES["numbers"], MEDIAPIPE):
        (sequence,) = read(text(f"frame,{column},x,y,z", rows(right, names)))
        same(sequence, right)


@pytest.mark.parametrize(
    "axes", ["X,Y,Z", "pos_x,pos_y,pos_z", "x_m,y_m,z_m", "world_x,world_y,world_z", "tx,ty,tz"]
)
def test_names_of_the_axes(read, right, axes):
    (sequence,) = read(text(f"frame,joint,{axes}", rows(right, MEDIAPIPE)))
    same(sequence, right)


def test_unit_in_the_titles(read, right):
    (sequence,) = read(text("frame,joint,x_mm,y_mm,z_mm", rows(1e3 * right, MEDIAPIPE)))
    same(sequence, right)


@pytest.mark.parametrize("labels", [("Left", "Right"), ("L", "R"), ("left_hand", "right_hand")])
@pytest.mark.parametrize("column", ["hand", "handedness", "side", "label"])
def test_two_hands_in_any_order(read, left, right, labels, column):
    lines = rows(left, MEDIAPIPE, hand=labels[0]) + rows(right, MEDIAPIPE, hand=labels[1])
    lines = [lines[i] for i in np.random.default_rng(3).permutation(len(lines))]
    a, b = read(text(f"frame,{column},landmark,x,y,z", lines))
    assert (a.hand, b.hand) in (("left", "right"), ("right", "left"))
    a, b = sorted((a, b), key=lambda s: s.hand)
    same(a, left)
    same(b, right)


def test_hand_in_the_joints_name(read, left, right):
    lines = rows(left, [f"left_{n}" for n in JOINT_NAMES])
    lines += rows(right, [f"right_{n}" for n in JOINT_NAMES])
    a, b = sorted(read(text("frame,joint,x,y,z", lines)), key=lambda s: s.hand)
    same(a, left)
    same(b, right)


def test_two_hands_without_a_name_stand_one_behind_the_other(read, left, right):
    lines = []
    for t in range(len(left)):
        lines += rows(left[t : t + 1], MEDIAPIPE, [t]) + rows(right[t : t + 1], MEDIAPIPE, [t])
    a, b = read(text("frame,joint,x,y,z", lines))
    same(a, left)
    same(b, right)


def test_joints_without_rows_are_missing(read, right):
    lines = rows(right, STYLES["numbers"])
    gone = [(2, "8"), (3, "0"), (3, "20")]
    kept = [r for r in lines if (r[0], r[2]) not in gone]
    (sequence,) = read(text("frame,landmark,x,y,z", kept))
    truth = right.copy()
    for frame, joint in gone:
        truth[frame, int(joint)] = np.nan
    same(sequence, truth)


def test_joints_that_are_never_there(read, right):
    kept = [r for r in rows(right, STYLES["numbers"]) if r[2] != "0" and r[2] != "20"]
    with pytest.raises(ht.InputError, match="numbered 1 to 19"):
        read(text("frame,landmark,x,y,z", kept))
    named = [
        r for r in rows(right, MEDIAPIPE) if r[2] not in ("WRIST", "PINKY_TIP", "LITTLE_FINGER_TIP")
    ]
    (sequence,) = read(text("frame,landmark,x,y,z", named))
    truth = right.copy()
    truth[:, [0, 20]] = np.nan
    same(sequence, truth)


def test_frames_without_rows_are_missing_frames(read, right):
    numbers = [n for n in range(12) if n not in (4, 5)]
    lines = rows(right[numbers], MEDIAPIPE, numbers)
    (sequence,) = read(text("frame,landmark,x,y,z", lines))
    truth = right.copy()
    truth[4:6] = np.nan
    same(sequence, truth)
    assert list(sequence.frame_index) == list(range(12))
    assert sequence.notes[0] == "no time in the file: 30 frames/s assumed (--fps)"


def test_times_of_frames_without_rows(read, right):
    lines = [
        (n, f"{n / 50:.3f}", *r[2:])
        for n in range(12)
        if n != 6
        for r in rows(right[n : n + 1], MEDIAPIPE, [n])
    ]
    (sequence,) = read(text("frame,time_s,landmark,x,y,z", lines))
    assert len(sequence.joints) == 12
    assert not sequence.present[6].any()
    np.testing.assert_array_equal(sequence.time_ns, np.arange(12) * 20_000_000)


def test_far_frames_are_not_filled(read, right):
    numbers = [*range(6), *range(10**9, 10**9 + 6)]
    (sequence,) = read(text("frame,landmark,x,y,z", rows(right, MEDIAPIPE, numbers)))
    same(sequence, right)
    assert list(sequence.frame_index) == numbers


def test_a_hand_that_comes_late_is_missing_before(read, left, right):
    lines = rows(left, MEDIAPIPE, hand="Left") + rows(right[8:], MEDIAPIPE, range(8, 12), "Right")
    _, b = sorted(read(text("frame,hand,landmark,x,y,z", lines)), key=lambda s: s.hand)
    assert len(b.joints) == 12
    assert not b.present[:8].any()
    same(b, np.where(np.arange(12)[:, None, None] < 8, np.nan, right))
