"""Which profile holds for a sequence."""

from __future__ import annotations

from collections.abc import Mapping

from handtrack.detectors.profile import NO_PROFILE, Profile, load_profile, shipped
from handtrack.errors import shown
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import without_landmarks

AUTO = "auto"
_IN_PICTURES = {"mediapipe": "mediapipe-3d"}
"""Profiles of one camera's landmarks in space, and of those in its pictures."""


def seen_by(model: HandModel, wanted: str, said: str) -> tuple[HandModel, Profile | None]:
    """A hand with the landmarks of a detector, and its profile; arguments as `chosen_profile`.

    Landmarks that a hand has already, as one from a recording, stay.
    """
    if wanted == NO_PROFILE:
        return without_landmarks(model), None
    profile = chosen_profile(wanted, said)
    if profile is None or model.has_landmarks:
        return model, profile
    return profile.on(model), profile


def in_pictures(model: HandModel, settings: Mapping[str, object]) -> HandModel:
    """A tracked hand with the landmarks that its detector has in pictures.

    What a detector makes of one picture in space is another hand, smaller and bent otherwise,
    than the one that it marks in the picture.

    Args:
        model: the hand.
        settings: the track's.
    """
    used = str(settings.get("detector"))
    name = of_pictures(used)
    return load_profile(name).on(model) if name != used and model.has_landmarks else model


def of_pictures(name: str) -> str:
    """The profile of a detector's landmarks in pictures, by that of one camera's in space."""
    return _IN_PICTURES.get(name, name)


def chosen_profile(wanted: str, said: str) -> Profile | None:
    """The profile to use, or None: joints are joint centres.

    Args:
        wanted: the setting: "auto", "none", the name of a profile or its file.
        said: what the reader says of its detector, or "".

    Raises:
        SettingsError, InputError: as `load_profile`.
    """
    if wanted == NO_PROFILE:
        return None
    if wanted == AUTO:
        return load_profile(said) if said in shipped() else None
    return load_profile(wanted)


def why(wanted: str) -> str:
    """Why a profile is used, for `wanted` as in `chosen_profile`."""
    return "the input is that detector's" if wanted == AUTO else "as asked for"


def told(settings: Mapping[str, object]) -> str:
    """Which profile a track used and why, by its settings; for people."""
    reason = settings.get("detector_why")
    said = f"{shown(str(settings.get('detector')), 80)}"
    if isinstance(reason, str) and reason:
        said += f", {shown(reason, 80)}"
    if settings.get("detector_corrects") is True:
        said += "; joints are corrected before they are fitted, errors are to those as detected"
    return said + " (--detector none: joint centres)"
