"""Hands as loggers of engines and headsets write them: Unity, MRTK, OpenXR, visionOS."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES

MRTK = ["Wrist"] + [
    finger + part
    for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky")
    for part in (
        ("MetacarpalJoint", "ProximalJoint", "DistalJoint", "Tip")
        if finger == "Thumb"
        else ("Knuckle", "MiddleJoint", "DistalJoint", "Tip")
    )
]


def same(path, right, atol=1e-9):
    found = {s.hand: s for s in ht.load(path)}
    joints = found["right"].joints
    seen = np.isfinite(joints).all((1, 2))
    np.testing.assert_allclose(joints[seen], right[seen], atol=atol)
    assert seen.sum() >= len(right) - 1
    return found


def test_two_lines_of_titles_and_places_between_slashes(tmp_path, right):
    left = right * [-1, 1, 1]
    lines = [",,Right Hand" + "," * 21 + "Left Hand", ",".join(["Time", "Counter", *MRTK, *MRTK])]
    for t, both in enumerate(zip(right, left, strict=True)):
        cells = [
            "({:.6f}/ {:.6f}/ {:.6f})".format(*place) if t else "0"
            for hand in both
            for place in hand
        ]
        lines.append(",".join([f"10:11:{12 + t / 30:09.6f}", str(t), *cells]))
    (tmp_path / "a.csv").write_text("\n".join(lines))
    found = same(tmp_path / "a.csv", right, 1e-6)
    assert np.isnan(found["left"].joints[0]).all()


@pytest.mark.parametrize(
    "cell", ["Vector3({}, {}, {})", "SIMD3<Float>({}, {}, {})", "vec3({}, {}, {})"]
)
def test_places_as_vectors_are_printed(tmp_path, right, cell):
    lines = ["timestamp;" + ";".join(f"Right{name}" for name in MRTK)]
    lines += [
        f"{t / 30};" + ";".join(cell.format(*place) for place in frame)
        for t, frame in enumerate(right)
    ]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    same(tmp_path / "a.csv", right)


@pytest.mark.parametrize("style", ["{n}_p{a}", "{n}_Pos{A}", "{n}.pos{A}", "{n}P{A}"])
def test_positions_beside_rotations(tmp_path, right, style):
    titles = [style.format(n=n, a=a, A=a.upper()) for n in MRTK for a in "xyz"]
    turns = [f"{n}_q{a}" for n in MRTK for a in "xyzw"]
    lines = [",".join(["time", *titles, *turns])]
    for t, frame in enumerate(right):
        lines.append(",".join(map(str, [t / 30, *frame.ravel(), *[0, 0, 0, 1] * 21])))
    (tmp_path / "Right.csv").write_text("\n".join(lines))
    same(tmp_path / "Right.csv", right)


@pytest.mark.parametrize("side", ["Right", "HandType.Right", "XR_HAND_RIGHT_EXT", "right_hand"])
@pytest.mark.parametrize("name", ["{}", "HandSkeleton.JointName.{}"])
def test_a_row_for_each_joint(tmp_path, right, side, name):
    lines = ["timestamp,hand,joint,px,py,pz,qx,qy,qz,qw"]
    for t, frame in enumerate(right):
        for joint, place in zip(JOINT_NAMES, frame, strict=True):
            cells = [t / 30, side, name.format(joint), *place, 0, 0, 0, 1]
            lines.append(",".join(map(str, cells)))
    (tmp_path / "a.csv").write_text("\n".join(lines))
    same(tmp_path / "a.csv", right)


def matrix(place, by):
    pose = np.eye(4)
    pose[:3, 3] = place
    return {"rows": pose, "columns": pose.T}[by.split()[0]]


@pytest.mark.parametrize("by", ["rows flat", "columns flat", "rows nested", "columns nested"])
def test_poses_as_matrices(tmp_path, right, by):
    frames = []
    for t, frame in enumerate(right):
        poses = [matrix(place, by) for place in frame]
        given = [p.ravel().tolist() if "flat" in by else p.tolist() for p in poses]
        joints = [{"name": n, "transform": g} for n, g in zip(JOINT_NAMES, given, strict=True)]
        frames.append({"timestamp": t / 30, "chirality": "right", "joints": joints})
    (tmp_path / "a.json").write_text(json.dumps(frames))
    same(tmp_path / "a.json", right)


@pytest.mark.parametrize("by", ["rows", "columns", "quaternions"])
def test_poses_in_an_array(tmp_path, right, by):
    if by == "quaternions":
        poses = np.concatenate([right, np.tile([0, 0, 0, 1.0], (*right.shape[:2], 1))], -1)
    else:
        poses = np.array([[matrix(place, by) for place in frame] for frame in right])
    np.savez(tmp_path / "a.npz", right_hand=poses)
    same(tmp_path / "a.npz", right)
    np.save(tmp_path / "right.npy", poses)
    same(tmp_path / "right.npy", right)


@pytest.mark.parametrize("key", ["boneDatas", "jointLocations", "trackedPoints"])
def test_a_list_of_joints_under_any_name(tmp_path, right, key):
    frames = [
        {
            "time": t / 30,
            "hand": "right",
            key: [
                {"boneName": n, "pose": {"position": dict(zip("xyz", x, strict=True))}}
                for n, x in zip(JOINT_NAMES, frame.tolist(), strict=True)
            ],
        }
        for t, frame in enumerate(right)
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, frames)))
    same(tmp_path / "a.jsonl", right)
    (tmp_path / "b.json").write_text(json.dumps({"data": frames}))
    same(tmp_path / "b.json", right)
    (tmp_path / "c.txt").write_text(",\n".join(json.dumps(f, indent=1) for f in frames) + ",")
    same(tmp_path / "c.txt", right)
