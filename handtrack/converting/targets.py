"""The formats that hands are converted to."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from handtrack.errors import SettingsError


class Target(NamedTuple):
    """A format that hands are converted to.

    Attributes:
        ending: of its files.
        together: whether one file holds all hands.
        absolute: whether it keeps the source's times; else they start at 0.
        about: what it holds, for people.
    """

    ending: str
    together: bool
    absolute: bool
    about: str


TARGETS: dict[str, Target] = {
    "npz": Target(".npz", False, True, "NumPy arrays of joints [m]"),
    "csv": Target(".csv", False, True, "a column for each coordinate [mm]"),
    "parquet": Target(".parquet", False, True, "the same columns, in full precision"),
    "lerobot": Target(".parquet", False, False, "a LeRobot episode: 63 numbers a frame [m]"),
    "mcap": Target(".mcap", True, True, "a recording of handtrack: joints and their fit"),
    "openxr": Target(".jsonl", True, True, "OpenXR's 26 joints with orientations"),
    "umetrack": Target(".jsonl", True, True, "UmeTrack's angles as in HOT3D; needs a profile"),
    "mano": Target(".npz", False, True, "MANO parameters; needs your MANO"),
    "egodex": Target(".hdf5", True, False, "visionOS's 25 joints as in EgoDex, 30 frames/s"),
    "trc": Target(".trc", False, False, "OpenSim's marker trajectories [mm]"),
    "bvh": Target(".bvh", False, False, "a skeleton with fingers and its motion"),
    "glb": Target(".glb", True, False, "skinned hands with an animation (glTF)"),
}
_BY_ENDING = {".h5": "egodex"} | {
    target.ending: name for name, target in reversed(TARGETS.items()) if name != "umetrack"
}
_BY_ENDING |= {".npz": "npz", ".parquet": "parquet"}


def target_of(path: Path, to: str | None = None) -> str:
    """The format that a name asks for.

    Raises:
        SettingsError: none, or the name ends otherwise than files of that format.
    """
    if to is None:
        name = _BY_ENDING.get(path.suffix.lower())
        if name is None:
            endings = ", ".join(dict.fromkeys(t.ending for t in TARGETS.values()))
            raise SettingsError(f"{path}: expected a name that ends in {endings}")
        return name
    if to not in TARGETS:
        raise SettingsError(f"{to!r} is no format to convert to: {', '.join(TARGETS)}")
    ending = TARGETS[to].ending
    if path.suffix.lower() != ending and _BY_ENDING.get(path.suffix.lower()) != to:
        raise SettingsError(f"{path}: a file of {to} ends in {ending}")
    return to
