"""Make a data set whose true joints are known: clips of several subjects, in several formats.

    python -m tools.make.data_set OUT [--clips 2000] [--frames 300] [--subjects 20] [--seed 1]

OUT gets a folder for each subject, manifest.csv with a row for each clip, and truth/ with each
clip's true joints and each subject's true hands. Everything is the same each time.
"""

from __future__ import annotations

import argparse
import csv
import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS, JOINT_NAMES, Hand
from tools.make.sample import mirrored, motion, subject_hand

Array = NDArray[np.float64]

FPS = 30.0
ACTIONS = ("count", "pinch", "wave")
"""A column of the manifest that is the user's own; says nothing of the motion."""


class Size(NamedTuple):
    """How large the data set is."""

    clips: int = 2000
    frames: int = 300
    subjects: int = 20
    seed: int = 1


class Made(NamedTuple):
    """A clip.

    Attributes:
        subject, hand: whose.
        joints: (T, 21, 3) as seen [m], NaN = missing.
        truth: (T, 21, 3) [m].
    """

    subject: str
    hand: Hand
    joints: Array
    truth: Array


def subject_hands(size: Size, subject: int) -> dict[Hand, HandModel]:
    """The true hands of a subject: of one shape, left and right."""
    made: dict[Hand, HandModel] = {}
    for hand in HANDS:
        made[hand] = subject_hand(np.random.default_rng([size.seed, subject]), hand)
    return made


def make_clip(size: Size, number: int) -> Made:
    """A clip by its number: subjects in turn, each with left and right hands."""
    subject = number % size.subjects
    hand = HANDS[(number // size.subjects) % 2]
    model = subject_hands(size, subject)[hand]
    rng = np.random.default_rng([size.seed, 7, number])
    # a clip is any part of the motion, so that clips differ in what they show
    late = int(rng.integers(0, 300))
    angles, rotation, translation = motion((late + size.frames) / FPS, FPS, rng)
    if hand == "left":
        rotation, translation = mirrored(rotation, translation)
    truth = model.joints(angles, rotation, translation)[late:]
    noise = rng.uniform(0.001, 0.004)
    joints = truth + rng.normal(0.0, noise, truth.shape)
    joints[rng.random(truth.shape[:2]) < 0.02] = np.nan
    if number % 5 == 0:
        # a third of a second in which nothing is seen
        joints[size.frames // 2 : size.frames // 2 + 10] = np.nan
    return Made(f"s{subject:02d}", hand, joints, truth)


def _npz(path: Path, clip: Made) -> None:
    with path.open("wb") as stream:
        np.savez_compressed(
            stream,
            joints_m=clip.joints.astype(np.float32),
            hand=np.array(clip.hand),
            fps=np.array(FPS),
        )


def _csv(path: Path, clip: Made) -> None:
    names = [f"{name}_{c}" for name in JOINT_NAMES for c in "xyz"]
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(["time", *names])
        for t, row in enumerate(clip.joints.reshape(len(clip.joints), -1)):
            cells = ["" if np.isnan(x) else f"{x:.6f}" for x in row]
            writer.writerow([f"{t / FPS:.6f}", *cells])


def _frame(t: int, joints: Array) -> dict[str, object]:
    known = [[None if np.isnan(x) else round(float(x), 6) for x in p] for p in joints]
    return {"time": round(t / FPS, 6), "joints": known}


def _json(path: Path, clip: Made) -> None:
    frames = [_frame(t, joints) for t, joints in enumerate(clip.joints)]
    said = {"hand": clip.hand, "unit": "m", "fps": FPS, "frames": frames}
    path.write_text(json.dumps(said, allow_nan=False))


def _jsonl(path: Path, clip: Made) -> None:
    lines = (
        json.dumps({"hand": clip.hand, **_frame(t, joints)}, allow_nan=False)
        for t, joints in enumerate(clip.joints)
    )
    path.write_text("\n".join(lines) + "\n")


WRITERS: dict[str, Callable[[Path, Made], None]] = {
    ".npz": _npz,
    ".csv": _csv,
    ".json": _json,
    ".jsonl": _jsonl,
}
"""Formats, in turn."""


def write(out: Path, size: Size) -> Path:
    """Write the data set; the path of its manifest."""
    (out / "truth").mkdir(parents=True, exist_ok=True)
    for subject in range(size.subjects):
        hands = subject_hands(size, subject)
        with (out / "truth" / f"s{subject:02d}_hands.npy").open("wb") as stream:
            np.save(stream, np.stack([hands[hand].rest_joints for hand in HANDS]))
    manifest = out / "manifest.csv"
    with manifest.open("w", newline="") as stream:
        table = csv.writer(stream)
        table.writerow(["path", "hand", "subject", "fps", "truth", "action"])
        for number in range(size.clips):
            clip = make_clip(size, number)
            suffix = tuple(WRITERS)[number // (2 * size.subjects) % len(WRITERS)]
            path = Path(clip.subject) / f"clip{number:05d}{suffix}"
            truth = Path("truth") / f"clip{number:05d}.npz"
            (out / clip.subject).mkdir(exist_ok=True)
            WRITERS[suffix](out / path, clip)
            _npz(out / truth, clip._replace(joints=clip.truth))
            action = ACTIONS[number // (2 * size.subjects) % len(ACTIONS)]
            table.writerow([path, clip.hand, clip.subject, FPS, truth, action])
    return manifest


def main() -> None:
    """Write it, and say what it is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("out", type=Path)
    for name, value in Size()._asdict().items():
        parser.add_argument(f"--{name}", type=int, default=value)
    given = vars(parser.parse_args())
    out = given.pop("out")
    manifest = write(out, Size(**given))
    total = sum(p.stat().st_size for p in out.rglob("*") if p.is_file())
    print(f"{manifest}: {given['clips']} clips, {total / 1e6:.0f} MB")


if __name__ == "__main__":
    main()
