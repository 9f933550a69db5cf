"""A detector's profile from what it saw and the truth."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.calibrate import calibrate
from handtrack.detectors.profile import IN_SPACE, ONE_CAMERA, Noise, Profile
from handtrack.errors import InputError
from handtrack.evaluation.alignment import procrustes
from handtrack.evaluation.landmark_noise import Errors, noise_of
from handtrack.fitting.batch import fit_batch
from handtrack.hand.bone_frames import rest_frames
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ARRIVING, N_JOINTS
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

LEAST_FRAMES = 50
"""Frames with all joints that a profile is estimated from, at least."""
_ROUNDS = 6
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
    """

    name: str
    joints: Array
    truth: Array
    frames: Array
    time_ns: NDArray[np.int64]
    size: float
    view: Array | None

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
        )


def in_one_world(seen: Seen) -> bool:
    """Whether detections and truth are given in the same frame of reference."""
    apart = np.linalg.norm((seen.joints - seen.truth).mean(1), axis=-1)
    return float(np.median(apart)) < _SAME_WORLD * seen.size


def aligned(seen: Seen, offsets: Array, input: str) -> Array:
    """(T, 21, 3) the detections brought onto where offsets expect them.

    One camera's by each frame's own similarity; in space as they are where truth and detections
    are in one world, else rigidly.
    """
    if input == IN_SPACE and in_one_world(seen):
        return seen.joints
    scale, turn, shift = procrustes(seen.joints, seen.landmarks(offsets), scale=input == ONE_CAMERA)
    moved = np.einsum("tij,tnj->tni", turn, seen.joints)
    return np.asarray(scale[:, None, None] * moved + shift[:, None])


def offsets_of(clips: list[Seen], input: str) -> Array:
    """(21, 3) medians of the landmarks' places in their bones' frames, in palm lengths."""
    offsets = np.zeros((N_JOINTS, 3))
    for _ in range(_ROUNDS):
        found = [
            np.einsum("tjik,tji->tjk", c.frames, aligned(c, offsets, input) - c.truth) / c.size
            for c in clips
        ]
        offsets = np.median(np.concatenate(found), axis=0)
        if input == IN_SPACE and all(in_one_world(c) for c in clips):
            break  # nothing is aligned, so nothing changes
    return np.asarray(offsets)


def errors_of(seen: Seen, offsets: Array, input: str) -> Errors:
    """What a clip's landmarks are off where the offsets expect them."""
    landmarks = seen.landmarks(offsets)
    scale, turn, _ = procrustes(landmarks, seen.joints)
    view = None
    if seen.view is not None:
        view = np.einsum("tji,j->ti", turn, seen.view)
    return Errors(
        off=aligned(seen, offsets, input) - landmarks,
        frames=seen.frames,
        time_ns=seen.time_ns,
        view=view,
        log_scale=np.log(scale),
        aligned=input == ONE_CAMERA or not in_one_world(seen),
    )


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
    noise: Noise = noise_of([errors_of(c, offsets, input) for c in given], input == ONE_CAMERA)
    before, after = (
        float(np.mean([np.linalg.norm(errors_of(c, o, input).off, axis=-1).mean() for c in given]))
        for o in (np.zeros_like(offsets), offsets)
    )
    evidence = {
        "clips": len(given),
        "frames": frames,
        "without_mm": round(1e3 * before, 2),
        "with_mm": round(1e3 * after, 2),
    }
    return Profile(name, detector or name, input, offsets, noise, evidence)
