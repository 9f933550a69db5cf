"""Read the skinned mesh of a glTF 2.0 file (.glb or .gltf): what a hand needs of it."""

from __future__ import annotations

import base64
import binascii
import struct
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.hand.rotations import quaternion_to_matrix

Array = NDArray[np.float64]

# Khronos, glTF 2.0 specification, 3.6.2.2
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TRIANGLES = 4
# what few bytes may not be multiplied to: a person's whole body has less of each
_NODES, _JOINTS, _PRIMITIVES, _SETS = 20_000, 1000, 1000, 4
_VERTICES, _WEIGHTS = 500_000, 2 * 10**7
_FAR = 1e6


class _Struct(msgspec.Struct, rename="camel"):
    """Members that are not named here do not matter to us."""


class _Node(_Struct):
    name: str = ""
    children: list[int] = []
    matrix: list[float] | None = None
    translation: tuple[float, float, float] = (0, 0, 0)
    rotation: tuple[float, float, float, float] = (0, 0, 0, 1)
    scale: tuple[float, float, float] = (1, 1, 1)
    mesh: int | None = None
    skin: int | None = None


class _Skin(_Struct):
    joints: list[int]
    inverse_bind_matrices: int | None = None


class _Primitive(_Struct):
    attributes: dict[str, int]
    indices: int | None = None
    mode: int = _TRIANGLES
    extensions: dict[str, Any] = {}


class _Mesh(_Struct):
    primitives: list[_Primitive]


class _Accessor(_Struct):
    component_type: int
    count: int
    type: str
    buffer_view: int | None = None
    byte_offset: int = 0
    normalized: bool = False
    sparse: dict[str, Any] | None = None


class _View(_Struct):
    buffer: int
    byte_length: int
    byte_offset: int = 0
    byte_stride: int | None = None


class _Buffer(_Struct):
    byte_length: int
    uri: str | None = None


class _Asset(_Struct):
    version: str


class _Document(_Struct):
    asset: _Asset
    nodes: list[_Node] = []
    skins: list[_Skin] = []
    meshes: list[_Mesh] = []
    accessors: list[_Accessor] = []
    buffer_views: list[_View] = []
    buffers: list[_Buffer] = []
    extensions_required: list[str] = []


_DAMAGED: tuple[type[Exception], ...] = (LookupError, MemoryError, OverflowError)
_DAMAGED += (RecursionError, TypeError, ValueError, struct.error)


class SkinnedMesh(NamedTuple):
    """A mesh on a skeleton, as the file's scene shows it [m].

    Attributes:
        names: of the J joints.
        joints: (J, 4, 4) their frames in the scene.
        vertices: (V, 3) in the scene.
        faces: (F, 3), counter-clockwise from outside.
        weights: (V, J), rows summing to one.
    """

    names: tuple[str, ...]
    joints: Array
    vertices: Array
    faces: NDArray[np.int64]
    weights: Array


def read_skinned_mesh(path: str | Path) -> SkinnedMesh:
    """The one skinned mesh of a glTF 2.0 file.

    Raises:
        InputError: the file is not there, is no glTF, is damaged, has no skin or several, or
            needs an extension that is not read (compressed meshes).
    """
    path = Path(path)
    try:
        return _File(path).skinned_mesh()
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", path) from error
    except msgspec.MsgspecError as error:
        raise InputError(f"is no glTF 2.0: {error}", path) from error
    except _DAMAGED as error:
        raise InputError(f"is a damaged glTF file: {shown(str(error))}", path) from error


class _File:
    def __init__(self, path: Path) -> None:
        self.path = path
        data = budget.read(path, budget.MODELS)
        self.inside: bytes | None = None
        if data[:4] == b"glTF":
            data, self.inside = self._chunks(data)
        self.document = msgspec.json.decode(data, type=_Document)
        if not self.document.asset.version.startswith("2."):
            version = shown(self.document.asset.version, 40)
            raise InputError(f"is glTF {version}, expected 2.0", path)
        if self.document.extensions_required:
            needed = shown(", ".join(self.document.extensions_required[:5]), 100)
            raise InputError(f"needs {needed}, which is not read", path)
        self.buffers: dict[int, bytes] = {}
        self.arrays: dict[int, Array] = {}
        if len(self.document.nodes) > _NODES:
            raise InputError(f"has {len(self.document.nodes)} nodes, expected a hand", path)

    def _chunks(self, data: bytes) -> tuple[bytes, bytes | None]:
        """JSON and binary chunk of a .glb."""
        _, version, length = struct.unpack_from("<III", data)
        if version != 2 or length > len(data):
            raise InputError(f"is cut short: {len(data)} bytes of {length}", self.path)
        found: dict[bytes, bytes] = {}
        place = 12
        while place + 8 <= length:
            size, kind = struct.unpack_from("<I4s", data, place)
            found.setdefault(kind, data[place + 8 : place + 8 + size])
            place += 8 + size
        return found.get(b"JSON", b""), found.get(b"BIN\0")

    def skinned_mesh(self) -> SkinnedMesh:
        doc = self.document
        hosts = [n for n in doc.nodes if n.skin is not None and n.mesh is not None]
        if not hosts:
            raise InputError("has no mesh with a skin", self.path)
        if len({node.skin for node in hosts}) > 1:
            raise InputError("has several skins, expected one hand", self.path)
        skin = doc.skins[_index(hosts[0].skin)]
        if not 0 < len(skin.joints) <= _JOINTS:
            raise InputError(f"has a skin of {len(skin.joints)} joints", self.path)
        world = self._world()
        if not all(0 <= i < len(world) for i in skin.joints):
            raise InputError("has a skin of joints that do not exist", self.path)
        joints = world[skin.joints]
        bind = np.broadcast_to(np.eye(4), joints.shape)
        if skin.inverse_bind_matrices is not None:
            bind = self._array(skin.inverse_bind_matrices).reshape(-1, 4, 4).swapaxes(1, 2)
        if bind.shape != joints.shape:
            raise InputError(f"has {len(bind)} bind matrices for {len(joints)} joints", self.path)
        parts: list[tuple[Array, NDArray[np.int64], Array]] = []
        vertices = 0
        for primitive in self._primitives(hosts):
            vertices += self._vertices(primitive)
            if vertices > _VERTICES or vertices * len(joints) > _WEIGHTS:
                raise InputError(f"has {vertices} vertices or more, expected a hand", self.path)
            parts.append(self._primitive(primitive, len(joints)))
        if not parts:
            raise InputError("has a mesh of nothing", self.path)
        starts = np.cumsum([0] + [len(v) for v, _, _ in parts])
        rest = np.concatenate([v for v, _, _ in parts])
        faces = np.concatenate([f + s for (_, f, _), s in zip(parts, starts, strict=False)])
        weights = np.concatenate([w for _, _, w in parts])
        moves = joints @ bind
        blended = np.einsum("vj,jab->vab", weights, moves[:, :3])
        points = np.einsum("vab,vb->va", blended[..., :3], rest) + blended[..., 3]
        if not np.isfinite(points).all():
            raise InputError("has vertices that are nowhere", self.path)
        if np.linalg.det(moves[0, :3, :3]) < 0:
            faces = faces[:, ::-1]
        names = tuple(doc.nodes[i].name for i in skin.joints)
        return SkinnedMesh(names, joints, points, faces, weights)

    def _primitives(self, hosts: list[_Node]) -> list[_Primitive]:
        found: list[_Primitive] = []
        for node in hosts:
            found += self.document.meshes[_index(node.mesh)].primitives
            if len(found) > _PRIMITIVES:
                raise InputError(f"has more than {_PRIMITIVES} parts of a mesh", self.path)
        return found

    def _vertices(self, primitive: _Primitive) -> int:
        """How many it has, by what it says."""
        position = primitive.attributes.get("POSITION")
        return 0 if position is None else self.document.accessors[_index(position)].count

    def _world(self) -> Array:
        """(N, 4, 4) frames of all nodes in the scene."""
        nodes = self.document.nodes
        out = np.stack([_local(node) for node in nodes])
        parents = {child: i for i, node in enumerate(nodes) for child in node.children}
        done: dict[int, Array] = {}

        def frame(i: int) -> Array:
            if i not in done:
                done[i] = frame(parents[i]) @ out[i] if i in parents else out[i]
            return done[i]

        return np.stack([frame(i) for i in range(len(nodes))])

    def _primitive(self, primitive: _Primitive, n: int) -> tuple[Array, NDArray[np.int64], Array]:
        has = primitive.attributes
        if "KHR_draco_mesh_compression" in primitive.extensions:
            raise InputError("has a compressed mesh (Draco), which is not read", self.path)
        if primitive.mode != _TRIANGLES:
            raise InputError("has a mesh of something else than triangles", self.path)
        missing = [key for key in ("POSITION", "JOINTS_0", "WEIGHTS_0") if key not in has]
        if missing:
            raise InputError(f"has a mesh without {' and '.join(missing)}", self.path)
        points = self._array(has["POSITION"])
        if points.shape[1] != 3:
            raise InputError("has positions of other than three numbers", self.path)
        weights = np.zeros((len(points), n))
        rows = np.arange(len(points))[:, None]
        for i in range(_SETS):
            if f"JOINTS_{i}" in has:
                which = self._places(has[f"JOINTS_{i}"], n, "vertices of joints")
                np.add.at(weights, (rows, which), self._array(has[f"WEIGHTS_{i}"]))
        total = weights.sum(1, keepdims=True)
        if not (total > 1e-6).all():
            raise InputError("has vertices that follow no joint", self.path)
        faces = np.arange(len(points))
        if primitive.indices is not None:
            faces = self._places(primitive.indices, len(points), "triangles of vertices").ravel()
        if len(faces) % 3:
            raise InputError("has triangles of vertices that do not exist", self.path)
        return points, faces.reshape(-1, 3), weights / total

    def _places(self, index: int, count: int, what: str) -> NDArray[np.int64]:
        """Whole numbers of an accessor, all below `count`."""
        places = self._array(index)
        if not ((places >= 0) & (places < count) & (places % 1 == 0)).all():
            raise InputError(f"has {what} that do not exist", self.path)
        return places.astype(np.int64)

    def _array(self, index: int) -> Array:
        """(count, width) numbers of an accessor, normalised where it says so."""
        if index in self.arrays:
            return self.arrays[index]
        accessor = self.document.accessors[_index(index)]
        if accessor.sparse is not None or accessor.buffer_view is None:
            raise InputError("has sparse data, which is not read", self.path)
        view = self.document.buffer_views[_index(accessor.buffer_view)]
        dtype = np.dtype(_COMPONENTS[accessor.component_type])
        width = _WIDTHS[accessor.type]
        step = view.byte_stride or width * dtype.itemsize
        if step < width * dtype.itemsize or accessor.count > 10 * _VERTICES:
            raise InputError(f"has accessor {index}, which multiplies its numbers", self.path)
        start = view.byte_offset + accessor.byte_offset
        data = self._buffer(view.buffer)
        last = start + step * (accessor.count - 1) + width * dtype.itemsize
        if accessor.count < 1 or start < 0 or last > len(data):
            raise InputError(f"is cut short: accessor {index} ends after its buffer", self.path)
        shape, strides = (accessor.count, width), (step, dtype.itemsize)
        raw = np.ndarray(shape, dtype, data, start, strides)
        with np.errstate(invalid="ignore"):  # a NaN that signals; see below
            out = raw.astype(np.float64)
        if accessor.normalized and dtype.kind in "iu":
            out = np.maximum(out / np.iinfo(dtype).max, -1.0)
        if not np.isfinite(out).all():
            raise InputError("holds numbers that are not finite", self.path)
        self.arrays[index] = out
        return out

    def _buffer(self, index: int) -> bytes:
        if index not in self.buffers:
            uri = self.document.buffers[_index(index)].uri
            if uri is None:
                if self.inside is None:
                    raise InputError("lacks its binary part", self.path)
                self.buffers[index] = self.inside
            elif uri.startswith("data:"):
                try:
                    self.buffers[index] = base64.b64decode(uri.partition(",")[2], validate=True)
                except binascii.Error as error:
                    raise InputError(f"has damaged base64 data: {error}", self.path) from error
            else:
                beside = (self.path.parent / unquote(uri)).resolve()
                if not beside.is_relative_to(self.path.parent.resolve()):
                    raise InputError(f"names a file outside of its folder: {shown(uri)}", self.path)
                self.buffers[index] = budget.read(beside, budget.MODELS)
        return self.buffers[index]


def _index(value: int | None) -> int:
    if value is None or value < 0:
        raise IndexError(f"index {value}")
    return value


def _local(node: _Node) -> Array:
    out = np.eye(4)
    if node.matrix is not None:
        return _near(np.array(node.matrix, dtype=np.float64)).reshape(4, 4).T
    x, y, z, w = node.rotation
    size = np.hypot(np.hypot(x, y), np.hypot(z, w))
    if not 0.5 < size < 2:
        raise ValueError(f"a rotation by a quaternion of length {size:.3g}")
    _near(np.array([*node.scale, *node.translation]))
    out[:3, :3] = quaternion_to_matrix([w, x, y, z]) * np.array(node.scale)
    out[:3, 3] = node.translation
    return out


def _near(values: Array) -> Array:
    if not (np.abs(values) < _FAR).all():
        raise ValueError("a node that is too far away")
    return values
