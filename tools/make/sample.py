"""Make recordings/sample.npz: ten seconds of a hand whose true joints are known.

    python -m tools.make.sample [OUT.npz]

The motion (`motion`) and the subject's hand (`subject_hand`) are also what the benchmarks and
`make_panoptic.py` use.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.limits import Limits, preset
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import about_axis
from handtrack.hand.skeleton import BASES, FINGERS, N_ANGLES, PARENTS, Hand

Array = NDArray[np.float64]

SEED = 20210702
FRAMES, FPS = 300, 30.0
NOISE_M = 0.002
"""Standard deviation of the white noise on each coordinate [m]."""
DROPPED = 0.02
"""Part of the single joints that are missing, outside the gap."""
GAP = slice(200, 210)
"""Frames in which nothing is seen."""

# ---- the poses: degrees, one row per finger: base flexion, abduction, two hinges ----

Pose = dict[str, tuple[float, ...]]

_CURLED: Pose = {
    "index": (62.0, 5.5, 92.0, 58.0),
    "middle": (66.0, 4.5, 95.0, 60.0),
    "ring": (66.0, 4.5, 94.0, 58.0),
    "little": (60.0, -5.5, 90.0, 56.0),
}
_OPEN: Pose = {
    "thumb": (-15.0, 10.0, 3.0, 3.0),
    "index": (2.0, 7.0, 4.0, 3.0),
    "middle": (3.0, 0.0, 4.0, 3.0),
    "ring": (3.0, -5.0, 5.0, 4.0),
    "little": (2.0, -8.0, 6.0, 4.0),
}
_RELAXED: Pose = {
    "thumb": (-3.0, 13.0, 14.0, 15.0),
    "index": (18.0, 2.0, 24.0, 12.0),
    "middle": (22.0, 0.0, 28.0, 14.0),
    "ring": (25.0, -2.0, 31.0, 15.0),
    "little": (27.0, -4.0, 32.0, 16.0),
}
_FIST: Pose = {"thumb": (-1.0, 7.0, 40.0, 43.0), **_CURLED}
_PINCH: Pose = {
    "thumb": (10.0, 16.0, 26.0, 28.0),
    "index": (54.0, 5.0, 48.0, 29.0),
    "middle": (30.0, 0.0, 28.0, 15.0),
    "ring": (22.0, -3.0, 23.0, 12.0),
    "little": (15.0, -6.0, 20.0, 11.0),
}
_PINCH_OPEN: Pose = {
    "thumb": (-2.0, 10.0, 13.0, 13.0),
    "index": (32.0, 4.0, 30.0, 18.0),
    "middle": (25.0, 0.0, 25.0, 14.0),
    "ring": (20.0, -3.0, 22.0, 12.0),
    "little": (15.0, -6.0, 20.0, 11.0),
}


def _counted(thumb: tuple[float, ...], *fingers: str) -> Pose:
    """Those fingers stretched, the others curled, the thumb over them."""
    return {"thumb": thumb, **_CURLED} | {finger: _OPEN[finger] for finger in fingers}


POSES: dict[str, Pose] = {
    "relaxed": _RELAXED,
    "open": _OPEN,
    "fist": _FIST,
    "pinch": _PINCH,
    "pinch_open": _PINCH_OPEN,
    "release": {**_FIST, "thumb": (1.0, 12.0, 22.0, 23.0)},
    "one": _counted((8.0, 0.0, 33.0, 35.0), "index"),
    "two": _counted((6.0, 12.0, 50.0, 53.0), "index", "middle"),
    "three": _counted((7.0, 21.0, 56.0, 59.0), "index", "middle", "ring"),
    "four": _counted((8.0, 26.0, 58.0, 78.0), "index", "middle", "ring", "little"),
    "five": _OPEN,
    "flat": {
        "thumb": (-6.0, 7.0, 6.0, 7.0),
        "index": (4.0, 2.0, 5.0, 4.0),
        "middle": (4.0, 0.0, 5.0, 4.0),
        "ring": (4.0, -2.0, 6.0, 4.0),
        "little": (5.0, -4.0, 7.0, 5.0),
    },
}

# ---- the score of ten seconds: start of a movement [s], its duration [s], where it ends ----

CYCLE = 10.0
_THUMB_LAST = np.repeat([0.10, 0.0, 0.0, 0.0, 0.0], 4)
_THUMB_FIRST = np.repeat([0.0, 0.05, 0.05, 0.05, 0.05], 4)
_HAND_SCORE: tuple[tuple[float, float, str], ...] = (
    (0.25, 0.50, "open"),
    (1.05, 0.50, "fist"),
    (1.75, 0.50, "open"),
    (2.45, 0.50, "pinch"),
    (3.00, 0.26, "pinch_open"),
    (3.30, 0.30, "pinch"),
    (3.72, 0.45, "fist"),
    (4.22, 0.24, "release"),
    (4.42, 0.34, "one"),
    (4.86, 0.32, "two"),
    (5.29, 0.32, "three"),
    (5.72, 0.32, "four"),
    (6.15, 0.34, "five"),
    (6.60, 0.45, "flat"),
    (8.10, 0.40, "open"),
    (9.40, 0.50, "relaxed"),
)
ARM = ("turn", "flex", "deviate", "side", "forward")
"""Turn of the forearm (0: palm away from the person, positive: supination), flexion and radial
deviation of the wrist, tilt of the forearm to the person's right and away [degrees]."""
_ARM_START = (35.0, 8.0, 0.0, 8.0, 22.0)
_ARM_SCORE: tuple[tuple[float, float, tuple[float, ...]], ...] = (
    (0.20, 0.60, (8.0, -12.0, 0.0, 4.0, 10.0)),
    (1.05, 0.50, (14.0, -22.0, 2.0, 4.0, 12.0)),
    (1.75, 0.50, (8.0, -10.0, 0.0, 4.0, 8.0)),
    (2.40, 0.60, (45.0, -16.0, 4.0, 2.0, 14.0)),
    (3.70, 0.50, (12.0, -20.0, 0.0, 5.0, 10.0)),
    (6.10, 0.45, (4.0, -10.0, 0.0, 5.0, 6.0)),
    (6.60, 0.60, (118.0, -6.0, 0.0, 8.0, 8.0)),
    (7.32, 0.62, (6.0, -12.0, 0.0, 4.0, 6.0)),
    (8.00, 0.38, (4.0, -8.0, 10.0, -16.0, 5.0)),
    (8.36, 0.40, (4.0, -8.0, -14.0, 24.0, 5.0)),
    (8.74, 0.40, (4.0, -8.0, 10.0, -14.0, 5.0)),
    (9.12, 0.40, (8.0, -8.0, -6.0, 14.0, 6.0)),
    (9.45, 0.52, _ARM_START),
)
_ELBOW = np.array([0.22, 0.28, 1.02])
_FOREARM = np.array([0.0, 0.0, 0.26])
# root frame (x to the fingertips, z out of the back of the hand) to the world of a person who
# shows the palm: x to the person's right, y away from the person, z up
_SHOWN = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])


def minimum_jerk(s: Array) -> Array:
    """0 to 1 over s in 0..1 with no speed or acceleration at the ends (Flash and Hogan 1985)."""
    s = np.clip(s, 0.0, 1.0)
    return np.asarray(s**3 * (10.0 + s * (-15.0 + 6.0 * s)))


def motion(seconds: float, fps: float, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """A hand that opens, closes, pinches, counts, turns and waves, again and again.

    Each ten seconds repeat the score with other tempo, amplitudes and timing of the fingers.
    Fingers set out up to 0.15 s apart and take 0.9 to 1.15 of the movement's time; a slow drift
    (about 1 degree) and a tremor of 8-11 Hz (0.06 degrees, 0.1 mm) lie on top. All angles stay
    inside Table 1 of Li et al. 2021, and so inside the anatomical limits.

    Args:
        seconds, fps: length and frame rate.
        rng: everything that is not in the score.

    Returns:
        angles (T, 20) [rad], rotation (T, 3, 3) from the root frame to the world, and
        translation (T, 3) of the wrist [m]. The world has z up and y away from the person.
    """
    time = np.arange(round(seconds * fps)) / fps
    angles = _pose(_RELAXED)[None].repeat(len(time), 0)
    arm = np.array(_ARM_START)[None].repeat(len(time), 0)
    elbow = _ELBOW[None].repeat(len(time), 0)
    hand_now, arm_now, elbow_now = angles[0].copy(), arm[0].copy(), _ELBOW.copy()
    begin, first = 0.0, True
    while begin < seconds:
        tempo = 1.0 if first else rng.uniform(0.85, 1.2)
        for start, duration, name in _HAND_SCORE:
            target = _varied(_pose(POSES[name]), rng)
            # the two angles of a saddle move as one: straight lines stay inside its ellipse
            late = np.repeat(rng.uniform(0.0, 0.07, 5), 4) + np.tile(
                np.array([0.0, 0.0, 0.02, 0.03]), 5
            )
            # the thumb lies over the fingers: last to close, first to open
            late += _THUMB_LAST if name in ("fist", "one") else _THUMB_FIRST
            longer = np.repeat(rng.uniform(0.9, 1.15, 5), 4)
            s = (time[:, None] - begin - tempo * start - late) / (tempo * duration * longer)
            angles += minimum_jerk(s) * (target - hand_now)
            hand_now = target
        for start, duration, posture in _ARM_SCORE:
            goal = np.array(posture) + rng.normal(0.0, 1.5, len(ARM))
            place = _ELBOW + rng.normal(0.0, 0.012, 3)
            s = minimum_jerk((time[:, None] - begin - tempo * start) / (tempo * duration))
            arm += s * (goal - arm_now)
            elbow += s * (place - elbow_now)
            arm_now, elbow_now = goal, place
        begin, first = begin + tempo * CYCLE, False
    slow, fast = (0.1, 0.7), (8.0, 11.0)
    drift = np.array([0.7, 0.25, 0.8, 0.5])  # flexion, abduction, two hinges [degrees]
    angles += waves(time, np.tile(drift, 5), slow, rng)
    angles += waves(time, np.full(N_ANGLES, 0.06), fast, rng)
    arm += waves(time, np.full(len(ARM), 0.8), slow, rng)
    arm += waves(time, np.full(len(ARM), 0.04), fast, rng)
    elbow += waves(time, np.full(3, 0.003), slow, rng)
    elbow += waves(time, np.full(3, 0.0001), fast, rng)
    rotation, translation = _arm_pose(np.deg2rad(arm), elbow)
    return np.deg2rad(angles), rotation, translation


def _pose(rows: Pose) -> Array:
    return np.array([rows[f] for f in FINGERS]).ravel()


def _varied(pose: Array, rng: np.random.Generator) -> Array:
    """The pose as it comes out this time, with room to the limits for drift and tremor."""
    pose = pose + rng.normal(0.0, np.tile([1.0, 0.3, 1.0, 0.8], 5))
    room = np.tile([2.5, 1.0, 2.6, 1.7], 5)
    table = preset("li2021")
    inner = Limits("inner", table.lower + np.deg2rad(room), table.upper - np.deg2rad(room))
    return np.rad2deg(inner.clamp(np.deg2rad(pose)))


def waves(
    time: Array, deviation: Array, band: tuple[float, float], rng: np.random.Generator
) -> Array:
    """(T, n) sums of three sines from a band of frequencies [Hz], of that standard deviation."""
    frequency = rng.uniform(*band, (3, len(deviation)))
    phase = rng.uniform(0.0, 2 * np.pi, (3, len(deviation)))
    waves = np.sin(2 * np.pi * frequency * time[:, None, None] + phase).sum(1)
    return np.asarray(waves * deviation * np.sqrt(2.0 / 3.0))


def _arm_pose(arm: Array, elbow: Array) -> tuple[Array, Array]:
    turn, flex, deviate, side, forward = arm.T
    x, y, z = np.eye(3)
    forearm = about_axis(y, side) @ about_axis(x, -forward)
    wrist = about_axis(y, flex) @ about_axis(z, deviate)
    rotation = forearm @ about_axis(z, turn) @ _SHOWN @ wrist
    return rotation, elbow + forearm @ _FOREARM


def mirrored(rotation: Array, translation: Array) -> tuple[Array, Array]:
    """The placement of the other hand, left and right exchanged in the world."""
    across, root = np.diag([-1.0, 1.0, 1.0]), np.diag([1.0, -1.0, 1.0])
    return across @ rotation @ root, translation @ across


def subject_hand(rng: np.random.Generator, hand: Hand = "right") -> HandModel:
    """A hand that is nobody's default: what calibration has to find. It has no skin.

    Against the default hand each finger bone is up to 6 % longer or shorter, each finger base
    up to 5 % farther from the wrist or nearer and 1.5 mm (standard deviation) beside, and each
    axis tilted by 3 degrees (standard deviation).
    """
    model = HandModel.default(hand)
    bones = rng.uniform(0.94, 1.06, 20)
    palm = rng.uniform(0.95, 1.05, 5)
    beside = rng.normal(0.0, 0.0015, (5, 3))
    tilt = rng.normal(0.0, np.deg2rad(3.0), (N_ANGLES, 3))
    if hand == "left":
        beside, tilt = beside * [1.0, -1.0, 1.0], -tilt * [1.0, -1.0, 1.0]
    rest = model.rest_joints.copy()
    rest[BASES] = rest[0] + (model.rest_joints[BASES] - rest[0]) * palm[:, None] + beside
    for k in range(1, len(rest)):
        if k not in BASES:
            bone = model.rest_joints[k] - model.rest_joints[PARENTS[k]]
            rest[k] = rest[PARENTS[k]] + bone * bones[k - 1]
    axes = model.axes + np.cross(tilt, model.axes)
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    empty = np.zeros((0, 3))
    return replace(
        model,
        name="subject",
        rest_joints=rest,
        axes=axes,
        rest_vertices=empty,
        faces=empty.astype(np.int32),
        weights=np.zeros((0, 16)),
    )


@dataclass(frozen=True)
class Sample:
    """The sample and what made it."""

    model: HandModel
    angles: Array
    rotation: Array
    translation: Array
    truth: Array
    joints: Array


def make() -> Sample:
    """The sample at full precision, always the same."""
    rng = np.random.default_rng(SEED)
    model = subject_hand(rng)
    angles, rotation, translation = motion(FRAMES / FPS, FPS, rng)
    truth = model.joints(angles, rotation, translation)
    joints = truth + rng.normal(0.0, NOISE_M, truth.shape)
    joints[_dropped(rng, truth.shape[:2])] = np.nan
    joints[GAP] = np.nan
    return Sample(model, angles, rotation, translation, truth, joints)


def _dropped(rng: np.random.Generator, shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Short drop-outs of single joints, 1-5 frames, tips three times as often as others."""
    missing = np.zeros(shape, dtype=bool)
    often = np.ones(shape[1])
    often[BASES + 3] = 3.0
    while missing.mean() < DROPPED:
        joint = rng.choice(shape[1], p=often / often.sum())
        start = rng.integers(0, shape[0] - 5)
        missing[start : start + rng.integers(1, 6), joint] = True
    return missing


def stored(sample: Sample) -> dict[str, NDArray[np.generic]]:
    """The arrays of the file. Numbers are rounded to a power of two, so that they pack well."""
    return {
        "joints_m": _rounded(sample.joints, 16),
        "time_ns": np.rint(np.arange(FRAMES) * 1e9 / FPS).astype(np.int64),
        "confidence": (~np.isnan(sample.joints[..., 0])).astype(np.float32),
        "truth_m": _rounded(sample.truth, 20),
        "truth_angles_rad": _rounded(sample.angles, 16),
        "hand": np.array("right"),
        "fps": np.array(FPS),
        "name": np.array("sample"),
        "subject": np.array("made by tools/make/sample.py"),
    }


def _rounded(x: Array, bits: int) -> NDArray[np.float32]:
    return (np.rint(x * 2.0**bits) / 2.0**bits).astype(np.float32)


def main() -> None:
    """Write the file."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    here = Path(__file__).resolve().parents[2] / "recordings" / "sample.npz"
    parser.add_argument("out", nargs="?", type=Path, default=here)
    out = parser.parse_args().out
    np.savez_compressed(out, **stored(make()))  # type: ignore[arg-type]
    print(f"{out}: {FRAMES} frames at {FPS:g} fps, {out.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    main()
