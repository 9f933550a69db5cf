"""fit() and fit_batch(): the poses of a hand model that best explain 21 joints a frame."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.deprecated import old_positions
from handtrack.errors import InputError, SettingsError
from handtrack.fitting.result import Fit
from handtrack.fitting.settings import FitSettings
from handtrack.fitting.solver import STATUS, Program, Results, at_noise, observations, start_at
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS
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


@old_positions("update", "method", "robust", "spread_mm", "noise_mm", "collisions", "threads")
def fit_batch(
    model: HandModel,
    joints: ArrayLike,
    weights: ArrayLike | None = None,
    *,
    threads: int | None = None,
    covariances: bool = False,
    settings: FitSettings | None = None,
    **options: Any,
) -> Fit:
    """Fit a hand model to many unrelated frames, each from the model's mean pose.

    Args:
        model: the hand.
        joints: (N, 21, 3) in the world [m]; NaN = missing.
        weights: (N, 21) or (21,), not negative; 1 by default.
        threads: as many as there are cores by default.
        covariances: whether they are wanted (5 kB a frame), or variances alone.
        settings, options: as in `fit`.

    Returns:
        The fits, with the frames in front of every shape.

    Raises:
        InputError: wrong shapes, infinite joints, or weights that are negative or not finite.
        SettingsError: as `fit`, or fewer than one thread.
    """
    targets = np.array(joints, dtype=np.float64, order="C")
    if targets.ndim != 3 or targets.shape[1:] != (N_JOINTS, 3):
        raise InputError(f"joints have shape {targets.shape}, expected (frames, 21, 3)")
    n = len(targets)
    given = np.ones(N_JOINTS) if weights is None else np.asarray(weights, dtype=np.float64)
    if given.shape not in ((N_JOINTS,), (n, N_JOINTS)):
        raise InputError(f"weights have shape {given.shape}, expected ({n}, 21) or (21,)")
    w = np.array(np.broadcast_to(given, (n, N_JOINTS)), order="C")
    threads = os.cpu_count() or 1 if threads is None else threads
    if threads < 1:
        raise SettingsError(f"threads is {threads}, expected at least 1")
    program = Program(FitSettings.of(settings, options))
    program.contacts(model)  # once, not in every thread

    def run(part: slice) -> Results:
        results = Results(len(targets[part]), full=covariances)
        keep, start = start_at(model), model.mean_angles
        results.run(program, model, targets[part], w[part], keep, start, alone=True)
        return results

    size = max(-(-n // threads), 1)
    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(run, [slice(i, i + size) for i in range(0, max(n, 1), size)]))

    def join(name: str) -> Array:
        return np.concatenate([part.rows[name] for part in parts])

    roots, covariance = join("root"), np.concatenate([part.covariance for part in parts])
    if covariances:
        covariance = at_noise(covariance, join("noise")[:, None, None])
    status = np.array([STATUS.get(int(s), "missing") for s in join("state")], dtype=str)
    return Fit(
        angles=join("angles"),
        rotation=roots[:, :9].reshape(-1, 3, 3),
        translation=roots[:, 9:],
        joints=join("joints"),
        objective=join("objective"),
        status=status,
        sweeps=join("sweeps"),
        steps=join("steps"),
        covariance=covariance,
        variance=join("variance"),
    )
