"""How a sequence is tracked: all settings of a tracker in one object."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from handtrack.calibration.settings import CalibrationSettings
from handtrack.errors import SettingsError
from handtrack.fitting.settings import FitSettings
from handtrack.settings import Settings, setting

FILTERS = ("none", "kalman", "one-euro", "fixed-lag", "rts")
WAITING = ("fixed-lag", "rts")
"""Filters that give a frame when later ones are known."""
ENGINES = ("compiled", "filterpy")


@dataclass(frozen=True)
class FilterSettings(Settings):
    """Which filter steadies the poses, and how; the joints' noise and loss are the fit's.

    Attributes:
        name: "none"; "kalman", "one-euro": causal; "fixed-lag": smoothed by the next frames, so
            its results come `lag` frames later; "rts": smoothed by the whole sequence.
        lag: frames that "fixed-lag" waits.
        process_noise: "auto", learnt from the motion, or a factor on the usual accelerations.
        noise_colour: "white" where the joints' noise is new in every frame, or how long some of it
            lasts [s] (Kalman filters). How much does is seen in what the fits leave; "auto" is
            `colour.LASTS_S` for it.
        couple: whether the filter's prediction enters the fit as a prior, or the raw fit is
            filtered (Kalman filters).
        engine: "compiled", or "filterpy" for its reference, which takes all noise for white.

    Raises:
        SettingsError: a value makes no sense.
    """

    name: str = setting(
        "none",
        "Steady the poses: frame by frame (kalman, one-euro), by the next frames too"
        " (fixed-lag), or by the whole sequence (rts).",
        choices=FILTERS,
        flat="filter",
    )
    lag: int = setting(
        2, "How many frames fixed-lag waits.", least=0, most=1000, unit="frames", metavar="FRAMES"
    )
    process_noise: float | Literal["auto"] = setting(
        "auto",
        "How wildly the hand moves: learnt, or a factor on usual accelerations.",
        words=("auto",),
        least=1e-4,
        most=1e4,
        spelt="process noise",
        amount="a factor",
        unit="on the usual accelerations",
        metavar="auto|FACTOR",
    )
    noise_colour: float | Literal["auto", "white"] = setting(
        "auto",
        "How long the joints' noise lasts: 0.1 s where fits show that some does, no longer than a"
        " frame (white), or this time.",
        words=("auto", "white"),
        least=1e-3,
        most=10.0,
        spelt="noise colour",
        amount="a time",
        unit="s",
        metavar="auto|white|SECONDS",
    )
    couple: bool = setting(
        True, "Let the filter's prediction enter the fit (default), or filter the fits."
    )
    engine: str = setting(
        "compiled", "The filter's own code, or filterpy's.", choices=ENGINES, option=False
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name == "one-euro" and self.engine != "compiled":
            raise SettingsError("filterpy has no one-euro filter")
        if not isinstance(self.noise_colour, str) and self.engine != "compiled":
            raise SettingsError(
                "filterpy has no noise that lasts: noise_colour is"
                f" {self.noise_colour:g}, expected white"
            )

    @property
    def waits(self) -> bool:
        """Whether a frame is final only when later ones are known."""
        return self.name in WAITING


@dataclass(frozen=True)
class TrackerSettings(Settings):
    """How one hand is tracked.

    Attributes:
        fit: how a frame is fitted.
        filter: how poses are steadied.
        gate: leave out joints and frames that cannot be true (`handtrack.tracking.gating`).
        min_joints: a frame with fewer observed joints is lost: it says too little of the hand.
        coast_s: how long a filter predicts frames that cannot be fitted [s].
        lasting_deg, lasting_mm: deviations that last, of the angles (20) [deg] and of joint centres
            (21) [mm]; empty where nothing is known of them. `track` finds them where a detector's
            profile is known (see `calibration.lasting`).

    Raises:
        SettingsError: a value makes no sense.
    """

    fit: FitSettings = FitSettings()
    filter: FilterSettings = FilterSettings()
    gate: bool = setting(
        True, "Leave out joints and frames that cannot be true (default), or use all."
    )
    min_joints: int = setting(
        6, "A frame with fewer observed joints is not fitted.", least=3, most=21, option=False
    )
    coast_s: float = setting(
        0.3,
        "How long a filter predicts where nothing is fitted.",
        least=0,
        most=1e6,
        unit="s",
        option=False,
    )
    lasting_deg: tuple[float, ...] = setting(
        (),
        "Deviations of the angles that last: variances are not below them.",
        count=20,
        unit="deg",
        option=False,
        always=False,
    )
    lasting_mm: tuple[float, ...] = setting(
        (),
        "Deviations of the joints that last, per coordinate.",
        count=21,
        unit="mm",
        option=False,
        always=False,
    )

    @property
    def coast_ns(self) -> int:
        """`coast_s` [ns]."""
        return int(self.coast_s * 1e9)


@dataclass(frozen=True)
class TrackSettings(TrackerSettings):
    """How a whole sequence is tracked: a tracker's settings, and how the hand is found first.

    Attributes:
        calibration: how the subject's hand is found in the sequence.
        detector: whose landmarks the joints are: a profile's name or file, "none" where they are
            joint centres, or "auto", what the reader says.
        picture: whether the hand is fitted to the camera's picture too, where the input has it.

    Raises:
        SettingsError: a value makes no sense.
    """

    calibration: CalibrationSettings = CalibrationSettings()
    detector: str = setting(
        "auto",
        "Whose landmarks the joints are: the reader's word (auto), mediapipe (one camera's world"
        " landmarks), mediapipe-3d (triangulated), a profile's file, or none: joint centres.",
        metavar="auto|none|NAME|PROFILE.json",
        always=False,
    )
    picture: bool = setting(
        True,
        "Fit the hand to the camera's picture as well, where the input has it (default), or to the"
        " joints alone.",
        option=False,
        always=False,
    )


def reprojection_px(settings: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Of a track that was fitted to the pictures of cameras, by its settings: how far it is from
    what was seen there, `mean`, `p95` and so on [px]; else None."""
    cameras = settings.get("cameras")
    pixels = cameras.get("reprojection_px") if isinstance(cameras, Mapping) else None
    return pixels if isinstance(pixels, Mapping) else None
