"""All kinds of inputs that the project reads, each with its reader."""

from __future__ import annotations

import atexit
import shutil
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.cameras.formats import load_cameras
from handtrack.hand.hand_file import load_hand, save_hand
from handtrack.hand.mano_file import read_mano
from handtrack.hand.model import HandModel
from tools.fuzz import as_written, brought, robots
from tools.fuzz.corpus import (
    Files,
    Joints,
    Kind,
    as_npz,
    bare_csv,
    dexycb,
    dumps,
    fpha,
    frankmocap,
    ho3d,
    in_folder,
    interhand,
    leap,
    lines,
    mano,
    mano_npz,
    mcap,
    motion,
    named_csv,
    npy,
    own_recording,
    panoptic,
    tar,
    webxr,
    write_glb,
)

_K = [[900.0, 0.5, 640], [0, 905.0, 360], [0, 0, 1]]
_TOML = """[cam_0]\nname = "one"\nsize = [1280, 720]\nmatrix = %s\ndistortions = [0.1, 0, 0, 0, 0]
rotation = [0.1, 0.2, 0.3]\ntranslation = [0.0, 0.1, 0.5]\n\n[metadata]\nerror = 0.5\n"""
_YAML = """%YAML:1.0\n---\nimage_width: 1280\nimage_height: 720
camera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d
   data: [ 900., 0., 640., 0., 905., 360., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d
   data: [ 0.1, 0., 0., 0., 0. ]
R: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ 0.1, 0.2, 0.3 ]
T: !!opencv-matrix\n   rows: 3\n   cols: 1\n   dt: d\n   data: [ 0.0, 0.1, 0.5 ]\n"""


def _panoptic_cameras(joints: Joints) -> Files:
    camera = {
        "name": "00_00",
        "type": "hd",
        "resolution": [1920, 1080],
        "K": _K,
        "distCoef": [0] * 5,
    }
    camera |= {"R": np.eye(3).tolist(), "t": [[1.0], [2.0], [300.0]]}
    other = camera | {"name": "00_01", "t": [[-60.0], [2.0], [300.0]]}
    return {"a.json": dumps({"cameras": [camera, other]})}


def _load(path: Path) -> Any:
    return ht.load(path)


def _load_mano(path: Path) -> Any:
    return ht.load(path, mano=_mano_folder())


@cache
def _mano_folder() -> Path:
    folder = Path(tempfile.mkdtemp())
    atexit.register(shutil.rmtree, folder)
    for name, data in mano(motion()).items():
        (folder / name).write_bytes(data)
    return folder


def kinds() -> dict[str, Kind]:
    """All kinds, by name."""
    fields = {"fps": 30.0, "hand": "right"}
    return {
        "npz": Kind(lambda j: {"a.npz": as_npz(joints_m=j, **fields)}, "a.npz", _load, True),
        "npz packed": Kind(
            lambda j: {"a.npz": as_npz(True, joints_m=j, **fields)}, "a.npz", _load, True
        ),
        "npz mano": Kind(
            lambda j: {"a.npz": as_npz(poses=np.zeros((6, 48)), betas=np.zeros(10), **fields)},
            "a.npz",
            _load_mano,
        ),
        "npy": Kind(lambda j: {"a.npy": npy(j)}, "a.npy", _load),
        "json": Kind(
            lambda j: {"a.json": dumps({"joints_m": j.tolist()} | fields)}, "a.json", _load
        ),
        "json bare": Kind(lambda j: {"a.json": dumps(j.tolist())}, "a.json", _load),
        "json frames": Kind(
            lambda j: {
                "a.json": dumps([{"time": i / 30, "joints": x.tolist()} for i, x in enumerate(j)])
            },
            "a.json",
            _load,
        ),
        "freihand": Kind(
            lambda j: {"training_xyz.json": dumps(j.tolist())}, "training_xyz.json", _load
        ),
        "freihand mano": Kind(
            lambda j: {"training_mano.json": dumps(np.zeros((6, 1, 61)).tolist())},
            "training_mano.json",
            _load_mano,
        ),
        "jsonl": Kind(lines, "a.jsonl", _load),
        "csv": Kind(named_csv, "a.csv", _load),
        "csv bare": Kind(bare_csv, "a.csv", _load),
        "fpha": Kind(fpha, "skeleton.txt", _load),
        "leap": Kind(leap, "a.json", _load),
        "interhand": Kind(interhand, "joint_3d.json", _load),
        "webxr": Kind(webxr, "a.jsonl", _load),
        "panoptic": Kind(panoptic, "", _load),
        "tar": Kind(tar("w"), "a.tar", _load),
        "tar.gz": Kind(tar("w:gz"), "a.tar", _load, True),
        "tar.xz": Kind(tar("w:xz"), "a.tar", _load, True),
        "tar.bz2": Kind(tar("w:bz2"), "a.tar", _load, True),
        "ho3d": Kind(ho3d, "", _load),
        "frankmocap": Kind(frankmocap, "", _load),
        "dexycb": Kind(dexycb, "", _load, True),
        "mcap": Kind(mcap, "a.mcap", _load, True),
        "own recording": Kind(own_recording("lz4"), "a.mcap", _load, True),
        "recording lz4": Kind(own_recording("lz4"), "a.mcap", ht.read_mcap, True),
        "recording zstd": Kind(own_recording("zstd"), "a.mcap", ht.read_mcap, True),
        "recording none": Kind(own_recording("none"), "a.mcap", ht.read_mcap, True),
        "mano": Kind(mano, "MANO_RIGHT.pkl", read_mano),
        "mano npz": Kind(mano_npz, "MANO_RIGHT.npz", read_mano),
        "hand.json": Kind(
            in_folder(lambda p: save_hand(HandModel.default("right"), p), "hand.json"),
            "hand.json",
            load_hand,
        ),
        "glb": Kind(in_folder(write_glb, "a.glb"), "a.glb", HandModel.from_gltf),
        "toml": Kind(lambda j: {"a.toml": (_TOML % _K).encode()}, "a.toml", load_cameras),
        "yaml": Kind(lambda j: {"a.yaml": _YAML.encode()}, "a.yaml", load_cameras),
        "cameras.json": Kind(_panoptic_cameras, "a.json", load_cameras),
        **brought.kinds(),
        **robots.kinds(),
        **as_written.kinds(),
    }
