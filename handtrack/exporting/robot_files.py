"""The files of a hand as a robot: URDF or MJCF, its meshes, and how its joints move."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.exporting.robot import Link, links, write_stl
from handtrack.exporting.robot_xml import mjcf, urdf
from handtrack.files.whole import whole_file
from handtrack.hand.capsules import bone_joints, capsule_radii, contact_depths, contacts
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.tracking.track import Track

Array = NDArray[np.float64]

WRIST = JOINT_NAMES[0]
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_/-]*")


def check_base(base: str) -> None:
    """Refuse a name that no frame above the wrist can have.

    Raises:
        SettingsError: it is no name, or that of another joint.
    """
    if not _NAME.fullmatch(base) or base in JOINT_NAMES[1:]:
        raise SettingsError(
            f"base is {base!r}, expected wrist or the name of the frame that the input is in,"
            " as world or camera"
        )


def moves_file(path: Path) -> Path:
    """Where the motion of a robot's joints is, beside its document."""
    return path.with_name(f"{_beside(path)}_joints.csv")


def _beside(path: Path) -> str:
    """What the files beside a document begin with: each document has its own, as hand.urdf and
    hand.xml may be of other bases and hands."""
    kind = path.suffix.lower()
    return path.stem if kind == ".urdf" else f"{path.stem}_{kind.removeprefix('.')}"


def write_robot(
    track: Track, part: Path, path: Path, origin_ns: int, *, raw: bool = False, base: str = WRIST
) -> list[str]:
    """Write a hand as URDF, or MJCF where the path does not end in .urdf.

    Beside it come `NAME_meshes/LINK.stl`, of a hand with a skin, and `NAME_joints.csv` (of MJCF
    `NAME_xml_meshes` and `NAME_xml_joints.csv`, by its ending): a row for
    each frame with `time_s`, with a base other than the wrist the wrist's pose in it (`x`, `y`,
    `z` [m], `qw` ... `qz`), and an angle [rad] for each hinge by its name; empty where the hand
    is lost.

    Args:
        track: whose model and motion.
        part: where to write the document.
        path: the name that it will have; the others are named after it.
        origin_ns: what becomes time zero [ns].
        raw: the motion as fitted, not as filtered.
        base: "wrist": the hand's root is fixed; else the name of the frame that the input is in,
            in which the wrist floats.

    Returns:
        What a user should know.

    Raises:
        SettingsError: the base is no name.
        InputError: the folder for the meshes cannot be made.
    """
    check_base(base)
    model = track.model
    body = links(model)
    folder = path.with_name(f"{_beside(path)}_meshes")
    meshes = _write_meshes(body, folder)
    name = f"handtrack_{model.hand}"
    if path.suffix.lower() == ".urdf":
        document = urdf(name, body, base, meshes)
    else:
        document = mjcf(name, body, base, meshes, _may_touch(model))
    document.write(part, encoding="utf-8", xml_declaration=True)
    moves = moves_file(path)
    _write_moves(track, body, moves, origin_ns, raw, base)
    notes = [f"joints by time in {moves.name}"]
    if meshes:
        notes.append(f"{len(meshes)} meshes in {folder.name}")
        if model.licensed:
            notes.append("the skin is licensed: it may not be passed on")
    else:
        notes.append(f"the {model.name} model has no skin here: capsules are shown instead")
    return [*notes, "saddles have boxes for limits, not ellipses"]


def _write_meshes(body: list[Link], folder: Path) -> dict[str, str]:
    """Write the skins; the file of each link, relative to the document."""
    files = {}
    for link in body:
        if link.mesh is None:
            continue
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise InputError(f"cannot be made: {error.strerror or error}", folder) from error
        with whole_file(folder / f"{link.name}.stl") as part:
            write_stl(link.mesh, part)
        files[link.name] = f"{folder.name}/{link.name}.stl"
    return files


def _may_touch(model: HandModel) -> set[frozenset[str]]:
    """Pairs of links that push each other away: not those that do so in the flat hand."""
    pairs = contacts(model)
    bones = pairs[:, :2].astype(int)
    radii = capsule_radii(model)[bones].sum(1)
    whole = np.column_stack([pairs[:, :2], radii, pairs[:, 3:]])
    apart = contact_depths(model.rest_joints[None], whole)[0] < 0
    names = [JOINT_NAMES[first] for first, _ in bone_joints()]
    touching = {frozenset((names[a], names[b])) for a, b in bones[~apart]}
    return {frozenset((names[a], names[b])) for a, b in bones} - touching


def hinge_angles(body: list[Link], angles: Array) -> dict[str, Array]:
    """(T,) angle of each hinge by name [rad], of angles (T, 20)."""
    hinges = [hinge for link in body for hinge in link.hinges]
    free = [hinge.name for hinge in hinges if not hinge.follows]
    found = dict(zip(free, angles.T, strict=True))
    return {h.name: found[h.name] if not h.follows else h.share * found[h.follows] for h in hinges}


def _write_moves(
    track: Track, body: list[Link], path: Path, origin_ns: int, raw: bool, base: str
) -> None:
    import pyarrow
    from pyarrow import csv

    columns = {"time_s": (track.time_ns - origin_ns) * 1e-9}
    if base != WRIST:
        quaternion = track.quaternion_raw if raw else track.quaternion
        translation = track.translation_raw if raw else track.translation
        wrist = quaternion_to_matrix(quaternion) @ track.model.rest_joints[0] + translation
        columns |= dict(zip("xyz", wrist.T, strict=True))
        columns |= dict(zip(("qw", "qx", "qy", "qz"), quaternion.T, strict=True))
    columns |= hinge_angles(body, track.angles_raw if raw else track.angles)
    arrays = {
        name: pyarrow.array(np.round(values, 9), mask=~np.isfinite(values))
        for name, values in columns.items()
    }
    with whole_file(path) as part:
        csv.write_csv(pyarrow.table(arrays), part, csv.WriteOptions(quoting_style="needed"))
