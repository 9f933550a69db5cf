"""A detector's profile from what it saw and the truth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.calibrate import calibrate
from handtrack.detectors.profile import IN_SPACE, ONE_CAMERA, Noise, Profile
from handtrack.errors import InputError
from handtrack.evaluation.alignment import procrustes
from handtrack.evaluation.landmark_corrections import Example, learn
from handtrack.evaluation.landmark_noise import Errors, noise_of
from handtrack.fitting.fit import fit_batch
from handtrack.hand.axes import rest_frames
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ARRIVING, N_JOINTS, Hand
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

LEAST_FRAMES = 50
"""Frames with all joints that a profile is estimated from, at least."""
# joints in one world are nearer than this to the truth, in the mean of a frame [palm lengths]
_SAME_WORLD = 1.0
# a truth that rigid bones leave so much of is no hand's [m]
_NO_HAND_M = 0.012


@dataclass(frozen=True, eq=False)
class Seen:
    """Frames in which a detector saw all joints, beside the truth.

    Attributes:
        name: of the sequence.
        joints, truth: (T, 21, 3) [m].
        frames: (T, 21, 3, 3) true frames of the bones that arrive at the joints.
        time_ns: (T,).
        size: palm length of the true hand [m].
        view: (3,) viewing direction in the axes of `joints`, or None.
        hand: left or right.
        person: whose hand it is; by the sequence's name where its subject is not known.
    """

    name: str
    joints: Array
    truth: Array
    frames: Array
    time_ns: NDArray[np.int64]
    size: float
    view: Array | None
    hand: Hand
    person: str

    def landmarks(self, offsets: Array) -> Array:
        """(T, 21, 3) where offsets put the landmarks."""
        moved = np.einsum("tjik,jk->tji", self.frames, offsets)
        return np.asarray(self.truth + self.size * moved)

    @staticmethod
    def of(
        detected: Sequence, truth: Array, hand: HandModel | None = None, view: Array | None = None
    ) -> Seen:
        """The frames of a sequence with all joints.

        Args:
            detected: what the detector says.
            truth: (T, 21, 3) true joint centres of the same frames [m].
            hand: the true hand; found in the truth if left out.
            view: as in `Seen`.

        Raises:
            InputError: the truth does not match.
        """
        where = detected.source or None
        if truth.shape != detected.joints.shape:
            raise InputError(
                f"the truth has shape {truth.shape}, the detections {detected.joints.shape}", where
            )
        whole = np.isfinite(detected.joints).all((1, 2)) & np.isfinite(truth).all((1, 2))
        if not whole.any():
            raise InputError("no frame has all 21 joints both detected and true", where)
        if hand is None:
            found = Sequence(detected.time_ns[whole], truth[whole], hand=detected.hand)
            hand = calibrate(HandModel.default(detected.hand), found).model
        truth = truth[whole]
        fits = fit_batch(hand, truth)
        off = float(np.median(np.linalg.norm(fits.joints - truth, axis=-1)))
        if off > _NO_HAND_M:
            raise InputError(
                f"the truth is no {detected.hand} hand's: rigid bones leave {1e3 * off:.0f} mm",
                where,
            )
        turned = fits.rotation[:, None] @ hand.rotations(fits.angles)[:, ARRIVING]
        return Seen(
            detected.name,
            detected.joints[whole],
            truth,
            turned @ rest_frames(hand.rest_joints, hand.hand),
            detected.time_ns[whole],
            hand.size,
            view,
            detected.hand,
            detected.subject or detected.name,
        )


def in_one_world(seen: Seen) -> bool:
    """Whether detections and truth are given in the same frame of reference."""
    apart = np.linalg.norm((seen.joints - seen.truth).mean(1), axis=-1)
    return float(np.median(apart)) < _SAME_WORLD * seen.size


def aligned(seen: Seen, offsets: Array, input: str, usual: float = 0.0) -> Array:
    """(T, 21, 3) the detections brought onto where offsets expect them.

    One camera's by each frame's own similarity; in space as they are where truth and detections
    are in one world, else rigidly.

    Args:
        usual: of one camera, `log_size` that a frame of usual size has.
    """
    if input == IN_SPACE and in_one_world(seen):
        return seen.joints
    expected = seen.landmarks(offsets)
    scale = np.ones(len(expected))
    if input == ONE_CAMERA:
        scale = np.exp(usual - log_size(seen, offsets))
    _, turn, _ = procrustes(seen.joints, expected, scale=False)
    middle = seen.joints.mean(1, keepdims=True)
    moved = np.einsum("tij,tnj->tni", turn, seen.joints - middle)
    return np.asarray(scale[:, None, None] * moved + expected.mean(1, keepdims=True))


def log_size(seen: Seen, offsets: Array) -> Array:
    """(T,) logarithm of the detected hand's size over the one that offsets expect.

    By both hands' extent: a similarity that is fitted shrinks what does not match.
    """
    extents = [
        np.sqrt(np.square(x - x.mean(1, keepdims=True)).sum((1, 2)))
        for x in (seen.joints, seen.landmarks(offsets))
    ]
    return np.asarray(np.log(extents[0] / extents[1]))


def offsets_of(clips: list[Seen], input: str) -> Array:
    """(21, 3) medians of the landmarks' places in their bones' frames, in palm lengths.

    One camera's frames are brought onto the joints, at a size that makes a hand as large as the
    detector's in the mean of clips. Once: brought onto the offsets found, again and again, all
    offsets together would drift, which no landmarks about a hand's middle show.
    """
    none = np.zeros((N_JOINTS, 3))
    usual = float(np.mean([log_size(c, none).mean() for c in clips]))
    found = [
        np.einsum("tjik,tji->tjk", c.frames, aligned(c, none, input, usual) - c.truth) / c.size
        for c in clips
    ]
    return np.asarray(np.median(np.concatenate(found), axis=0))


def errors_of(seen: Seen, offsets: Array, input: str) -> Errors:
    """What a clip's landmarks are off where the offsets expect them."""
    landmarks = seen.landmarks(offsets)
    _, turn, _ = procrustes(landmarks, seen.joints)
    view = None
    if seen.view is not None:
        view = np.einsum("tji,j->ti", turn, seen.view)
    return Errors(
        off=aligned(seen, offsets, input) - landmarks,
        frames=seen.frames,
        time_ns=seen.time_ns,
        view=view,
        log_scale=log_size(seen, offsets),
        aligned=input == ONE_CAMERA or not in_one_world(seen),
    )


def _expected(seen: Seen, offsets: Array, input: str) -> Array:
    """(T, 21, 3) landmarks as offsets expect them, brought onto the detections.

    Where a whole hand is put does not go with its pose, and would be noise to learn from.
    """
    landmarks = seen.landmarks(offsets)
    scale, turn, shift = procrustes(landmarks, seen.joints, scale=input == ONE_CAMERA)
    moved = np.einsum("tij,tnj->tni", turn, landmarks)
    return np.asarray(scale[:, None, None] * moved + shift[:, None])


def estimate_profile(
    clips: Iterable[Seen], name: str, detector: str = "", input: str = IN_SPACE
) -> Profile:
    """The profile of a detector.

    Args:
        clips: what it saw; of several subjects if it is to hold for others.
        name, detector, input: as in `Profile`.

    Raises:
        InputError: too few frames.
    """
    given = list(clips)
    frames = sum(len(c.time_ns) for c in given)
    if frames < LEAST_FRAMES:
        raise InputError(
            f"{frames} frames have all 21 joints detected and true, a profile needs {LEAST_FRAMES}"
        )
    offsets = offsets_of(given, input)
    learnt = learn(
        [Example(c.joints, _expected(c, offsets, input), c.hand, c.person) for c in given]
    )
    left = given
    if learnt is not None:  # noise is what is left of people who are not known
        left = [replace(c, joints=j) for c, j in zip(given, learnt.unknown, strict=True)]
    noise: Noise = noise_of([errors_of(c, offsets, input) for c in left], input == ONE_CAMERA)
    evidence: dict[str, float] = {
        "clips": len(given),
        "frames": frames,
        "without_mm": _off_mm(given, np.zeros_like(offsets), input),
        "with_mm": _off_mm(given, offsets, input),
    }
    if learnt is not None:
        evidence["corrected_mm"] = _off_mm(left, offsets, input)
        return Profile(name, detector or name, input, offsets, noise, evidence, learnt.correction)
    return Profile(name, detector or name, input, offsets, noise, evidence)


def _off_mm(clips: list[Seen], offsets: Array, input: str) -> float:
    """Mean distance of landmarks to where offsets expect them, of clips alike [mm]."""
    off = [np.linalg.norm(errors_of(c, offsets, input).off, axis=-1).mean() for c in clips]
    return round(1e3 * float(np.mean(off)), 2)
