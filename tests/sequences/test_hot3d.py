"""HOT3D's trajectories, UmeTrack's kinematics, VisionProTeleop's lines: after their layouts."""

from __future__ import annotations

import io
import json
import tarfile

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError, SettingsError
from handtrack.hand.mano import MANO
from handtrack.hand.mano_pose import decode
from tools.make import mano_like
from tools.make.hdf5_files import PARTS, profile, write_profile

QUATERNION = [0.8, 0.0, 0.6, 0.0]
TURN = np.array([[0.28, 0.0, 0.96], [0.0, 1.0, 0.0], [-0.96, 0.0, 0.28]])
MARKS = (5, -1, 6, 7, 0, 8, 9, 10, 1, 11, 12, 13, 2, 14, 15, 16, 3, 17, 18, 19, 4)


def turned(axis, angle):
    """Rodrigues, as a 4 x 4 matrix about the origin."""
    x, y, z = np.array(axis) / np.linalg.norm(axis)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    out = np.eye(4)
    out[:3, :3] += np.sin(angle) * k + (1 - np.cos(angle)) * k @ k
    return out


def landmarks(hand, angles):
    """21 landmarks [m] of a left hand, one after the other, by 4 x 4 matrices."""
    frames = [np.eye(4), np.eye(4)]
    for finger in range(5):
        pose = np.eye(4)
        for k in range(4):
            i = 4 * finger + k
            at = np.eye(4)
            at[:3, 3] = np.array(hand["joint_rest_positions"][i]) / 1e3
            pose = pose @ at @ turned(hand["joint_rotation_axes"][i], angles[i]) @ np.linalg.inv(at)
            if k:
                frames.append(pose)
    rest = np.array(hand["landmark_rest_positions"]) / 1e3
    of = [bones[0] for bones in hand["landmark_rest_bone_indices"]]
    return np.array([(frames[b] @ [*x, 1.0])[:3] for b, x in zip(of, rest, strict=True)])


def bends(n=10):
    angles = np.zeros((n, 22))
    angles[:, :20] = np.linspace(0.1, 0.7, n)[:, None] * np.linspace(1.0, 0.6, 20)
    angles[:, 4:20:4] *= 0.2
    return angles


def write_umetrack(path, angles, only=None):
    lines = []
    for t, row in enumerate(angles):
        pose = {
            "wrist_xform": {"t_xyz": [0.1, -0.2, 0.3 + 0.001 * t], "q_wxyz": QUATERNION},
            "joint_angles": row.tolist(),
            "hand_confidence": 1.0,
        }
        hands = {"0": pose, "1": pose} if only is None else {only: pose}
        lines.append({"timestamp_ns": 56752108188860 + 33_333_333 * t, "hand_poses": hands})
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    return path


def test_umetrack_angles_make_joints(tmp_path):
    angles = bends()
    path = write_umetrack(tmp_path / "umetrack_hand_pose_trajectory.jsonl", angles)
    write_profile(tmp_path / "umetrack_hand_user_profile.json")
    left, right = ht.load(path)
    assert (left.hand, right.hand) == ("left", "right")
    assert left.time_ns[0] == 56752108188860
    assert left.fps == pytest.approx(30, abs=0.01)
    assert not left.notes
    assert not right.notes
    for t, row in enumerate(angles):
        place = np.array([0.1, -0.2, 0.3 + 0.001 * t])
        marks = landmarks(profile(), row)
        for joint, mark in enumerate(MARKS):
            for sequence, mirror in ((left, 1.0), (right, -1.0)):
                got = sequence.joints[t, joint]
                if mark < 0:
                    assert np.isnan(got).all()
                else:
                    mine = TURN @ (marks[mark] * [mirror, 1, 1]) + place
                    np.testing.assert_allclose(got, mine, atol=1e-12)


def test_profile_elsewhere_and_missing(tmp_path):
    path = write_umetrack(tmp_path / "a.jsonl", bends(), "1")
    with pytest.raises(HandtrackError, match="--profile FILE says where it is"):
        ht.load(path)
    hand = write_profile(tmp_path / "hand.json")
    (sequence,) = ht.load(path, profile=hand)
    assert sequence.hand == "right"
    with pytest.raises(HandtrackError, match="--profile"):
        ht.load(path, profile=tmp_path / "nothing.json")
    with pytest.raises(SettingsError, match="nothing in it takes --trajectory"):
        ht.load(path, profile=hand, trajectory=hand)


def test_masks_leave_frames_out(tmp_path):
    path = write_umetrack(tmp_path / "a.jsonl", bends(), "0")
    write_profile(tmp_path / "umetrack_hand_user_profile.json")
    (tmp_path / "masks").mkdir()
    mask = tmp_path / "masks" / "mask_qa_pass.csv"
    rows = [f"{56752108188860 + 33_333_333 * t},214-1,{t != 4}\n" for t in range(10)]
    mask.write_text("timestamp[ns],stream_id,mask\n" + "".join(rows))
    (sequence,) = ht.load(path)
    assert not sequence.present[4].any()
    assert sequence.present[[3, 5], 0].all()
    assert any("1 frames that the masks leave out" in note for note in sequence.notes)
    mask.write_text("timestamp[ns],stream_id,mask\n1,2,perhaps\n")
    with pytest.raises(HandtrackError, match="line 2 is no mask"):
        ht.load(path)


def test_two_cameras_of_one_moment_are_one_frame(tmp_path):
    path = write_umetrack(tmp_path / "a.jsonl", bends(6), "0")
    write_profile(tmp_path / "umetrack_hand_user_profile.json")
    lines = path.read_text().splitlines()
    both = []
    for a in lines:
        time = json.loads(a)
        both += [a, json.dumps(time | {"timestamp_ns": time["timestamp_ns"] + 91_000})]
    path.write_text("\n".join(both))
    (sequence,) = ht.load(path)
    assert len(sequence) == 6
    assert sequence.fps == pytest.approx(30, abs=0.01)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"joint_angles": [0.1] * 5}, "line 3: hand right: joint_angles is not 20 numbers"),
        ({"wrist_xform": "x"}, "line 3: hand right has no wrist_xform"),
        ({"wrist_xform": {"t_xyz": [0, 0, 0], "q_wxyz": [0, 0, 0, 0]}}, "no rotation"),
        ({"wrist_xform": {"t_xyz": [0, "x", 0], "q_wxyz": QUATERNION}}, "t_xyz is not 3 numbers"),
    ],
)
def test_poses_that_are_none(tmp_path, change, text):
    path = write_umetrack(tmp_path / "a.jsonl", bends(), "1")
    write_profile(tmp_path / "umetrack_hand_user_profile.json")
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    lines[2]["hand_poses"]["1"].update(change)
    path.write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(HandtrackError, match=text) as caught:
        ht.load(path)
    assert str(path) in str(caught.value)


def test_mano_trajectory_needs_mano(tmp_path):
    rng = np.random.default_rng(2)
    pose = np.cumsum(rng.normal(0, 0.05, (8, 15)), axis=0)
    lines = [
        {
            "timestamp_ns": 10**12 + 33_333_333 * t,
            "hand_poses": {
                "1": {
                    "pose": row.tolist(),
                    "wrist_xform": {"t_xyz": [0.1, 0.2, 0.3], "q_wxyz": QUATERNION},
                    "betas": [0.1] * 10,
                }
            },
        }
        for t, row in enumerate(pose)
    ]
    path = tmp_path / "mano_hand_pose_trajectory.jsonl"
    path.write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(HandtrackError, match="--mano DIR"):
        ht.load(path)
    folder = tmp_path / "mano"
    folder.mkdir()
    with (folder / "MANO_RIGHT.pkl").open("wb") as file:
        mano_like.write_pickle(mano_like.make_mano_like("right"), file)
    (sequence,) = ht.load(path, mano=folder)
    model = MANO.load(folder, "right")
    both = np.empty((8, 48))
    both[:, :3] = np.arccos(0.8) * 2 * np.array([0.0, 1.0, 0.0])
    both[:, 3:] = model.hand_pose(pose, flat_hand_mean=False)
    truth, _ = decode(model, both, np.full(10, 0.1), np.array([0.1, 0.2, 0.3]))
    np.testing.assert_allclose(sequence.joints, truth, atol=1e-9)


def test_visionos_lines_come_into_the_world(tmp_path, left, right):
    fingers = ("thumb", "index", "middle", "ring", "little")
    names = ["wrist", *(f"{finger}{part}" for finger in fingers for part in PARTS)]
    lines = []
    for t in range(len(right)):
        line = {"timestamp": 100.0 + t / 60, "headMatrix": np.eye(4).ravel().tolist()}
        for side, joints in (("left", left), ("right", right)):
            hand = {}
            for name, place in zip(names, joints[t], strict=True):
                pose = np.eye(4)
                pose[:3, 3] = TURN.T @ (place - joints[t, 0])
                if name == "wrist":
                    pose[:3, :3], pose[:3, 3] = TURN, place
                hand[name] = pose.T.ravel().tolist()
            hand["indexMetacarpal"] = hand["forearmWrist"] = np.eye(4).ravel().tolist()
            line[f"{side}Hand"] = hand
        lines.append(line)
    lines[3]["leftHand"] = None
    path = tmp_path / "tracking.jsonl"
    path.write_text("\n".join(map(json.dumps, lines)))
    mine, other = ht.load(path)
    left[3] = np.nan
    np.testing.assert_allclose(mine.joints, left, atol=1e-12)
    np.testing.assert_allclose(other.joints, right, atol=1e-12)
    assert (mine.hand, other.hand) == ("left", "right")
    assert mine.fps == pytest.approx(60, abs=0.1)
    listed = tmp_path / "tracking.json"
    for content in (lines, {"frames": lines}):
        listed.write_text(json.dumps(content))
        for a, b in zip(ht.load(listed), (mine, other), strict=True):
            np.testing.assert_array_equal(a.joints, b.joints)
            np.testing.assert_array_equal(a.time_ns, b.time_ns)
    lines[5]["rightHand"]["ringTip"] = [1, 2, 3]
    path.write_text("\n".join(map(json.dumps, lines)))
    with pytest.raises(HandtrackError, match="line 6: rightHand: ringTip is no pose"):
        ht.load(path)


@pytest.mark.parametrize("matrix", [False, True])
def test_clips_are_read_by_the_profile_in_them(tmp_path, matrix):
    angles = bends()
    write_umetrack(tmp_path / "umetrack_hand_pose_trajectory.jsonl", angles)
    write_profile(tmp_path / "umetrack_hand_user_profile.json")
    expected = ht.load(tmp_path / "umetrack_hand_pose_trajectory.jsonl")
    files = {"__hand_shapes.json__": {"mano": [0.0] * 10, "umetrack": profile()}}
    for t, row in enumerate(angles):
        place = [0.1, -0.2, 0.3 + 0.001 * t]
        pose = {"joint_angles": row.tolist()}
        if matrix:
            pose["wrist_xform"] = [[*r, x] for r, x in zip(TURN.tolist(), place, strict=True)]
            pose["wrist_xform"].append([0, 0, 0, 1])
        else:
            pose["T_world_from_wrist"] = {"quaternion_wxyz": QUATERNION, "translation_xyz": place}
        hands = {side: {"umetrack_pose": pose} for side in ("left", "right")}
        files[f"{t:06d}.hands.json"] = {} if t == 4 else hands
        files[f"{t:06d}.info.json"] = {"ref_timestamp_ns": 56752108188860 + 33_333_333 * t}
    path = tmp_path / "clips" / "clip-000001.tar"
    path.parent.mkdir()
    with tarfile.open(path, "w") as archive:
        for name, value in {**files, "000000.image_214-1.jpg": 0}.items():
            data = json.dumps(value).encode()
            member = tarfile.TarInfo(name)
            member.size = len(data)
            archive.addfile(member, io.BytesIO(data))
    found = ht.load(path)
    seen = np.arange(len(angles)) != 4
    for one, as_before in zip(found, expected, strict=True):
        assert (one.hand, one.name) == (as_before.hand, f"clip-000001 {one.hand}")
        np.testing.assert_allclose(one.joints[seen], as_before.joints[seen], atol=1e-9)
        assert np.isnan(one.joints[4]).all()
        assert np.array_equal(one.time_ns, as_before.time_ns)
        assert one.frame_index.tolist() == list(range(len(angles)))
    assert len(ht.load(path, frames=(2, 3))[0]) == 2
