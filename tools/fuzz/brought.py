"""Sound inputs of headsets, gloves, data sets and motion capture, to be spoilt."""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES, ORDERS
from tools.fuzz.corpus import Files, Joints, Kind, as_npz, dumps

Writer = Callable[[Joints], bytes]
ONE_WAY = ("egodex", "emg2pose", "hdf5", "c3d", "manus")
"""Kinds that nothing writes otherwise: no text and no archive, or with decimal commas."""
_ARKIT = ("Knuckle", "IntermediateBase", "IntermediateTip", "Tip")
_FINGERS = ("Thumb", "Index", "Middle", "Ring", "Little")


def _hdf5(fill: Callable[[Any, Joints], None]) -> Writer:
    def make(joints: Joints) -> bytes:
        import h5py

        out = io.BytesIO()
        with h5py.File(out, "w") as file:
            fill(file, joints)
        return out.getvalue()

    return make


def _egodex(file: Any, joints: Joints) -> None:
    poses = np.tile(np.eye(4), (len(joints), 1, 1))
    named = {"rightHand": 0, "camera": 0}
    for f, finger in enumerate(_FINGERS):
        for p, part in enumerate(_ARKIT):
            named[f"right{finger}{'Finger' if f else ''}{part}"] = 1 + 4 * f + p
    for name, joint in named.items():
        poses[:, :3, 3] = joints[:, joint]
        file.create_dataset(f"transforms/{name}", data=poses, compression="gzip")
        file.create_dataset(f"confidences/{name}", data=np.ones(len(joints)))


def _arrays(file: Any, joints: Joints) -> None:
    file["a/joints_m"] = joints
    file["a/time_s"] = np.arange(len(joints)) / 30
    file["a"].attrs["hand"] = "right"


def _emg2pose(file: Any, joints: Joints) -> None:
    kind = np.dtype([("time", "<f8"), ("joint_angles", "<f4", (20,)), ("emg", "<f4", (16,))])
    rows = np.zeros(len(joints), kind)
    rows["time"] = 1.67e9 + np.arange(len(joints)) / 500
    rows["joint_angles"] = np.linspace(0.1, 0.6, len(joints))[:, None]
    rows["joint_angles"][:, 4::4] = 0.0
    file.create_dataset("emg2pose/timeseries", data=rows, chunks=True, compression="gzip")
    file["emg2pose"].attrs["side"] = "right"


def profile() -> bytes:
    """A hand of UmeTrack's layout, of made numbers [mm]."""
    places, axes, marks, bones = [], [], np.zeros((21, 3)), [1] * 21
    for f in range(5):
        z = 30.0 - 20 * f
        base = [20.0, -10.0, 15.0] if f == 0 else [90.0, 0.0, z]
        tip = [105.0, -30.0, 70.0] if f == 0 else [180.0 - 10 * f, 0.0, z]
        spots = [
            (np.array(base) + s * np.subtract(tip, base)).tolist() for s in (0, 0.0, 0.45, 0.75)
        ]
        places += spots
        axes += [[0.0, -1.0, 0.0], *[[0.0, 0.0, -1.0]] * 3]
        marks[f], bones[f] = tip, 4 + 3 * f
        for k, mark in enumerate((6, 7) if f == 0 else range(5 + 3 * f, 8 + 3 * f)):
            marks[mark] = spots[k + (2 if f == 0 else 1)]
            bones[mark] = 2 + 3 * f + k if f == 0 else (1, 2 + 3 * f, 3 + 3 * f)[k]
    hand = {
        "joint_rotation_axes": axes,
        "joint_rest_positions": places,
        "landmark_rest_positions": marks.tolist(),
        "landmark_rest_bone_indices": [[b] for b in bones],
        "landmark_rest_bone_weights": [[1.0]] * 21,
    }
    return dumps({"hand_model": hand})


def _hot3d(joints: Joints) -> bytes:
    lines = []
    for i, j in enumerate(joints):
        pose = {
            "wrist_xform": {"t_xyz": j[0].tolist(), "q_wxyz": [0.8, 0.0, 0.6, 0.0]},
            "joint_angles": [0.0 if k % 4 == 0 else 0.1 + 0.1 * i for k in range(22)],
            "hand_confidence": 1.0,
        }
        lines.append({"timestamp_ns": 10**12 + 33_000_000 * i, "hand_poses": {"1": pose}})
    return b"\n".join(map(dumps, lines))


def _visionpro(joints: Joints) -> bytes:
    names = ["wrist", *(f"{f.lower()}{p}" for f in _FINGERS for p in _ARKIT)]
    lines = []
    for i, j in enumerate(joints):
        hand = {}
        for name, place in zip(names, j, strict=True):
            pose = np.eye(4)
            pose[:3, 3] = place if name == "wrist" else place - j[0]
            hand[name] = pose.T.ravel().tolist()
        head = np.eye(4).ravel().tolist()
        lines.append({"timestamp": i / 60, "headMatrix": head, "rightHand": hand, "leftHand": None})
    return b"\n".join(map(dumps, lines))


def _trc(joints: Joints) -> bytes:
    names = [f"R_{n}" for n in JOINT_NAMES]
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ta.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits",
        f"100.0\t100.0\t{len(joints)}\t21\tmm",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{a}{i}" for i in range(1, 22) for a in "XYZ"),
        "",
    ]
    for i, j in enumerate(joints):
        places = (f"{1e3 * x:.6f}" for x in j.ravel())
        lines.append("\t".join([str(i + 1), f"{i / 100:.3f}", *places]))
    return "\n".join(lines).encode() + b"\n"


def _c3d(joints: Joints) -> bytes:
    import c3d

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        writer = c3d.Writer(point_rate=100.0, analog_rate=0, point_scale=-1.0)
        writer.set_point_labels([f"R_{n}".ljust(16) for n in JOINT_NAMES])
        for j in joints:
            points = np.zeros((21, 5), np.float32)
            points[:, :3] = 1e3 * j
            writer.add_frames([(points, np.zeros((0, 0), np.float32))])
        out = io.BytesIO()
        writer.write(out)
    return out.getvalue()


def _bvh(joints: Joints) -> bytes:
    rest = 100 * joints[0]
    turn = "Zrotation Xrotation Yrotation"
    lines = ["HIERARCHY", "ROOT RightHand", "{", "OFFSET 0 0 0"]
    lines.append(f"CHANNELS 6 Xposition Yposition Zposition {turn}")
    for f, finger in enumerate(_FINGERS):
        before = rest[0]
        for k in range(1, 4):
            place = rest[4 * f + k]
            lines += [f"JOINT RightHand{finger}{k}", "{"]
            lines += ["OFFSET " + " ".join(f"{x:.6f}" for x in place - before)]
            lines.append(f"CHANNELS 3 {turn}")
            before = place
        end = " ".join(f"{x:.6f}" for x in rest[4 * f + 4] - before)
        lines += ["End Site", "{", f"OFFSET {end}", "}", "}", "}", "}"]
    lines += ["}", "MOTION", f"Frames: {len(joints)}", "Frame Time: 0.033333"]
    for i, j in enumerate(joints):
        numbers = [*(100 * j[0]), *([5.0 * i] * 48)]
        lines.append(" ".join(f"{x:.6f}" for x in numbers))
    return "\n".join(lines).encode() + b"\n"


def _manus(joints: Joints) -> bytes:
    local = 100 * (joints - joints[:, :1])
    names, columns = ["Hand"], [local[:, 0]]
    for f, finger in enumerate(("Thumb", "Index", "Middle", "Ring", "Pinky")):
        parts = ("MCP", "PIP", "DIP", "TIP") if f else ("CMC", "MCP", "DIP", "TIP")
        if f:
            names.append(f"{finger}_CMC")
            columns.append(0.2 * local[:, 1 + 4 * f])
        names += [f"{finger}_{p}" for p in parts]
        columns += [local[:, 1 + 4 * f + k] for k in range(4)]
    titles = [f"{n}_{a}" for n in names for a in "XYZ"]
    table = np.concatenate(columns, axis=1)
    lines = [";".join(["Frame", "Elapsed_Time_In_Milliseconds", *titles, *titles])]
    for i, row in enumerate(table):
        cells = [str(i), f"{1e3 * i / 60:.4f}", *(f"{x:.6f}" for x in row), *(["12.5"] * 75)]
        lines.append(";".join(cells).replace(".", ","))
    return "\n".join(lines).encode() + b"\n"


def _aria(joints: Joints) -> Files:
    back = ORDERS["umetrack"]
    titles = ["tracking_timestamp_us", "right_tracking_confidence"]
    titles += [f"t{a}_right_landmark_{i}_device" for i in range(21) for a in "xyz"]
    lines = [",".join(titles)]
    way = ["tracking_timestamp_us", *(f"t{a}_world_device" for a in "xyz")]
    way += [f"q{a}_world_device" for a in "xyzw"]
    poses = [",".join(way)]
    for i, j in enumerate(joints):
        marks = np.zeros((21, 3))
        for joint, mark in enumerate(back):
            if mark >= 0:
                marks[mark] = j[joint]
        marks[20] = j[[0, 9]].mean(0)
        lines.append(",".join(map(str, [10**9 + 33_333 * i, 0.9, *marks.ravel().tolist()])))
    for i in range(40):
        poses.append(f"{10**9 + 5000 * i},{0.01 * i},1.0,0.5,0.0,0.6,0.0,0.8")
    return {
        "hands.csv": "\n".join(lines).encode() + b"\n",
        "way.csv": "\n".join(poses).encode() + b"\n",
    }


def _stream(joints: Joints) -> bytes:
    wrist = np.tile(np.eye(4), (len(joints), 1, 1, 1))
    wrist[:, 0, :3, 3] = joints[:, 0]
    fingers = np.tile(np.eye(4), (len(joints), 25, 1, 1))
    fingers[..., :3, 3][:, list(ORDERS["webxr"])] = joints - joints[:, :1]
    return as_npz(True, right_wrist=wrist, right_fingers=fingers)


def _load(path: Path) -> Any:
    return ht.load(path)


def _one(name: str, make: Writer) -> Kind:
    return Kind(lambda j: {name: make(j)}, name, _load)


def _of_markers(joints: Joints) -> Files:
    text = _trc(joints).decode().replace("R_", "M")
    said = {f"M{n}": f"right {n}" for n in JOINT_NAMES}
    return {"a.trc": text.encode(), "markers.json": json.dumps(said).encode()}


def kinds() -> dict[str, Kind]:
    """All of them, by name."""
    beside = {"umetrack_hand_user_profile.json": profile()}
    return {
        "egodex": _one("a.hdf5", _hdf5(_egodex)),
        "hdf5": _one("a.h5", _hdf5(_arrays)),
        "emg2pose": Kind(lambda j: {"a.hdf5": _hdf5(_emg2pose)(j), **beside}, "a.hdf5", _load),
        "hot3d": Kind(lambda j: {"a.jsonl": _hot3d(j), **beside}, "a.jsonl", _load),
        "visionpro": _one("a.jsonl", _visionpro),
        "visionpro npz": _one("a.npz", _stream),
        "trc": _one("a.trc", _trc),
        "trc markers": Kind(
            _of_markers, "a.trc", lambda p: ht.load(p, markers=p.with_name("markers.json"))
        ),
        "c3d": _one("a.c3d", _c3d),
        "bvh": _one("a.bvh", _bvh),
        "manus": _one("take_R.csv", _manus),
        "aria": Kind(_aria, "hands.csv", lambda p: ht.load(p, trajectory=p.with_name("way.csv"))),
    }
