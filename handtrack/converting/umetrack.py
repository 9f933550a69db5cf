"""Joints as UmeTrack's angles, by fitting the hand of a profile; HOT3D's JSON lines."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.converting.source import Source
from handtrack.hand.rotations import matrix_to_quaternion, vector_to_matrix
from handtrack.sequences.readers.umetrack import N_HINGES, Profile, load_profile

Array = NDArray[np.float64]

_NOISE_M = 0.001
_LOOSE_RAD = 3.0
"""How far angles are from zero where nothing else says."""
_ROUNDS = 40
_STEP = 1e-5
_BLOCK = 1024
_MIRROR = np.array([-1.0, 1.0, 1.0])
"""A right hand is UmeTrack's left one in a mirror."""


class Fitted(NamedTuple):
    """Poses of a profile's hand, for T frames; NaN where too little was seen.

    Attributes:
        angles: (T, 20) [rad].
        rotation: (T, 3, 3) and translation (T, 3) [m]: from the wrist's frame to the world.
    """

    angles: Array
    rotation: Array
    translation: Array


def fit_profile(profile: Profile, joints: Array, hand: str) -> Fitted:
    """The poses nearest to joints, by Levenberg and Marquardt's method on all frames at once.

    Args:
        profile: the hand.
        joints: (T, 21, 3) [m], NaN = missing; the thumb's CMC is not used.
        hand: "left" or "right".
    """
    n = len(joints)
    angles, turn = np.full((n, N_HINGES), np.nan), np.full((n, 3, 3), np.nan)
    move = np.full((n, 3), np.nan)
    for start in range(0, n, _BLOCK):
        part = slice(start, start + _BLOCK)
        angles[part], turn[part], move[part] = _fit(profile, joints[part], hand)
    return Fitted(angles, turn, move)


def _model(profile: Profile, angles: Array, hand: str) -> Array:
    joints = profile.joints(angles)
    return joints * _MIRROR if hand == "right" else joints


def _fit(profile: Profile, joints: Array, hand: str) -> Fitted:
    n = len(joints)
    rest = _model(profile, np.zeros((1, N_HINGES)), hand)[0]
    there = np.isfinite(joints).all(-1) & np.isfinite(rest).all(-1)
    palm = there & np.isin(np.arange(21), [0, 2, 5, 9, 13, 17])
    known = np.flatnonzero((palm.sum(1) >= 3) & (there.sum(1) >= 6))
    angles, turn, move = np.zeros((n, N_HINGES)), np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    for t in known:
        turn[t], move[t] = _placed(rest[palm[t]], joints[t, palm[t]])
    lost = np.setdiff1d(np.arange(n), known)
    weight = there[..., None] / _NOISE_M
    goal = np.nan_to_num(joints)
    damping = np.full(n, 1e-3)

    def left(angles: Array, turn: Array, move: Array) -> Array:
        at = np.nan_to_num(_model(profile, angles, hand))
        off = weight * (np.einsum("tij,tkj->tki", turn, at) + move[:, None] - goal)
        return np.concatenate([off.reshape(n, -1), angles / _LOOSE_RAD], 1)

    now = left(angles, turn, move)
    for _ in range(_ROUNDS):
        slope = _slope(left, angles, turn, move, now)
        gradient = np.einsum("trp,tr->tp", slope, now)
        square = np.einsum("trp,trq->tpq", slope, slope)
        diagonal = np.einsum("tpp->tp", square)
        lifted = square + np.einsum("tp,pq->tpq", damping[:, None] * diagonal + 1e-9, np.eye(26))
        step = -np.linalg.solve(lifted, gradient[..., None])[..., 0]
        tried = angles + step[:, :20], vector_to_matrix(step[:, 20:23]) @ turn, move + step[:, 23:]
        then = left(*tried)
        better = (then**2).sum(1) < (now**2).sum(1)
        small = np.abs(step).max() < 1e-7
        angles, turn, move = (
            np.where(better.reshape(-1, *(1,) * (new.ndim - 1)), new, old)
            for new, old in zip(tried, (angles, turn, move), strict=True)
        )
        now = np.where(better[:, None], then, now)
        damping = np.clip(np.where(better, damping / 5, damping * 4), 1e-9, 1e9)
        if small:
            break
    angles[lost], turn[lost], move[lost] = np.nan, np.nan, np.nan
    return Fitted(angles, turn, move)


def _slope(left, angles: Array, turn: Array, move: Array, now: Array) -> Array:  # type: ignore[no-untyped-def]
    """(T, R, 26) derivatives of what is left, by differences."""
    out = np.empty((*now.shape, 26))
    for p in range(26):
        step = np.zeros((len(now), 26))
        step[:, p] = _STEP
        moved = angles + step[:, :20], vector_to_matrix(step[:, 20:23]) @ turn, move + step[:, 23:]
        out[..., p] = (left(*moved) - now) / _STEP
    return out


def _placed(rest: Array, goal: Array) -> tuple[Array, Array]:
    """The rotation and translation that bring points to others."""
    middle, aim = rest.mean(0), goal.mean(0)
    u, _, vt = np.linalg.svd((goal - aim).T @ (rest - middle))
    rotation = u @ np.diag([1, 1, np.sign(np.linalg.det(u @ vt))]) @ vt
    return rotation, aim - rotation @ middle


def write_umetrack(sources: list[Source], path: Path, profile: Path) -> None:
    """HOT3D's lines: `{"timestamp_ns", "hand_poses": {"0": {"wrist_xform", "joint_angles"}}}`.

    0 is the left hand, 1 the right one; 22 angles, of which UmeTrack's wrist has the last two, 0
    here. Frames in which too little was seen have no pose.
    """
    hand = load_profile(profile)
    by_time: dict[int, dict[str, object]] = {}
    for source in sources:
        found = fit_profile(hand, source.joints, source.hand)
        quaternion = matrix_to_quaternion(np.nan_to_num(found.rotation))
        for t, time in enumerate(source.time_ns.tolist()):
            poses = by_time.setdefault(time, {})
            if not np.isfinite(found.angles[t]).all():
                continue
            poses["0" if source.hand == "left" else "1"] = {
                "wrist_xform": {
                    "q_wxyz": quaternion[t].tolist(),
                    "t_xyz": found.translation[t].tolist(),
                },
                "joint_angles": [*found.angles[t].tolist(), 0.0, 0.0],
                "hand_confidence": 1.0,
            }
    encoder = msgspec.json.Encoder()
    rows = [
        encoder.encode({"timestamp_ns": time, "hand_poses": poses})
        for time, poses in sorted(by_time.items())
    ]
    path.write_bytes(b"\n".join(rows) + b"\n")
