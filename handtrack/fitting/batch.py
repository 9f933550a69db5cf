"""fit_batch(): many unrelated poses at once, over threads."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.deprecated import moved, old_positions
from handtrack.errors import InputError, SettingsError
from handtrack.fitting.result import Fit
from handtrack.fitting.settings import FitSettings
from handtrack.fitting.solver import STATUS, Program, Results, at_noise, start_at
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS

Array = NDArray[np.float64]

if not TYPE_CHECKING:
    __getattr__ = moved(__name__, {"BatchFit": "fitting.result:Fit"})


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
