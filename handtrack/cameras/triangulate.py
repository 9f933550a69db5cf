"""3D points from what several cameras see of them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.cameras.camera import Camera
from handtrack.errors import InputError

Array = NDArray[np.float64]

INLIER_PX = 30.0
"""A view farther off than this does not see the point that the others see."""
CAUCHY_PX = 12.0
"""From about here on a view that is farther off pulls less, not more."""
_STEPS, _ENOUGH = 20, 1e-9


def triangulate(
    cameras: Sequence[Camera],
    pixels: ArrayLike,
    weights: ArrayLike | None = None,
    inlier_px: float = INLIER_PX,
    cauchy_px: float = CAUCHY_PX,
) -> tuple[Array, NDArray[np.bool_]]:
    """Points seen by several cameras, robust to single bad views.

    Of each pair of views the linear solution (Hartley and Sturm's DLT on undistorted rays) is
    tried; the pair that most views agree with (then the one with the least error) wins. All
    views that agree then share the point, by the least of their reprojection errors under
    Cauchy's loss: detectors err by many pixels for many frames, mostly in one view at a time.

    Args:
        cameras: C of them.
        pixels: (C, ..., 2) [px]; NaN = not seen.
        weights: (C, ...) of the views; 0 = not used.
        inlier_px: how far from the picture's point a view may be [px].
        cauchy_px: scale of the loss [px]; inf for the linear solution of those views.

    Returns:
        points (..., 3) [m], NaN where fewer than two views agree; and (C, ...) which views do.

    Raises:
        InputError: shapes do not fit.
    """
    p = np.asarray(pixels, dtype=np.float64)
    if len(p) != len(cameras) or p.shape[-1] != 2:
        raise InputError(f"pixels have shape {p.shape}, expected ({len(cameras)}, ..., 2)")
    flat = p.reshape(len(p), -1, 2)
    w = np.ones(flat.shape[:2])
    if weights is not None:
        w = np.broadcast_to(np.asarray(weights, np.float64), p.shape[:-1]).reshape(w.shape)
    seen = np.isfinite(flat).all(-1) & (w > 0)
    rays = np.stack([c.undistorted(x) for c, x in zip(cameras, flat, strict=True)])
    w = np.where(seen, w, 0.0)
    n = flat.shape[1]
    points, agree = np.full((n, 3), np.nan), np.zeros((len(p), n), dtype=bool)
    best = np.zeros(n)
    for pair in combinations(range(len(cameras)), 2):
        use = np.zeros_like(w)
        use[list(pair)] = w[list(pair)]
        both = seen[list(pair)].all(0)
        if not both.any():
            continue
        candidate = np.full((n, 3), np.nan)
        candidate[both] = _linear(cameras, rays[:, both], use[:, both])
        error = _errors(cameras, candidate, flat)
        inlier = seen & (error < inlier_px)
        # views first, then how near they are
        score = inlier.sum(0) + 1.0 / (2.0 + np.where(inlier, error, 0.0).sum(0))
        better = (inlier.sum(0) >= 2) & (score > best)
        best[better] = score[better]
        agree[:, better] = inlier[:, better]
    there = agree.any(0)
    if there.any():
        agreed = np.where(agree, w, 0.0)[:, there]
        points[there] = _linear(cameras, rays[:, there], agreed)
        if np.isfinite(cauchy_px):
            points[there] = _shared(cameras, points[there], rays[:, there], agreed, cauchy_px)
    shape = p.shape[1:-1]
    return points.reshape(*shape, 3), agree.reshape(len(p), *shape)


def _linear(cameras: Sequence[Camera], rays: Array, w: Array) -> Array:
    """(n, 3): least squares of w |x Z - X|, |y Z - Y| in the cameras' frames."""
    a, b = np.zeros((rays.shape[1], 3, 3)), np.zeros((rays.shape[1], 3))
    for camera, ray, weight in zip(cameras, rays, w, strict=True):
        ray = np.where(weight[:, None] > 0, ray, 0.0)
        for axis in (0, 1):
            row = ray[:, axis, None] * camera.rotation[2] - camera.rotation[axis]
            right = camera.translation[axis] - ray[:, axis] * camera.translation[2]
            a += weight[:, None, None] * row[:, :, None] * row[:, None, :]
            b += (weight * right)[:, None] * row
    # parallel rays leave the depth open: the least-norm solution, which no view will agree with
    return np.asarray((np.linalg.pinv(a) @ b[..., None])[..., 0])


def _shared(
    cameras: Sequence[Camera], points: Array, rays: Array, w: Array, cauchy_px: float
) -> Array:
    """(n, 3): the least w * loss of the undistorted reprojection errors, by Gauss and Newton with
    weights that follow the errors; a step that makes a point worse is not taken."""
    points, left = points.copy(), np.arange(len(points))
    best, (normal, right) = _loss(cameras, points, rays, w, cauchy_px)
    better = np.isfinite(best)
    for _ in range(_STEPS):
        left, best = left[better], best[better]
        normal, right = normal[better], right[better]
        if not left.size:
            break
        # a depth that parallel rays leave open stays where it is
        step = (np.linalg.pinv(normal, hermitian=True) @ right[..., None])[..., 0]
        tried = points[left] - step
        loss, (normal, right) = _loss(cameras, tried, rays[:, left], w[:, left], cauchy_px)
        better = loss < (1.0 - _ENOUGH) * best
        points[left[better]], best = tried[better], loss
    return points


def _loss(
    cameras: Sequence[Camera], points: Array, rays: Array, w: Array, cauchy_px: float
) -> tuple[Array, tuple[Array, Array]]:
    """(n,) losses over cauchy_px^2, inf behind a camera that counts; (n, 3, 3) normal matrices
    and (n, 3) gradients."""
    total, normal, gradient = np.zeros(len(points)), np.zeros((len(points), 3, 3)), points * 0.0
    for camera, ray, weight in zip(cameras, rays, w, strict=True):
        use = weight > 0
        own = points[use] @ camera.rotation.T + camera.translation
        depth = own[:, 2:]
        lens = camera.matrix[:2, :2]
        with np.errstate(divide="ignore", invalid="ignore"):
            off = (own[:, :2] / depth - ray[use]) @ lens.T
            slopes = camera.rotation[:2] - (own[:, :2] / depth)[..., None] * camera.rotation[2]
            slopes = lens @ slopes / depth[..., None]
        squares = (off**2).sum(-1) / cauchy_px**2
        pull = weight[use] / (1.0 + squares)
        total[use] += np.where(depth[:, 0] > 0, weight[use] * np.log1p(squares), np.inf)
        normal[use] += np.einsum("n,nik,nil->nkl", pull, slopes, slopes)
        gradient[use] += np.einsum("n,nik,ni->nk", pull, slopes, off)
    return np.where(np.isfinite(total), total, np.inf), (normal, gradient)


def _errors(cameras: Sequence[Camera], points: Array, pixels: Array) -> Array:
    """(C, n) distance to what each camera sees [px]; inf behind it or not seen."""
    error = np.stack(
        [
            np.linalg.norm(camera.project(points) - seen, axis=-1)
            for camera, seen in zip(cameras, pixels, strict=True)
        ]
    )
    return np.where(np.isfinite(error), error, np.inf)
