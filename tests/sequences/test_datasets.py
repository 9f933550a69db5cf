"""Data sets in their own layouts: FreiHAND, InterHand2.6M, AssemblyHands, DexYCB, WebXR, OpenXR."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError, SettingsError
from handtrack.hand.skeleton import ORDERS
from handtrack.sequences.names import joint_name, words
from handtrack.sequences.settled import settle


def scattered(joints, order, n):
    """(T, n, 3) joints as the source orders them."""
    out = np.zeros((len(joints), n, 3))
    out[:, list(ORDERS[order])] = joints
    return out


# --- FreiHAND


def test_freihand(tmp_path, right):
    """The folder as FreiHAND_pub_v2 has it: joints beside files that hold none."""
    (tmp_path / "training_xyz.json").write_text(json.dumps(right.tolist()))
    (tmp_path / "training_K.json").write_text(json.dumps([np.eye(3).tolist()] * 12))
    (tmp_path / "training_scale.json").write_text(json.dumps([0.028] * 12))
    (tmp_path / "training_verts.json").write_text(json.dumps(np.zeros((12, 778, 3)).tolist()))
    (sequence,) = ht.load(tmp_path)
    np.testing.assert_array_equal(sequence.joints, right)
    assert sequence.hand == "right"
    assert any("unrelated" in note for note in sequence.notes)
    with pytest.raises(InputError, match=r"training_K.json: FreiHAND's file of cameras"):
        ht.load(tmp_path / "training_K.json")


# --- InterHand2.6M, AssemblyHands


def interhand_frames(left, right, first=69148, step=3):
    """{frame: ...} as joint_3d.json holds them: right 0-20, left 21-41, mm, validity in lists."""
    both = np.concatenate([scattered(right, "interhand", 21), scattered(left, "interhand", 21)], 1)
    return {
        str(first + step * t): {
            "world_coord": (x * 1e3).tolist(),
            "joint_valid": [[True]] * 42,
            "hand_type": "interacting",
            "hand_type_valid": True,
        }
        for t, x in enumerate(both)
    }


def test_interhand(tmp_path, left, right):
    frames = interhand_frames(left, right)
    frames["69151"]["joint_valid"][3] = [False]  # the right thumb's base
    only_left = interhand_frames(left, right, 7)
    for frame in only_left.values():
        frame["joint_valid"] = [[False]] * 21 + [[True]] * 21
        frame["hand_type"] = "left"
    path = tmp_path / "InterHand2.6M_test_joint_3d.json"
    # frames do not stand in order
    shuffled = dict(reversed(frames.items()))
    path.write_text(json.dumps({"3": shuffled, "12": only_left}))
    # what lies beside it holds no joints
    camera = {"0": {"campos": {"400002": [1.0, 2.0, 3.0]}}}
    (tmp_path / "InterHand2.6M_test_camera.json").write_text(json.dumps(camera))
    found = {s.name: s for s in ht.load(tmp_path)}
    assert sorted(found) == ["capture12 left", "capture3 left", "capture3 right"]
    sequence = found["capture3 right"]
    expected = right.copy()
    expected[1, 1] = np.nan  # interhand's 3 is our 1
    np.testing.assert_allclose(sequence.joints, expected, atol=1e-12)
    np.testing.assert_array_equal(sequence.frame_index, 69148 + 3 * np.arange(12))
    assert sequence.hand == "right"
    np.testing.assert_allclose(found["capture3 left"].joints, left, atol=1e-12)
    np.testing.assert_allclose(found["capture12 left"].joints, left, atol=1e-12)
    assert not found["capture3 left"].notes[1:]  # of the hands, none is doubted


def test_assemblyhands(tmp_path, left, right):
    """The same under "annotations", names instead of numbers, six digits, flat validity."""
    frames = interhand_frames(left, right, 554, 2)
    frames = {f"{int(k):06d}": v | {"joint_valid": [1.0] * 42} for k, v in frames.items()}
    name = "nusar-2021_action_both_9061-c13d_9061_user_id_2021-02-09_143830"
    path = tmp_path / "assemblyhands_val_joint_3d_v1-1.json"
    path.write_text(json.dumps({"annotations": {name: frames}}))
    found = ht.load(path)
    assert [s.name for s in found] == [f"{name} right", f"{name} left"]
    np.testing.assert_allclose(found[0].joints, right, atol=1e-12)
    np.testing.assert_allclose(found[1].joints, left, atol=1e-12)
    assert found[0].frame_index[1] == 556
    only = ht.load(path, hand="left", format="assemblyhands")
    assert [s.hand for s in only] == ["left"]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"world_coord": [[1.0, 2.0, 3.0]] * 21}, "capture3, frame 7: world_coord has 21 joints"),
        ({"joint_valid": [True] * 21}, "capture3, frame 7: joint_valid has 21 numbers"),
        ({"world_coord": [[1.0, 2.0]] * 42}, "expected `array` of length 3"),
    ],
)
def test_interhand_that_does_not_fit(tmp_path, left, right, change, message):
    frames = interhand_frames(left, right, 1, 2)
    frames["7"] |= change
    path = tmp_path / "joint_3d.json"
    path.write_text(json.dumps({"3": frames}))
    with pytest.raises(InputError, match=r"joint_3d\.json: ") as error:
        ht.load(path)
    assert message in str(error.value)


# --- DexYCB

META = """extrinsics: '20200702_151821'
grasp_ind: 0
mano_calib:
- 20200709-subject-01
mano_sides:
- {side}
num_frames: 12
serials:
- '836212060125'
"""


def dexycb(folder, joints, side="left"):
    """subject/sequence/camera/labels_*.npz with the pictures' labels beside the joints."""
    camera = folder / "20200709-subject-01" / "20200709_141754" / "836212060125"
    camera.mkdir(parents=True)
    (camera.parent / "meta.yml").write_text(META.format(side=side))
    for t, x in enumerate(joints):
        np.savez_compressed(
            camera / f"labels_{t:06d}.npz",
            seg=np.zeros((480, 640), np.uint8),
            pose_y=np.zeros((4, 3, 4), np.float32),
            pose_m=np.zeros((1, 51), np.float32),
            joint_3d=np.where(np.isnan(x), -1, x).astype(np.float32)[None],
            joint_2d=np.full((1, 21, 2), -1, np.float32),
        )
        (camera / f"color_{t:06d}.jpg").write_bytes(b"\xff\xd8")
    return camera


def test_dexycb(tmp_path, left):
    left[4] = np.nan  # not in the picture: -1 everywhere
    camera = dexycb(tmp_path, left)
    for folder in (camera, tmp_path):
        (sequence,) = ht.load(folder)
        np.testing.assert_allclose(sequence.joints, left, atol=1e-7)
        assert (sequence.hand, sequence.subject) == ("left", "20200709-subject-01")
        assert sequence.fps == pytest.approx(30)
    (part,) = ht.load(tmp_path, frames=(5, 7))
    np.testing.assert_array_equal(part.frame_index, [5, 6, 7])
    (single,) = ht.load(camera / "labels_000003.npz")
    np.testing.assert_allclose(single.joints, left[3:4], atol=1e-7)


def test_dexycb_that_does_not_fit(tmp_path, left):
    camera = dexycb(tmp_path, left)
    np.savez(camera / "labels_000005.npz", joint_3d=np.zeros((1, 20, 3)))
    with pytest.raises(InputError, match=r"labels_000005.npz: joint_3d has shape \(1, 20, 3\)"):
        ht.load(tmp_path)
    np.savez(camera / "labels_000005.npz", seg=np.zeros(3))
    with pytest.raises(InputError, match=r"labels_000005.npz: no joint_3d in it, found seg"):
        ht.load(tmp_path)
    data = (camera / "labels_000004.npz").read_bytes()
    (camera / "labels_000005.npz").write_bytes(data[: len(data) // 2])
    with pytest.raises(InputError, match=r"labels_000005.npz: the .npz file is damaged"):
        ht.load(camera)
    with pytest.raises(InputError, match=r"no frame in \(90, 95\), there are 0:11"):
        ht.load(camera, frames=(90, 95))


# --- WebXR, OpenXR


def webxr_names():
    """The 25 names of the WebXR Hand Input Module, in its order."""
    names = ["wrist", *(f"thumb-{p}" for p in ("metacarpal", "phalanx-proximal"))]
    names += ["thumb-phalanx-distal", "thumb-tip"]
    for finger in ("index", "middle", "ring", "pinky"):
        names += [f"{finger}-finger-metacarpal"]
        names += [f"{finger}-finger-phalanx-{p}" for p in ("proximal", "intermediate", "distal")]
        names += [f"{finger}-finger-tip"]
    return names


def openxr_names():
    """The 26 names of XR_EXT_hand_tracking, in its order."""
    names = ["PALM", "WRIST", *(f"THUMB_{p}" for p in ("METACARPAL", "PROXIMAL", "DISTAL", "TIP"))]
    for finger in ("INDEX", "MIDDLE", "RING", "LITTLE"):
        parts = ("METACARPAL", "PROXIMAL", "INTERMEDIATE", "DISTAL", "TIP")
        names += [f"{finger}_{p}" for p in parts]
    return [f"XR_HAND_JOINT_{name}_EXT" for name in names]


def test_names_are_those_of_the_orders():
    """The specifications' lists, by name and by place, mean the same joints."""
    for names, order in ((webxr_names(), "webxr"), (openxr_names(), "openxr")):
        said = [joint_name(words(names[i])) for i in ORDERS[order]]
        assert settle([name for name in said if name is not None]) == list(range(21))


def matrix(point):
    turn = np.eye(4)
    turn[:3, 3] = point
    return turn.T.ravel().tolist()  # column-major


SHAPES = {
    "list": lambda p: list(p),
    "xyz": lambda p: dict(zip("xyz", p, strict=True)),
    "position": lambda p: {"position": dict(zip("xyz", p, strict=True)), "radius": 0.01},
    "transform": lambda p: {"transform": {"position": list(p)}, "orientation": [0, 0, 0, 1]},
    "matrix": matrix,
}


def named(joints, names, order, shape="list"):
    """{name: point} of one frame; metacarpals and the palm somewhere near."""
    every = np.full((len(names), 3), 0.05) + joints[0]
    every[list(ORDERS[order])] = joints
    return {n: SHAPES[shape](p) for n, p in zip(names, every.tolist(), strict=True)}


@pytest.mark.parametrize("shape", SHAPES)
def test_webxr_lines(tmp_path, left, right, shape):
    """Both hands a line, by name; milliseconds of the page; a hand that is away is null."""
    lines = []
    for t in range(12):
        hands = {
            hand: {"joints": named(x[t], webxr_names(), "webxr", shape)}
            for hand, x in (("left", left), ("right", right))
        }
        hands |= {"right": None} if t == 4 else {}
        lines.append(json.dumps({"timestamp": 1234.5 + 13.9 * t, **hands}))
    path = tmp_path / "stream.jsonl"
    path.write_text("\n".join(lines) + "\n")
    found = {s.hand: s for s in ht.load(path)}
    np.testing.assert_allclose(found["left"].joints, left, atol=1e-12)
    right[4] = np.nan
    np.testing.assert_allclose(found["right"].joints, right, atol=1e-12)
    assert found["left"].fps == pytest.approx(1e3 / 13.9)
    assert any("timestamp read as ms" in n for n in found["left"].notes)


def test_openxr_lines_with_one_hand_each(tmp_path, left, right):
    """One hand a line, XrTime in nanoseconds, a list of 26 joints with its own time unit."""
    lines = []
    for t in range(12):
        for hand, x in (("left", left), ("right", right)):
            joints = list(named(x[t], openxr_names(), "openxr").values())
            row = {"time_ns": 10**18 + 13_888_889 * t, "handedness": hand, "joints": joints}
            lines.append(json.dumps(row))
    path = tmp_path / "openxr.jsonl"
    path.write_text("\n".join(lines))
    found = ht.load(path, format="openxr")
    assert [s.hand for s in found] == ["left", "right"]
    np.testing.assert_allclose(found[1].joints, right, atol=1e-12)
    assert found[0].time_ns[1] - found[0].time_ns[0] == 13_888_889


def test_a_list_of_frames_with_a_list_of_hands(tmp_path, left):
    joints = [named(x, openxr_names(), "openxr", "position") for x in left]
    frames = [
        {"t": 0.02 * i, "hands": [{"side": "LEFT", "joints": x}]} for i, x in enumerate(joints)
    ]
    path = tmp_path / "a.json"
    path.write_text(json.dumps(frames, indent=1))
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, left, atol=1e-12)
    assert sequence.hand == "left"
    assert sequence.fps == pytest.approx(50)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wrist": [1, 2]}, "line 3: wrist is no position"),
        ({"sixth-finger-tip": [1, 2, 3]}, "line 3: joint 'sixth-finger-tip' is unknown"),
        ({"hand": "both"}, "line 3: hand is 'both'"),
        ({"time_ms": "now"}, "line 3: time_ms is 'now', expected a number"),
    ],
)
def test_xr_frames_that_do_not_fit(tmp_path, left, change, message):
    frames = [
        {"time_ms": 10 * i, "hand": "left", **named(x, webxr_names(), "webxr")}
        for i, x in enumerate(left[:5])
    ]
    frames[2] |= change
    path = tmp_path / "a.jsonl"
    path.write_text("\n".join(map(json.dumps, frames)))
    with pytest.raises(InputError, match=r"a\.jsonl: ") as error:
        ht.load(path)
    assert message in str(error.value)


def test_an_unknown_format_is_named(tmp_path, right):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(right.tolist()))
    with pytest.raises(SettingsError, match="unknown format 'abc', expected one of assemblyhands"):
        ht.load(path, format="abc")
    with pytest.raises(InputError, match=r"a\.json: "):
        ht.load(path, format="panoptic")
    assert ht.load(path, format="freihand")[0].hand == "right"
