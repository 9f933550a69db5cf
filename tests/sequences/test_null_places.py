"""null stands for what was not seen, wherever a format has places; a topic of each joint."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES
from tools.fuzz.corpus import motion
from tools.fuzz.kinds import kinds


@pytest.mark.parametrize("null", [None, [None, None, None]])
def test_null_places_of_leap_are_missing(tmp_path, null):
    recording = json.loads(kinds()["leap"].make(motion())["a.json"])
    (tmp_path / "a.json").write_text(json.dumps(recording))
    (whole,) = ht.load(tmp_path / "a.json")
    recording["frames"][2]["pointables"][1]["dipPosition"] = null
    (tmp_path / "b.json").write_text(json.dumps(recording))
    (sequence,) = ht.load(tmp_path / "b.json")
    gone = np.isnan(sequence.joints) & ~np.isnan(whole.joints)
    assert gone.any(-1).sum() == 1
    assert gone[2].any()


@pytest.mark.parametrize("key", ["wrist_xform", "joint_angles"])
@pytest.mark.parametrize("whole", [True, False])
def test_null_poses_of_hot3d_are_missing(tmp_path, key, whole):
    kind = kinds()["hot3d"]
    files = kind.make(motion())
    for name, data in files.items():
        (tmp_path / name).write_bytes(data)
    before = kind.read(tmp_path / kind.target)
    lines = [json.loads(line) for line in files[kind.target].splitlines()]
    pose = next(iter(lines[2]["hand_poses"].values()))
    if whole:
        pose[key] = None
    elif key == "wrist_xform":
        pose[key]["t_xyz"] = [None, 0.0, 0.0]
    else:
        pose[key][3] = None
    (tmp_path / kind.target).write_text("\n".join(map(json.dumps, lines)))
    after = kind.read(tmp_path / kind.target)
    gone = [
        np.isnan(a.joints).all((1, 2)) & ~np.isnan(b.joints).all((1, 2))
        for a, b in zip(after, before, strict=True)
    ]
    assert [g.nonzero()[0].tolist() for g in gone if g.any()] == [[2]]


@pytest.mark.parametrize("place", ["position", "pose", "point"])
@pytest.mark.parametrize("listed", [True, False])
@pytest.mark.parametrize("time", [("time", 1), ("timestamp", 10**9), ("stamp_ms", 1000)])
def test_lines_of_a_topic_for_each_joint(tmp_path, right, place, listed, time):
    lines = []
    for t, frame in enumerate(right.tolist()):
        for name, x in zip(JOINT_NAMES, frame, strict=True):
            given = x if listed else dict(zip("xyz", x, strict=True))
            message = {"pose": {"position": given}} if place == "pose" else {place: given}
            stamp = {time[0]: time[1] * (1_700_000_000 + t / 30)}
            lines.append({"topic": f"/right_hand/{name}", **stamp, **message})
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, lines)))
    (sequence,) = ht.load(tmp_path / "a.jsonl")
    np.testing.assert_allclose(sequence.joints, right, atol=1e-12)
    assert sequence.hand == "right"
    assert 29.9 < sequence.fps < 30.1
