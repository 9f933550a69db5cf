"""Files that belong to a source and are not in it: a hand's profile, a headset's way, markers."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Protocol

from handtrack.errors import SettingsError
from handtrack.sequences.readers.raw import Raw


@dataclass(frozen=True)
class Companions:
    """What the caller names beside a source; None: nothing.

    Attributes:
        profile: UmeTrack's description of a hand, which makes joints of its angles.
        trajectory: where Project Aria's device was, which brings its hands into the world.
        markers: which marker of a motion capture file is which joint.
    """

    profile: Path | None = None
    trajectory: Path | None = None
    markers: Path | None = None


class NotTakenError(SettingsError):
    """A companion was named that nothing of a source takes.

    Attributes:
        companion: a field of `Companions`.
    """

    def __init__(self, companion: str, path: Path) -> None:
        super().__init__(f"{path}: nothing in it takes --{companion}")
        self.companion = companion


class Pending(Protocol):
    """What a reader found that makes joints only together with a companion."""

    @property
    def takes(self) -> str:
        """The field of `Companions` that it takes."""

    def resolved(self, raw: Raw, companions: Companions) -> list[Raw]:
        """The hands of it.

        Raises:
            InputError: the companion is missing or does not fit; the message names the option.
        """


def resolved(raws: list[Raw], companions: Companions) -> list[Raw]:
    """The same hands with what their companions tell.

    Raises:
        InputError: a companion that a source needs is missing, or does not fit.
    """
    out: list[Raw] = []
    for raw in raws:
        out += [raw] if raw.pending is None else raw.pending.resolved(raw, companions)
    return out


def check_taken(pending: list[Pending], companions: Companions, path: Path) -> None:
    """Refuse a companion that nothing of a source takes.

    Raises:
        NotTakenError: there is one.
    """
    taken = {one.takes for one in pending}
    for field in fields(companions):
        if getattr(companions, field.name) is not None and field.name not in taken:
            raise NotTakenError(field.name, path)
