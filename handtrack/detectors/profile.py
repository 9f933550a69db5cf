"""Detector profiles: where a detector's landmarks lie about the joints, and how it errs."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.detectors.correction import Correction
from handtrack.detectors.profile_file import (
    DIGITS,
    as_number,
    as_object,
    as_rows,
    named,
    read_correction,
    written_correction,
)
from handtrack.errors import InputError, SettingsError, shown
from handtrack.files.texts import parse_json, read_json
from handtrack.files.whole import whole_file
from handtrack.hand.axes import rest_frames
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS, Hand

Array = NDArray[np.float64]

ONE_CAMERA, IN_SPACE = "one camera", "in space"
INPUTS = (ONE_CAMERA, IN_SPACE)
"""What joints a profile is of: one camera's, about the hand's middle and of its own size in each
frame; or in space, triangulated or a 3D detector's."""


@dataclass(frozen=True, eq=False)
class Noise:
    """How landmarks err about where the offsets expect them.

    Each coordinate's error is a sum of three: one that lasts the whole sequence (the subject's own
    offset), one that fades (an AR(1) process whose correlation is exp(-dt / `fades_s`)), and one
    that is new in every frame.

    Attributes:
        constant, fading, white: (21,) standard deviations per coordinate, root mean square over
            directions [m].
        fades_s: time after which the fading error is correlated by 1/e [s].
        bone: (21, 3) what the deviation is along the bone, towards the thumb's side and along
            their normal, over its root mean square.
        view: deviation along the viewing direction over that across it; 1 where there is no one
            direction.
        finger: correlation of the errors of neighbouring joints of a finger.
        outliers: share of landmarks beyond four deviations of the rest.
        scale: deviation of the logarithm of the hand's size from frame to frame in a sequence.
        scale_fades_s: as `fades_s`, of the size [s].
        size: deviation of the logarithm of the hand's size from one sequence to another.
    """

    constant: Array
    fading: Array
    white: Array
    fades_s: float
    bone: Array = field(default_factory=lambda: np.ones((N_JOINTS, 3)))
    view: float = 1.0
    finger: float = 0.0
    outliers: float = 0.0
    scale: float = 0.0
    scale_fades_s: float = 0.5
    size: float = 0.0

    def __post_init__(self) -> None:
        for name, shape in {
            "constant": (N_JOINTS,),
            "fading": (N_JOINTS,),
            "white": (N_JOINTS,),
            "bone": (N_JOINTS, 3),
            "fades_s": (),
            "view": (),
            "finger": (),
            "outliers": (),
            "scale": (),
            "scale_fades_s": (),
            "size": (),
        }.items():
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != shape:
                raise InputError(f"noise.{name} has shape {value.shape}, expected {shape}")
            if not np.isfinite(value).all() or (name != "finger" and (value < 0).any()):
                raise InputError(f"noise.{name} holds a number that is negative or not finite")
            if shape:
                value.flags.writeable = False
            object.__setattr__(self, name, value if shape else float(value))

    @property
    def lasting(self) -> Array:
        """(21,) deviation of all that is not new in every frame [m]."""
        return np.asarray(np.hypot(self.constant, self.fading))

    @property
    def total(self) -> Array:
        """(21,) deviation of a landmark [m]."""
        return np.asarray(np.hypot(self.lasting, self.white))

    def correlation(self, dt_s: float) -> float:
        """Of the fading error after a time [s]."""
        return float(np.exp(-dt_s / self.fades_s)) if self.fades_s > 0 else 0.0


@dataclass(frozen=True, eq=False)
class Profile:
    """A detector's landmarks against joint centres.

    Attributes:
        name: of the profile.
        detector: which program's landmarks.
        input: one of `INPUTS`.
        offsets: (21, 3) from joint centre to landmark, in the frame of the bone that arrives at
            the joint (`axes.rest_frames`: along it, towards the thumb's side, out of the
            back), in palm lengths (`HandModel.size`). For left hands alike.
        noise: what is left.
        evidence: what it was estimated from, and what it gained: plain JSON values by name.
        correction: how errors go with the pose that the detector sees; its noise is then what
            is left of corrected landmarks. None where that is not known.
    """

    name: str
    detector: str
    input: str
    offsets: Array
    noise: Noise
    evidence: Mapping[str, Any] = field(default_factory=dict)
    correction: Correction | None = None

    def __post_init__(self) -> None:
        if self.input not in INPUTS:
            raise InputError(f"input is {self.input!r}, expected one of {', '.join(INPUTS)}")
        offsets = np.array(self.offsets, dtype=np.float64)
        if offsets.shape != (N_JOINTS, 3) or not np.isfinite(offsets).all():
            raise InputError(f"offsets have shape {offsets.shape}, expected (21, 3) finite numbers")
        offsets.flags.writeable = False
        object.__setattr__(self, "offsets", offsets)

    def on(self, model: HandModel) -> HandModel:
        """The hand with this detector's landmarks: fits bring those onto the joints observed."""
        frames = rest_frames(model.rest_joints, model.hand)
        moved = np.einsum("jik,jk->ji", frames, self.offsets) * model.size
        return replace(model, landmark_offsets=moved)

    def corrected(self, joints: Array, hand: Hand) -> Array:
        """(T, 21, 3) joints as detected, without what goes with the pose [m]; NaN = missing."""
        return joints if self.correction is None else self.correction.of(joints, hand)


FORMAT, VERSION = "handtrack detector profile", 1
NO_PROFILE = "none"
_SHIPPED = ("mediapipe", "mediapipe-3d")
_WRONG = "is no detector profile"
_MM = 1e3
_ROWS = {"constant_mm": "constant", "fading_mm": "fading", "white_mm": "white", "bone": "bone"}
_NUMBERS = ("fades_s", "view", "finger", "outliers", "scale", "scale_fades_s")
# profiles that were written before it had a name do not tell it
_SIZE = "size"
_LIST = re.compile(r"\[[^\[\]{}\"]*\]")


def shipped() -> tuple[str, ...]:
    """Names of the profiles that ship with the project."""
    return tuple(name for name in _SHIPPED if _resource(name).is_file())


def load_profile(name: str | Path) -> Profile:
    """A profile that ships, by its name, or that of a file.

    Raises:
        SettingsError: it is neither.
        InputError: the file is no profile, of another version or joint set, or something in it
            is missing or wrong; the message says what.
    """
    if str(name) in _SHIPPED and _resource(str(name)).is_file():
        path = Path(f"{name}.json")
        text = _resource(str(name)).read_text(encoding="utf-8")
        return _parsed(parse_json(text, path, _WRONG), path)
    path = Path(name)
    if not path.suffix and not path.exists():
        known = ", ".join((*shipped(), NO_PROFILE))
        raise SettingsError(
            f"detector {shown(str(name))!r} is unknown, expected {known} or a profile's file"
        )
    return _parsed(read_json(path, _WRONG), path)


def save_profile(profile: Profile, path: str | Path) -> Path:
    """Write a profile; the file appears whole or not at all.

    Raises:
        HandtrackError: writing failed.
    """
    path, noise = Path(path), profile.noise
    rows = {
        "constant_mm": _MM * noise.constant,
        "fading_mm": _MM * noise.fading,
        "white_mm": _MM * noise.white,
        "bone": noise.bone,
    }
    content = {
        "format": FORMAT,
        "version": VERSION,
        "name": profile.name,
        "detector": profile.detector,
        "input": profile.input,
        "units": "offsets: palm lengths, along the bone, towards the thumb's side, out of the back",
        "offsets": named(profile.offsets),
        "noise": {name: named(values) for name, values in rows.items()}
        | {name: round(getattr(noise, name), DIGITS) for name in (*_NUMBERS, _SIZE)},
        "evidence": dict(profile.evidence),
    }
    if profile.correction is not None:
        content["correction"] = written_correction(profile.correction)
    text = _LIST.sub(_on_a_line, json.dumps(content, indent=1, allow_nan=False)) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


def _on_a_line(numbers: re.Match[str]) -> str:
    return re.sub(r"\s+", " ", numbers[0]).replace("[ ", "[").replace(" ]", "]")


def _resource(name: str) -> Any:
    return resources.files("handtrack.detectors") / "data" / f"{name}.json"


def _parsed(content: Any, path: Path) -> Profile:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f'{_WRONG}: "format" is not "{FORMAT}"', path)
    if content.get("version") != VERSION:
        found = shown(content.get("version"), 40)
        raise InputError(f"is a detector profile of version {found}, expected {VERSION}", path)
    said = as_object(content.get("noise"), "noise", path)
    rows = {
        field: as_rows(said.get(name), f"noise.{name}", path)
        / (_MM if name.endswith("mm") else 1.0)
        for name, field in _ROWS.items()
    }
    told: dict[str, Any] = dict(rows)
    told |= {name: as_number(said.get(name), f"noise.{name}", path) for name in _NUMBERS}
    told[_SIZE] = as_number(said.get(_SIZE, 0.0), f"noise.{_SIZE}", path)
    offsets = as_rows(content.get("offsets"), "offsets", path)
    evidence = as_object(content.get("evidence", {}), "evidence", path)
    try:
        return Profile(
            name=shown(content.get("name", path.stem), 80),
            detector=shown(content.get("detector", ""), 80),
            input=shown(content.get("input"), 80),
            offsets=offsets,
            noise=Noise(**told),
            evidence=evidence,
            correction=read_correction(content.get("correction"), path),
        )
    except InputError as error:
        raise InputError(str(error), path) from None
