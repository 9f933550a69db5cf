"""Bodies that a hand is made of, as distance fields: tubes, ellipsoids, membranes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]


class Profile:
    """Smooth, monotone curves through stations, tabled for speed: (N,) -> (N, C)."""

    def __init__(self, stations: Array, values: Array):
        self.t = np.linspace(stations[0], stations[-1], 400)
        self.table = PchipInterpolator(stations, values)(self.t)

    def __call__(self, t: Array) -> Array:
        return np.stack([np.interp(t, self.t, column) for column in self.table.T], -1)


@dataclass(frozen=True)
class Tube:
    """A tube of half-elliptic cross-sections about a straight axis, with rounded ends.

    Attributes:
        origin: (3,) where the axis starts.
        frame: (3, 3) rows: axis, side, dorsal (orthonormal).
        start, end: the axial range [mm] outside which the ends round off.
        caps: length of the rounding at the start and at the end [mm].
        radii: axial coordinate -> half width, dorsal height, palmar depth, (N,) -> (N, 3).
    """

    origin: Array
    frame: Array
    start: float
    end: float
    caps: tuple[float, float]
    radii: Profile
    power: float = 2.0

    def local(self, points: Array) -> Array:
        """Points (N, 3) as axial, side and dorsal coordinates."""
        return (points - self.origin) @ self.frame.T

    def __call__(self, points: Array) -> Array:
        q = self.local(points)
        t = np.clip(q[:, 0], self.start, self.end)
        width, dorsal, palmar = self.radii(t).T
        r = np.stack(
            [
                np.where(q[:, 0] < self.start, *self.caps),
                width,
                np.where(q[:, 2] > 0, dorsal, palmar),
            ],
            -1,
        )
        q[:, 0] -= t
        return _superellipsoid(q, r, self.power)


def _superellipsoid(q: Array, r: Array, power: float) -> Array:
    """Field of |q/r|_power = 1, scaled to about a distance by its own gradient."""
    s = np.abs(q / r)
    k = np.maximum((s**power).sum(-1), 1e-12)
    norm = k ** (1 / power)
    gradient = np.linalg.norm(s ** (power - 1) / r, axis=-1) * k ** (1 / power - 1)
    return np.asarray((norm - 1) / np.maximum(gradient, 1e-9))


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid with its own axes (rows of frame)."""

    centre: Array
    frame: Array
    radii: Array

    def __call__(self, points: Array) -> Array:
        q = (points - self.centre) @ self.frame.T
        return _superellipsoid(q, np.broadcast_to(self.radii, q.shape), 2.0)


@dataclass(frozen=True)
class Membrane:
    """A triangle of some thickness: the web of skin between two rays of the hand."""

    corners: Array
    thickness: Array
    """Half thickness at each corner [mm]."""

    def __call__(self, points: Array) -> Array:
        corners = self.corners
        middle = corners.mean(0)
        reach = np.linalg.norm(corners - middle, axis=1).max() + FAR
        away = points - middle
        near = (away * away).sum(-1) < reach * reach
        out = np.full(len(points), FAR)
        points = points[near]
        bary = nearest_in_triangle(points, corners)
        away = points - bary @ corners
        out[near] = np.sqrt((away * away).sum(-1)) - bary @ self.thickness
        return out


FAR = 25.0


def nearest_in_triangle(points: Array, corners: Array) -> Array:
    """Barycentric coordinates (N, 3) of the point of a triangle nearest to each point."""
    p = points - corners[0]
    b, c = corners[1:] - corners[0]
    bb, bc, cc = b @ b, b @ c, c @ c
    pb, pc = p @ b, p @ c
    det = bb * cc - bc * bc
    u, v = (cc * pb - bc * pc) / det, (bb * pc - bc * pb) / det
    out = np.stack([1 - u - v, u, v], -1)
    outside = np.flatnonzero((out < 0).any(-1))
    p = p[outside]
    best = np.full(len(p), np.inf)
    for i in range(3):
        j = (i + 1) % 3
        start, edge = corners[i] - corners[0], corners[j] - corners[i]
        q = p - start
        t = np.clip(q @ edge / (edge @ edge), 0, 1)
        q = q - t[:, None] * edge
        d = (q * q).sum(-1)
        take = d < best
        best[take] = d[take]
        bary = np.zeros((int(take.sum()), 3))
        bary[:, i], bary[:, j] = 1 - t[take], t[take]
        out[outside[take]] = bary
    return out


def smooth_min(a: Array, b: Array, k: float) -> Array:
    """Union of two fields with a fillet of about size k [mm]."""
    h = np.maximum(k - np.abs(a - b), 0) / k
    return np.asarray(np.minimum(a, b) - h**3 * k / 6)


def smoothstep(x: Array) -> Array:
    """0 below 0, 1 above 1, and smooth between."""
    x = np.clip(x, 0, 1)
    return np.asarray(x * x * (3 - 2 * x))
