"""Subjects whose hands are known, and their motion, for the tests of calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from handtrack.fitting.fit import fit_batch
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import BASES
from handtrack.sequences.sequence import Sequence
from tools.make import sample as make_sample

FINGER_BONES = np.setdiff1d(np.arange(20), BASES - 1)


def subject(rng: np.random.Generator, hand: str = "right", axes_deg: float = 8.0) -> HandModel:
    """Bones and palm up to 10 % off the default hand's, axes up to 8 degrees."""
    model = HandModel.default(hand)
    rest = model.rest_joints.copy()
    rest[BASES] = rest[0] + (rest[BASES] - rest[0]) * rng.uniform(0.9, 1.1, (5, 1))
    rest[BASES] += rng.normal(0, 0.002, (5, 3))
    for k in np.setdiff1d(np.arange(1, 21), BASES):
        bone = model.rest_joints[k] - model.rest_joints[k - 1]
        rest[k] = rest[k - 1] + bone * rng.uniform(0.9, 1.1)
    beside = np.cross(rng.normal(size=(20, 3)), model.axes)
    beside /= np.linalg.norm(beside, axis=1, keepdims=True)
    tilt = np.deg2rad(rng.uniform(-axes_deg, axes_deg, (20, 1)))
    empty = np.zeros((0, 3))
    return replace(
        model,
        rest_joints=rest,
        axes=np.cos(tilt) * model.axes + np.sin(tilt) * beside,
        rest_vertices=empty,
        faces=empty.astype(np.int32),
        weights=np.zeros((0, 16)),
    )


def poses(rng: np.random.Generator, frames: int = 300) -> tuple[np.ndarray, ...]:
    return make_sample.motion(frames / 30.0, 30.0, rng)


def sequence(joints: np.ndarray, hand: str = "right", **given: object) -> Sequence:
    time = np.arange(len(joints)) * 33_333_333
    return Sequence(time_ns=time, joints=joints, hand=hand, **given)


def residual_mm(model: HandModel, joints: np.ndarray) -> float:
    """Mean distance of the fitted joints to those given."""
    fits = fit_batch(model, joints, threads=1)
    return float(np.nanmean(np.linalg.norm(fits.joints - joints, axis=-1))) * 1e3


def turned_deg(found: HandModel, true: HandModel) -> np.ndarray:
    """(20,) angle between axes, in frames that lie best on each other."""
    a, b = (m.rest_joints[[0, *BASES]] for m in (found, true))
    u, _, vt = np.linalg.svd((b - b.mean(0)).T @ (a - a.mean(0)))
    turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
    cosine = (true.axes * (found.axes @ turn.T)).sum(1)
    return np.rad2deg(np.arccos(np.clip(cosine, -1, 1)))
