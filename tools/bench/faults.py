"""What real detectors do to clean joints: noise, dropped joints, gaps, jumps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Faults:
    """How much of each fault.

    Attributes:
        noise_mm: standard deviation of the white noise on each coordinate [mm].
        dropped: part of the single joints that are missing.
        jumps: part of the single joints that jump away for one frame.
        jump_m: how far they jump, in any direction [m].
        gaps: how many gaps there are in which nothing is seen.
        gap_frames: how long each gap is [frames].
    """

    noise_mm: float = 0.0
    dropped: float = 0.0
    jumps: float = 0.0
    jump_m: float = 0.2
    gaps: int = 0
    gap_frames: int = 5


KINDS: dict[str, Faults] = {
    "none": Faults(),
    "dropped": Faults(dropped=0.10),
    "gaps": Faults(gaps=3),
    "jumps": Faults(jumps=0.02),
    "all": Faults(dropped=0.10, jumps=0.02, gaps=3),
}
"""Kinds of faults by name, without noise."""


def disturbed(clean: Array, faults: Faults, rng: np.random.Generator) -> Array:
    """The joints with noise and faults; the same noise for every kind of fault.

    Args:
        clean: (T, 21, 3) [m], NaN = missing, which stays so.
        faults: how much of what.
        rng: draws are made in a fixed order, all of them for all kinds.

    Returns:
        A new (T, 21, 3).
    """
    joints = clean + rng.normal(0.0, 1e-3 * faults.noise_mm, clean.shape)
    chance = rng.random(clean.shape[:2])
    away = rng.normal(size=clean.shape)
    away *= faults.jump_m / np.linalg.norm(away, axis=-1, keepdims=True)
    jumped = rng.random(clean.shape[:2]) < faults.jumps
    joints = np.where(jumped[..., None], joints + away, joints)
    joints[chance < faults.dropped] = np.nan
    for start in gap_starts(len(clean), faults):
        joints[start : start + faults.gap_frames] = np.nan
    return joints


def gap_starts(frames: int, faults: Faults) -> list[int]:
    """First frame of each gap, evenly spread, none at an end of the sequence."""
    return [
        (i + 1) * frames // (faults.gaps + 1) - faults.gap_frames // 2 for i in range(faults.gaps)
    ]
