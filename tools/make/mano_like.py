"""Make free stand-ins for MANO's files, to try and test what reads them.

    python -m tools.make.mano_like FOLDER

writes MANO_RIGHT.pkl and MANO_LEFT.pkl: our own default hand thinned to 778 vertices with an
open wrist, and bases of our own making, stored as MANO's are: pickled by Python 2, with a
chumpy.reordering.Select over a chumpy.ch.Ch and an old scipy.sparse matrix. They hold nothing of
MANO; numbers made with them say nothing about MANO.
"""

from __future__ import annotations

import argparse
import heapq
import pickle
import struct
import sys
from pathlib import Path
from types import ModuleType
from typing import IO, Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.mano import MANO_JOINT, TIP_VERTICES, mano_axes
from handtrack.hand.mano_file import N_VERTICES, PARENTS
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from handtrack.hand.rotations import matrix_to_vector
from handtrack.hand.skeleton import BASES, PART_JOINT, TIPS

Array = NDArray[np.float64]

RIM = 16
"""Vertices of the open wrist, as in MANO: 778 vertices and 1538 triangles ask for 16."""
_CUT = -0.0105
"""The arm is cut off here, behind the wrist [m]."""


def thinned(vertices: Array, faces: NDArray[Any], count: int, rim: int) -> tuple[Any, Any]:
    """A mesh with some of its vertices taken away, the least missed first.

    Garland and Heckbert 1997, "Surface simplification using quadric error metrics", moving no
    vertex.

    Args:
        vertices: (V, 3).
        faces: (F, 3) of one surface with one hole.
        count: vertices to keep.
        rim: how many of them on the hole's rim.

    Returns:
        (count,) indices of the vertices kept, and (2 count - 2 - rim, 3) faces over them.
    """
    around: list[set[int]] = [set() for _ in vertices]  # faces at each vertex
    triangles = [list(map(int, f)) for f in faces]
    for i, face in enumerate(triangles):
        for v in face:
            around[v].add(i)

    def neighbours(v: int) -> set[int]:
        return {w for i in around[v] for w in triangles[i]} - {v}

    def shared(a: int, b: int) -> set[int]:
        return around[a] & around[b]

    edge = {v: any(len(shared(v, w)) == 1 for w in neighbours(v)) for v in range(len(vertices))}
    on_rim, left = sum(edge.values()), sum(map(bool, around))

    def flips(gone: int, kept: int) -> bool:
        for i in around[gone] - around[kept]:
            old = vertices[triangles[i]]
            new = vertices[[kept if v == gone else v for v in triangles[i]]]
            a, b = (np.cross(t[1] - t[0], t[2] - t[0]) for t in (old, new))
            if a @ b < 0.6 * np.linalg.norm(a) * np.linalg.norm(b):
                return True
        return False

    # squared distances to the planes of the triangles that a vertex stands for
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    planes = np.column_stack([normal, -(normal * a).sum(1)])
    planes /= np.sqrt(np.linalg.norm(normal, axis=1))[:, None]
    quadrics = np.zeros((len(vertices), 4, 4))
    for i in range(3):
        np.add.at(quadrics, faces[:, i], planes[:, :, None] * planes[:, None, :])
    homogeneous = np.column_stack([vertices, np.ones(len(vertices))])

    def cost(gone: int, kept: int) -> float:
        p = homogeneous[kept]
        length = np.linalg.norm(vertices[gone] - vertices[kept])
        return float(p @ (quadrics[gone] + quadrics[kept]) @ p + 1e-7 * length**2)

    heap = [(cost(a, b), a, b) for a in range(len(vertices)) for b in neighbours(a) if around[a]]
    heapq.heapify(heap)
    while left > count or on_rim > rim:
        _, gone, kept = heapq.heappop(heap)
        both = shared(gone, kept) if around[gone] else set()
        if not both or (edge[gone] and (len(both) != 1 or on_rim <= rim)):
            continue
        if not edge[gone] and left - max(on_rim - rim, 0) <= count:
            continue
        if len(neighbours(gone) & neighbours(kept)) != len(both) or flips(gone, kept):
            continue
        for i in list(around[gone]):
            if i in both:
                for v in triangles[i]:
                    around[v].discard(i)
            else:
                triangles[i] = [kept if v == gone else v for v in triangles[i]]
                around[kept].add(i)
        around[gone] = set()
        quadrics[kept] += quadrics[gone]
        on_rim, left = on_rim - edge[gone], left - 1
        for w in neighbours(kept):
            heapq.heappush(heap, (cost(kept, w), kept, w))
            heapq.heappush(heap, (cost(w, kept), w, kept))
    keep = np.flatnonzero([bool(a) for a in around])
    new = np.full(len(vertices), -1)
    new[keep] = np.arange(len(keep))
    used = sorted({i for a in around for i in a})
    return keep, new[np.array([triangles[i] for i in used])]


def _skin() -> tuple[HandModel, NDArray[np.int64], NDArray[np.int64]]:
    """The right default hand, the vertices that stay, in MANO's order of tips, and faces."""
    model = HandModel.default("right")
    v = model.rest_vertices
    faces = model.faces[(v[model.faces, 0] > _CUT).all(1)]
    keep, faces = thinned(v, faces, N_VERTICES, RIM)
    # the vertices that anyone takes for a fingertip are put at the tips
    order = list(range(N_VERTICES))
    place = {i: i for i in order}
    for f, tip in enumerate(TIPS):
        wanted = list(
            dict.fromkeys(side[f] for sets in TIP_VERTICES.values() for side in sets[::-1])
        )
        near = np.argsort(np.linalg.norm(v[keep] - model.rest_joints[tip], axis=1))
        for index, vertex in zip(sorted(wanted), near[: len(wanted)].tolist(), strict=True):
            other, here = order[index], place[vertex]
            order[index], order[here] = vertex, other
            place[vertex], place[other] = index, here
    new = np.empty(N_VERTICES, np.int64)
    new[order] = np.arange(N_VERTICES)
    return model, keep[order], new[faces]


def _regressor(vertices: Array, joints: Array) -> Array:
    """(J, V) of rows that sum to one and give the joints from some sixty vertices around."""
    out = np.zeros((len(joints), len(vertices)))
    for row, joint in zip(out, joints, strict=True):
        near = np.argsort(np.linalg.norm(vertices - joint, axis=1))[:60]
        system = np.concatenate([vertices[near].T, np.ones((1, 60))])
        row[near] = np.linalg.lstsq(system, np.append(joint, 1.0), rcond=None)[0]
    return out


def _shapes(model: HandModel, keep: NDArray[np.int64]) -> Array:
    """(V, 3, 10) offsets: size, finger lengths, palm width, thickness, and smooth bulges."""
    rest, v = model.rest_joints, model.rest_vertices
    long = rest.copy()
    for base in BASES:
        long[base + 1 : base + 4] = rest[base] + 1.06 * (rest[base + 1 : base + 4] - rest[base])
    wide = rest * np.array([1.0, 1.06, 1.0])
    bones = reshaped(model, long).rest_vertices - v, reshaped(model, wide).rest_vertices - v
    shapes = [0.05 * v, *bones, 0.05 * v * np.array([0.0, 0.0, 1.0])]
    rng = np.random.default_rng(2017)
    for _ in range(6):
        wave = rng.normal(0, 30, (3, 3))
        shapes.append(5e-4 * np.sin(v @ wave + rng.uniform(0, 6.28, 3)))
    return np.stack(shapes, -1)[keep]


def make_mano_like(hand: str = "right", *, wrong_left: bool = False) -> dict[str, Any]:
    """The contents of a file, as arrays by MANO's names.

    Args:
        hand: "right" or "left", the mirror image.
        wrong_left: with the shape basis of the right hand's signs, as some left files have.
    """
    model, keep, faces = _skin()
    turn = mano_axes("right")
    shift = np.array([-0.0957, 0.0062, 0.0064])  # the wrist is not MANO's origin
    vertices = (model.rest_vertices[keep] + shift) @ turn
    joints = (model.rest_joints[PART_JOINT] + shift) @ turn
    mano_part = np.argsort(MANO_JOINT)  # our part of each of MANO's joints
    weights = model.weights[keep][:, mano_part]
    rng = np.random.default_rng(45)
    # a joint's blend shapes move the skin at the joint
    near = (weights * weights[:, np.maximum(PARENTS, 0)])[:, 1:] * 4
    pose = rng.normal(0, 1e-3, (N_VERTICES, 3, 15, 9)) * near[:, None, :, None]
    local = model.local_rotations(model.rotations(model.mean_angles))
    mean = (matrix_to_vector(local) @ turn)[mano_part[1:] - 1]
    out = {
        "v_template": vertices,
        "shapedirs": np.einsum("vis,ia->vas", _shapes(model, keep), turn),
        "posedirs": pose.reshape(N_VERTICES, 3, 135),
        "J_regressor": _regressor(vertices, joints[mano_part]),
        "weights": weights / weights.sum(1, keepdims=True),
        "kintree_table": np.array([PARENTS, range(16)]).astype(np.uint32),
        "f": faces.astype(np.uint32),
        "hands_mean": mean.reshape(45),
        "hands_components": np.linalg.qr(rng.normal(size=(45, 45)))[0],
        "hands_coeffs": rng.normal(size=(1554, 45)),
        "bs_style": "lbs",
        "bs_type": "lrotmin",
    }
    if hand == "left":
        mirror = np.array([-1.0, 1.0, 1.0])
        out["v_template"] = vertices * mirror
        out["f"] = out["f"][:, ::-1].copy()
        if not wrong_left:
            out["shapedirs"] = out["shapedirs"] * mirror[:, None]
        signs = np.outer(mirror, mirror).ravel()
        pose = pose.reshape(N_VERTICES, 3, 15, 9) * mirror[:, None, None] * signs
        out["posedirs"] = pose.reshape(N_VERTICES, 3, 135)
        out["hands_mean"] = (mean * [1, -1, -1]).reshape(45)
    out["J"] = out["J_regressor"] @ out["v_template"]
    return out


_Pickler: Any = pickle._Pickler
"""The one that is written in Python can be taught."""


class _Python2Pickler(_Pickler):  # type: ignore[misc]
    """Writes what Python 2's pickle would: byte strings and the names of that time."""

    dispatch: ClassVar[dict[Any, Any]] = dict(_Pickler.dispatch)

    def save_string(self, text: str | bytes) -> None:
        data = text.encode("latin1") if isinstance(text, str) else text
        if self.proto == 0:
            self.write(b"S" + repr(data)[1:].encode() + b"\n")
        elif len(data) < 256:
            self.write(b"U" + struct.pack("<B", len(data)) + data)
        else:
            self.write(b"T" + struct.pack("<i", len(data)) + data)
        self.memoize(text)

    dispatch[bytes] = dispatch[str] = save_string

    def save_global(self, obj: Any, name: str | None = None) -> None:
        module = getattr(obj, "__module__", "")
        if module in _OLD_NAMES:
            self.write(f"c{_OLD_NAMES[module]}\n{name or obj.__name__}\n".encode())
            self.memoize(obj)
        else:
            super().save_global(obj, name)

    dispatch[type] = dispatch[type(thinned)] = dispatch[type(len)] = save_global


_OLD_NAMES = {
    "numpy._core.multiarray": "numpy.core.multiarray",
    "numpy": "numpy",
    "scipy.sparse._csc": "scipy.sparse.csc",
    "copyreg": "copy_reg",
}


def chumpy_modules() -> dict[str, ModuleType]:
    """Modules with the names and stored state of chumpy's, for writing (and other readers)."""

    class Ch:
        def __init__(self, **stored: Any) -> None:
            self.__dict__ |= {"_dirty_vars": set(), "_itr": None, "_depends_on_deps": {}}
            self.__dict__ |= {"_make_dense": False, "_make_sparse": False, **stored}

        @property
        def r(self) -> NDArray[Any]:
            return np.asarray(self.__dict__["x"])

        @property
        def shape(self) -> tuple[int, ...]:
            return self.r.shape

        def __array__(self, dtype: Any = None, copy: Any = None) -> NDArray[Any]:
            return np.asarray(self.r, dtype)

        def __getitem__(self, key: Any) -> Any:
            return self.r[key]

    class Select(Ch):
        @property
        def r(self) -> NDArray[Any]:
            here = self.__dict__
            return np.asarray(here["a"].r.ravel()[here["idxs"]].reshape(here["preferred_shape"]))

    package, ch, reordering = map(ModuleType, ("chumpy", "chumpy.ch", "chumpy.reordering"))
    for module, thing in ((ch, Ch), (reordering, Select)):
        thing.__module__, thing.__qualname__ = module.__name__, thing.__name__
        setattr(module, thing.__name__, thing)
    return {m.__name__: m for m in (package, ch, reordering)}


def write_pickle(content: dict[str, Any], file: IO[bytes], protocol: int = 2) -> None:
    """Write contents as MANO's own files are: by Python 2, with chumpy's and scipy's objects."""
    from scipy.sparse import csc_matrix

    modules = chumpy_modules()
    before = {name: sys.modules.get(name) for name in modules}
    sys.modules.update(modules)
    try:
        shapes = content["shapedirs"]
        # twenty shapes were made, ten are given
        all_shapes = np.concatenate([shapes, np.zeros_like(shapes)], -1)
        picked = np.arange(all_shapes.size).reshape(all_shapes.shape)[..., : shapes.shape[-1]]
        ch: Any = modules["chumpy.ch"]
        reordering: Any = modules["chumpy.reordering"]
        stored = content | {
            "shapedirs": reordering.Select(
                a=ch.Ch(x=all_shapes), idxs=picked.ravel(), preferred_shape=shapes.shape
            ),
            "J_regressor": csc_matrix(content["J_regressor"]),
        }
        _Python2Pickler(file, protocol, fix_imports=True).dump(stored)
    finally:
        for name, module in before.items():
            if module is None:
                del sys.modules[name]
            else:
                sys.modules[name] = module


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    folder.mkdir(parents=True, exist_ok=True)
    for hand in ("right", "left"):
        path = folder / f"MANO_{hand.upper()}.pkl"
        with path.open("wb") as file:
            write_pickle(make_mano_like(hand), file)
        print(f"{path}: {path.stat().st_size} bytes, a stand-in, not MANO")


if __name__ == "__main__":
    main()
