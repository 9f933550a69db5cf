"""`handtrack.load`: joint sequences, and those of the hands in videos and images."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from pathlib import Path
from typing import Any, ParamSpec

from handtrack.errors import SettingsError
from handtrack.files.pictures import pictures_in
from handtrack.sequences import load as joints
from handtrack.sequences.hands import CHOICES
from handtrack.sequences.sequence import Sequence
from handtrack.video.detections import detect, labelled

P = ParamSpec("P")
_OF_JOINTS = ("unit", "order", "format", "mirror", "key", "columns", "time_unit", "image_size")


def check_picture_options(path: Path, given: dict[str, Any]) -> None:
    """Refuse options that pictures have no use for.

    Raises:
        SettingsError: one is given.
    """
    used = [name for name in _OF_JOINTS if given.get(name) is not None]
    if used:
        names = " and ".join("--" + name.replace("_", "-") for name in used)
        raise SettingsError(f"{path}: {names} {'are' if len(used) > 1 else 'is'} for joint"
                            " sequences, not pictures")  # fmt: skip


def _with_pictures(read: Callable[P, list[Sequence]]) -> Callable[P, list[Sequence]]:
    """A reader of joint sequences that looks for hands in pictures as well."""
    signature = inspect.signature(read)

    @functools.wraps(read)
    def load(*args: P.args, **kwargs: P.kwargs) -> list[Sequence]:
        given = signature.bind(*args, **kwargs).arguments
        path = joints.as_path(given["path"])
        if not _holds_pictures(path):
            return read(*args, **kwargs)
        check_picture_options(path, given)
        choice = next((c for c in CHOICES if c == (given.get("hand") or "auto")), None)
        if choice is None:
            raise SettingsError(f"unknown hand, expected one of {', '.join(CHOICES)}")
        found = detect(path, fps=given.get("fps"), frames=given.get("frames"))
        return labelled(found, choice)

    return load


def _holds_pictures(path: Path) -> bool:
    try:
        return path.exists() and pictures_in(path) is not None
    except (OSError, ValueError):  # a name that no file can have
        return False


load = _with_pictures(joints.load)
