"""hand.json: a subject's calibrated hand in a file that says what is in it.

The skin is not in it: it is that of the hand that the calibration began with, brought to the
subject's joints. Of MANO only the user's file and the shape coefficients are named.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, ModelError, shown
from handtrack.files.texts import read_json
from handtrack.files.whole import whole_file
from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import reshaped
from handtrack.hand.skeleton import ANGLE_NAMES, HANDS, JOINT_NAMES, Hand

Array = NDArray[np.float64]

FORMAT, VERSION = "handtrack hand", 1
BASES = ("default", "mano", "gltf")
_LONGEST, _FAR, _UNIT = 4096, 1e6, 1e-3


@dataclass(frozen=True, eq=False)
class HandFile:
    """What a hand file holds.

    Attributes:
        hand: "left" or "right".
        base: whose skin it has: "default", "mano" or "gltf".
        base_file: the user's file of that base, or "".
        joints: (21, 3) at rest, in the root frame [m].
        axes: (20, 3) unit axes.
        limits: of the angles.
        thumb_twist: as in HandModel.
        shape: (S,) the base's shape coefficients.
        calibration: what made it: plain JSON values by name.
    """

    hand: Hand
    base: str
    base_file: str
    joints: Array
    axes: Array
    limits: Limits
    thumb_twist: float
    shape: Array
    calibration: Mapping[str, Any]


def save_hand(
    model: HandModel,
    path: str | Path,
    calibration: Mapping[str, Any] | None = None,
    base: str = "default",
    base_file: str | Path = "",
) -> Path:
    """Write a hand; the file appears whole or not at all.

    Args:
        model: the subject's hand.
        path: the file, usually hand.json.
        calibration: what made it: plain JSON values by name, such as `Calibration.summary()`.
        base: the hand that the calibration began with: "default", "mano" or "gltf".
        base_file: the user's file of MANO or of the glTF hand.

    Raises:
        ModelError: an unknown base, or one that needs its file without it.
        HandtrackError: writing failed.
    """
    path = Path(path)
    if base not in BASES:
        raise ModelError(f"base {base!r} is unknown, expected one of {', '.join(BASES)}")
    if base != "default" and not str(base_file):
        raise ModelError(f"a hand from {base} needs the name of its file")
    content = {
        "format": FORMAT,
        "version": VERSION,
        "hand": model.hand,
        "base": {"name": base, "file": str(base_file), "shape": model.shape.tolist()},
        "units": "metres and radians, in the root frame: x to the fingertips, z out of the back",
        "joints": dict(zip(JOINT_NAMES, model.rest_joints.tolist(), strict=True)),
        "axes": dict(zip(ANGLE_NAMES, model.axes.tolist(), strict=True)),
        "thumb_twist": model.thumb_twist,
        "limits": {
            "name": model.limits.name,
            "lower": dict(zip(ANGLE_NAMES, model.limits.lower.tolist(), strict=True)),
            "upper": dict(zip(ANGLE_NAMES, model.limits.upper.tolist(), strict=True)),
        },
        "calibration": dict(calibration or {}),
    }
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


def read_hand(path: str | Path) -> HandFile:
    """What stands in a hand file.

    Raises:
        InputError: it is not there, is no hand file, is of another version, or something in it
            is missing or wrong; the message says what.
    """
    path = Path(path)
    content = read_json(path, "is no hand file")
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f'is no hand file: "format" is not "{FORMAT}"', path)
    if content.get("version") != VERSION:
        raise InputError(
            f"is a hand file of version {shown(content.get('version'), 40)}, expected {VERSION}",
            path,
        )
    read = _Reader(path, content)
    hand = content.get("hand")
    if hand not in HANDS:
        raise InputError(f"hand is {shown(hand, 40)}, expected left or right", path)
    base = read.object("base")
    if base.get("name") not in BASES:
        name = shown(base.get("name"), 40)
        raise InputError(f"base is {name}, expected {', '.join(BASES)}", path)
    limits = read.object("limits")
    return HandFile(
        hand,
        str(base["name"]),
        read.text(base, "file"),
        read.rows(content, "joints", JOINT_NAMES, (3,)),
        read.rows(content, "axes", ANGLE_NAMES, (3,)),
        Limits(
            read.text(limits, "name"),
            read.rows(limits, "lower", ANGLE_NAMES, ()),
            read.rows(limits, "upper", ANGLE_NAMES, ()),
        ),
        float(read.numbers(content.get("thumb_twist"), "thumb_twist", ())),
        read.numbers(base.get("shape", []), "base.shape", None),
        read.object("calibration"),
    )


def load_hand(path: str | Path, base: HandModel | None = None) -> HandModel:
    """The hand of a file, with its skin.

    Args:
        path: as `save_hand` wrote it.
        base: the hand that lends its skin; by default the one that the file names.

    Raises:
        InputError: as `read_hand`, or `base` is of the other hand, or the file that it names
            is not there.
        ModelError: what stands in it is no hand.
    """
    stored = read_hand(path)
    if base is None:
        try:
            base = _base_of(stored)
        except InputError as error:
            raise InputError(f"its {stored.base} hand: {error}", path) from error
    if base.hand != stored.hand:
        raise InputError(f"is a {stored.hand} hand, the model a {base.hand} one", path)
    if not np.array_equal(base.rest_joints, stored.joints):
        base = reshaped(base, stored.joints)
    lengths = np.linalg.norm(stored.axes, axis=1, keepdims=True)
    if np.abs(lengths - 1).max() > _UNIT:
        raise InputError("axes holds one that is not of length 1", path)
    axes = stored.axes / lengths
    return replace(
        base,
        axes=stored.axes if np.abs(axes - stored.axes).max() < 1e-9 else axes,
        limits=stored.limits,
        thumb_twist=stored.thumb_twist,
        shape=stored.shape,
    )


def _base_of(stored: HandFile) -> HandModel:
    if stored.base == "default":
        return HandModel.default(stored.hand)
    if stored.base == "gltf":
        return HandModel.from_gltf(stored.base_file, stored.hand)
    return HandModel.from_mano(stored.base_file, stored.hand, betas=stored.shape)


class _Reader:
    """Values of a hand file, checked."""

    def __init__(self, path: Path, content: dict[str, Any]):
        self._path, self._content = path, content

    def object(self, name: str) -> dict[str, Any]:
        value = self._content.get(name)
        if not isinstance(value, dict):
            raise InputError(f"{name} is missing or no object", self._path)
        return value

    def text(self, within: Mapping[str, Any], name: str) -> str:
        value = within.get(name, "")
        if not isinstance(value, str) or len(value) > _LONGEST:
            raise InputError(f"{name} is {shown(value, 40)}, expected a name", self._path)
        return value

    def numbers(self, value: Any, name: str, shape: tuple[int, ...] | None) -> Array:
        flat = value if isinstance(value, list) else [value]
        if any(isinstance(x, bool) or not isinstance(x, int | float) for x in flat):
            raise InputError(f"{name} is {shown(value, 40)}, expected numbers", self._path)
        # numbers of any length may stand there
        if any(not abs(x) < _FAR for x in flat):
            raise InputError(f"{name} holds a number that is not finite", self._path)
        array = np.array(value, dtype=np.float64)
        if shape is not None and array.shape != shape:
            wanted = "one number" if shape == () else f"{shape[0]} numbers"
            raise InputError(f"{name} has {array.size} numbers, expected {wanted}", self._path)
        return array

    def rows(
        self, within: Mapping[str, Any], name: str, names: tuple[str, ...], shape: tuple[int, ...]
    ) -> Array:
        value = within.get(name)
        if not isinstance(value, dict):
            raise InputError(f"{name} is missing or no object", self._path)
        for wanted in names:
            if wanted not in value:
                raise InputError(f"{name} lacks {wanted}", self._path)
        return np.array([self.numbers(value[n], f"{name}.{n}", shape) for n in names])
