"""Made motion for the tests of filters."""

from __future__ import annotations

import numpy as np

import handtrack as ht
from handtrack.fitting import solver
from handtrack.hand.rotations import about_axis
from handtrack.tracking.filter_input import Frames
from handtrack.tracking.settings import TrackerSettings

MODEL = ht.HandModel.default("right")
FRAME_NS = 33_333_333


def steady(name: str, **settings) -> TrackerSettings:
    """A tracker's settings with this filter."""
    return TrackerSettings.of({"filter": name}, settings)


def bent(t: np.ndarray, speed: float = 1.0) -> np.ndarray:
    """(T, 20) angles well inside the limits that wave to and fro, for times (T,) [s]."""
    phase = np.arange(20) * 0.7
    middle = 0.5 * (MODEL.limits.lower + MODEL.limits.upper)
    middle[[0, 1, 4, 5, 8, 9, 12, 13, 16, 17]] = 0.05
    return middle + 0.12 * np.sin(speed * np.outer(t, np.full(20, 3.0)) + phase)


def moving(
    frames: int, dt: float = 1 / 30, turn: float = 0.5, speed: float = 1.0
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times [ns], angles (T, 20), rotations (T, 3, 3) and joints (T, 21, 3) of a moving hand."""
    t = np.arange(frames) * dt
    angles = bent(t, speed)
    rotation = about_axis(np.array([0.48, -0.6, 0.64]), turn * t)
    shift = np.stack([0.1 * np.sin(2 * t), 0.05 * t, 0.4 + 0.0 * t], 1)
    return (
        np.round(t * 1e9).astype(np.int64),
        angles,
        rotation,
        MODEL.joints(angles, rotation, shift),
    )


def frames_of(
    times_ns: np.ndarray,
    joints: np.ndarray,
    weights: np.ndarray | None = None,
    model: ht.HandModel = MODEL,
) -> Frames:
    """Frames with their raw fits."""
    joints = joints.copy()
    w = np.ones(joints.shape[:2]) if weights is None else weights.copy()
    results = solver.Results(len(joints), full=False)
    start = solver.start_at(model)
    results.run(solver.Program(), model, joints, w, start, model.mean_angles, 6)
    return Frames(times_ns, joints, w, results.rows)


def hard_frames(frames: int = 120, noise: float = 2e-3, seed: int = 1) -> Frames:
    """Irregular times, noise, missing joints, a gap, weights that differ."""
    rng = np.random.default_rng(seed)
    _, _, _, joints = moving(frames)
    times_ns = np.cumsum(rng.integers(20_000_000, 50_000_000, frames))
    joints = joints + rng.normal(0, noise, joints.shape)
    joints[rng.random(joints.shape[:2]) < 0.1] = np.nan
    joints[40:45] = np.nan
    joints[60:63, [i for i in range(21) if i % 5]] = np.nan  # too few for a fit
    joints[80:85, 17:] = np.nan  # a finger that is not seen
    return frames_of(times_ns, joints, rng.uniform(0.3, 1.0, joints.shape[:2]))


def turns_of(rows: np.ndarray) -> np.ndarray:
    """(..., 3, 3) rotations of rows."""
    return rows["root"][..., :9].reshape(*rows.shape, 3, 3)


def poses(rows: np.ndarray) -> np.ndarray:
    """(..., 99) all numbers of rows' poses: angles, root, quaternion, joints."""
    joints = rows["joints"].reshape(*rows.shape, 63)
    return np.concatenate([rows["angles"], rows["root"], rows["quaternion"], joints], axis=-1)
