"""Recordings in the formats of other programs, chosen by the ending of the file's name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from handtrack import __version__
from handtrack.errors import SettingsError
from handtrack.exporting.arrays import write_npz
from handtrack.exporting.bvh import write_bvh
from handtrack.exporting.gltf import Hand, write_glb
from handtrack.exporting.motion import motion
from handtrack.exporting.robot_files import WRIST, check_base, moves_file, write_robot
from handtrack.exporting.settings import TABLES, ExportSettings
from handtrack.exporting.table import write_csv, write_parquet
from handtrack.files.whole import whole_file
from handtrack.mcap.hand import hand_topics
from handtrack.tracking.track import Track, tracks_of

ROBOTS = (".urdf", ".xml", ".mjcf")
FORMATS = (".csv", ".parquet", ".npz", ".bvh", ".glb", *ROBOTS)

_LOST = {
    ".csv": "empty cells in {}",
    ".parquet": "null in {}",
    ".npz": "NaN in {}",
    ".bvh": "the last pose held in {}",
    ".glb": "the last pose held in {}",
    **dict.fromkeys(ROBOTS, "empty cells in {}"),
}


class Exported(NamedTuple):
    """A file that was written.

    Attributes:
        path: the file.
        hands: the hands in it, as "right" or "person0_left".
        frames: how many frames it has, over all its hands.
        lost: how many of them have no pose.
        notes: what a user should know of it.
    """

    path: Path
    hands: tuple[str, ...]
    frames: int
    lost: int
    notes: tuple[str, ...]


def targets(tracks: Sequence[Track], path: Path) -> list[Path]:
    """The files that `export` writes of tracks, when it is given that name."""
    files = [file for file, _ in _groups([t for t in tracks if len(t)], path)]
    if path.suffix.lower() in ROBOTS:
        files += [moves_file(file) for file in files]
    return files


def _groups(tracks: Sequence[Track], path: Path) -> list[tuple[Path, list[tuple[str, Track]]]]:
    """Which named tracks go into which file."""
    named = list(zip(hand_topics((t.name, t.hand) for t in tracks), tracks, strict=True))
    if path.suffix.lower() == ".glb" or len(tracks) < 2:
        return [(path, named)]
    return [(path.with_stem(f"{path.stem}_{name}"), [(name, t)]) for name, t in named]


def export(
    tracks: Track | Sequence[Track],
    path: str | Path,
    *,
    raw: bool = False,
    up: str = "y",
    unit: str = "cm",
    base: str = WRIST,
    rotations: str | None = None,
    frame: str = "world",
) -> list[Exported]:
    """Write tracks for other programs, in the format that the file's ending names.

    ======== ================================================================================
    .csv     a line for each frame: angles [deg], joints and errors [mm], status; see `columns`
    .parquet the same columns, in full precision
    .npz     all arrays, with units in their names; see `arrays`
    .bvh     a skeleton with fingers and its motion; see `write_bvh`
    .glb     skinned hands with an animation, all hands in one file; see `write_glb`
    .urdf    the hand as a robot with meshes and joints over time; see `write_robot`
    .xml     the same for MuJoCo (MJCF), or .mjcf
    ======== ================================================================================

    Of several hands each gets a file of its own, NAME_right.csv and NAME_left.csv, but for
    .glb. Files appear whole or not at all.

    Args:
        tracks: one track or several of one recording, which start the time together.
        path: the file to write.
        raw: .bvh, .glb and robots: move as fitted instead of as filtered.
        up: .bvh and .glb: the axis of the input's frame that points up ("y", "z", "-y" ...);
            it becomes their y.
        unit: .bvh: the unit of length, "cm", "m" or "mm".
        base: robots: "wrist", or the name of the frame that the input is in, for the wrist to
            float in.
        rotations: .csv, .parquet and .npz: the joints' rotations in the world as well, as
            "quaternion", "matrix" or "axis-angle" (see `joint_rotations`).
        frame: the same: "operator" adds joints about the wrist as dex-retargeting takes them (see
            `operator_frame`).

    Returns:
        What was written.

    Raises:
        SettingsError: there is no track, the ending is unknown, or an argument makes no sense.
        InputError: nothing of a hand can be animated, or the folder is missing.
        HandtrackError: writing failed.
    """
    tracks = tracks_of(tracks)
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise SettingsError(f"{path}: expected a name that ends in {', '.join(FORMATS)}")
    check_base(base)
    settings = ExportSettings(raw, up, unit, rotations or "none", frame)
    if kind not in TABLES and (settings.rotations, frame) != ("none", "world"):
        raise SettingsError(f"{path}: rotations and frame are for {', '.join(TABLES)}")
    tracks = [t for t in tracks if len(t)]
    if not tracks:
        raise SettingsError("there is nothing to export: no track has a frame")
    origin = min(int(t.time_ns[0]) for t in tracks)
    written = []
    for file, group in _groups(tracks, path):
        with whole_file(file) as part:
            if kind in ROBOTS:
                ((_, track),) = group
                notes = write_robot(track, part, file, origin, raw=raw, base=base)
            else:
                notes = _write(kind, group, part, origin, settings)
        lost = sum(int(np.isnan(t.angles).any(1).sum()) for _, t in group)
        if lost:
            notes.insert(0, _LOST[kind].format(f"{lost} lost frame{'s' * (lost > 1)}"))
        hands = tuple(name for name, _ in group)
        frames = sum(len(t) for _, t in group)
        written.append(Exported(file, hands, frames, lost, tuple(notes)))
    return written


def _write(
    kind: str,
    group: list[tuple[str, Track]],
    part: Path,
    origin: int,
    settings: ExportSettings,
) -> list[str]:
    """Write a group of named hands; what should be known of the file."""
    notes = []
    raw, up, unit = settings.raw, settings.up, settings.unit
    rotations = None if settings.rotations == "none" else settings.rotations
    if kind == ".glb":
        hands = [Hand(n, t.model, motion(t, origin, raw=raw, up=up)) for n, t in group]
        notes.append(write_glb(hands, part, f"handtrack {__version__}"))
        if any(h.model.licensed and len(h.model.rest_vertices) for h in hands):
            notes.append("the skin is licensed: it may not be passed on")
        if any(h.model.pose_blend is not None for h in hands):
            notes.append("without pose blend shapes, which glTF has no place for")
    else:
        ((_, track),) = group
        if kind == ".csv":
            write_csv(track, part, origin, rotations, settings.frame)
        elif kind == ".parquet":
            write_parquet(track, part, origin, rotations, settings.frame)
        elif kind == ".npz":
            write_npz(track, part, rotations, settings.frame)
        else:
            moved = motion(track, origin, raw=raw, up=up)
            notes += [f"in {unit}", write_bvh(track.model, moved, part, unit)]
    return [note for note in notes if note]
