"""How a whole data set is tracked, and what is kept of it."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Protocol

from handtrack import __version__
from handtrack.errors import SettingsError
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import Hand
from handtrack.recording.settings import MeshChoice, RecordingSettings
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.settings import TrackSettings

EXPORTS = ("csv", "parquet", "npz", "mano")
"""What a clip can be exported as, beside its recording."""


class Models(Protocol):
    """Which hand is fitted; it travels to the workers."""

    def of(self, hand: Hand) -> HandModel:
        """The hand that calibration begins with."""

    def subject(self, sequence: Sequence, calibrate: Any) -> tuple[HandModel, Any]:
        """The hand for a sequence, and how it is then to be calibrated."""

    def told(self) -> Mapping[str, object]:
        """What makes it another hand than others, as plain JSON values."""


@dataclass(frozen=True)
class FreeHands:
    """The free default hand, with the limits of that name."""

    limits: str = "anatomical"

    def of(self, hand: Hand) -> HandModel:
        """As `Models`."""
        return HandModel.default(hand, self.limits)

    def subject(self, sequence: Sequence, calibrate: Any) -> tuple[HandModel, Any]:
        """As `Models`."""
        return self.of(sequence.hand), calibrate

    def told(self) -> Mapping[str, object]:
        """As `Models`."""
        return {"limits": self.limits}


@dataclass(frozen=True)
class BatchSettings:
    """How every clip is tracked, and what is kept.

    Attributes:
        tracking: as for `track`.
        models: which hand is fitted.
        reading: options of `handtrack.load` for all clips; what a clip says itself counts more.
        repair: put back hands that were exchanged for a moment.
        pool: find one hand for each subject in several of its clips.
        recordings: write a recording of each clip.
        recording: what goes into it.
        frames: write a table of each clip's frames.
        exports: of `EXPORTS`, written for each clip.
        config: the configuration file that options came from, and what it says; recorded only.

    Raises:
        SettingsError: an export is unknown.
    """

    tracking: TrackSettings = TrackSettings()  # noqa: RUF009
    models: Models = FreeHands()
    reading: Mapping[str, Any] = field(default_factory=dict)
    repair: bool = True
    pool: bool = True
    recordings: bool = True
    recording: RecordingSettings = RecordingSettings(MeshChoice(every=0))  # noqa: RUF009
    frames: bool = False
    exports: tuple[str, ...] = ()
    config: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for name in self.exports:
            if name not in EXPORTS:
                raise SettingsError(
                    f"export {name!r} is unknown, expected one of {', '.join(EXPORTS)}"
                )

    @staticmethod
    def of(settings: BatchSettings | TrackSettings | Mapping[str, Any] | None) -> BatchSettings:
        """The settings of a call: these, those of the tracking, or the tracking's by their names.

        Raises:
            SettingsError: a name is unknown, or a value cannot be used.
        """
        if isinstance(settings, BatchSettings):
            return settings
        return BatchSettings(TrackSettings.of(settings))

    def of_hand(self) -> dict[str, object]:
        """What makes a difference to a subject's hand, as plain JSON values."""
        found = self.tracking.calibration
        return {
            "version": __version__,
            "models": dict(self.models.told()),
            "reading": {name: _plain(value) for name, value in self.reading.items()},
            "repair": self.repair,
            "method": found.by,
            "frames": found.frames,
        }

    def told(self) -> dict[str, object]:
        """All that makes a difference to what is written of a clip, as plain JSON values."""
        recording = self.recording
        return self.of_hand() | {
            "tracking": self.tracking.to_dict(),
            "recordings": [str(recording.mesh), recording.compression, recording.foxglove_mesh]
            if self.recordings
            else None,
            "tables": self.frames,
            "exports": sorted(self.exports),
        }


def digest(of: object) -> str:
    """A short name for plain JSON values: another one whenever something in them differs."""
    text = json.dumps(of, sort_keys=True, default=_plain)
    return hashlib.blake2b(text.encode(), digest_size=12).hexdigest()


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value if _is_json(value) else str(value)


def _is_json(value: Any) -> bool:
    return value is None or isinstance(value, str | int | float | bool | list | dict)
