"""A picture of a hand's joint axes: flexion (z, blue) and abduction (y, green), as in Fig. 4 of
Li et al. 2021.

    python -m tools.render.axes axes.png                       # the default hand, and as MANO's
    python -m tools.render.axes axes.png --mano DIR --gltf DIR  # your own hands

Without --mano the free stand-in of tools/make/mano_like.py shows what geometry makes of a rest
skeleton.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_JOINT, BONES, HANDS
from tools.make.mano_like import make_mano_like, write_pickle
from tools.render.hand import render, view, write_png

Array = NDArray[np.float64]

FLEXION, ABDUCTION = np.array([0.10, 0.25, 0.85]), np.array([0.10, 0.60, 0.30])
BONE, JOINT = np.array([0.45, 0.45, 0.45]), np.array([0.15, 0.15, 0.15])
LENGTH = 0.018
"""Of an axis on either side of its joint [m]."""


def draw(model: HandModel, camera: Array, size: int, width: float) -> Array:
    """A faded hand at rest with its bones and axes, (size, size, 3)."""
    v = model.rest_vertices
    centre = 0.5 * (v.min(0) + v.max(0))
    picture = render(v, model.faces, camera, size, width, centre)
    picture = 1 - 0.45 * (1 - picture)
    joints = model.rest_joints

    def line(a: Array, b: Array, colour: Array, thick: float) -> None:
        p, q = size / 2 + (np.stack([a, b]) - centre) @ camera[:2].T * [1, -1] * (size / width)
        y, x = np.mgrid[:size, :size] + 0.5
        d = q - p
        t = np.clip(((x - p[0]) * d[0] + (y - p[1]) * d[1]) / max(d @ d, 1e-9), 0, 1)
        away = np.hypot(x - p[0] - t * d[0], y - p[1] - t * d[1])
        ink = np.clip(thick + 0.5 - away, 0, 1)[..., None]
        picture[:] = picture * (1 - ink) + colour * ink

    for a, b in BONES:
        line(joints[a], joints[b], BONE, 0.8)
    for i, joint in enumerate(ANGLE_JOINT):
        colour, length = (ABDUCTION, 0.7 * LENGTH) if i % 4 == 1 else (FLEXION, LENGTH)
        start, end = joints[joint] - 0.4 * length * model.axes[i], joints[joint]
        end = end + length * model.axes[i]
        line(start, end, colour, 1.2)
        line(end, end, colour, 2.6)  # where it points: a right hand's fingers turn about it
    for joint in joints:
        line(joint, joint, JOINT, 1.8)
    return picture


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", type=Path, help="PNG to write")
    parser.add_argument("--mano", type=Path, help="your MANO file or folder")
    parser.add_argument("--gltf", type=Path, help="a folder with left.glb and right.glb")
    parser.add_argument("--hand", default="right", choices=HANDS)
    parser.add_argument("--views", nargs="+", default=["dorsal", "radial+-35+-15"])
    parser.add_argument("--size", type=int, default=330, help="pixels of one picture's side")
    parser.add_argument("--width", type=float, default=0.22, help="metres it shows")
    args = parser.parse_args()
    models = [HandModel.default(args.hand)]
    if args.mano is None:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"MANO_{args.hand.upper()}.pkl"
            with path.open("wb") as file:
                write_pickle(make_mano_like(args.hand), file)
            models.append(HandModel.from_mano(path))
    else:
        models.append(HandModel.from_mano(args.mano, args.hand))
    if args.gltf is not None:
        models.append(HandModel.from_gltf(args.gltf, args.hand))
    rows = [
        np.concatenate([draw(m, view(name), args.size, args.width) for name in args.views], 1)
        for m in models
    ]
    write_png(args.output, np.concatenate(rows, 0))


if __name__ == "__main__":
    main()
