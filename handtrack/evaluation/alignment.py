"""Procrustes alignment of point sets and the errors that are measured after it."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.evaluation.arrays import Array, in_blocks, lengths, nan_mean, pair
from handtrack.files.long_arrays import Growing, blocks
from handtrack.hand.rotations import quaternion_to_matrix

MIN_POINTS = 3
"""A frame with fewer common points has no alignment."""
_ALIGNED = 4000
"""Frames aligned at once."""


def procrustes(
    a: ArrayLike, b: ArrayLike, scale: bool = True, reflection: bool = False
) -> tuple[Array, Array, Array]:
    """The similarity that brings each frame of `a` nearest to `b` in the least-squares sense.

    Minimises sum_j |s R a_j + t - b_j|^2 over the points present in both (Umeyama 1991;
    `compute_similarity_transform` of VIBE and its kin).
    Collinear or flat sets have an optimum too and get it; where all points of `a` coincide
    no scale is better than another and 1 is taken.

    Args:
        a: estimate, (..., J, 3), any unit; NaN = missing.
        b: reference, same shape and unit.
        scale: also find s; otherwise s = 1.
        reflection: allow det R = -1.

    Returns:
        s (...), R (..., 3, 3) and t (..., 3); NaN in frames with fewer than 3 common points.

    Raises:
        InputError: shapes differ or values are infinite.
    """
    a, b = pair(a, b)
    return _procrustes(a, b, scale, reflection)


def _procrustes(
    a: Array, b: Array, scale: bool = True, reflection: bool = False
) -> tuple[Array, Array, Array]:
    present = ~(np.isnan(a[..., 0]) | np.isnan(b[..., 0]))
    count = present.sum(-1)
    enough = count >= MIN_POINTS
    if not present.all():
        a, b = (np.where(present[..., None], x, 0.0) for x in (a, b))
    divisor = np.maximum(count, 1)[..., None]
    mean_a, mean_b = a.sum(-2) / divisor, b.sum(-2) / divisor
    a0, b0 = a - mean_a[..., None, :], b - mean_b[..., None, :]
    if not present.all():
        a0, b0 = (np.where(present[..., None], x, 0.0) for x in (a0, b0))
    rotation, gain = _best_rotation(b0.swapaxes(-1, -2) @ a0, reflection)
    s = np.ones(a.shape[:-2])
    if scale:
        spread = np.einsum("...ji,...ji->...", a0, a0)
        s = np.where(spread > 0, gain / np.where(spread > 0, spread, 1.0), 1.0)
    if not enough.all():
        s = np.where(enough, s, np.nan)
        rotation = np.where(enough[..., None, None], rotation, np.nan)
    translation = mean_b - s[..., None] * (rotation @ mean_a[..., None])[..., 0]
    return s, rotation, translation


def _best_rotation(m: Array, reflection: bool) -> tuple[Array, Array]:
    """The orthogonal R (..., 3, 3) with the greatest trace(R^T M), and that trace (...)."""
    if reflection:
        return _by_svd(m, True)
    flat = m.reshape(-1, 3, 3)
    rotation, gain, sure = _by_quaternion(flat)
    if not sure.all():
        rotation[~sure], gain[~sure] = _by_svd(flat[~sure], False)
    return rotation.reshape(m.shape), gain.reshape(m.shape[:-2])


def _by_svd(m: Array, reflection: bool) -> tuple[Array, Array]:
    u, singular, vt = np.linalg.svd(m)
    signs = np.ones_like(singular)
    if not reflection:
        signs[..., 2] = np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)
    return (u * signs[..., None, :]) @ vt, (singular * signs).sum(-1)


def _by_quaternion(m: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """As `_by_svd` for (n, 3, 3), several times as fast; not where rotations are nearly a tie.

    The best q is the eigenvector of the greatest eigenvalue of Horn's K; Newton's method finds
    that eigenvalue from above (Theobald 2005).

    Returns:
        rotations, traces, and whether they are exact to rounding.
    """
    size = np.sqrt(np.einsum("nij,nij->n", m, m))
    unit = m / np.where(size > 0, size, 1.0)[:, None, None]
    k = _horn(unit)
    k2 = k @ k
    # characteristic polynomial of a traceless K: x^4 + c2 x^2 + c1 x + c0
    c2, c1 = np.full(len(m), -2.0), -8.0 * np.linalg.det(unit)
    c0 = 0.125 * np.einsum("nii->n", k2) ** 2 - 0.25 * np.einsum("nij,nij->n", k2, k2)
    x = np.full(len(m), np.sqrt(3.0))  # at least the sum of the singular values
    for _ in range(50):
        slope = (4.0 * x * x + 2.0 * c2) * x + c1
        value = ((x * x + c2) * x + c1) * x + c0
        step = np.where(slope > 0, value / np.where(slope > 0, slope, 1.0), 0.0)
        x = x - step
        if np.abs(step).max(initial=0.0) < 1e-15:
            break
    # p(K) = 0 and p(x) = 0: (K - x) B = 0 for this B, a multiple of q q^T
    x1 = x[:, None, None]
    c2, c1 = c2[:, None, None], c1[:, None, None]
    b = k2 @ k + x1 * k2 + (x1 * x1 + c2) * k + ((x1 * x1 + c2) * x1 + c1) * np.eye(4)
    diagonal = np.einsum("nii->ni", b)
    q = np.take_along_axis(b, diagonal.argmax(1)[:, None, None], 1)[:, 0]
    # the sum is the product of the distances to the other eigenvalues: small for a tie
    sure = (size > 0) & (diagonal.sum(1) > 1e-2)
    q = np.where(sure[:, None], q, [1.0, 0.0, 0.0, 0.0])
    return quaternion_to_matrix(q), x * size, sure


def _horn(m: Array) -> Array:
    """K (n, 4, 4) with trace(R(q)^T M) = q^T K q for unit quaternions q, wxyz (Horn 1987)."""
    k = np.empty((len(m), 4, 4))
    xx, yy, zz = m[:, 0, 0], m[:, 1, 1], m[:, 2, 2]
    k[:, 0, 0] = xx + yy + zz
    k[:, 1, 1] = xx - yy - zz
    k[:, 2, 2] = yy - xx - zz
    k[:, 3, 3] = zz - xx - yy
    for row, column, i, j, sign in (
        (0, 1, 2, 1, -1),
        (0, 2, 0, 2, -1),
        (0, 3, 1, 0, -1),
        (1, 2, 0, 1, 1),
        (1, 3, 0, 2, 1),
        (2, 3, 1, 2, 1),
    ):
        k[:, row, column] = k[:, column, row] = m[:, i, j] + sign * m[:, j, i]
    return k


def align(a: ArrayLike, b: ArrayLike, scale: bool = True, reflection: bool = False) -> Array:
    """`a` moved onto `b`, frame by frame, by the transform that `procrustes` finds.

    Points of `a` that `b` lacks are moved along; a frame without an alignment becomes NaN.

    Args:
        a, b, scale, reflection: as for `procrustes`.

    Returns:
        A new array (..., J, 3) in the unit of `b`.
    """
    a, b = pair(a, b)
    return _align(a, b, scale, reflection)


def _align(a: Array, b: Array, scale: bool, reflection: bool) -> Array:
    s, rotation, translation = _procrustes(a, b, scale, reflection)
    moved = a @ (s[..., None, None] * rotation).swapaxes(-1, -2)
    return np.asarray(moved + translation[..., None, :])


def _mean_error(a: Array, b: Array, scale: bool, reflection: bool) -> Array:
    return nan_mean(lengths(_align(a, b, scale, reflection) - b))


def pa_mpjpe(a: ArrayLike, b: ArrayLike) -> Array:
    """Mean joint error after the best similarity (rotation, translation, scale) per frame.

    PA-MPJPE as the field reports it (VIBE): the estimate is aligned to the reference, one
    transform per frame, det R = +1, so that a mirrored hand is an error.

    Args:
        a: estimate, (T, J, 3), any unit; NaN = missing.
        b: reference, (T, J, 3), same unit.

    Returns:
        (T,) in that unit; NaN in frames with fewer than 3 common joints.

    Raises:
        InputError: shapes differ or values are infinite.
    """
    return in_blocks(partial(_mean_error, scale=True, reflection=False), *pair(a, b))


def rigid_pa_mpjpe(a: ArrayLike, b: ArrayLike) -> Array:
    """As `pa_mpjpe`, but without a scale: rotation and translation only, det R = +1."""
    return in_blocks(partial(_mean_error, scale=False, reflection=False), *pair(a, b))


def reflection_pa_mpjpe(a: ArrayLike, b: ArrayLike) -> Array:
    """As `pa_mpjpe`, but the alignment may mirror the estimate.

    This is what FreiHAND's evaluation script does (`align_w_scale` with SciPy's
    orthogonal_procrustes): a hand of the wrong side can score 0. Use it to compare with
    numbers of that script, and to recognise a mirrored reference.
    """
    return in_blocks(partial(_mean_error, scale=True, reflection=True), *pair(a, b))


def pa_mpvpe(a: ArrayLike, b: ArrayLike) -> Array:
    """As `pa_mpjpe`, on mesh vertices (T, V, 3) and aligned on them."""
    return pa_mpjpe(a, b)


def joint_errors_mm(a: Array, b: Array) -> tuple[Array, Array, Array]:
    """(T, 21) distances [mm] after similarity alignment of each frame, without, and with the
    wrists on each other."""
    out = Growing((3, a.shape[1]))
    known = any(not np.isnan(b[part]).all() for part in blocks(len(b)))
    for part in blocks(len(a), _ALIGNED):
        errors = np.full((3, *a[part].shape[:2]), np.nan)
        if known:
            x, y = a[part] * 1e3, b[part] * 1e3
            apart = x - y
            errors[:] = lengths(align(x, y) - y), lengths(apart), lengths(apart - apart[:, :1])
        out.append(errors.swapaxes(0, 1))
    whole = out.whole()
    return whole[:, 0], whole[:, 1], whole[:, 2]
