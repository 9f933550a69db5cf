"""Our 20 angles as a MANO pose, and a MANO pose as our 20 angles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.hand.mano import MANO, MANO_JOINT, mano_axes
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import about_axis, matrix_to_vector, vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES, N_PARTS, PART_JOINT, TIPS
from handtrack.hand.skinning import Skinning

Array = NDArray[np.float64]

_FROM_MANO = np.argsort(MANO_JOINT[1:])
"""Place of MANO's finger joints 1..15 among our parts 1..15."""


class ManoPose(NamedTuple):
    """Poses as MANO's libraries take them.

    Attributes:
        global_orient: (..., 3) rotation vector about the wrist [rad].
        hand_pose: (..., 45) rotation vectors of the 15 finger joints, MANO's order [rad].
        transl: (..., 3) [m].
        betas: (S,) shape of the hand; none if the model was not made by MANO's shape space.
    """

    global_orient: Array
    hand_pose: Array
    transl: Array
    betas: Array

    @property
    def values(self) -> Array:
        """(..., 48) global_orient and hand_pose in one."""
        return np.concatenate([self.global_orient, self.hand_pose], axis=-1)


class AnglesOfMano(NamedTuple):
    """What our 20 angles keep of MANO poses.

    Attributes:
        angles: (..., 20) nearest angles, not held to any limits [rad].
        rotation: (..., 3, 3) from the root frame to the world.
        translation: (..., 3) [m].
        lost: (..., 15) how far each finger joint is turned from what the angles make of it, parts
            1..15, thumb to little finger [rad]: MANO's joints turn freely, ours about one or
            two axes.
    """

    angles: Array
    rotation: Array
    translation: Array
    lost: Array


def to_mano(
    model: HandModel,
    angles: ArrayLike,
    rotation: ArrayLike | None = None,
    translation: ArrayLike = 0.0,
    *,
    hands_mean: ArrayLike | None = None,
) -> ManoPose:
    """Poses of a model as MANO poses.

    MANO turns the hand about its wrist J0, x = R (v - J0) + J0 + transl, we about the origin.

    Args:
        model: a hand made by `MANO.model`. Of another hand come the same rotations about that
            hand's own axes; the result is then MANO's closest relative, not the same surface.
        angles: (..., 20) [rad].
        rotation: (..., 3, 3) from the root frame to the world; identity by default.
        translation: (..., 3) [m].
        hands_mean: (45,) `MANO.hands_mean` for libraries with flat_hand_mean=False, which add
            it to what they are given; None for flat_hand_mean=True and for smplx.MANOLayer,
            which adds nothing.

    Returns:
        The poses; `vector_to_matrix` makes the matrices that smplx.MANOLayer takes.
    """
    turn = mano_axes(model.hand)
    angles = np.asarray(angles, dtype=np.float64)
    lead = angles.shape[:-1]
    # a rotation vector turns like any vector
    local = matrix_to_vector(model.local_rotations(model.rotations(angles)))
    pose = (local @ turn)[..., _FROM_MANO, :].reshape(*lead, 45)
    if hands_mean is not None:
        pose = pose - np.asarray(hands_mean, dtype=np.float64)
    root = np.eye(3) if rotation is None else np.asarray(rotation, dtype=np.float64)
    root = np.broadcast_to(root @ turn, (*lead, 3, 3))
    wrist = model.rest_joints[0] @ turn
    transl = np.asarray(translation, dtype=np.float64) + root @ wrist - wrist
    return ManoPose(matrix_to_vector(root), pose, transl, model.shape)


def from_mano(
    model: HandModel,
    values: ArrayLike,
    transl: ArrayLike = 0.0,
    *,
    hands_mean: ArrayLike | None = None,
) -> AnglesOfMano:
    """The angles nearest to MANO poses, joint by joint, and what they lose.

    Each joint's rotation is replaced by the nearest one (least |R - R_k|, Frobenius) that it can
    make. For the angles that bring the joints, not the rotations, nearest, fit the joints.

    Args:
        model: a hand made by `MANO.model` with the poses' shape.
        values: (..., 48) rotation vectors: global orientation, then 15 joints [rad].
        transl: (..., 3) [m].
        hands_mean: (45,) for poses of a library with flat_hand_mean=False; None if zero is
            the flat hand. For principal components see `MANO.hand_pose`.

    Raises:
        InputError: values have another shape, or are not finite.
    """
    pose = np.asarray(values, dtype=np.float64)
    if pose.shape[-1:] != (48,) or not np.isfinite(pose).all():
        raise InputError(f"a MANO pose has shape {pose.shape}, expected (..., 48) finite numbers")
    lead = pose.shape[:-1]
    joints = pose[..., 3:]
    if hands_mean is not None:
        joints = joints + np.asarray(hands_mean, dtype=np.float64)
    turn = mano_axes(model.hand)
    vectors = joints.reshape(*lead, 15, 3) @ turn.T
    local = vector_to_matrix(vectors[..., MANO_JOINT[1:] - 1, :])
    angles = nearest_angles(model, local)
    made = model.local_rotations(model.rotations(angles))
    lost = np.linalg.norm(matrix_to_vector(made.swapaxes(-1, -2) @ local), axis=-1)
    root = vector_to_matrix(pose[..., :3])
    wrist = model.rest_joints[0] @ turn
    translation = np.asarray(transl, dtype=np.float64) + wrist - root @ wrist
    return AnglesOfMano(angles, root @ turn.T, translation, lost)


def nearest_angles(model: HandModel, local: Array) -> Array:
    """Angles (..., 20) that bring every joint nearest to rotations (..., 15, 3, 3)."""
    angles = np.zeros((*local.shape[:-3], N_ANGLES))
    for f in range(5):
        z, y = model.axes[4 * f], model.axes[4 * f + 1]
        twist = np.zeros(3)
        if f == 0:
            bone = model.rest_joints[2] - model.rest_joints[1]
            twist = model.thumb_twist * bone / np.linalg.norm(bone)
        angles[..., 4 * f : 4 * f + 2] = _nearest_saddle(local[..., 3 * f, :, :], z, y, twist)
        for i in (1, 2):
            a = 4 * f + 1 + i
            angles[..., a] = _nearest_turn(local[..., 3 * f + i, :, :], model.axes[a])
    return angles


def _nearest_turn(matrix: Array, axis: Array) -> Array:
    """The angle (...) about an axis that comes nearest to rotations (..., 3, 3)."""
    anti = matrix - matrix.swapaxes(-1, -2)
    w = np.stack([anti[..., 2, 1], anti[..., 0, 2], anti[..., 1, 0]], -1)
    along = np.einsum("i,...ij,j->...", axis, matrix, axis)
    return np.asarray(np.arctan2(w @ axis, np.trace(matrix, axis1=-2, axis2=-1) - along))


def _nearest_saddle(matrix: Array, z: Array, y: Array, twist: Array) -> Array:
    """Angles (..., 2) about z and y that come nearest to rotations (..., 3, 3).

    The rotation is exp(z a) exp(y b) exp(twist b), Li et al. 2021 eq. 2 and its R_in.
    """
    b = _nearest_turn(matrix, y)
    for _ in range(20):  # each angle in turn has a closed form
        a = _nearest_turn(matrix @ about_axis(y, b).swapaxes(-1, -2), z)
        b = _nearest_turn(about_axis(z, a).swapaxes(-1, -2) @ matrix, y)
    alpha = np.linalg.norm(twist)
    bone = twist / alpha if alpha else z
    for _ in range(50):  # both together, with the twist: Gauss-Newton
        rz, ry, rb = about_axis(z, a), about_axis(y, b), about_axis(bone, alpha * b)
        made = rz @ ry @ rb
        da = _skew(z) @ made
        db = rz @ _skew(y) @ ry @ rb + alpha * rz @ ry @ _skew(bone) @ rb
        miss = matrix - made
        aa, ab, bb = ((p * q).sum((-2, -1)) for p, q in ((da, da), (da, db), (db, db)))
        ga, gb = (miss * da).sum((-2, -1)), (miss * db).sum((-2, -1))
        det = aa * bb - ab * ab
        step_a, step_b = (bb * ga - ab * gb) / det, (aa * gb - ab * ga) / det
        a, b = a + step_a, b + step_b
        if max(np.abs(step_a).max(initial=0), np.abs(step_b).max(initial=0)) < 1e-12:
            break
    return np.stack([a, b], -1)


def _skew(v: Array) -> Array:
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


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
