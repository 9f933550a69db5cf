"""Which filter, and its settings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from handtrack.errors import SettingsError
from handtrack.tracking import process_noise as motion

FILTERS = ("none", "kalman", "one-euro", "fixed-lag", "rts")
ENGINES = ("compiled", "filterpy")
LAG = 2
"""Frames that `fixed-lag` waits unless told otherwise."""


@dataclass(frozen=True)
class FilterSettings:
    """Which filter steadies the poses, and how.

    Attributes:
        name: "none"; "kalman", "one-euro": causal; "fixed-lag": smoothed by the next frames, so
            its results come `lag` frames later; "rts": smoothed by the whole sequence.
        lag: frames that "fixed-lag" waits.
        process_noise: "auto", learnt from the motion, or a factor on the usual accelerations.
        couple: whether the filter's prediction enters the fit as a prior, or the raw fit is
            filtered (Kalman filters).
        noise_mm: standard deviation of the joints per coordinate [mm]; learnt if left out.
        robust, spread_mm: loss of a joint's distance where the filter weighs joints (Kalman
            filters), as in `handtrack.fit`.
        engine: "compiled", or "filterpy" for its reference.

    Raises:
        SettingsError: a value makes no sense.
    """

    name: str = "none"
    lag: int = LAG
    process_noise: float | Literal["auto"] = "auto"
    couple: bool = True
    noise_mm: float | None = None
    engine: str = "compiled"
    robust: str = "none"
    spread_mm: float = 10.0

    def __post_init__(self) -> None:
        if self.name not in FILTERS:
            raise SettingsError(
                f"filter {self.name!r} is unknown, expected one of {', '.join(FILTERS)}"
            )
        if not isinstance(self.lag, int) or not 0 <= self.lag <= 1000:
            raise SettingsError(f"lag is {self.lag}, expected 0..1000 frames")
        if self.engine not in ENGINES:
            raise SettingsError(f"engine {self.engine!r} is unknown, expected compiled or filterpy")
        if self.noise_mm is not None and not 1e-3 <= self.noise_mm <= 1e3:
            raise SettingsError(f"noise_mm is {self.noise_mm}, expected 0.001..1000 mm")
        if isinstance(self.process_noise, str):
            if self.process_noise != "auto":
                raise SettingsError(f"process noise is {self.process_noise!r}, expected auto")
        else:
            motion.scaled(self.process_noise)

    @property
    def noise_m2(self) -> float | None:
        """Variance of the joints per coordinate [m^2]."""
        return None if self.noise_mm is None else (1e-3 * self.noise_mm) ** 2
