"""Write the sample's motion as a CMU Panoptic Studio hand folder, for tests and demos.

    python -m tools.make.panoptic OUT [--frames 100] [--noise-mm 2] [--people 1]

OUT/hdHand3d/handRecon3D_hd00020701.json and so on: centimetres, the studio's frame (y down),
29.97 frames a second, both hands of each person. `--truth FOLDER` also keeps the true joints, as
person0_left.npz and so on, in metres.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import HANDS, Hand
from tools.make.sample import mirrored, motion, subject_hand

Array = NDArray[np.float64]

FIRST_FRAME = 20701
FPS = 29.97
CAMERAS = 31
SEED = 171204
# metres with z up to the studio's centimetres with y down
_TO_STUDIO = 100.0 * np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


def make(
    frames: int = 100, noise_mm: float = 2.0, people: int = 1, seed: int = SEED
) -> tuple[dict[tuple[int, Hand], Array], dict[tuple[int, Hand], Array]]:
    """The hands of some people, truth and noisy, in the studio's frame.

    Returns:
        truth and joints: (person, hand) -> (frames, 21, 3) [cm].
    """
    truth: dict[tuple[int, Hand], Array] = {}
    joints: dict[tuple[int, Hand], Array] = {}
    for person in range(people):
        for side, hand in enumerate(HANDS):
            rng = np.random.default_rng([seed, person, side])
            # one person, one size: both hands are drawn alike
            model = subject_hand(np.random.default_rng([seed, person]), hand)
            angles, rotation, translation = motion(frames / FPS, FPS, rng)
            if hand == "left":
                rotation, translation = mirrored(rotation, translation)
            beside = np.array([1.2 * person, 0.0, 0.0])
            world = model.joints(angles, rotation, translation + beside)
            truth[person, hand] = world @ _TO_STUDIO.T
            noise = rng.normal(0.0, noise_mm / 10.0, world.shape)
            joints[person, hand] = truth[person, hand] + noise
    return truth, joints


def write(out: Path, joints: dict[tuple[int, Hand], Array], seed: int = SEED) -> Path:
    """Write OUT/hdHand3d, one file a frame; the folder is returned."""
    folder = out / "hdHand3d"
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    frames = len(next(iter(joints.values())))
    for t in range(frames):
        people: dict[int, dict[str, Any]] = {}
        for (person, hand), x in joints.items():
            entry = people.setdefault(person, {"id": person})
            entry[f"{hand}_hand"] = _hand(x[t], rng)
        number = FIRST_FRAME + t
        content = {
            "version": 0.5,
            "univTime": round(53541.542 + 1e3 * number / FPS, 3),
            "fpsType": "hd_29_97",
            "people": list(people.values()),
        }
        (folder / f"handRecon3D_hd{number:08d}.json").write_text(json.dumps(content))
    return folder


def _hand(x: Array, rng: np.random.Generator) -> dict[str, Any]:
    seen = [sorted(rng.choice(CAMERAS, rng.integers(4, 12), replace=False).tolist()) for _ in x]
    return {
        "landmarks": [round(v, 4) for v in x.ravel().tolist()],
        "averageScore": [round(v, 4) for v in rng.uniform(0.4, 0.95, len(x)).tolist()],
        "averageReproError": [round(v, 3) for v in rng.uniform(1.0, 4.0, len(x)).tolist()],
        "validity": [1] * len(x),
        "visibility": seen,
    }


def write_truth(folder: Path, truth: dict[tuple[int, Hand], Array]) -> None:
    """Write the true joints [m] of each hand, in the studio's frame, with its frame numbers."""
    folder.mkdir(parents=True, exist_ok=True)
    for (person, hand), x in truth.items():
        numbers = np.arange(FIRST_FRAME, FIRST_FRAME + len(x))
        np.savez_compressed(
            folder / f"person{person}_{hand}.npz",
            joints_m=(x / 100.0).astype(np.float32),
            frame_index=numbers,
            time_ns=np.rint(numbers * 1e9 / FPS).astype(np.int64),
            fps=np.array(FPS),
            hand=np.array(hand),
            name=np.array(f"person{person}_{hand}"),
        )


def main() -> None:
    """Write the folder, and the truth if asked for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("out", type=Path)
    parser.add_argument("--frames", type=int, default=100)
    parser.add_argument("--noise-mm", type=float, default=2.0)
    parser.add_argument("--people", type=int, default=1)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--truth", type=Path, help="folder for the true joints, .npz [m]")
    args = parser.parse_args()
    if args.frames < 1 or args.people < 1 or args.noise_mm < 0:
        parser.error("--frames and --people must be at least 1, --noise-mm not negative")
    truth, joints = make(args.frames, args.noise_mm, args.people, args.seed)
    folder = write(args.out, joints, args.seed)
    if args.truth:
        write_truth(args.truth, truth)
    print(
        f"{folder}: frames {FIRST_FRAME}:{FIRST_FRAME + args.frames - 1},"
        f" {args.people} {'person' if args.people == 1 else 'people'}, both hands,"
        f" noise {args.noise_mm:g} mm per coordinate"
    )


if __name__ == "__main__":
    main()
