"""Which profile holds for a sequence."""

from __future__ import annotations

from handtrack.detectors.profile import Profile
from handtrack.detectors.profile_file import NO_PROFILE, load_profile, shipped

AUTO = "auto"


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
