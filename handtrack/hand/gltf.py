"""Hands of browsers and headsets: skinned glTF meshes on the 25 joints of WebXR."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, ModelError, SettingsError
from handtrack.hand.axes import local_axes, palm_frame
from handtrack.hand.gltf_file import SkinnedMesh, read_skinned_mesh
from handtrack.hand.limits import Limits
from handtrack.hand.mano_file import hand_named
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_JOINT, HANDS, N_PARTS, ORDERS, PARENTS, Hand

Array = NDArray[np.float64]

_BONES = ("metacarpal", "phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")

JOINTS: tuple[str, ...] = (
    "wrist",
    *(f"thumb-{bone}" for bone in _BONES if bone != "phalanx-intermediate"),
    *(f"{f}-finger-{bone}" for f in ("index", "middle", "ring", "pinky") for bone in _BONES),
)
"""The 25 joints of W3C's WebXR Hand Input, in its order."""

# a joint's -Z points along its bone; a file whose frames are off by more has other ones
_ALONG = np.cos(np.deg2rad(30.0))


def gltf_hand(path: str | Path, hand: Hand | None, limits: Limits, licensed: bool) -> HandModel:
    """The hand of a glTF file, see `HandModel.from_gltf`."""
    path = Path(path)
    if path.is_dir():
        if hand is None:
            raise SettingsError(f"{path}: no hand is named, expected left or right")
        path = _in_folder(path, hand)
    mesh = read_skinned_mesh(path)
    frames = _known_joints(mesh, path)
    joints = frames[list(ORDERS["webxr"]), :3, 3]
    shown = _hand_shown(frames)
    named = hand or hand_named(path) or shown
    if named not in HANDS:
        raise SettingsError(f"{path}: hand is {named!r}, expected left or right")
    if shown != named:
        raise InputError(f"shows a {shown} hand, by its joints' frames, not a {named} one", path)
    try:
        turn = palm_frame(joints, named)
        joints, wrist = (joints - joints[0]) @ turn.T, joints[0]
        axes = _axes(joints, turn @ frames[list(ORDERS["webxr"]), :3, :3], named)
        return HandModel(
            name="gltf",
            hand=named,
            rest_joints=joints,
            axes=axes,
            limits=limits,
            rest_vertices=(mesh.vertices - wrist) @ turn.T,
            faces=mesh.faces.astype(np.int32),
            weights=_weights(mesh),
            licensed=licensed,
        )
    except ModelError as error:
        raise InputError(str(error), path) from error


def _in_folder(folder: Path, hand: Hand) -> Path:
    for suffix in (".glb", ".gltf"):
        if (folder / f"{hand}{suffix}").is_file():
            return folder / f"{hand}{suffix}"
    raise InputError(f"holds no {hand}.glb or {hand}.gltf", folder)


def _known_joints(mesh: SkinnedMesh, path: Path) -> Array:
    """(25, 4, 4) frames of WebXR's joints, scales taken out of their axes."""
    lacking = [name for name in JOINTS if name not in mesh.names]
    if lacking:
        raise InputError(
            f"lacks the joints {', '.join(lacking[:3])}{' ...' * (len(lacking) > 3)} of WebXR's 25"
            f" (it has {', '.join(mesh.names[:3])}{' ...' * (len(mesh.names) > 3)})",
            path,
        )
    frames = mesh.joints[[mesh.names.index(name) for name in JOINTS]].copy()
    length = np.linalg.norm(frames[:, :3, :3], axis=1, keepdims=True)
    if length.min() < 1e-9:
        raise InputError("has joints scaled to nothing", path)
    frames[:, :3, :3] /= length
    size = float(np.linalg.norm(frames[11, :3, 3] - frames[0, :3, 3]))
    if not 0.02 < size < 0.3:
        raise InputError(f"shows a palm {size:.3g} long, expected a hand in metres", path)
    return frames


def _hand_shown(frames: Array) -> Hand:
    """Left or right, as the wrist's frame (Y out of the back, -Z to the fingers) has it."""
    thumb_side = frames[6, :3, 3] - frames[21, :3, 3]
    return "right" if thumb_side @ frames[0, :3, 0] < 0 else "left"


def _axes(joints: Array, frames: Array, hand: Hand) -> Array:
    """Axes by the joints' own frames where they are WebXR's, else by the hand's geometry.

    In WebXR -Z points along the bone and Y out of the back, so that fingers flex about -X.
    """
    axes = local_axes(joints, hand)
    bones = joints[ANGLE_JOINT + 1] - joints[ANGLE_JOINT]
    bones /= np.linalg.norm(bones, axis=1, keepdims=True)
    if (-frames[ANGLE_JOINT, :, 2] * bones).sum(1).min() < _ALONG:
        return axes
    for a in range(len(axes)):
        frame = frames[ANGLE_JOINT[a]]
        if a % 4 == 1:  # abduction, across flexion and bone, to the thumb's side
            axis = np.cross(bones[a], axes[a - 1]) * (1 if hand == "right" else -1)
        else:
            axis = -frame[:, 0] + bones[a] * (frame[:, 0] @ bones[a])
        axes[a] = axis / np.linalg.norm(axis)
    return axes


def _weights(mesh: SkinnedMesh) -> Array:
    """(V, 16): the palm takes the four long metacarpals, each last bone its tip."""
    part = np.zeros(len(JOINTS), np.int64)
    for joint, source in enumerate(ORDERS["webxr"]):
        bone = PARENTS[joint] if joint % 4 == 0 else joint  # a tip goes with its bone
        part[source] = 0 if joint == 0 else 1 + 3 * ((bone - 1) // 4) + (bone - 1) % 4
    out = np.zeros((len(mesh.vertices), N_PARTS))
    for j, name in enumerate(mesh.names):
        # a joint besides WebXR's, an arm or a twist, belongs to the wrist
        out[:, part[JOINTS.index(name)] if name in JOINTS else 0] += mesh.weights[:, j]
    return out
