"""How tracks are exported."""

from __future__ import annotations

from dataclasses import dataclass

from handtrack.hand.units import METRES
from handtrack.settings import Settings, setting

UPS = ("y", "x", "z", "-x", "-y", "-z")
"""Axes of the input that may point up; in BVH and glTF it is y."""
TABLES = (".csv", ".parquet", ".npz")
"""Formats of numbers by name."""


@dataclass(frozen=True)
class ExportSettings(Settings):
    """What `export` makes of tracks; each setting says which formats it is for."""

    raw: bool = setting(False, "bvh, glb, urdf, mjcf: poses as fitted, not as filtered.")
    up: str = setting("y", "bvh, glb: the input's axis that points up; it becomes y.", choices=UPS)
    unit: str = setting("cm", "bvh: the unit of length.", choices=tuple(METRES))
    rotations: str = setting(
        "none",
        "csv, parquet, npz: the joints' rotations in the world as well.",
        choices=("none", "quaternion", "matrix", "axis-angle"),
    )
    frame: str = setting(
        "world",
        "csv, parquet, npz: operator adds joints about the wrist as dex-retargeting takes them.",
        choices=("world", "operator"),
    )
