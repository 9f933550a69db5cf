"""Poses whose 15 finger joints turn freely, as MANO's do: kinematics and their gradient.

Only what the paper is compared with poses a hand so; our own fits have 20 angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from handtrack.fitting.result import Fit
from handtrack.hand.mano_pose import nearest_angles
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_vector
from handtrack.hand.skeleton import N_ANGLES, N_PARTS, PALM, PART_JOINT
from handtrack.hand.skinning import Skinning

Array = NDArray[np.float64]

N_FREE = N_PARTS - 1
PARENT = np.array([-1] + [0 if p % 3 == 1 else p - 1 for p in range(1, N_PARTS)])
"""The part that each part hangs on."""
_BELOW = [np.arange(PART_JOINT[p] + 1, PART_JOINT[p] - (p - 1) % 3 + 4) for p in range(1, N_PARTS)]
"""The joints that each of parts 1..15 moves."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FreeFit(Fit):
    """A batch of fits of freely turning joints; `angles` are the nearest, not held to limits.

    Attributes:
        local: (N, 15, 3, 3) rotation of parts 1..15 against their parents.
    """

    local: Array

    def vertices(self, model: HandModel) -> Array:
        """(N, V, 3) skin of the poses in the world [m]."""
        turns, places = accumulated(model, self.local, self.rotation, self.translation)
        rest = model.rest_joints[PART_JOINT]
        skin = Skinning(model.rest_vertices, model.weights, model.pose_blend)
        offsets = places - np.einsum("npij,pj->npi", turns, rest)
        return skin(turns, offsets, self.local)


def accumulated(
    model: HandModel, local: Array, rotation: Array, translation: Array
) -> tuple[Array, Array]:
    """Rotations (N, 16, 3, 3) and places (N, 16, 3) of the parts in the world.

    Args:
        local: (N, 15, 3, 3); rotation: (N, 3, 3); translation: (N, 3) of the root frame [m].
    """
    rest = model.rest_joints[PART_JOINT]
    turns = np.empty((len(local), N_PARTS, 3, 3))
    places = np.empty((len(local), N_PARTS, 3))
    turns[:, 0] = rotation
    places[:, 0] = rotation @ rest[0] + translation
    for p in range(1, N_PARTS):
        q = PARENT[p]
        turns[:, p] = turns[:, q] @ local[:, p - 1]
        places[:, p] = places[:, q] + turns[:, q] @ (rest[p] - rest[q])
    return turns, places


def joints_of(model: HandModel, turns: Array, places: Array) -> Array:
    """(N, 21, 3) joints of accumulated parts."""
    rest = model.rest_joints
    out = np.empty((len(turns), len(rest), 3))
    out[:, PART_JOINT] = places
    tips = np.arange(3, N_PARTS, 3)
    bones = rest[PART_JOINT[tips] + 1] - rest[PART_JOINT[tips]]
    out[:, PART_JOINT[tips] + 1] = places[:, tips] + np.einsum(
        "npij,pj->npi", turns[:, tips], bones
    )
    return out


def gradient(
    vectors: Array, turns: Array, places: Array, joints: Array, force: Array, translation: Array
) -> tuple[Array, Array, Array]:
    """Derivatives of a function of the joints, from its derivatives by them.

    Turning part p by d about its joint moves what hangs on it by d x (x_j - t_p), so that the
    function changes by d . sum_j (x_j - t_p) x f_j.

    Args:
        vectors: (N, 15, 3) rotation vectors of the local rotations.
        turns, places, joints: of `accumulated` and `joints_of`.
        force: (N, 21, 3) derivatives by the joints.
        translation: (N, 3).

    Returns:
        by the rotation vectors (N, 15, 3), by a small turn of the world about the translation
        on the left of the root's rotation (N, 3), and by the translation (N, 3).
    """
    moment = np.cross(joints, force)
    out = np.empty_like(vectors)
    for p in range(1, N_PARTS):
        below = _BELOW[p - 1]
        torque = moment[:, below].sum(1) - np.cross(places[:, p], force[:, below].sum(1))
        # in the parent's frame, then by how the vector's change turns the part
        out[:, p - 1] = np.einsum("nji,nj->ni", turns[:, PARENT[p]], torque)
    out = np.einsum("npji,npj->npi", left_jacobian(vectors), out)
    total = force.sum(1)
    return out, moment.sum(1) - np.cross(translation, total), total


def left_jacobian(vectors: Array) -> Array:
    """J (..., 3, 3) with exp(v + dv) = exp(J dv) exp(v) to first order."""
    angle2 = np.einsum("...i,...i->...", vectors, vectors)[..., None, None]
    small = angle2 < 1e-8
    angle = np.sqrt(np.where(small, 1.0, angle2))
    first = np.where(small, 0.5 - angle2 / 24, (1 - np.cos(angle)) / angle**2)
    second = np.where(small, 1 / 6 - angle2 / 120, (angle - np.sin(angle)) / angle**3)
    x, y, z = np.moveaxis(vectors, -1, 0)
    o = np.zeros_like(x)
    skew = np.stack([o, -z, y, z, o, -x, -y, x, o], -1).reshape(*vectors.shape, 3)
    return np.asarray(np.eye(3) + first * skew + second * (skew @ skew))


def palm_pose(model: HandModel, joints: Array) -> tuple[Array, Array]:
    """Rotations (N, 3, 3) and translations (N, 3) that bring the resting palm onto the joints.

    Args:
        joints: (N, 21, 3) [m], three of the palm's in each frame at least; NaN = missing.
    """
    seen = joints[:, PALM]
    share = np.asarray(~np.isnan(seen[..., :1]), dtype=np.float64)
    share /= share.sum(1, keepdims=True)
    seen = np.nan_to_num(seen)
    rest = np.broadcast_to(model.rest_joints[PALM], seen.shape)
    middle, place = (share * rest).sum(1), (share * seen).sum(1)
    a, b = rest - middle[:, None], seen - place[:, None]
    u, _, vt = np.linalg.svd(np.einsum("nji,njk->nik", share * b, a))
    u[..., -1] *= np.sign(np.linalg.det(u @ vt))[:, None]
    rotation = u @ vt
    return rotation, place - np.einsum("nij,nj->ni", rotation, middle)


def free_fit(
    model: HandModel, joints: Array, local: Array, rotation: Array, translation: Array
) -> FreeFit:
    """The result of poses for the joints (N, 21, 3) that they explain."""
    turns, places = accumulated(model, local, rotation, translation)
    fitted = joints_of(model, turns, places)
    n = len(joints)
    return FreeFit(
        angles=nearest_angles(model, local),
        rotation=rotation,
        translation=translation,
        joints=fitted,
        objective=np.nansum(np.square(fitted - joints), (1, 2)),
        variance=np.full((n, N_ANGLES), np.inf),
        status=np.full(n, "iteration limit"),
        local=local,
    )


@lru_cache(maxsize=8)
def pose_components(model: HandModel, count: int = 4000) -> tuple[Array, Array]:
    """Mean (45,) and principal components (45, 45), one a row, of random valid poses.

    What MANO's `hands_mean` and `hands_components` are of its registrations, for hands that have
    none: rotation vectors of parts 1..15.
    """
    rng = np.random.default_rng(0)
    limits = model.limits
    angles = limits.clamp(rng.uniform(limits.lower, limits.upper, (count, N_ANGLES)))
    local = model.local_rotations(model.rotations(angles))
    vectors = matrix_to_vector(local).reshape(count, -1)
    mean = vectors.mean(0)
    _, _, components = np.linalg.svd(vectors - mean, full_matrices=False)
    return mean, components
