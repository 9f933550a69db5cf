"""Give a hand model other proportions: new rest joints, with the skin carried along."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.hand.axes import palm_frame, palm_length, rest_frames
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import PALM, PART_JOINT

Array = NDArray[np.float64]

# bones whose cosine is this near to -1 have no smallest turn
_OPPOSED = 1e-9
# palm joints that are so near, over the palm's extent, are at one place
_SAME = 1e-4


def reshaped(
    model: HandModel,
    rest_joints: ArrayLike,
    axes: ArrayLike | None = None,
    *,
    thickness: float = 1.0,
) -> HandModel:
    """The same hand with its joints resting elsewhere.

    The skin follows: what hangs on a finger bone is stretched along the bone and turned with
    it, with its thickness scaled by the hand's size; what hangs on the palm follows the six
    palm joints smoothly. Parts blend by the skinning weights.

    Args:
        model: the hand to start from.
        rest_joints: (21, 3) new rest positions in the root frame [m].
        axes: (20, 3) new unit axes; the model's by default.
        thickness: how much thicker the skin lies about the bones than the hand's size has it:
            across the finger bones, and out of the plane of the palm.

    Returns:
        A new model.

    Raises:
        ModelError: a bone would have no length, or values are not finite.
    """
    new = np.asarray(rest_joints, dtype=np.float64)
    out = replace(
        model,
        rest_joints=new,
        axes=model.axes if axes is None else np.asarray(axes, dtype=np.float64),
        shape=np.zeros(0),
        landmark_offsets=_offsets(model, new),
    )
    if not len(model.rest_vertices):
        return out
    old, v, w = model.rest_joints, model.rest_vertices, model.weights
    size = out.size / model.size
    palm = _palm(v, old[PALM], new[PALM], size)
    if thickness != 1.0:
        out_of_plane = palm_frame(new, model.hand)[2]
        height = (palm - new[PALM].mean(0)) @ out_of_plane
        palm = palm + (thickness - 1) * height[:, None] * out_of_plane
    moved = w[:, :1] * palm
    for part in range(1, len(PART_JOINT)):
        k = PART_JOINT[part]
        turn = _bone_map(old[k + 1] - old[k], new[k + 1] - new[k], size * thickness)
        moved += w[:, part : part + 1] * ((v - old[k]) @ turn.T + new[k])
    return replace(out, rest_vertices=moved)


def _offsets(model: HandModel, new: Array) -> Array:
    """The landmarks' offsets in the frames of the new bones, with the hand's size."""
    if not model.has_landmarks:
        return model.landmark_offsets
    before, after = rest_frames(model.rest_joints, model.hand), rest_frames(new, model.hand)
    turned = (after @ before.swapaxes(1, 2) @ model.landmark_offsets[:, :, None])[..., 0]
    return np.asarray(turned * palm_length(new) / model.size)


def landmarks_on(model: HandModel, other: HandModel) -> HandModel:
    """The other hand with a model's landmarks, in the frames of its own bones and at its size."""
    return replace(other, landmark_offsets=_offsets(model, other.rest_joints))


def without_landmarks(model: HandModel) -> HandModel:
    """The same hand, seen by its joint centres."""
    return replace(model, landmark_offsets=np.zeros_like(model.landmark_offsets))


def _bone_map(before: Array, after: Array, thickness: float) -> Array:
    """(3, 3): the smallest turn from one bone to the other, stretched to its length."""
    a, b = before / np.linalg.norm(before), after / np.linalg.norm(after)
    turn = _smallest_turn(a, b)
    along = np.linalg.norm(after) / np.linalg.norm(before)
    stretch = thickness * np.eye(3) + (along - thickness) * np.outer(a, a)
    return np.asarray(turn @ stretch)


def _smallest_turn(a: Array, b: Array) -> Array:
    """(3, 3) rotation of unit vector a to b; half a turn about any axis where they are opposed."""
    c, s = a @ b, np.cross(a, b)
    if c < _OPPOSED - 1:
        axis = np.cross(a, np.eye(3)[np.abs(a).argmin()])
        axis /= np.linalg.norm(axis)
        return np.asarray(2 * np.outer(axis, axis) - np.eye(3))
    skew = np.array([[0, -s[2], s[1]], [s[2], 0, -s[0]], [-s[1], s[0], 0]])
    return np.asarray(np.eye(3) + skew + skew @ skew / (1.0 + c))


def _palm(points: Array, before: Array, after: Array, size: float) -> Array:
    """Points scaled by size, plus what the six palm joints move beyond that, spread smoothly."""
    centre, target = before.mean(0), after.mean(0)
    base = (points - centre) * size + target
    rest = after - ((before - centre) * size + target)
    # interpolation with the kernel -|r| and a constant meets every joint exactly
    n = len(before)
    distance = np.linalg.norm(before[:, None] - before, axis=-1)
    system = np.block([[-distance, np.ones((n, 1))], [np.ones((1, n)), np.zeros((1, 1))]])
    # of palm joints that lie on one another, none is met exactly
    solved = np.linalg.lstsq(system, np.vstack([rest, np.zeros((1, 3))]), rcond=_SAME)[0]
    reach = np.linalg.norm(points[:, None] - before, axis=-1)
    return np.asarray(base - reach @ solved[:n] + solved[n])
