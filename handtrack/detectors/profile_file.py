"""Profiles as JSON: those that ship, by name, and the user's, by path."""

from __future__ import annotations

import json
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.detectors.profile import Noise, Profile
from handtrack.errors import InputError, SettingsError, shown
from handtrack.files.texts import parse_json, read_json
from handtrack.files.whole import whole_file
from handtrack.hand.skeleton import JOINT_NAMES

FORMAT, VERSION = "handtrack detector profile", 1
NO_PROFILE = "none"
_SHIPPED = ("mediapipe", "mediapipe-3d")
_WRONG = "is no detector profile"
_MM = 1e3
_ROWS = {"constant_mm": "constant", "fading_mm": "fading", "white_mm": "white", "bone": "bone"}
_NUMBERS = ("fades_s", "view", "finger", "outliers", "scale", "scale_fades_s")
# numbers are written to so many digits
_DIGITS = 4


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
        "offsets": _named(profile.offsets),
        "noise": {name: _named(values) for name, values in rows.items()}
        | {name: round(getattr(noise, name), _DIGITS) for name in _NUMBERS},
        "evidence": dict(profile.evidence),
    }
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")
    return path


def _resource(name: str) -> Any:
    return resources.files("handtrack.detectors") / "data" / f"{name}.json"


def _named(values: NDArray[np.float64]) -> dict[str, Any]:
    return dict(zip(JOINT_NAMES, np.round(values, _DIGITS).tolist(), strict=True))


def _parsed(content: Any, path: Path) -> Profile:
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(f'{_WRONG}: "format" is not "{FORMAT}"', path)
    if content.get("version") != VERSION:
        found = shown(content.get("version"), 40)
        raise InputError(f"is a detector profile of version {found}, expected {VERSION}", path)
    said = _object(content.get("noise"), "noise", path)
    rows = {
        field: _rows(said.get(name), f"noise.{name}", path) / (_MM if name.endswith("mm") else 1.0)
        for name, field in _ROWS.items()
    }
    told: dict[str, Any] = dict(rows)
    told |= {name: _number(said.get(name), f"noise.{name}", path) for name in _NUMBERS}
    offsets = _rows(content.get("offsets"), "offsets", path)
    evidence = _object(content.get("evidence", {}), "evidence", path)
    try:
        return Profile(
            name=shown(content.get("name", path.stem), 80),
            detector=shown(content.get("detector", ""), 80),
            input=shown(content.get("input"), 80),
            offsets=offsets,
            noise=Noise(**told),
            evidence=evidence,
        )
    except InputError as error:
        raise InputError(str(error), path) from None


def _object(value: Any, name: str, path: Path) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{name} is missing or no object", path)
    return value


def _number(value: Any, name: str, path: Path) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < 1e6:
        raise InputError(f"{name} is {shown(value, 40)}, expected a number", path)
    return float(value)


def _rows(value: Any, name: str, path: Path) -> NDArray[np.float64]:
    by_joint = _object(value, name, path)
    if set(by_joint) != set(JOINT_NAMES):
        odd = sorted(set(by_joint) ^ set(JOINT_NAMES))[0]
        raise InputError(
            f"{name} is of another joint set: {shown(odd, 40)} is not in both; expected the 21 of"
            f" handtrack, {JOINT_NAMES[0]} to {JOINT_NAMES[-1]}",
            path,
        )
    wide = name in ("offsets", "noise.bone")
    rows = []
    for joint in JOINT_NAMES:
        given = by_joint[joint]
        numbers = given if isinstance(given, list) else [given]
        if len(numbers) != (3 if wide else 1) or isinstance(given, list) != wide:
            raise InputError(f"{name}.{joint} expects {3 if wide else 1} numbers", path)
        rows.append([_number(x, f"{name}.{joint}", path) for x in numbers])
    return np.array(rows if wide else [row[0] for row in rows])
