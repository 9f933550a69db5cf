"""Sound inputs of every kind that a reader has, small ones, to be spoilt."""

from __future__ import annotations

import importlib.util
import io
import json
import pickle
import tarfile
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import JOINT_NAMES, ORDERS
from tools.bench.damage import hands
from tools.make.mano_like import make_mano_like, write_pickle

ROOT = Path(__file__).resolve().parents[2]
FRAMES = 6
Joints = NDArray[np.float64]
Files = dict[str, bytes]


@dataclass(frozen=True)
class Kind:
    """A kind of input.

    Attributes:
        make: the files, by their names in a folder, of joints (T, 21, 3) [m].
        target: what is read of the folder: a file's name, or "" for the folder.
        read: reads it.
        checked: whether sums in the file tell every wrong byte.
    """

    make: Callable[[Joints], Files]
    target: str
    read: Callable[[Path], Any]
    checked: bool = False


def motion(frames: int = FRAMES) -> Joints:
    """A right hand that bends."""
    model = HandModel.default("right")
    t = np.linspace(0, 1, frames)[:, None]
    angles = np.zeros((frames, 20))
    for finger in range(1, 5):
        angles[:, [4 * finger, 4 * finger + 2, 4 * finger + 3]] = 0.3 + 0.6 * t
    angles[:, 2:4] = 0.3
    place = np.array([0.1, 0.2, 1.0]) + 0.2 * t * np.array([1.0, 0.5, 0.0])
    return np.asarray(model.joints(angles, np.broadcast_to(np.eye(3), (frames, 3, 3)), place))


def dumps(value: Any) -> bytes:
    """JSON."""
    return json.dumps(value).encode()


def as_npz(compressed: Any = False, **arrays: Any) -> bytes:
    """A .npz file."""
    out = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(out, **arrays)
    return out.getvalue()


def npy(joints: Joints) -> bytes:
    """A .npy file."""
    out = io.BytesIO()
    np.save(out, joints)
    return out.getvalue()


def panoptic_frame(joints: Joints) -> bytes:
    """One frame, one person."""
    hand = {"landmarks": (100 * joints).ravel().tolist(), "averageScore": [0.9] * 21}
    person = {"id": 0, "right_hand": hand, "left_hand": hand | {"validity": [1] * 21}}
    return dumps({"version": 0.7, "people": [person]})


def panoptic(joints: Joints) -> Files:
    """A folder of frames."""
    return {f"handRecon3D_hd{i:08d}.json": panoptic_frame(j) for i, j in enumerate(joints)}


def tar(mode: str) -> Callable[[Joints], Files]:
    """The folder in an archive."""

    def make(joints: Joints) -> Files:
        out = io.BytesIO()
        with tarfile.open(fileobj=out, mode=mode) as archive:  # type: ignore[call-overload]
            for name, data in panoptic(joints).items():
                member = tarfile.TarInfo(f"hdHand3d/{name}")
                member.size = len(data)
                archive.addfile(member, io.BytesIO(data))
        return {"a.tar": out.getvalue()}

    return make


def named_csv(joints: Joints) -> Files:
    """A table with a header."""
    header = ["time", "frame", *(f"{n}_{a}" for n in JOINT_NAMES for a in "xyz")]
    lines = [",".join(header)]
    lines += [
        ",".join(map(repr, [i / 30, i, *map(float, j.ravel())])) for i, j in enumerate(joints)
    ]
    return {"a.csv": "\n".join(lines).encode() + b"\n"}


def bare_csv(joints: Joints) -> Files:
    """63 columns."""
    lines = [",".join(map(repr, map(float, j.ravel()))) for j in joints]
    return {"a.csv": "\n".join(lines).encode() + b"\n"}


def fpha(joints: Joints) -> Files:
    """FPHA's skeleton.txt."""
    order = np.argsort(ORDERS["fpha"])
    rows = (1000 * joints[:, order]).reshape(len(joints), -1)
    return {
        "skeleton.txt": "\n".join(
            f"{i} " + " ".join(map(str, r)) for i, r in enumerate(rows)
        ).encode()
    }


def lines(joints: Joints) -> Files:
    """JSON lines."""
    rows = [{"time": i / 30, "joints": j.tolist(), "hand": "right"} for i, j in enumerate(joints)]
    return {"a.jsonl": b"\n".join(map(dumps, rows))}


def leap(joints: Joints) -> Files:
    """A Leap recording."""
    names = ("mcpPosition", "pipPosition", "dipPosition", "tipPosition")
    frames = []
    for i, j in enumerate(joints):
        fingers = [
            {"handId": 7, "type": k, "id": 70 + k, "tool": False}
            | {n: (1000 * j[4 * k + 1 + m]).tolist() for m, n in enumerate(names)}
            for k in range(5)
        ]
        hand = {"id": 7, "type": "right", "confidence": 0.8}
        frames.append({"id": i, "timestamp": 10_000 * i, "hands": [hand], "pointables": fingers})
    return {"a.json": dumps({"frames": frames, "metadata": {}})}


def interhand(joints: Joints) -> Files:
    """InterHand2.6M's joint_3d.json."""
    own = np.zeros_like(joints)
    own[:, list(ORDERS["interhand"])] = 1000 * joints
    both = np.concatenate([own, own], 1)
    frames = {
        str(3 * i): {"world_coord": x.tolist(), "joint_valid": [[1]] * 42}
        for i, x in enumerate(both)
    }
    return {"joint_3d.json": dumps({"0": frames})}


def webxr(joints: Joints) -> Files:
    """Lines of WebXR frames by joint names."""
    bones = ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
    names = ["wrist", *(f"thumb-{b}" for b in bones if b != "phalanx-intermediate")]
    names += [f"{f}-finger-{b}" for f in ("index", "middle", "ring", "pinky") for b in bones]
    every = np.full((len(joints), 25, 3), 0.05) + joints[:, :1]
    every[:, list(ORDERS["webxr"])] = joints
    rows = [
        {"time": 33.0 * i, "right": dict(zip(names, x.tolist(), strict=True)), "left": None}
        for i, x in enumerate(every)
    ]
    return {"a.jsonl": b"\n".join(map(dumps, rows))}


def ho3d(joints: Joints) -> Files:
    """A meta folder."""
    files = {}
    for i, j in enumerate(joints):
        own = np.zeros((21, 3))
        own[list(ORDERS["mano"])] = j * [1, -1, -1]
        content = {"handJoints3D": own, "objName": "cup", "camMat": np.eye(3), "handBeta": None}
        files[f"{i:04d}.pkl"] = pickle.dumps(content, i % 6)
    return files


def frankmocap(joints: Joints) -> Files:
    """A folder of predictions."""
    files = {}
    for i, j in enumerate(joints):
        hand = {"pred_joints_smpl": j.astype(np.float32), "bbox_scale_ratio": 1.2}
        content = {"pred_output_list": [{"right_hand": hand, "left_hand": None}], "image_path": "a"}
        files[f"{i:05d}_prediction_result.pkl"] = pickle.dumps(content, 2 + i % 4)
    return files


def dexycb(joints: Joints) -> Files:
    """A folder of labels."""
    files = {
        f"labels_{i:06d}.npz": as_npz(
            True, joint_3d=j[None].astype(np.float32), seg=np.zeros((8, 8))
        )
        for i, j in enumerate(joints)
    }
    return files | {"meta.yml": b"mano_sides:\n- right\nmano_calib:\n- subject-01\n"}


def mcap(joints: Joints, **options: Any) -> Files:
    """Another program's MCAP of JSON messages."""
    from mcap.writer import Writer

    out = io.BytesIO()
    writer = Writer(out, **options)
    writer.start()
    schema = writer.register_schema("hand", "jsonschema", b'{"type": "object"}')
    channel = writer.register_channel("/hand/right", "json", schema)
    for i, j in enumerate(joints):
        time = 10**18 + i * 33_333_333
        data = dumps({"timestamp": time, "hand": "right", "joints_m": j.tolist()})
        writer.add_message(channel, time, data, time)
    writer.finish()  # type: ignore[no-untyped-call]
    return {"a.mcap": out.getvalue()}


def own_recording(compression: str) -> Callable[[Joints], Files]:
    """This project's recording of two hands."""

    def write(path: Path) -> None:
        ht.write_mcap(hands(), path, mesh=False, compression=compression)

    return in_folder(write, "a.mcap")


def mano(joints: Joints) -> Files:
    """A stand-in for MANO's file."""
    out = io.BytesIO()
    write_pickle(make_mano_like("right"), out)
    return {"MANO_RIGHT.pkl": out.getvalue()}


def mano_npz(joints: Joints) -> Files:
    """It as a .npz with a pickled member."""
    content = {k: np.asarray(v) for k, v in make_mano_like("right").items()}
    content["bs_style"] = np.array({"lbs": 1}, dtype=object)
    return {"MANO_RIGHT.npz": as_npz(**content)}


def _tests(name: str) -> ModuleType:
    path = ROOT / "tests" / f"{name}.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise FileNotFoundError(path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def in_folder(write: Callable[[Path], object], name: str) -> Callable[[Joints], Files]:
    """What a function writes to a path."""

    def make(joints: Joints) -> Files:
        with tempfile.TemporaryDirectory() as folder:
            write(Path(folder) / name)
            return {name: (Path(folder) / name).read_bytes()}

    return make


def write_glb(path: Path, **options: Any) -> None:
    _tests("hand/glb_files").write_glb(path, HandModel.default("right"), **options)
