"""Who holds the hand into the camera, and in what light: drawn by a seed."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.hand.reshape import reshaped
from handtrack.hand.skeleton import BASES, HANDS, Hand
from tools.bench.rendered.raster import Lights

Array = NDArray[np.float64]

# backs of hands from very fair to very dark, and their palms, sRGB
_TONES = (
    ((234, 196, 176), (240, 200, 184)),
    ((224, 178, 152), (236, 190, 170)),
    ((212, 163, 132), (230, 180, 157)),
    ((194, 142, 108), (220, 168, 142)),
    ((168, 117, 84), (206, 154, 127)),
    ((136, 92, 66), (190, 140, 116)),
    ((104, 70, 52), (176, 128, 108)),
    ((80, 56, 45), (160, 116, 100)),
)
_CLOTHS = (
    (40, 44, 60),
    (120, 120, 125),
    (150, 40, 45),
    (50, 90, 70),
    (225, 222, 215),
    (25, 25, 28),
)


@dataclass(frozen=True, eq=False)
class Subject:
    """A person's hand and arm.

    Attributes:
        name: of the subject; clips of one subject share a hand.
        hand: "left" or "right".
        number: of the subject.
        shape: (4,) coefficients of the default hand, in standard deviations.
        tone, tone_palm, cloth: (3,) linear RGB.
        sleeve_mm: where a sleeve begins behind the wrist; None: a bare arm.
        loose_mm: how far it stands off.
        roughness, wrinkles: of the skin.
        seed: of the skin's pattern.
    """

    name: str
    hand: Hand
    number: int
    shape: Array
    tone: Array
    tone_palm: Array
    cloth: Array
    sleeve_mm: float | None
    loose_mm: float
    roughness: float
    wrinkles: float
    seed: float

    @cached_property
    def model(self) -> ht.HandModel:
        """The subject's hand: its shape, and what no few coefficients say.

        Each bone has a length of its own (what the size leaves of the 8 to 12 % by which bones
        vary, Buryanov and Kotiuk 2010), each finger its place and direction on the palm, and each
        joint its axis.
        """
        rng = np.random.default_rng([18, self.number])
        base = ht.HandModel.default("right", shape=self.shape)
        rest = base.rest_joints.copy()
        place = rng.normal(0.0, 0.0015, (5, 3)) + base.rest_joints[BASES] * rng.normal(
            0.0, 0.03, (5, 1)
        )
        turn = Rotation.from_rotvec(np.deg2rad(rng.normal(0.0, [2.0, 2.5, 2.5], (5, 3))))
        longer = np.exp(np.clip(rng.normal(0.0, 1.0, 20), -2, 2) * 0.055)
        for f, first in enumerate(BASES):
            rest[first] = base.rest_joints[first] + place[f]
            for j in range(first + 1, first + 4):
                bone = base.rest_joints[j] - base.rest_joints[j - 1]
                rest[j] = rest[j - 1] + turn[f].apply(bone) * longer[j - 1]
        tilt = Rotation.from_rotvec(np.deg2rad(rng.normal(0.0, 3.0, (20, 3))))
        axes = tilt.apply(turn[np.repeat(np.arange(5), 4)].apply(base.axes.copy()))
        if self.hand == "left":
            # a mirrored rotation turns the other way about the mirrored axis
            base = ht.HandModel.default("left", shape=self.shape)
            rest, axes = rest * [1, -1, 1], -axes * [1, -1, 1]
        return reshaped(base, rest, axes)


def linear(srgb: object) -> Array:
    """sRGB 0..255 to linear 0..1, by the power law."""
    return np.asarray((np.asarray(srgb, dtype=np.float64) / 255.0) ** 2.2)


def subject(number: int) -> Subject:
    """The subject of that number: always the same, and no other's hand."""
    rng = np.random.default_rng([17, number])
    shape = np.clip(rng.normal(0.0, 1.0, 4), -2.0, 2.0)
    back, palm = (linear(x) for x in _TONES[number % len(_TONES)])
    vary = rng.uniform(0.92, 1.08, 3) * rng.uniform(0.9, 1.1)
    sleeved = rng.random() < 0.6
    return Subject(
        name=f"subject{number:02d}",
        hand=HANDS[1 - (number // 2) % 2],
        number=number,
        shape=shape,
        tone=back * vary,
        tone_palm=palm * vary,
        cloth=linear(_CLOTHS[rng.integers(len(_CLOTHS))]),
        sleeve_mm=float(rng.uniform(25, 110)) if sleeved else None,
        loose_mm=float(rng.uniform(3, 9)),
        roughness=float(rng.uniform(0.42, 0.62)),
        wrinkles=float(rng.uniform(0.5, 1.0)),
        seed=float(rng.uniform(0, 20)),
    )


def lights(rng: np.random.Generator) -> Lights:
    """The light of a room: a window or lamp, the ceiling, and what comes back from a wall."""
    azimuth = rng.uniform(-1.2, 1.2)
    height = rng.uniform(0.25, 1.0)
    key = np.array([-np.sin(azimuth), np.cos(azimuth), -height])  # from the cameras' side
    top = np.array([rng.uniform(-0.4, 0.4), rng.uniform(-0.2, 0.5), -1.0])
    wall = np.array([np.sign(azimuth) * 0.9, rng.uniform(-0.2, 0.6), 0.1])
    directions = np.stack([key, top, wall])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    warm = rng.uniform(-1.0, 1.0)
    white = np.array([1 + 0.08 * warm, 1.0, 1 - 0.1 * warm])
    strength = np.array([rng.uniform(0.7, 1.5), rng.uniform(0.3, 0.7), rng.uniform(0.15, 0.4)])
    return Lights(
        directions,
        strength[:, None] * white,
        above=rng.uniform(0.3, 0.5) * white,
        below=rng.uniform(0.18, 0.3) * np.array([1.0, 0.93, 0.86]),
        exposure=float(rng.uniform(0.85, 1.25)),
    )


def exposed(light: Lights, person: Subject) -> Lights:
    """The light as a camera that measures for the hand would take it, in part."""
    gain = (0.35 / float(person.tone.mean())) ** 0.3
    return Lights(light.directions, light.colours, light.above, light.below, light.exposure * gain)
