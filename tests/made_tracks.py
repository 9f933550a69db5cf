"""Tracks made by forward kinematics, for the tests of recording."""

from __future__ import annotations

import dataclasses

import numpy as np

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import about_axis, matrix_to_quaternion
from handtrack.hand.skeleton import ANGLE_JOINT, PART_JOINT
from handtrack.tracking.track import Event, Track


def with_skin(model: HandModel, sides: int = 8, rings: int = 5) -> HandModel:
    """The model with a tube around each bone for a skin: few vertices, any number of them."""
    vertices, faces, weights = [], [], []
    joints = model.rest_joints
    for child in range(1, 21):
        parent = 0 if child % 4 == 1 else child - 1
        part = int(np.flatnonzero(parent == PART_JOINT)[0])
        along = joints[child] - joints[parent]
        across = np.cross(along, [0.0, 0.0, 1.0])
        across /= np.linalg.norm(across)
        up = np.cross(along, across) / np.linalg.norm(along)
        start = sum(len(v) for v in vertices)
        turn = np.linspace(0, 2 * np.pi, sides, endpoint=False)[:, None]
        ring = 0.008 * (np.cos(turn) * across + np.sin(turn) * up)
        for i in range(rings):
            vertices.append(joints[parent] + i / (rings - 1) * along + ring)
            weights.append(np.tile(np.eye(16)[part], (sides, 1)))
        for i in range(rings - 1):
            for s in range(sides):
                a, b = start + i * sides + s, start + i * sides + (s + 1) % sides
                faces += [[a, b, a + sides], [b, b + sides, a + sides]]
    return dataclasses.replace(
        model,
        thumb_twist=0.125,
        shape=np.array([0.5, -1.25]),
        rest_vertices=np.concatenate(vertices),
        faces=np.array(faces, np.int32),
        weights=np.concatenate(weights),
    )


def without_skin(model: HandModel) -> HandModel:
    return dataclasses.replace(
        model,
        rest_vertices=np.empty((0, 3)),
        faces=np.empty((0, 3), np.int32),
        weights=np.empty((0, 16)),
    )


def make_track(
    frames: int = 60,
    hand: str = "right",
    *,
    name: str = "sample",
    seed: int = 0,
    skin: bool = True,
    truth: bool = True,
    start_ns: int = 0,
    lost: slice = slice(20, 26),
    offset: tuple[float, float, float] = (0.0, 0.0, 0.0),
    model: HandModel | None = None,
) -> Track:
    """A hand that opens and closes while it turns, observed with noise, lost for a while."""
    rng = np.random.default_rng(seed)
    model = model or HandModel.default(hand)  # type: ignore[arg-type]
    model = model if skin else without_skin(model)
    t = np.arange(frames) / 30.0
    # fingers bend one after another; abduction swings a little about zero
    phase = 2 * np.pi * 0.4 * t[:, None] - 0.25 * ANGLE_JOINT[None, :] / 4 + seed
    bend = 0.5 - 0.5 * np.cos(phase)
    upper, lower = model.limits.upper, model.limits.lower
    angles = 0.75 * bend * upper
    for a in (1, 5, 9, 13, 17):
        angles[:, a] = 0.3 * np.sin(phase[:, a]) * np.minimum(upper[a], -lower[a])
    angles = model.limits.clamp(angles)
    rotation = about_axis(np.array([0.0, 0.0, 1.0]), 0.5 * np.sin(t)) @ about_axis(
        np.array([1.0, 0.0, 0.0]), 0.6 * np.sin(0.7 * t)
    )
    translation = np.stack([0.03 * np.sin(t), 0.02 * np.cos(t), 0.05 * t / t.max()], -1) + offset
    joints = model.joints(angles, rotation, translation)
    observed = joints + rng.normal(0, 0.002, joints.shape)
    observed[rng.random((frames, 21)) < 0.02] = np.nan
    raw = model.limits.clamp(angles + rng.normal(0, 0.03, angles.shape))
    translation_raw = translation + rng.normal(0, 0.0005, translation.shape)
    quaternion = matrix_to_quaternion(rotation)
    fitted = model.joints(raw, rotation, translation_raw)
    filtered, variance = model.joints(angles, rotation, translation), np.full(angles.shape, 1e-4)
    quaternion_raw = quaternion.copy()
    objective = np.nansum((fitted - observed) ** 2, (1, 2))
    for array in (raw, angles, quaternion, quaternion_raw, translation, translation_raw):
        array[lost] = np.nan
    for array in (fitted, filtered, observed, objective):
        array[lost] = np.nan
    variance[lost] = np.inf
    status = np.full(frames, "fitted", dtype="<U9")
    reason = np.full(frames, "", dtype="<U40")
    status[lost], reason[lost] = "lost", "0 of 21 joints observed, 4 are needed"
    status[:1], reason[:1] = "predicted", "first frame"
    time_ns = start_ns + np.round(t * 1e9).astype(np.int64)
    events = (
        Event(int(time_ns[min(20, frames - 1)]), "warning", "hand lost: no joints"),
        Event(int(time_ns[min(26, frames - 1)]), "info", "hand found again after 6 frames"),
    )
    return Track(
        name=name,
        hand=hand,  # type: ignore[arg-type]
        time_ns=time_ns,
        frame_index=np.arange(frames) + 100,
        observed=observed,
        confidence=np.where(np.isnan(observed[..., 0]), 0.0, 0.9),
        truth=joints if truth else None,
        angles_raw=raw,
        angles=angles,
        quaternion_raw=quaternion_raw,
        quaternion=quaternion,
        translation_raw=translation_raw,
        translation=translation,
        fitted_joints=fitted,
        filtered_joints=filtered,
        angle_variance=variance,
        objective=objective,
        iterations=rng.integers(1, 9, frames),
        status=status,
        reason=reason,
        model=model,
        settings={"filter": "kalman", "update": "exact", "limits": "anatomical"},
        version="0.1.0",
        source="tests/made.npz",
        subject="nobody",
        events=events,
        rejected=~np.isnan(observed[..., 0]) & (rng.random((frames, 21)) < 0.1),
        restart=np.arange(frames) == 26,
    )
