"""EgoDex, emg2pose and UmeTrack files, made after their documented layouts."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from handtrack.hand.rotations import about_axis

PARTS = ("Knuckle", "IntermediateBase", "IntermediateTip", "Tip")
FINGERS = ("Thumb", "IndexFinger", "MiddleFinger", "RingFinger", "LittleFinger")


def write_egodex(path: Path, hands: dict[str, np.ndarray], confidence: float | None = 0.8) -> Path:
    """hands: (T, 21, 3) [m] by name; rotations are turned about y, as nothing reads them."""
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["llm_description"] = "folds a towel"
        file.create_dataset("camera/intrinsic", data=np.diag([736.6, 736.6, 1.0]))
        n = len(next(iter(hands.values())))
        poses = np.tile(np.eye(4), (n, 1, 1))
        for name in ("camera", "hip", "neck1", "spine1", "leftArm", "rightShoulder", "leftForearm"):
            file.create_dataset(f"transforms/{name}", data=poses.astype(np.float32))
        for side, joints in hands.items():
            named = {f"{side}Hand": joints[:, 0]}
            for f, finger in enumerate(FINGERS):
                if f:
                    named[f"{side}{finger}Metacarpal"] = 0.7 * joints[:, 0] + 0.3 * joints[:, 4 * f]
                for p, part in enumerate(PARTS):
                    named[f"{side}{finger}{part}"] = joints[:, 1 + 4 * f + p]
            for name, x in named.items():
                pose = poses.copy()
                pose[:, :3, :3] = about_axis(np.array([0.0, 1.0, 0.0]), np.array(0.4))
                pose[:, :3, 3] = x
                file.create_dataset(f"transforms/{name}", data=pose, compression="gzip")
                if confidence is not None:
                    file.create_dataset(f"confidences/{name}", data=np.full(n, confidence))
    return path


def profile(scale: float = 1000.0) -> dict[str, object]:
    """A left hand of UmeTrack's layout, flat, fingers along x, of made numbers."""
    places, axes, landmarks = [], [], np.zeros((21, 3))
    bones, weights = [[1, 1]] * 21, [[1, 0]] * 21
    tips = {f: (0.18 - 0.01 * f, 0.0, 0.03 - 0.02 * f) for f in range(5)}
    tips[0] = (0.105, -0.03, 0.07)
    for f in range(5):
        tip = np.array(tips[f])
        base = np.array([0.02, -0.01, 0.015]) if f == 0 else np.array([0.09, 0.0, tip[2]])
        spots = [base, base, base + 0.45 * (tip - base), base + 0.75 * (tip - base)]
        if f == 0:
            spots = [base, base + 0.1 * (tip - base), *spots[2:]]
        places += [s.tolist() for s in spots]
        bend = [0.6, 0.75, -0.15] if f == 0 else [0.05, 0.02, -1.0]
        first = [0.8, 0.6, 0.0] if f == 0 else [0.0, -1.0, 0.02 * f]
        axes += [(np.array(a) / np.linalg.norm(a)).tolist() for a in (first, bend, bend, bend)]
        first_frame = 2 + 3 * f
        landmarks[f] = tip
        bones[f] = [first_frame + 2] * 2
        if f == 0:
            for k, mark in enumerate((6, 7)):
                landmarks[mark] = spots[2 + k]
                bones[mark] = [first_frame + k] * 2
        else:
            for k, mark in enumerate(range(5 + 3 * f, 8 + 3 * f)):
                landmarks[mark] = spots[1 + k]
                bones[mark] = [1 if k == 0 else first_frame + k - 1] * 2
    landmarks[20] = [0.05, 0.0, 0.0]
    places += [[0.0, 0.0, 0.0]] * 2
    axes += [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    return {
        "joint_rotation_axes": axes,
        "joint_rest_positions": (scale * np.array(places)).tolist(),
        "landmark_rest_positions": (scale * landmarks).tolist(),
        "landmark_rest_bone_indices": bones,
        "landmark_rest_bone_weights": weights,
        "hand_scale": 1.0,
    }


def write_profile(path: Path, scale: float = 1000.0) -> Path:
    """The same as a file."""
    path.write_text(json.dumps({"hand_model": profile(scale)}))
    return path


def write_emg2pose(
    path: Path, angles: np.ndarray, side: str = "right", rate: float = 2000.0
) -> Path:
    """angles: (T, 20) of UmeTrack [rad]."""
    import h5py

    kind = np.dtype([("time", "<f8"), ("joint_angles", "<f4", (20,)), ("emg", "<f4", (16,))])
    rows = np.zeros(len(angles), kind)
    rows["time"] = 1670313313.1833334 + np.arange(len(angles)) / rate
    rows["joint_angles"] = angles
    with h5py.File(path, "w") as file:
        group = file.create_group("emg2pose")
        group.create_dataset("timeseries", data=rows, compression="gzip", chunks=True)
        group.attrs.update({"side": side, "user": "d387095792", "sample_rate": rate})
    return path
