"""Make clips: move a hand, draw it, let a detector see it, keep both sides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.cameras.triangulate import triangulate
from handtrack.errors import InputError
from handtrack.video.detector import Detection, Detector
from tools.bench.rendered import layout, motion, rig
from tools.bench.rendered.people import Subject, subject
from tools.bench.rendered.raster import Raster
from tools.bench.rendered.scene import Scene

Array = NDArray[np.float64]
MakeDetector = Callable[[], Detector]

ROOT = Path(__file__).resolve().parents[3]
SAMPLE = ROOT / "recordings" / "sample.npz"
LENGTHS = (60, 60, 75, 90, 120)
LEARN = "learn"
"""Clips of many people, which profiles are made of and no method is measured on."""
_LEARNERS = range(5, 100)
CAMERAS = 3
GENERATED = "generated"
# of the splits that are held out: first subject, part of the sample, first seed
_HELD_OUT = {
    "holdout": (40, 1.0, 1000),
    "holdout2": (80, 0.75, 3000),
    "holdout3": (100, 0.5, 4000),
    "holdout4": (220, 0.25, 6000),
    "holdout5": (320, 0.0, 7000),
    "holdout6": (440, 0.6, 8000),
    "holdout7": (560, 0.35, 9000),
    "holdout8": (680, 0.85, 10000),
}
SPLITS = ("tune", *tuple(_HELD_OUT)[:-1])
"""What is measured."""
NEXT = tuple(_HELD_OUT)[-1]
"""Held out for the next time: planned, and not drawn yet."""


@dataclass(frozen=True)
class Plan:
    """What a clip is made of; everything else follows from its seed.

    Attributes:
        name: of the clip.
        subject: number of the subject.
        source: "generated", or a file with joints whose movement is taken.
        part: which of the source's stretches, 0..1 from its beginning to its end.
        seed: of movement, light, room, cameras and noise.
        lengths: frames, of which one is drawn.
        fps: frames in a second of generated movement.
        apart: each finger moves for itself.
    """

    name: str
    subject: int
    source: str
    part: float
    seed: int
    lengths: tuple[int, ...] = LENGTHS
    fps: float = motion.FPS
    apart: bool = False


def plans_of(source: Path, subjects: int = 3) -> list[Plan]:
    """Clips that move as a file of joints does: its beginning, middle and end, on other hands."""
    return [
        Plan(f"{source.parent.name}-{source.stem}{i}", 60 + i, str(source), i / 2, 2000 + i)
        for i in range(subjects)
    ]


def plans(split: str) -> list[Plan]:
    """The 30 clips to tune on, 10 held out, or short ones to learn from; other subjects in each.

    A fifth of them move as the shipped sample, those held out as its last third or the one before.
    """
    if split == "tune":
        return [
            Plan(f"tune{i:02d}", i % 15, "sample" if i % 5 == 4 else GENERATED, (i // 5) % 3 / 4, i)
            for i in range(30)
        ]
    if split == LEARN:  # quick, as it is the people that count
        return [
            Plan(f"learn{i:03d}", 120 + i, GENERATED, 0.0, 5000 + i, (24,), 12.0, i % 2 == 1)
            for i in _LEARNERS
        ]
    first, part, seed = _HELD_OUT[split]
    prefix = f"{split}-" if split[-1].isdigit() else split
    return [
        Plan(f"{prefix}{i:02d}", first + i, "sample" if i % 5 == 4 else GENERATED, part, seed + i)
        for i in range(10)
    ]


def moved(plan: Plan, person: Subject) -> motion.Motion:
    """The movement of a clip, for the person's hand."""
    rng = np.random.default_rng([plan.seed, 1])
    frames = int(rng.choice(plan.lengths))
    if plan.source == GENERATED:
        found = motion.generated(rng, frames, plan.fps, plan.apart)
    else:
        whole = _longest(SAMPLE if plan.source == "sample" else Path(plan.source))
        frames = min(frames, len(whole))
        found = motion.cut(whole, round(plan.part * (len(whole) - frames)), frames)
        found = motion.placed(found, rng)
    return found if found.hand == person.hand else motion.mirrored(found)


@cache
def _longest(path: Path) -> motion.Motion:
    found = motion.tracked(path)
    if not found:
        raise InputError("no hand is tracked for two seconds in a row", path)
    return max(found, key=len)


def make(plan: Plan, raster: Raster, detector: MakeDetector, cameras: int = CAMERAS) -> layout.Clip:
    """One clip.

    Args:
        plan: what of.
        raster: draws pictures of `rig.SIZE`.
        detector: makes one that follows a hand from picture to picture; one for each camera.
        cameras: how many, 1 to 4.
    """
    person = subject(plan.subject)
    movement = moved(plan, person)
    rigged = rig.arc(np.random.default_rng([plan.seed, 2]), cameras)
    scene = Scene(raster, person, rigged, [plan.seed, 3])
    time_ns = np.rint(np.arange(len(movement)) * 1e9 / motion.FPS).astype(np.int64)
    found = detected(scene, movement, time_ns, detector)
    model = person.model
    truth = model.joints(movement.angles, movement.rotation, movement.translation)
    quaternion = np.roll(Rotation.from_matrix(movement.rotation).as_quat(), 1, axis=1)
    right = found.label == layout.LABELS.index(person.hand)
    seen = np.where(right[..., None, None], found.image, np.nan)
    joints, _ = triangulate(rigged, seen, inlier_px=layout.RAW_INLIER_PX, cauchy_px=np.inf)
    return layout.Clip(
        name=plan.name,
        hand=person.hand,
        time_ns=time_ns,
        truth_joints=truth,
        subject=person.name,
        detector="mediapipe",
        motion=movement.name,
        joints=joints,
        image=found.image,
        world=found.world,
        score=found.score,
        label=found.label,
        camera_matrix=np.stack([c.matrix for c in rigged]),
        camera_distortion=np.stack([c.distortion for c in rigged]),
        camera_rotation=np.stack([c.rotation for c in rigged]),
        camera_translation=np.stack([c.translation for c in rigged]),
        camera_size=np.array([c.size for c in rigged]),
        truth_angles=movement.angles,
        truth_rotation=quaternion,
        truth_translation=movement.translation,
        truth_shape=person.shape,
        truth_rest_joints=model.rest_joints,
        truth_axes=model.axes,
        default_axes=ht.HandModel.default(person.hand).axes,
    )


@dataclass(frozen=True, eq=False)
class Seen:
    """What the detector said: arrays as in `layout`."""

    image: Array
    world: Array
    score: Array
    label: NDArray[np.int8]


def detected(
    scene: Scene, movement: motion.Motion, time_ns: NDArray[np.int64], detector: MakeDetector
) -> Seen:
    """The detector's word on every picture of a clip; of several hands the surest."""
    count, frames = len(scene.cameras), len(movement)
    image, world = np.full((count, frames, 21, 2), np.nan), np.full((count, frames, 21, 3), np.nan)
    score, label = np.full((count, frames), np.nan), np.zeros((count, frames), np.int8)
    detectors = [detector() for _ in range(count)]
    try:
        for t, pictures in enumerate(scene.pictures(movement)):
            for c, picture in enumerate(pictures):
                hands: list[Detection] = detectors[c].detect(picture, int(time_ns[t]))
                if not hands:
                    continue
                best = max(hands, key=lambda hand: hand.score)
                image[c, t], score[c, t] = best.image, best.score
                label[c, t] = layout.LABELS.index(best.hand)
                if best.world is not None:
                    world[c, t] = best.world
    finally:
        for one in detectors:
            one.close()
    return Seen(image, world, score, label)


def found_share(clip: layout.Clip) -> Array:
    """(C,) of the frames in which a camera's detector found the right hand where it is.

    Where: the joints are within a quarter of the hand's size of the true ones, in the middle.
    """
    share = []
    for c, camera in enumerate(clip.cameras):
        true = camera.project(clip.truth_joints)
        size = np.linalg.norm(true.max(1) - true.min(1), axis=-1)
        image = np.full_like(true, np.inf) if clip.image is None else clip.image[c]
        off = np.median(np.linalg.norm(image - true, axis=-1), axis=1)
        share.append(float((clip.seen(c) & (off < 0.25 * size)).mean()))
    return np.array(share)
