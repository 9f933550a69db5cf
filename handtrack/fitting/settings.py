"""How a frame is fitted: the settings of `fit`, `fit_batch`, `fit_2d` and the tracker."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from handtrack.kernels.losses import LOSSES as LOSSES
from handtrack.kernels.losses import Robust as Robust
from handtrack.settings import Settings, setting

Update = Literal["exact", "li2021"]
Method = Literal["newton", "bcd"]
UPDATES: tuple[Update, ...] = ("exact", "li2021")
METHODS: tuple[Method, ...] = ("newton", "bcd")


@dataclass(frozen=True)
class FitSettings(Settings):
    """How a hand is fitted to joints in space.

    Attributes:
        update: "exact", the constrained minimiser of each block, or "li2021", the paper's
            Procrustes, Euler angles and projection (always plain Algorithm 1).
        robust: loss of a joint's distance: "none" (squared), "huber" or "geman-mcclure",
            which give joints that are far off little weight, or next to none.
        spread_mm: distance at which the robust loss bends [mm].
        noise_mm: standard deviation of a joint's coordinates [mm], for variances and filters;
            estimated by default.
        collisions: move bones apart that sink into each other (see `kernels.collisions`); what
            they sink in counts beside the objective, and the covariance knows nothing of it.
        method: "newton", sweeps of Algorithm 1 and then Newton steps on the hand's structure
            to the constrained optimum; or "bcd", Algorithm 1 alone.
        max_sweeps: sweeps of plain Algorithm 1 at most.
        tolerance: stop when a sweep, or a step's promise, improves the objective by less than
            this share of it.

    Raises:
        SettingsError: a value makes no sense.
    """

    update: Update = setting(
        "exact", "Block updates: the constrained minimiser, or the paper's.", choices=UPDATES
    )
    robust: Robust = setting(
        "none",
        "Give joints that are far off little weight (huber), or next to none.",
        choices=LOSSES,
    )
    spread_mm: float = setting(
        10.0, "How far off --robust begins to doubt a joint.", above=0, unit="mm", metavar="MM"
    )
    noise_mm: float | None = setting(
        None,
        "Noise of the joints, per coordinate, for variances and filters; by default it is"
        " estimated.",
        least=1e-3,
        most=1e3,
        unit="mm",
        metavar="MM",
    )
    collisions: bool = setting(False, "Move bones apart that sink into each other; off by default.")
    method: Method = setting(
        "newton",
        "Newton steps after the sweeps of Algorithm 1, or Algorithm 1 alone.",
        choices=METHODS,
        option=False,
        always=False,
    )
    max_sweeps: int = setting(
        1000, "Sweeps of plain Algorithm 1 at most.", least=1, option=False, always=False
    )
    tolerance: float = setting(
        1e-5,
        "Share of the objective that a sweep or step must improve it by.",
        least=0,
        option=False,
        always=False,
    )

    @property
    def noise_m2(self) -> float:
        """Variance of the joints per coordinate [m^2]; 0 where it is to be estimated."""
        return 0.0 if self.noise_mm is None else (1e-3 * self.noise_mm) ** 2


@dataclass(frozen=True)
class ImageSettings(Settings):
    """How a hand is fitted to joints in pictures.

    Attributes:
        spread_px: where the loss bends from square to linear [px]; 0: never.
        prior_deg: standard deviation of the angles around the start's [degrees]; 0: no such
            prior. By default none with several cameras, 40 with one, which cannot see depth well.

    Raises:
        SettingsError: a value makes no sense.
    """

    spread_px: float = setting(
        10.0,
        "Distance at which the loss bends from square to linear: a detector's usual error.",
        least=0,
        most=1e9,
        unit="px",
    )
    prior_deg: float | None = setting(
        None,
        "How far from the start's angles a fit is believed.",
        least=0,
        most=1e9,
        unit="degrees",
    )
