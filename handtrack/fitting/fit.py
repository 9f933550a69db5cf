"""fit(): the pose of a hand model that best explains 21 joints of one frame."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.deprecated import old_positions
from handtrack.errors import InputError, SettingsError
from handtrack.fitting.result import Fit
from handtrack.fitting.settings import FitSettings
from handtrack.fitting.solver import Program, Results, observations, start_at
from handtrack.hand.model import HandModel
from handtrack.kernels import workspace

Array = NDArray[np.float64]


@old_positions(
    *("update", "method", "robust", "spread_mm", "starts"),
    *("max_sweeps", "tolerance", "noise_mm", "collisions"),
)
def fit(
    model: HandModel,
    joints: ArrayLike,
    start: Fit | ArrayLike | None = None,
    weights: ArrayLike | None = None,
    *,
    starts: int = 1,
    settings: FitSettings | None = None,
    **options: Any,
) -> Fit:
    """Fit a hand model to joints (Li et al. 2021, eq. 6).

    Args:
        model: the hand; its limits hold for the result.
        joints: (21, 3) in the world [m]; NaN = missing.
        start: the pose to start from: a Fit, or (20,) angles [rad]; by default the model's
            mean pose. Angles outside the limits are moved to the nearest valid ones.
        weights: (21,) non-negative weight of each joint; 1 by default.
        starts: how many poses to start from: the start and random ones; the best fit is kept.
        settings: how to fit; the defaults if left out.
        options: fields of `FitSettings` that replace the settings': update, method, robust,
            spread_mm, noise_mm, collisions, max_sweeps, tolerance.

    Returns:
        The fit. Its status says where the joints do not determine the pose; angles that
        nothing observes keep their start value.

    Raises:
        InputError: wrong shapes, infinite joints, weights that are negative or not finite,
            or no joint with a positive weight.
        SettingsError: an option is unknown, or a value makes no sense.
    """
    if starts < 1:
        raise SettingsError(f"starts is {starts}, expected at least 1")
    program = _program(FitSettings.of(settings, options))
    targets, w = observations(joints, weights)
    keep = start_at(model, start)
    first = keep["angles"][0].copy()
    rng = np.random.default_rng(0) if starts > 1 else None
    fits: list[Fit] = []
    for _ in range(starts):
        if fits and rng is not None:
            first = model.limits.clamp(rng.uniform(model.limits.lower, model.limits.upper))
            keep["memory"] = workspace.NEW
        results = Results(1)
        results.run(program, model, targets, w, keep, first)
        if not w.any():
            raise InputError("every joint is missing or has no weight")
        fits.append(results.fit(0))
    return min(fits, key=lambda f: float(f.objective))


# kept for the next frame with the same settings
_program = lru_cache(maxsize=8)(Program)


def warm_up() -> None:
    """Load the compiled code, or compile it (on the machine's first run) on two cores."""
    Program()
    model = HandModel.default()
    fit(model, model.rest_joints)
