"""How tracks are plotted."""

from __future__ import annotations

from dataclasses import dataclass

from handtrack.settings import Settings, setting


@dataclass(frozen=True)
class PlotSettings(Settings):
    """What `plot` draws, and how large."""

    width_mm: float = setting(
        180.0,
        "Width of the figure: 180 is two columns of a journal, 88 is one.",
        least=40.0,
        most=1000.0,
        unit="mm",
    )
    font_pt: float = setting(7.0, "Size of the text.", least=4.0, most=30.0, unit="pt")
    bands: float = setting(
        2.0,
        "Bands about the fit, in standard deviations of a single frame; 0 leaves them out.",
        least=0.0,
        most=10.0,
    )
    raw: bool = setting(True, "Angles as fitted, thin, beside those that a filter steadied.")
    errors: bool = setting(True, "Errors of input and output over time.")
    statuses: bool = setting(True, "Statuses and events over time.")
    dpi: float = setting(300.0, "Points per inch of a .png.", least=50.0, most=1200.0)
