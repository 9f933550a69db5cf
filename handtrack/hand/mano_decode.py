"""MANO poses as joints and vertices: all 45 rotations, as MANO has them.

Our 20 angles are fewer; for poses held to them see `mano_pose`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.hand.mano import MANO, MANO_JOINT, mano_axes
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import N_PARTS, PART_JOINT, TIPS
from handtrack.hand.skinning import Skinning

Array = NDArray[np.float64]


def decode(
    mano: MANO, values: ArrayLike, betas: ArrayLike | None = None, transl: ArrayLike = 0.0
) -> tuple[Array, Array]:
    """Joints and vertices of MANO poses (Romero et al. 2017, eq. 2-5).

    Args:
        mano: the user's MANO.
        values: (T, 48) rotation vectors from the flat hand: global, then 15 joints [rad].
        betas: (S,) or (T, S) shape coefficients, S <= 10; the mean hand by default.
        transl: (3,) or (T, 3) [m].

    Returns:
        (T, 21, 3) joints in this project's order, the tips as the MANO's set of vertices, and
        (T, 778, 3) vertices; in MANO's axes, as its libraries give them [m].

    Raises:
        InputError: another shape, or values that are not finite.
    """
    pose = np.asarray(values, dtype=np.float64)
    if pose.ndim != 2 or pose.shape[1] != 48 or not np.isfinite(pose).all():
        raise InputError(f"MANO poses have shape {pose.shape}, expected (frames, 48), all finite")
    n = len(pose)
    known = mano.shape_basis.shape[-1]
    given = np.zeros((1, known)) if betas is None else np.atleast_2d(np.asarray(betas, np.float64))
    if len(given) not in (1, n) or given.shape[1] > known or not np.isfinite(given).all():
        raise InputError(f"betas have shape {given.shape}, expected ({n}, {known}) or ({known},)")
    shapes = np.zeros((n, known))
    shapes[:, : given.shape[1]] = given
    move = np.broadcast_to(np.asarray(transl, dtype=np.float64), (n, 3))
    turn = mano_axes(mano.hand)
    # a rotation vector turns like any vector
    local = vector_to_matrix((pose.reshape(n, N_PARTS, 3) @ turn.T)[:, MANO_JOINT])
    joints, vertices = np.empty((n, 21, 3)), np.empty((n, len(mano.template), 3))
    unique, which = np.unique(shapes, axis=0, return_inverse=True)
    for s, shape in enumerate(unique):
        rows = np.flatnonzero(which.ravel() == s)
        joints[rows], vertices[rows] = _of_one_shape(mano, local[rows], shape)
    return joints @ turn + move[:, None], vertices @ turn + move[:, None]


def _of_one_shape(mano: MANO, local: Array, betas: Array) -> tuple[Array, Array]:
    """Joints and vertices in our axes of local rotations (n, 16, 3, 3) of our parts."""
    rest = mano.joint_template + mano.joint_basis @ betas
    parts = rest[PART_JOINT]
    rotations, places = np.empty_like(local), np.empty((len(local), N_PARTS, 3))
    rotations[:, 0], places[:, 0] = local[:, 0], parts[0]
    for p in range(1, N_PARTS):
        parent = 0 if p % 3 == 1 else p - 1
        rotations[:, p] = rotations[:, parent] @ local[:, p]
        places[:, p] = places[:, parent] + rotations[:, parent] @ (parts[p] - parts[parent])
    skin = Skinning(mano.template + mano.shape_basis @ betas, mano.weights, mano.pose_blend)
    offsets = places - np.einsum("npij,pj->npi", rotations, parts)
    vertices = skin(rotations, offsets, local[:, 1:])
    joints = np.empty((len(local), 21, 3))
    joints[:, PART_JOINT] = places
    joints[:, TIPS] = np.einsum("jv,nvc->njc", mano.regressor[TIPS], vertices)
    return joints, vertices
