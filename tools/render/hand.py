"""Pictures of the default hand, drawn by a small z-buffer renderer of our own.

python -m tools.render.hand hand.png --poses flat fist pinch --views dorsal palmar
"""

from __future__ import annotations

import argparse
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import about_axis
from handtrack.hand.skeleton import ANGLE_NAMES, HANDS

Array = NDArray[np.float64]

# degrees by angle name; `fingers_` stands for index..little
POSES: dict[str, dict[str, float]] = {
    "flat": {},
    "fist": {
        "fingers_mcp_flexion": 85,
        "fingers_pip_flexion": 104,
        "fingers_dip_flexion": 70,
        "thumb_cmc_flexion": 2,
        "thumb_cmc_abduction": 13,
        "thumb_mcp_flexion": 47,
        "thumb_ip_flexion": 50,
    },
    "pinch": {
        "fingers_mcp_flexion": 14,
        "fingers_pip_flexion": 20,
        "fingers_dip_flexion": 10,
        "index_mcp_flexion": 49,
        "index_pip_flexion": 55,
        "index_dip_flexion": 32,
        "thumb_cmc_flexion": 12,
        "thumb_cmc_abduction": 10,
        "thumb_mcp_flexion": 22,
        "thumb_ip_flexion": 26,
    },
    "point": {
        "fingers_mcp_flexion": 78,
        "fingers_pip_flexion": 100,
        "fingers_dip_flexion": 65,
        "index_mcp_flexion": 4,
        "index_pip_flexion": 6,
        "index_dip_flexion": 3,
        "thumb_cmc_flexion": 22,
        "thumb_cmc_abduction": 6,
        "thumb_mcp_flexion": 38,
        "thumb_ip_flexion": 42,
    },
    "spread": {
        "index_mcp_abduction": 16,
        "middle_mcp_abduction": 2,
        "ring_mcp_abduction": -10,
        "little_mcp_abduction": -24,
        "thumb_cmc_abduction": 10,
        "thumb_cmc_flexion": -18,
        "thumb_mcp_flexion": -4,
    },
}

# rows: right, up, towards the viewer, in the right hand's root frame
VIEWS: dict[str, tuple[tuple[float, float, float], ...]] = {
    "dorsal": ((0, -1, 0), (1, 0, 0), (0, 0, 1)),
    "palmar": ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    "radial": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "ulnar": ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
    "front": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
}

SKIN = np.array([0.90, 0.66, 0.53])
BACKGROUND = np.array([1.0, 1.0, 1.0])


def pose(name: str) -> Array:
    """(20,) angles of a named pose [rad]; later entries override earlier ones."""
    out = np.zeros(len(ANGLE_NAMES))
    for key, degrees in POSES[name].items():
        suffix = key.removeprefix("fingers")
        for i, angle in enumerate(ANGLE_NAMES):
            if angle == key or (key != suffix and angle.endswith(suffix) and "thumb" not in angle):
                out[i] = np.deg2rad(degrees)
    return out


def posed(model: HandModel, name: str) -> Array:
    """(V, 3) skin of a named pose in the root frame [m]."""
    return model.vertices(pose(name), translation=np.zeros(3))


def view(name: str) -> Array:
    """(3, 3) camera axes of a view; `name+azimuth+elevation` turns it by degrees."""
    base, *turns = name.split("+")
    camera = np.array(VIEWS[base], dtype=np.float64)
    azimuth, elevation = [np.deg2rad(float(t)) for t in turns] + [0.0] * (2 - len(turns))
    turn = about_axis([1.0, 0, 0], elevation) @ about_axis([0, 1.0, 0], azimuth)
    return np.asarray(turn @ camera)


def vertex_normals(vertices: Array, faces: NDArray[np.int32]) -> Array:
    """(V, 3) unit normals, faces weighted by area."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    face = np.cross(b - a, c - a)
    out = np.zeros_like(vertices)
    for i in range(3):
        np.add.at(out, faces[:, i], face)
    return np.asarray(out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-30))


def rasterise(points: Array, faces: NDArray[np.int32], values: Array, size: int) -> Array:
    """Z-buffer of triangles.

    Args:
        points: (V, 3) pixel x, pixel y, depth towards the viewer.
        faces: (F, 3).
        values: (V, C) to interpolate.
        size: side of the picture [pixels].

    Returns:
        (size, size, 2 + C): depth (-inf where nothing is), facing (1 from outside, -1 from
        inside) and values.
    """
    out = np.zeros((size, size, 2 + values.shape[1]))
    out[..., 0] = -np.inf
    for f in faces:
        p = points[f]
        lo = np.maximum(np.ceil(p[:, :2].min(0) - 0.5).astype(int), 0)
        hi = np.minimum(np.floor(p[:, :2].max(0) - 0.5).astype(int), size - 1)
        if (hi < lo).any():
            continue
        (ax, ay), (bx, by), (cx, cy) = p[:, :2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(area) < 1e-12:
            continue
        x = np.arange(lo[0], hi[0] + 1)[None] + 0.5
        y = np.arange(lo[1], hi[1] + 1)[:, None] + 0.5
        w1 = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
        w2 = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
        w0 = 1 - w1 - w2
        z = w0 * p[0, 2] + w1 * p[1, 2] + w2 * p[2, 2]
        tile = out[lo[1] : hi[1] + 1, lo[0] : hi[0] + 1]
        hit = (w0 >= 0) & (w1 >= 0) & (w2 >= 0) & (z > tile[..., 0])
        v = values[f]
        tile[hit, 0] = z[hit]
        tile[hit, 1] = -np.sign(area)  # y runs down
        tile[hit, 2:] = (w0[..., None] * v[0] + w1[..., None] * v[1] + w2[..., None] * v[2])[hit]
    return out


def render(
    vertices: Array,
    faces: NDArray[np.int32],
    camera: Array,
    size: int = 480,
    width: float = 0.22,
    centre: Array | None = None,
) -> Array:
    """Orthographic picture of a mesh under a soft light from above left.

    Args:
        vertices: (V, 3) [m].
        faces: (F, 3), counter-clockwise from outside.
        camera: (3, 3) rows: right, up, towards the viewer.
        size: side of the picture [pixels].
        width: side of what it shows [m].
        centre: (3,) what is in the middle [m]; the middle of the mesh's box by default.

    Returns:
        (size, size, 3) in 0..1.
    """
    big = 2 * size  # drawn at twice the size against jagged edges
    seen = vertices @ camera.T
    middle = 0.5 * (seen.min(0) + seen.max(0)) if centre is None else np.asarray(centre) @ camera.T
    pixel = (seen - middle) * (big / width)
    pixel = np.column_stack([big / 2 + pixel[:, 0], big / 2 - pixel[:, 1], pixel[:, 2]])
    buffer = rasterise(pixel, faces, vertex_normals(vertices, faces) @ camera.T, big)
    depth, back, n = buffer[..., 0], buffer[..., 1] < 0, buffer[..., 2:]
    n = n / np.maximum(np.linalg.norm(n, axis=-1, keepdims=True), 1e-9)
    key = np.array([-0.45, 0.55, 0.70])
    key /= np.linalg.norm(key)
    half = key + np.array([0, 0, 1.0])
    half /= np.linalg.norm(half)
    lambert = np.clip(n @ key, 0, None)
    wrap = np.clip((n @ key + 0.35) / 1.35, 0, None)  # skin lets some light round the edge
    sky = 0.5 + 0.5 * n[..., 1]
    shade = occlusion(depth, big)
    light = (0.34 + 0.16 * sky) * shade + (0.34 * lambert + 0.38 * wrap) * (0.6 + 0.4 * shade)
    gloss = 0.07 * np.clip(n @ half, 0, None) ** 20 * shade
    colour = SKIN * light[..., None] + gloss[..., None]
    # shadows in skin are redder
    colour *= 1 - (1 - shade)[..., None] * np.array([0.0, 0.12, 0.16])
    colour[back & np.isfinite(depth)] = (0.6, 0.1, 0.1)  # the inside, where it shows
    colour = np.where(np.isfinite(depth)[..., None], colour, BACKGROUND)
    colour = colour.reshape(size, 2, size, 2, 3).mean((1, 3))
    return np.asarray(np.clip(colour, 0, 1) ** (1 / 1.35))


def occlusion(depth: Array, size: int) -> Array:
    """Share of open sky of each pixel, from how far its surroundings stand out."""
    known = np.where(np.isfinite(depth), depth, -1e4)
    out = np.zeros_like(depth)
    reach = [max(round(r * size), 1) for r in (0.008, 0.018, 0.035)]
    n = 0
    for r in reach:
        for angle in np.arange(12) * (np.pi / 6) + 0.3 * r:
            dx, dy = round(r * np.cos(angle)), round(r * np.sin(angle))
            rise = np.roll(known, (dy, dx), (0, 1)) - known
            # far-off surfaces in front cast little shade
            blocked = np.clip(rise / r, 0, 1.5) / (1 + (rise / (4.0 * r)) ** 2)
            out += blocked
            n += 1
    return np.asarray(np.clip(1 - 1.1 * out / n, 0.15, 1))


def write_png(path: Path, image: Array) -> None:
    """Write an image (H, W, 3) in 0..1."""
    data = (np.clip(image, 0, 1) * 255 + 0.5).astype(np.uint8)
    # each pixel less the one above (filter 2): smooth shading packs better
    data = np.diff(data, axis=0, prepend=np.zeros_like(data[:1]))
    raw = b"".join(b"\2" + row.tobytes() for row in data)

    def chunk(kind: bytes, body: bytes) -> bytes:
        crc = zlib.crc32(kind + body)
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", crc)

    header = struct.pack(">IIBBBBB", data.shape[1], data.shape[0], 8, 2, 0, 0, 0)
    body = chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + body)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path, help="PNG to write")
    parser.add_argument("--poses", nargs="+", default=list(POSES), choices=list(POSES))
    parser.add_argument("--views", nargs="+", default=["dorsal", "palmar"], metavar="VIEW")
    parser.add_argument("--hand", default="right", choices=HANDS)
    parser.add_argument("--size", type=int, default=420, help="pixels of one picture's side")
    parser.add_argument("--width", type=float, default=0.23, help="metres it shows")
    args = parser.parse_args()
    model = HandModel.default(args.hand)
    rows = []
    for name in args.views:
        camera = view(name)
        cells = [
            render(posed(model, p), model.faces, camera, args.size, args.width) for p in args.poses
        ]
        rows.append(np.concatenate(cells, 1))
    write_png(args.output, np.concatenate(rows))


if __name__ == "__main__":
    main()
