"""How a subject's hand is found."""

from __future__ import annotations

from dataclasses import dataclass

from handtrack.settings import Settings, setting

METHODS = ("auto", "full", "lengths", "proportions", "scale")
MIN_FRAMES = 10
"""A full calibration from fewer frames would be a guess."""


@dataclass(frozen=True)
class CalibrationSettings(Settings):
    """How a subject's hand is found before it is tracked.

    Attributes:
        method: of `calibrate`; True is "auto", False is "scale", the model's size alone, and
            "none" takes the model as it is.
        frames: how many frames of each sequence to look at closely: those that differ most.

    Raises:
        SettingsError: a value makes no sense.
    """

    method: bool | str = setting(
        True,
        "Find the subject's hand in the sequence: lengths, palm and axes (default; with"
        " --hand-model it is fitted as it is); or only its size.",
        choices=(*METHODS, "none"),
        flat="calibrate",
    )
    frames: int = setting(
        120,
        "How many frames of a sequence a full calibration looks at closely.",
        least=MIN_FRAMES,
        flat="calibration_frames",
        option=False,
        always=False,
    )

    @property
    def by(self) -> str:
        """The method of `calibrate`, or "none"."""
        if isinstance(self.method, bool):
            return "auto" if self.method else "scale"
        return self.method
