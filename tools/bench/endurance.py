"""A tracker that runs for hours: as fast at the end as at the start, no memory that grows, no NaN.

python -m tools.bench.endurance --frames 1000000
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from tools.bench.faults import Faults, disturbed

CAUSAL = ("none", "kalman", "one-euro")
PARTS = 10
SAMPLE = Path(__file__).resolve().parents[2] / "recordings" / "sample.npz"
FRAME_NS = 33_333_333


@dataclass
class Part:
    """A tenth of a run.

    Attributes:
        micros: time of a frame, the median [us].
        memory: of the process at its end [MB].
        fitted: share of the frames.
    """

    micros: float
    memory: float
    fitted: float


def frames(count: int, seed: int = 0) -> Iterator[NDArray[np.float64]]:
    """The sample's truth there and back, with new noise, gaps and jumps each time."""
    (sample,) = ht.load(SAMPLE)
    clean = np.asarray(sample.truth)
    there = np.concatenate([clean, clean[::-1]])
    given, made = 0, seed
    while given < count:
        joints = disturbed(there, _FAULTS, np.random.default_rng(made))
        yield from joints[: count - given]
        given, made = given + len(joints), made + 1


_FAULTS = Faults(noise_mm=2.0, dropped=0.02, jumps=0.005, gaps=1)


def memory() -> float:
    """What the process holds now [MB]."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def endure(filter: str, count: int) -> list[Part]:
    """Run a tracker over so many frames, and look at every one.

    Raises:
        ArithmeticError: a pose that is known is not finite, or one that is not is said to be.
    """
    tracker = ht.Tracker(ht.HandModel.default("right"), filter=filter)
    parts: list[Part] = []
    spent: list[float] = []
    fitted = taken = done = 0
    for t, joints in enumerate(frames(count)):
        began = time.perf_counter()
        frame = tracker.step(joints, t * FRAME_NS)
        spent.append(time.perf_counter() - began)
        known = frame.status != "lost"
        pose = (frame.angles, frame.quaternion, frame.translation, frame.filtered_joints)
        if known != all(bool(np.isfinite(x).all()) for x in pose):
            raise ArithmeticError(f"{filter}, frame {t}: {frame.status}, pose {pose}")
        fitted += frame.status == "fitted"
        taken += 1
        if (t + 1) * PARTS >= (done + 1) * count:
            parts.append(Part(1e6 * float(np.median(spent)), memory(), fitted / taken))
            spent, fitted, taken, done = [], 0, 0, done + 1
    return parts


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=1_000_000)
    parser.add_argument("--filter", choices=CAUSAL, action="append")
    chosen = parser.parse_args()
    for name in chosen.filter or CAUSAL:
        print(f"{name}, {chosen.frames:,} frames")
        for i, part in enumerate(endure(name, chosen.frames), 1):
            print(
                f"  {10 * i:3d} %: {part.micros:6.1f} us a frame, {part.memory:6.1f} MB,"
                f" {100 * part.fitted:.2f} % fitted",
                flush=True,
            )


if __name__ == "__main__":
    main()
