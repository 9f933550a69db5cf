"""Filters that steady poses over time, behind one interface.

They see the raw fits, from which the next fit starts, and the frame's joints; what they make of
them stands beside the raw fits.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np

from handtrack.errors import SettingsError
from handtrack.hand.model import HandModel
from handtrack.kernels.frame_loop import OUT_SIZE
from handtrack.tracking.filter_settings import FILTERS, FilterSettings
from handtrack.tracking.kalman import FixedLagFilter, Frames, KalmanFilter, Smoother, Steadied
from handtrack.tracking.one_euro import OneEuroFilter

__all__ = ["FILTERS", "FilterSettings", "PoseFilter", "make_filter", "warm_up"]


class PoseFilter(Protocol):
    """What every filter does."""

    def reset(self) -> None:
        """Forget everything."""

    def advance(self, frames: Frames) -> Steadied:
        """Take in the next frames.

        Returns:
            Rows of the frames whose pose is final now, each frame once and in order: all of
            them, for a causal filter; fewer, or earlier frames, for one that waits.
        """

    def finish(self) -> Steadied:
        """The frames that are still to come; the filter is as new then."""


def make_filter(settings: FilterSettings, model: HandModel, coast_s: float) -> PoseFilter | None:
    """The filter that the settings ask for; None for "none".

    Args:
        settings: which filter.
        model: the hand.
        coast_s: how long to go on where nothing is fitted [s].

    Raises:
        SettingsError: a combination that makes no sense.
    """
    if settings.name == "none":
        return None
    if settings.name == "one-euro":
        if settings.engine != "compiled":
            raise SettingsError("filterpy has no one-euro filter")
        return OneEuroFilter(model, coast_s)
    kind = KalmanFilter
    if settings.engine == "filterpy":
        from handtrack.tracking.reference import FilterPyFilter

        kind = FilterPyFilter
    made = kind(model, settings, coast_s)
    if settings.name == "fixed-lag":
        return FixedLagFilter(made, settings.lag)
    return Smoother(made, settings) if settings.name == "rts" else made


def warm_up(settings: FilterSettings) -> None:
    """Load a filter's compiled code, or compile it (on the machine's first run)."""
    model = HandModel.default()
    if (made := make_filter(settings, model, 0.0)) is not None:
        nothing = np.full((2, 21, 3), np.nan), np.zeros((2, 21)), np.full((2, OUT_SIZE), np.nan)
        made.advance(Frames(np.arange(2), *nothing))
        made.finish()
