"""fit_batch(): many unrelated poses at once, over threads."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.fitting import fit
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class BatchFit:
    """Fits of N unrelated frames; fields as in `Fit`, with the frames in front.

    Attributes:
        angles: (N, 20) [rad]; rotation: (N, 3, 3); translation: (N, 3) [m];
            joints: (N, 21, 3) [m]; objective: (N,) [m^2]; variance: (N, 20) [rad^2].
        status: (N,) "converged", "iteration limit", "underdetermined"; "missing" where a frame
            has no joint at all: its poses are NaN, its variances infinite.
    """

    angles: Array
    rotation: Array
    translation: Array
    joints: Array
    objective: Array
    variance: Array
    status: NDArray[np.str_]


def fit_batch(
    model: HandModel,
    joints: ArrayLike,
    weights: ArrayLike | None = None,
    update: fit.Update = "exact",
    method: fit.Method = "newton",
    robust: fit.Robust = "none",
    spread_mm: float = fit.SPREAD_MM,
    noise_mm: float | None = None,
    collisions: bool = False,
    threads: int | None = None,
) -> BatchFit:
    """Fit a hand model to many unrelated frames, each from the model's mean pose.

    Args:
        model, update, method, robust, spread_mm, noise_mm, collisions: as in `fit`.
        joints: (N, 21, 3) in the world [m]; NaN = missing.
        weights: (N, 21) or (21,), not negative; 1 by default.
        threads: as many as there are cores by default.

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
    program = fit.Program(
        update, method, robust, spread_mm, noise_mm=noise_mm, collisions=collisions
    )
    program.contacts(model)  # once, not in every thread

    def run(part: slice) -> fit.Results:
        results = fit.Results(len(targets[part]), full=False)
        keep, start = fit.start_at(model), model.mean_angles
        results.run(program, model, targets[part], w[part], keep, start, alone=True)
        return results

    size = max(-(-n // threads), 1)
    with ThreadPoolExecutor(threads) as pool:
        parts = list(pool.map(run, [slice(i, i + size) for i in range(0, max(n, 1), size)]))

    def join(name: str) -> Array:
        return np.concatenate([getattr(part, name) for part in parts])

    roots = join("roots")
    status = np.array([fit.STATUS.get(int(s), "missing") for s in join("states")], dtype=str)
    return BatchFit(
        angles=join("angles"),
        rotation=roots[:, :9].reshape(-1, 3, 3),
        translation=roots[:, 9:],
        joints=join("joints"),
        objective=join("objective"),
        variance=join("variance"),
        status=status,
    )
