"""How hands move: our own generator, the shipped sample, and joints tracked from elsewhere.

A `Motion` says nothing of a subject: angles and a root pose, which any hand of that side can take.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.transform import Rotation, Slerp

import handtrack as ht
from handtrack.hand.skeleton import Hand
from tools.make.sample import waves

Array = NDArray[np.float64]

FPS = 30.0
REACH_M = np.array([0.07, 0.05, 0.06])
"""How far from the middle of its room the middle of a hand may go [m]."""

SHOWN = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
"""Root frame to world of a hand with its fingers up (z) that shows its palm to -y."""

# ---- postures, degrees: base flexion, abduction, two hinges; thumb, index .. little ----

_OPEN = ((-12, 8, 3, 3), (0, 6, 4, 3), (0, 0, 4, 3), (1, -5, 5, 4), (2, -10, 6, 4))
_EASY = ((0, 12, 13, 14), (16, 2, 24, 12), (21, 0, 28, 14), (25, -2, 31, 15), (27, -5, 32, 16))
_FIST = ((6, 16, 38, 41), (66, 3, 92, 56), (70, 1, 95, 58), (70, -2, 94, 56), (66, -5, 90, 54))
_BENT = {"thumb": (7, 15, 35, 38), "index": _FIST[1], "middle": _FIST[2]}
_BALL = ((-8, 22, 13, 15), (30, 6, 36, 22), (32, 0, 38, 22), (33, -5, 38, 22), (32, -12, 36, 22))
_HOOK = ((-4, 8, 9, 9), (8, 3, 82, 52), (8, 0, 86, 54), (8, -2, 84, 52), (10, -5, 80, 50))
_TABLE = ((2, 7, 7, 7), (68, 1, 8, 5), (72, 0, 8, 5), (72, -1, 8, 5), (68, -3, 8, 5))
_PINCH = ((10, 18, 24, 25), (48, 4, 46, 26), (28, 0, 28, 14), (20, -3, 22, 12), (14, -7, 20, 10))
_KEY = ((12, -1, 14, 15), (46, 2, 58, 30), (52, 0, 62, 34), (56, -1, 64, 34), (56, -3, 62, 32))


def _point(*straight: int) -> tuple[tuple[int, ...], ...]:
    """Those fingers stretched, the others closed."""
    out = [(7, 15, 35, 38)] + [_FIST[f] for f in range(1, 5)]
    for f in straight:
        out[f] = _OPEN[f]
    return tuple(out)


POSTURES = np.array(
    [
        *(_OPEN, _EASY, _FIST, _BALL, _HOOK, _TABLE, _PINCH, _KEY, _OPEN, _EASY),
        *(_point(1), _point(1, 2), _point(1, 2, 3), _point(1, 2, 3, 4), _point(0), _point(0, 1)),
        *(_point(0, 4), _point(1, 4)),
    ],
    dtype=np.float64,
).reshape(-1, 20)


@dataclass(frozen=True, eq=False)
class Motion:
    """A hand's movement.

    Attributes:
        name: of the movement.
        hand: the side it was made for.
        angles: (T, 20) [rad].
        rotation: (T, 3, 3) root frame to world.
        translation: (T, 3) of the root frame's origin [m].
        arm: (T, 3) unit vectors from the wrist to the elbow, in the world.
    """

    name: str
    hand: Hand
    angles: Array
    rotation: Array
    translation: Array
    arm: Array

    def __len__(self) -> int:
        return len(self.angles)


def mirrored(motion: Motion) -> Motion:
    """The movement for the other hand, mirrored in the world's x."""
    flip_world, flip_root = np.diag([-1.0, 1, 1]), np.diag([1.0, -1, 1])
    return Motion(
        motion.name,
        "left" if motion.hand == "right" else "right",
        motion.angles,
        flip_world @ motion.rotation @ flip_root,
        motion.translation @ flip_world,
        motion.arm @ flip_world,
    )


def minimum_jerk(s: Array) -> Array:
    """0 to 1 over s in 0..1 with no speed or acceleration at the ends (Flash and Hogan 1985)."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 + s * (-15.0 + 6.0 * s)))


def generated(
    rng: np.random.Generator, frames: int, fps: float = FPS, apart: bool = False
) -> Motion:
    """Our own movement of a right hand: from posture to posture, with a turning, wandering arm.

    Fingers set out at times of their own and take 0.2 to 0.9 s, and rest between movements. Slow
    drift and a tremor of 8 to 11 Hz lie on top; angles stay inside the limits. With `apart` each
    finger takes the posture of another hand.
    """
    time = np.arange(frames) / fps
    limits = ht.HandModel.default("right").limits
    tempo = rng.uniform(0.8, 1.8)
    angles = _performed(time, rng, tempo, _of_many if apart else _varied)
    angles += waves(time, np.tile([0.9, 0.35, 1.0, 0.6], 5), (0.1, 0.7), rng)
    angles += waves(time, np.full(20, 0.06), (8.0, 11.0), rng)
    angles = np.stack([limits.clamp(a) for a in np.deg2rad(angles)])
    # the forearm stands up, leans and turns about itself; then the wrist bends
    start, spread = np.concatenate([_drawn_lean(rng), [_drawn_turn(rng)]]), np.array([24, 18, 30])
    swing = _wander(time, rng, start, spread, (0.45 / tempo, 1.2 / tempo))
    limp, bends = np.array([-6.0, 0.0]), np.array([20.0, 9.0])
    wrist = _wander(time, rng, limp, bends, (0.4 / tempo, 0.9 / tempo))
    shake = waves(time, np.full(5, 0.05), (8.0, 11.0), rng)
    swung = Rotation.from_euler("YXZ", swing + shake[:, :3], degrees=True)
    forearm = swung.as_matrix() @ SHOWN
    bend = Rotation.from_euler("YZ", wrist + shake[:, 3:], degrees=True).as_matrix()
    rotation = forearm @ bend
    middle = _wander(time, rng, np.zeros(3), REACH_M, (0.45 / tempo, 1.2 / tempo))
    middle += waves(time, np.full(3, 0.0001), (8.0, 11.0), rng)
    translation = middle - rotation @ np.array([0.09, 0.0, 0.0])
    return Motion("generated", "right", angles, rotation, translation, -forearm[..., 0])


def _drawn_lean(rng: np.random.Generator) -> Array:
    """To the side and to the front [degrees]."""
    return rng.uniform([-32.0, -22.0], [32.0, 25.0])


def _drawn_turn(rng: np.random.Generator) -> float:
    """Of the forearm about itself [degrees]: palm, back or edge of the hand to the cameras."""
    shows = rng.random()
    if shows < 0.55:
        return float(rng.uniform(-45, 45))
    if shows < 0.85:
        return 180.0 + float(rng.uniform(-35, 35))
    return float(rng.choice([-1, 1]) * rng.uniform(55, 90))


def _performed(
    time: Array,
    rng: np.random.Generator,
    tempo: float,
    posture: Callable[[np.random.Generator], Array],
) -> Array:
    """(T, 20) degrees: a score of postures, each somewhat its own."""
    now = posture(rng)
    angles = now[None].repeat(len(time), 0)
    start = rng.uniform(-0.3, 0.4)
    while start < time[-1]:
        goal = posture(rng)
        if rng.random() < 0.3:  # only some fingers
            keep = np.repeat(rng.random(5) < 0.5, 4)
            goal = np.where(keep, now, goal)
        takes = rng.uniform(0.3, 0.8) / tempo
        late = np.repeat(rng.uniform(0.0, 0.09, 5), 4) + np.tile([0.0, 0.0, 0.02, 0.03], 5)
        own = takes * np.repeat(rng.uniform(0.85, 1.2, 5), 4)
        angles += minimum_jerk((time[:, None] - start - late) / own) * (goal - now)
        now = goal
        start += takes + (0.1 + rng.exponential(0.15)) / tempo
    return angles


def _varied(rng: np.random.Generator) -> Array:
    first, second = POSTURES[rng.integers(len(POSTURES), size=2)]
    mix = rng.uniform(0.0, 0.35)
    spread = np.tile([5.0, 1.5, 6.0, 4.0], 5)
    return np.asarray((1 - mix) * first + mix * second + rng.normal(0.0, spread))


def _of_many(rng: np.random.Generator) -> Array:
    postures = [_varied(rng) for _ in range(5)]
    return np.concatenate([postures[f][4 * f : 4 * f + 4] for f in range(5)])


def _wander(
    time: Array, rng: np.random.Generator, start: Array, spread: Array, takes: tuple[float, float]
) -> Array:
    """(T, n) minimum-jerk movements between places within the spread around the start."""
    now = start + rng.uniform(-0.6, 0.6, len(start)) * spread
    out = now[None].repeat(len(time), 0)
    begin = rng.uniform(-0.5, 0.5)
    while begin < time[-1]:
        goal = start + rng.uniform(-1.0, 1.0, len(start)) * spread
        long = rng.uniform(*takes)
        out += minimum_jerk((time[:, None] - begin) / long) * (goal - now)
        now = goal
        begin += long * rng.uniform(0.7, 1.3) + rng.exponential(0.1)
    return out


def tracked(path: Path) -> list[Motion]:
    """The movements of the sequences in a file, fitted and smoothed, at `FPS`.

    The pose in the world is the sequence's; `placed` brings it before the cameras.

    Raises:
        InputError: as `handtrack.load`.
    """
    motions = []
    for sequence in ht.load(path):
        if sequence.truth is not None:
            clean = sequence.truth
            sequence = ht.Sequence(sequence.time_ns, clean, hand=sequence.hand, name=sequence.name)
        track = ht.track(sequence, filter="rts")
        for good in _stretches(track.status):
            time = track.time_ns[good] * 1e-9
            at = np.arange(time[0], time[-1], 1.0 / FPS)
            turn = Rotation.from_quat(np.roll(track.quaternion[good], -1, axis=1))
            rotation = Slerp(time, turn)(at).as_matrix()
            columns = np.concatenate([track.angles[good], track.translation[good]], axis=1)
            values = np.stack([np.interp(at, time, c) for c in columns.T], 1)
            arm = gaussian_filter1d(-rotation[..., 0], 12.0, axis=0, mode="nearest")
            arm /= np.linalg.norm(arm, axis=1, keepdims=True)
            motions.append(
                Motion(sequence.name, sequence.hand, values[:, :20], rotation, values[:, 20:], arm)
            )
    return motions


def _stretches(status: NDArray[np.str_]) -> list[slice]:
    """Runs of at least two seconds' frames that were not lost."""
    lost = np.flatnonzero(np.concatenate([[True], np.asarray(status) == "lost", [True]]))
    runs = [slice(int(a), int(b) - 1) for a, b in pairwise(lost)]
    return [run for run in runs if run.stop - run.start >= 2 * FPS]


def cut(motion: Motion, start: int, frames: int) -> Motion:
    """Some frames of a movement."""
    part = slice(start, start + frames)
    return Motion(
        motion.name,
        motion.hand,
        motion.angles[part],
        motion.rotation[part],
        motion.translation[part],
        motion.arm[part],
    )


def placed(motion: Motion, rng: np.random.Generator) -> Motion:
    """The movement turned and moved to where the cameras look: a hand held up, palm or back.

    The mean pose is turned to a drawn one; movement about it is kept, and drawn in where it
    would leave the cameras' room.
    """
    mean = Rotation.from_matrix(motion.rotation).mean()
    drawn = [*_drawn_lean(rng), _drawn_turn(rng)]
    goal = Rotation.from_euler("YXZ", drawn, degrees=True) * Rotation.from_matrix(SHOWN)
    turn = (goal * mean.inv()).as_matrix()
    rotation = turn @ motion.rotation
    middle = motion.translation @ turn.T + rotation @ np.array([0.09, 0.0, 0.0])
    middle = middle - middle.mean(0)
    middle = middle * min(1.0, float((REACH_M / np.maximum(np.abs(middle).max(0), 1e-9)).min()))
    translation = middle - rotation @ np.array([0.09, 0.0, 0.0])
    return Motion(
        motion.name, motion.hand, motion.angles, rotation, translation, motion.arm @ turn.T
    )
