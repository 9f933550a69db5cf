"""Filters that steady poses over time, behind one interface.

They see the raw fits, from which the next fit starts, and the frame's joints; what they make of
them stands beside the raw fits.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from handtrack.hand.model import HandModel
from handtrack.kernels.workspace import unfitted
from handtrack.tracking.filter_input import Frames
from handtrack.tracking.kalman import DriftingFilter, KalmanFilter, Steadied
from handtrack.tracking.one_euro import OneEuroFilter
from handtrack.tracking.settings import TrackerSettings
from handtrack.tracking.smoothers import FixedLagFilter, Smoother


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

    def rest(self) -> Iterator[Steadied]:
        """As `finish`, some frames at a time."""


def make_filter(
    settings: TrackerSettings, model: HandModel, corrected: bool = False
) -> PoseFilter | None:
    """The filter that the settings ask for; None for "none".

    Args:
        settings: how to track.
        model: the hand.
        corrected: a profile corrects the joints.
    """
    wanted = settings.filter
    if wanted.name == "none":
        return None
    if wanted.name == "one-euro":
        return OneEuroFilter(model, settings.coast_s)
    kind = KalmanFilter
    if wanted.engine == "filterpy":
        from handtrack.tracking.filterpy_filter import FilterPyFilter

        kind = FilterPyFilter
    white = wanted.noise_colour == "white" or wanted.engine == "filterpy"
    if wanted.name == "rts":
        drifting = None if white else DriftingFilter(model, settings, corrected)
        return Smoother(kind(model, settings), settings, drifting)
    made = kind(model, settings) if white else DriftingFilter(model, settings, corrected)
    return FixedLagFilter(made, wanted.lag) if wanted.name == "fixed-lag" else made


def warm_up(settings: TrackerSettings) -> None:
    """Load a filter's compiled code, or compile it (on the machine's first run)."""
    model = HandModel.default()
    if (made := make_filter(settings, model)) is not None:
        nothing = np.full((2, 21, 3), np.nan), np.zeros((2, 21)), unfitted(2)
        made.advance(Frames(np.arange(2), *nothing))
        made.finish()
