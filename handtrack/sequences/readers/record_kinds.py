"""Records of other things among those of hands: the header of a log, events of buttons."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from handtrack.errors import InputError
from handtrack.sequences.readers.found import hands_in
from handtrack.sequences.titles import is_frame_number, looks_meant, time_unit

_TAGS = ("type", "event", "kind", "msg_type", "message_type", "record", "record_type", "event_type")


def frames_among(values: Sequence[Any]) -> list[int]:
    """Which records are frames: all but those that a tag tells from the ones with hands, and a
    first one without the time, or the frame's number, that all others have."""
    everything = list(range(len(values)))
    if not all(v is None or isinstance(v, dict) for v in values):
        return everything
    some: dict[str, Any] = next((v for v in values if v), {})
    tag = next((key for key in _TAGS if isinstance(some.get(key), str)), None)
    out = everything
    if tag is not None:
        kinds: dict[str, bool] = {}
        for value in values:
            said = value.get(tag) if value else None
            if isinstance(said, str) and not kinds.get(said):
                kinds[said] = bool(hands_in(value))
        if any(kinds.values()) and not all(kinds.values()):
            out = [i for i in everything if not values[i] or kinds.get(values[i].get(tag), True)]
    if len(out) == len(values) and _is_header(values):
        out = everything[1:]
    return out


def _is_header(values: Sequence[Any]) -> bool:
    """Whether the first record tells of the file, as it has no time where all others have one."""
    if len(values) < 3 or not values[0] or not all(values[1:3]):
        return False
    if hands_in(values[0]) or not all(hands_in(v) for v in values[1:3]):
        return False
    counted = [{k for k in v if _counts(str(k))} for v in values[:3]]
    return not counted[0] and bool(counted[1] & counted[2])


def _counts(key: str) -> bool:
    return time_unit(key) is not None or is_frame_number(key)


def refuse_meant(values: Sequence[Any], places: Sequence[str], path: Path) -> None:
    """Refuse keys that look like a time or a hand and are not understood."""
    kinds = {tuple(v): i for i, v in reversed(list(enumerate(values))) if isinstance(v, dict)}
    for keys, i in kinds.items():
        for key in keys:
            if values[i][key] is None or time_unit(str(key)) is not None:
                continue
            kind = looks_meant(str(key))
            if kind in ("a time", "a hand") and isinstance(values[i][key], int | float | str):
                raise InputError(
                    f"{places[i]}: {str(key)[:40]!r} looks like {kind} and is not understood: name"
                    f" it {'time_s' if kind == 'a time' else 'hand'}, or leave it out",
                    path,
                )
