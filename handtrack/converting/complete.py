"""All that other formats want of a hand: missing joints, metacarpals, rotations, and how sure."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import ANGLE_JOINT, BASES, N_JOINTS, PARENTS, PART_JOINT
from handtrack.kernels.kinematics import place_poses
from handtrack.tracking.track import Track

Array = NDArray[np.float64]

_BONE_SD = 0.09
"""Standard deviation of a bone's length among adults, in its length (Buryanov and Kotiuk 2010:
8 to 12 %)."""
_BASES_AT = np.array([0.28, 0.28, 0.30, 0.32])
"""Where the metacarpals of index to little finger begin, from the wrist to the finger's base."""
_FANNED = 0.2
"""Of how far a finger's base is beside the line to the middle one, what its metacarpal's base is
more than those shares say."""
METACARPAL_SD = 0.075
"""Of the bases of the metacarpals, in the length of the palm: what our own hand and HoloLens's
differ by."""
PALM_SD = 0.05
"""Of the palm's centre, likewise."""
_BLOCK = 2048


@dataclass(frozen=True, eq=False)
class Whole:
    """A hand with everything, for T frames; NaN where the hand is lost.

    Attributes:
        joints: (T, 21, 3) [m]: as the source has them, those that it lacks as fitted.
        made: (T, 21) whether a joint comes from the fitted hand.
        sd: (T, 21) how far such a joint is from its true place, root mean square [m]; NaN of
            joints of the source.
        bases: (T, 4, 3) where the metacarpals of index to little finger begin [m].
        palm: (T, 3) the middle of the middle finger's metacarpal [m], OpenXR's palm.
        parts: (T, 16, 3, 3) rotations of the palm and the fingers' parts in the world.
        size: length of the palm [m].
    """

    joints: Array
    made: NDArray[np.bool_]
    sd: Array
    bases: Array
    palm: Array
    parts: Array
    size: float


def completed(track: Track, given: Array | None = None) -> Whole:
    """A track's hand with everything.

    Args:
        track: its raw poses are taken where `given` are the joints, else the filtered ones.
        given: (T, 21, 3) joints of the source [m]; None: those of the track.
    """
    raw = given is not None
    angles = track.angles_raw if raw else track.angles
    turn = quaternion_to_matrix(track.quaternion_raw if raw else track.quaternion)
    move = track.translation_raw if raw else track.translation
    model = track.model
    fitted = model.joints(angles, turn, move)
    parts = turn[:, None] @ model.rotations(angles)
    if given is None:
        # of joints that no frame tells of the model is all there is
        given = np.where(track.measured_joints[:, None], fitted, np.nan)
    made = np.asarray(np.isnan(given).any(-1) & np.isfinite(fitted).all(-1))
    joints = np.where(made[..., None], fitted, given)
    sd = np.where(made, position_sd(track, angles), np.nan)
    rest = metacarpal_bases(model)
    bases = np.einsum("tij,kj->tki", turn, rest) + move[:, None]
    palm = (bases[:, 1] + joints[:, BASES[2]]) / 2
    return Whole(joints, made, sd, bases, palm, parts, model.size)


def metacarpal_bases(model: HandModel) -> Array:
    """(4, 3) where the metacarpals of index to little finger begin at rest [m], root frame."""
    wrist = model.rest_joints[0]
    out = model.rest_joints[BASES[1:]] - wrist
    line = out[1] / np.linalg.norm(out[1])
    beside = out - (out @ line)[:, None] * line
    return np.asarray(wrist + _BASES_AT[:, None] * out + _FANNED * beside)


def position_sd(track: Track, angles: Array) -> Array:
    """(T, 21) how far fitted joints are from the true ones, root mean square [m].

    From the angles' variances (of those that nothing observes, that of anything within limits),
    what the fit leaves of the joints that are there, and people's bones where no frame shows
    one.
    """
    model = track.model
    anything = (model.limits.upper - model.limits.lower) ** 2 / 12
    variance = np.minimum(track.angle_variance, anything)
    moved = _below()
    out = np.empty((len(track), N_JOINTS))
    for start in range(0, len(track), _BLOCK):
        part = slice(start, start + _BLOCK)
        placed = place_poses(model.rest_joints, model.axes, model.thumb_twist, angles[part])
        arm = placed.joints[:, :, None] - placed.joints[:, None, ANGLE_JOINT]
        speed = np.cross(placed.axes[:, None], arm)
        squared = np.where(moved, (speed**2).sum(-1), 0.0)
        out[part] = (squared * variance[part, None]).sum(-1)
    left = track.error**2
    seen = np.isfinite(left)
    count = seen.sum(1)
    residual = np.where(seen, left, 0).sum(1) / np.where(count, count, np.nan)
    everywhere = np.nanmedian(residual) if count.any() else 0.0
    out += np.where(count > 0, residual, everywhere)[:, None]
    return np.asarray(np.sqrt(out + _unseen_bones(track) ** 2))


def _below() -> NDArray[np.bool_]:
    """(21, 20) whether an angle moves a joint."""
    out = np.zeros((N_JOINTS, len(ANGLE_JOINT)), bool)
    for joint in range(1, N_JOINTS):
        above = int(PARENTS[joint])
        while above > 0:
            out[joint] |= above == ANGLE_JOINT
            above = int(PARENTS[above])
    return out


def _unseen_bones(track: Track) -> Array:
    """(21,) what people's bones differ by, along the chain to each joint, where neither end was
    ever seen [m]."""
    seen = np.asarray(np.isfinite(track.observed).all(-1).any(0))
    rest = track.model.rest_joints
    squared = np.zeros(N_JOINTS)
    for joint in range(1, N_JOINTS):
        parent = int(PARENTS[joint])
        if not seen[joint]:
            length = float(np.linalg.norm(rest[joint] - rest[parent]))
            squared[joint] = squared[parent] + (_BONE_SD * length) ** 2
    return np.sqrt(squared)


def bone_frames(model: HandModel) -> Array:
    """(16, 3, 3) at rest, a frame on each part: its columns are across the bone, out of the back
    of the hand, and back along the bone, as OpenXR's joints have x, y and z.
    """
    rest = model.rest_joints
    out = np.empty((len(PART_JOINT), 3, 3))
    for part, joint in enumerate(PART_JOINT):
        along = rest[BASES[2]] - rest[0] if part == 0 else rest[joint + 1] - rest[joint]
        along = along / np.linalg.norm(along)
        if part == 0:
            spread = rest[BASES[4]] - rest[BASES[1]]
            dorsal = np.cross(along, spread) * (1 if model.hand == "left" else -1)
        else:
            # flexion turns the bone towards the palm
            first = 4 * ((part - 1) // 3) + (0, 2, 3)[(part - 1) % 3]
            dorsal = np.cross(along, model.axes[first])
        dorsal = dorsal - (dorsal @ along) * along
        dorsal /= np.linalg.norm(dorsal)
        out[part] = np.stack([np.cross(dorsal, -along), dorsal, -along], -1)
    return out
