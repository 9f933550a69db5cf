"""The mesh of the default hand's skin: rings of vertices laid on the implicit shape.

The palm is a stack of rings from the wrist's stump to the roots of the fingers. Each finger
goes on from its share of the last ring, with webs between neighbours; the thumb grows out of a
hole in the palm's radial side. Every quad is made once with the winding of its patch, so the
mesh is closed by construction. Lengths are in millimetres.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from tools.make.hand_fields import Tube
from tools.make.hand_shape import HandShape

Array = NDArray[np.float64]
Ints = NDArray[np.int_]

TOP, SIDE, WEB = 4, 3, 2
"""Edges over the top and along a side of a finger's ring, and across a web."""
AROUND = 2 * (TOP + SIDE)
DORSAL = 4 * TOP + 3 * WEB
"""Edges over the back of the palm."""
RING = 2 * (DORSAL + SIDE)

# rings of the palm: distance from the wrist [mm], share of the way to the knuckle, distance
# from the knuckle [mm]
STUMP_RINGS = (-22.0, -19.0, -14.0, -7.0, 1.0)
PALM_RINGS = (0.12, 0.24, 0.36, 0.48, 0.60, 0.71, 0.81)
KNUCKLE_RINGS = (-10.0, -6.0, -2.0, 2.0, 6.5, 11.0, 15.5)
KNUCKLE_STIFFNESS = 3.0
HOLE = (7, 7 + TOP)
"""First and last ring of the hole for the thumb."""

# where each ray crosses the wrist and the stump (y) [mm]
WRIST_Y = (20.0, 6.8, -6.8, -20.0)


class Mesh:
    """A mesh of quads under construction [mm], with what each vertex belongs to.

    Attributes:
        vertices: (V, 3).
        quads: four vertices each, counter-clockwise from outside.
        owner: (V,) finger whose surface the vertex lies on, -1 for the palm's.
        share: (V, 4) how far a vertex of the palm belongs to the rays of index..little.
        free: (V,) vertices that the smoothing may slide along the surface.
        stiff: (V,) how hard a vertex's edges pull in the smoothing.
        nails: by finger, the (4, TOP + 1) vertices under its nail.
    """

    def __init__(self) -> None:
        self.vertices: Array = np.zeros((0, 3))
        self.quads: list[tuple[int, ...]] = []
        self.owner: Ints = np.zeros(0, int)
        self.share: Array = np.zeros((0, 4))
        self.free: NDArray[np.bool_] = np.zeros(0, bool)
        self.stiff: Array = np.zeros(0)
        self.nails: dict[int, Ints] = {}

    def add(self, points: Array, owner: int, share: Array | None = None, free: bool = True) -> Ints:
        """Append vertices; returns their indices in the shape of points' leading axes."""
        n0, flat = len(self.vertices), points.reshape(-1, 3)
        share = np.zeros((len(flat), 4)) if share is None else share.reshape(-1, 4)
        self.vertices = np.concatenate([self.vertices, flat])
        self.owner = np.concatenate([self.owner, np.full(len(flat), owner)])
        self.share = np.concatenate([self.share, share])
        self.free = np.concatenate([self.free, np.full(len(flat), free)])
        self.stiff = np.concatenate([self.stiff, np.ones(len(flat))])
        return np.arange(n0, len(self.vertices)).reshape(points.shape[:-1])

    def patch(self, grid: Ints) -> None:
        """Quads of a grid (R, C); seen from outside, columns turn counter-clockwise to rows."""
        for a, b in pairwise(grid):
            for i in range(len(a) - 1):
                self.quads.append((int(a[i]), int(a[i + 1]), int(b[i + 1]), int(b[i])))

    def compact(self) -> Ints:
        """Drop the vertices that no quad uses; returns old index -> new, -1 for the dropped."""
        used = np.unique(self.quads)
        new = np.full(len(self.vertices), -1)
        new[used] = np.arange(len(used))
        self.quads = [tuple(q) for q in new[np.array(self.quads)].tolist()]
        for name in ("vertices", "owner", "share", "free", "stiff"):
            setattr(self, name, getattr(self, name)[used])
        self.nails = {finger: new[grid] for finger, grid in self.nails.items()}
        return new

    def neighbours(self) -> tuple[Ints, Ints]:
        """Undirected edges of the quads, both ways, as (from, to)."""
        q = np.array(self.quads)
        e = np.concatenate([q[:, [i, (i + 1) % 4]] for i in range(4)])
        e = np.unique(np.concatenate([e, e[:, ::-1]]), axis=0)
        return e[:, 0], e[:, 1]

    def relax(self, shape: HandShape, rounds: int, power: float, step: float = 0.6) -> None:
        """Even out the free vertices along the surface.

        An edge pulls with its length to 1 + power: 0 smooths, more makes lengths even.
        """
        a, b = self.neighbours()
        use = self.free[a]
        a, b = a[use], b[use]
        move = np.flatnonzero(self.free)
        owner = self.owner[move]
        stiff = np.sqrt(self.stiff[a] * self.stiff[b])
        normal = slope = np.zeros(0)
        for i in range(rounds):
            edge = self.vertices[b] - self.vertices[a]
            pull = stiff * np.linalg.norm(edge, axis=1) ** power
            total = np.bincount(a, pull, len(self.vertices))[move]
            sums = [np.bincount(a, pull * e, len(self.vertices)) for e in edge.T]
            d = np.stack(sums, -1)[move] / total[:, None]
            points = self.vertices[move]
            if i % 4 == 0:  # the gradient changes little between rounds
                value, normal, slope = shape.linear(points, owner)
            else:
                value = shape(points, owner)
            d -= (d * normal).sum(-1, keepdims=True) * normal
            down = np.clip(value / slope, -2, 2)[:, None] * normal
            self.vertices[move] = points + step * d - down
        self.vertices = shape.project(self.vertices, self.owner, 6)

    def span(self, inner: Ints) -> None:
        """Stretch a film over inner vertices, each the mean of its neighbours."""
        a, b = self.neighbours()
        use = np.isin(a, inner)
        a, b = a[use], b[use]
        degree = np.bincount(a, minlength=len(self.vertices))[inner]
        for _ in range(30):
            for axis in range(3):
                sums = np.bincount(a, self.vertices[b, axis], len(self.vertices))
                self.vertices[inner, axis] = sums[inner] / degree

    def triangles(self) -> NDArray[np.int32]:
        """Each quad cut along its shorter diagonal, (F, 3)."""
        q, v = np.array(self.quads), self.vertices
        ac = np.linalg.norm(v[q[:, 0]] - v[q[:, 2]], axis=-1)
        bd = np.linalg.norm(v[q[:, 1]] - v[q[:, 3]], axis=-1)
        # the margin decides the ties of symmetric quads alike on every machine
        short = (ac < bd + 1e-3)[:, None, None]
        cut = np.where(short, q[:, [[0, 1, 2], [0, 2, 3]]], q[:, [[1, 2, 3], [1, 3, 0]]])
        return cut.reshape(-1, 3).astype(np.int32)


def _ring_points(tube: Tube, t: float) -> Array:
    """A ring about a tube's axis at axial coordinate t [mm], (AROUND, 3).

    It starts at the dorsal radial corner and goes over the back.
    """
    angles = np.pi / 2 + 2 * np.pi / AROUND * (np.arange(AROUND) - TOP / 2)
    width, dorsal, palmar = tube.radii(np.clip(t, tube.start, tube.end))
    # beyond the start of the cap the section shrinks as an ellipse's does
    x = max(t - tube.end, 0.0) / tube.caps[1]
    u, v = np.cos(angles) * width, np.sin(angles)
    section = np.stack([u, v * np.where(v > 0, dorsal, palmar)], -1) * np.sqrt(max(1 - x * x, 0.0))
    return np.asarray(tube.origin + t * tube.frame[0] + section @ tube.frame[1:])


def _stations(finger: int, shape: HandShape, root: float) -> list[float]:
    """Axial coordinates [mm] of a finger's rings beyond its root, dense at the joints."""
    chain = shape.joints[1 + 4 * finger : 5 + 4 * finger]
    first, second, tip = np.cumsum(np.linalg.norm(np.diff(chain, axis=0), axis=-1))
    about = (-9, -3, 3, 9) if finger == 0 else (-9, -5.4, -1.8, 1.8, 5.4, 9)
    knots = [root, *(first + d for d in about), *(second + d for d in (-7.5, -4.5, -1.5, 1.5, 4.5))]
    out: list[float] = []
    for a, b in pairwise(knots):
        n = max(round((b - a) / 4.2), 1)
        out += [float(x) for x in np.linspace(a, b, n + 1)[1:]]
    cap = shape.fingers[finger].caps[1]
    out += [float(x) for x in np.linspace(out[-1], tip - cap, 3)[1:]]
    return out + [float(tip - cap + cap * s) for s in (0.30, 0.56, 0.80)]


def _cap(mesh: Mesh, ring: Ints, owner: int, top: int, forward: Array) -> None:
    """Close a ring with a grid of quads, `top` edges wide, its inside moved forward [mm]."""
    side = len(ring) // 2 - top
    grid = np.full((side + 1, top + 1), -1)
    grid[0] = ring[: top + 1]
    grid[:, -1] = ring[top : top + side + 1]
    grid[-1] = ring[top + side : 2 * top + side + 1][::-1]
    grid[1:, 0] = ring[2 * top + side :][::-1]
    v = mesh.vertices
    for i in range(1, side):
        for j in range(1, top):
            a, b = i / side, j / top
            p = (1 - a) * v[grid[0, j]] + a * v[grid[-1, j]]
            p += (1 - b) * v[grid[i, 0]] + b * v[grid[i, -1]]
            grid[i, j] = mesh.add((0.5 * p + forward)[None], owner)[0]
    mesh.patch(grid)


def _palm_columns(shape: HandShape) -> tuple[Array, Array]:
    """Where the palm's columns run inside it, (rings, DORSAL + 1, 3), and their shares (.., 4)."""
    n = len(STUMP_RINGS)
    columns: list[Array] = []
    shares: list[Array] = []
    for f in range(4):
        knuckle, along = shape.joints[5 + 4 * f], shape.fingers[f + 1].frame[0]
        wrist = np.array([2.0, WRIST_Y[f], 0.0])
        rows = [np.array([x, WRIST_Y[f], 0.0]) for x in STUMP_RINGS]
        rows += [wrist + s * (knuckle - wrist) for s in PALM_RINGS]
        # the little finger's web is the shallowest
        rows += [knuckle + d * (0.92 if f == 3 else 1.0) * along for d in KNUCKLE_RINGS]
        half = np.concatenate(
            [np.full(n, 4.2), np.interp(np.arange(len(rows) - n), [0, 8, 13], [4.6, 7.4, 7.4])]
        )
        first = len(columns)
        for a in np.linspace(1, -1, TOP + 1):
            columns.append(np.array(rows) + (a * half)[:, None] * np.array([0, 1.0, 0]))
            shares.append(np.eye(4)[f])
        if f > 0:  # the columns of the web before this finger
            s = np.arange(1, WEB) / WEB
            a, b = columns[first - 1], columns[first]
            columns[first:first] = [a + x * (b - a) for x in s]
            shares[first:first] = [(1 - x) * np.eye(4)[f - 1] + x * np.eye(4)[f] for x in s]
    return np.stack(columns, 1), np.stack(shares)


def _palm_rings(mesh: Mesh, shape: HandShape) -> Ints:
    """Vertices of the palm's rings (rings, RING), from the dorsal radial corner over the back."""
    columns, shares = _palm_columns(shape)
    dorsal = _surface_along(shape, columns, np.array([0, 0, 1.0]))
    palmar = _surface_along(shape, columns, np.array([0, 0, -1.0]))
    s = np.arange(1, SIDE)[None, :, None] / SIDE

    def side(c: int, out: float) -> Array:
        a, b = dorsal[:, c, None], palmar[:, c, None]
        # off to the side, so that the projection comes in from there
        bow = out * np.array([0, 1.0, 0]) * 4 * s * (1 - s)
        return np.asarray(a + s * (b - a) + bow)

    points = np.concatenate([dorsal, side(-1, -8.0), palmar[:, ::-1], side(0, 8.0)[:, ::-1]], 1)
    first, last = shares[:1].repeat(SIDE - 1, 0), shares[-1:].repeat(SIDE - 1, 0)
    share = np.concatenate([shares, last, shares[::-1], first])
    return mesh.add(points, -1, np.broadcast_to(share, (*points.shape[:2], 4)))


def _surface_along(shape: HandShape, points: Array, direction: Array) -> Array:
    """Where the surface is met from points (..., 3) inside, marching along direction."""
    flat = points.reshape(-1, 3).copy()
    owner = np.full(len(flat), -1)
    travel = np.zeros(len(flat))
    for _ in range(40):
        travel -= np.clip(shape(flat + travel[:, None] * direction, owner), -3, 3) * 0.8
    travel = np.clip(travel, 2.0, 35.0)
    return (flat + travel[:, None] * direction).reshape(points.shape)


def build_mesh(shape: HandShape) -> Mesh:
    """The skin of a hand, closed at the wrist."""
    mesh = Mesh()
    palm = _palm_rings(mesh, shape)
    lo, hi = HOLE
    radial = [*range(2 * DORSAL + SIDE, RING), 0]
    closed = np.concatenate([palm, palm[:, :1]], 1)
    mesh.patch(closed[:, : radial[0] + 1])
    mesh.patch(closed[: lo + 1, radial[0] :])
    mesh.patch(closed[hi:, radial[0] :])
    stump = np.concatenate([palm[0, DORSAL::-1], palm[0, :DORSAL:-1]])
    _cap(mesh, stump, -1, DORSAL, np.array([-3.0, 0, 0]))
    webs = _fingers_and_webs(mesh, shape, palm[-1])
    border = [
        palm[lo : hi + 1, 0],
        palm[hi, radial[1:-1]][::-1],
        palm[lo : hi + 1, radial[0]][::-1],
        palm[lo, radial[1:-1]],
    ]
    _thumb(mesh, shape, np.concatenate(border))

    new = mesh.compact()  # the palm's vertices inside the thumb's hole
    mesh.vertices = shape.project(mesh.vertices, mesh.owner, 12)
    mesh.relax(shape, 40, 0.0)
    # even lengths would pull the webs' valleys together, and the knuckles' rings apart
    mesh.free[new[webs]] = mesh.free[new[palm[-2:]]] = False
    knuckles = new[palm[-len(KNUCKLE_RINGS) :]]
    mesh.stiff[knuckles] = KNUCKLE_STIFFNESS
    mesh.relax(shape, 100, 1.0)
    mesh.span(new[webs[:, 1:-1, 1:-1].ravel()])
    return mesh


def _fingers_and_webs(mesh: Mesh, shape: HandShape, root: Ints) -> Ints:
    """Index..little on their shares of the palm's last ring.

    Returns:
        (3, SIDE + 1, WEB + 1) vertices of the webs, from back to palm and index to little.
    """
    rows = np.arange(1, SIDE)[:, None] / SIDE
    dorsal, palmar = root[: DORSAL + 1], root[DORSAL + SIDE : 2 * DORSAL + SIDE + 1][::-1]
    sides = []
    for f in range(4):
        c = f * (TOP + WEB)
        ends = []
        for column in (c, c + TOP):
            if column == 0:
                ends.append(root[RING - SIDE + 1 :][::-1])
            elif column == DORSAL:
                ends.append(root[DORSAL + 1 : DORSAL + SIDE])
            else:
                a, b = mesh.vertices[dorsal[column]], mesh.vertices[palmar[column]]
                share = np.eye(4)[[f] * (SIDE - 1)]
                ends.append(mesh.add(a + rows * (b - a), f + 1, share))
        sides.append(ends)
        top, bottom = dorsal[c : c + TOP + 1], palmar[c : c + TOP + 1]
        ring = np.concatenate([top, ends[1], bottom[::-1], ends[0][::-1]])
        tube = shape.fingers[f + 1]
        start = float(tube.local(mesh.vertices[ring]).mean(0)[0])
        _tube(mesh, shape, f + 1, [ring], start, free=2)
    webs = []
    for f in range(3):
        c = f * (TOP + WEB) + TOP
        left, right = sides[f][1], sides[f + 1][0]
        s = (np.arange(1, WEB) / WEB)[:, None]
        a, b = mesh.vertices[left][:, None], mesh.vertices[right][:, None]
        share = (1 - s) * np.eye(4)[f] + s * np.eye(4)[f + 1]
        middle = mesh.add(a + s * (b - a), -1, np.tile(share, (SIDE - 1, 1)))
        grid = np.concatenate([left[:, None], middle, right[:, None]], 1)
        grid = np.concatenate([dorsal[None, c : c + WEB + 1], grid, palmar[None, c : c + WEB + 1]])
        mesh.patch(grid)
        webs.append(grid)
    return np.stack(webs)


def _thumb(mesh: Mesh, shape: HandShape, border: Ints) -> None:
    """The thumb, out of the hole's border; its columns start where they fit the border best."""
    start = float(np.linalg.norm(shape.joints[2] - shape.joints[1])) - 10.0
    ring = _ring_points(shape.fingers[0], start)
    fits = [((mesh.vertices[np.roll(border, -s)] - ring) ** 2).sum() for s in range(AROUND)]
    border = np.roll(border, -int(np.argmin(fits)))
    base = mesh.vertices[border]
    rings = [border, *(mesh.add(base + s * (ring - base), 0) for s in (0.25, 0.5, 0.75, 1.0))]
    _tube(mesh, shape, 0, rings, start, free=5)


def _tube(
    mesh: Mesh, shape: HandShape, finger: int, rings: list[Ints], start: float, free: int
) -> None:
    """Go on from rings to the tip of a finger; the first `free` new rings may be smoothed."""
    tube = shape.fingers[finger]
    for i, t in enumerate(_stations(finger, shape, start)):
        rings.append(mesh.add(_ring_points(tube, t), finger, free=i < free))
    rows = np.array(rings)
    mesh.patch(np.concatenate([rows, rows[:, :1]], 1))
    mesh.nails[finger] = rows[-4:, : TOP + 1]
    _cap(mesh, rings[-1], finger, TOP, tube.frame[0] * 0.1 * tube.caps[1])
