"""fit(): the pose of a hand model that best explains 21 joints of one frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.fitting import kernels
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS

Array = NDArray[np.float64]
Update = Literal["exact", "li2021"]
UPDATES: tuple[Update, Update] = ("exact", "li2021")

MAX_SWEEPS = 1000
TOLERANCE = 1e-6

_STATES = {kernels.CONVERGED: "converged", kernels.SWEEP_LIMIT: "iteration limit"}

# joints nearer than this to one line leave the rotation about it open
_LINE_M = 1e-4


@dataclass(frozen=True, eq=False)
class Fit:
    """A fitted pose and how it was reached.

    Attributes:
        angles: (20,) [rad], inside the model's limits.
        rotation: (3, 3) from the root frame to the world.
        translation: (3,) of the root frame's origin in the world [m].
        joints: (21, 3) of the fitted pose in the world [m].
        objective: sum of weighted squared distances to the given joints [m^2] (eq. 6).
        sweeps: sweeps of Algorithm 1 that were made.
        variance: (20,) of the angles [rad^2] from the Gauss-Newton Hessian, at the noise
            that the residual shows; inf where no given joint depends on an angle.
        status: "converged", "iteration limit", or "underdetermined" where the given joints
            leave the hand's rotation or position open.
    """

    angles: Array
    rotation: Array
    translation: Array
    joints: Array
    objective: float
    sweeps: int
    variance: Array
    status: str


def fit(
    model: HandModel,
    joints: ArrayLike,
    start: Fit | ArrayLike | None = None,
    weights: ArrayLike | None = None,
    update: Update = "exact",
    max_sweeps: int = MAX_SWEEPS,
    tolerance: float = TOLERANCE,
) -> Fit:
    """Fit a hand model to joints by block coordinate descent (Li et al. 2021, Algorithm 1).

    Args:
        model: the hand; its limits hold for the result.
        joints: (21, 3) in the world [m]; NaN = missing.
        start: the pose to start from: a Fit, or (20,) angles [rad]; by default the model's
            mean pose. Angles outside the limits are moved to the nearest valid ones.
        weights: (21,) non-negative weight of each joint; 1 by default.
        update: "exact", the constrained minimiser of each block, or "li2021", the paper's
            Procrustes, Euler angles and projection.
        max_sweeps: sweeps at most.
        tolerance: stop when a sweep improves the objective by less than this share of it.

    Returns:
        The fit. Its status says where the joints do not determine the pose; angles that
        nothing observes keep their start value.

    Raises:
        InputError: wrong shapes, infinite joints, weights that are negative or not finite,
            or no joint with a positive weight.
        SettingsError: an unknown update, or limits of the iteration that make no sense.
    """
    if update not in UPDATES:
        raise SettingsError(f"update {update!r} is unknown, expected exact or li2021")
    if max_sweeps < 1 or not tolerance >= 0:
        raise SettingsError("max_sweeps must be at least 1 and tolerance at least 0")
    targets, w = _observations(joints, weights)
    angles, root = _start(model, start)
    objective, sweeps, state = kernels.bcd(
        model.rest_joints,
        model.axes,
        model.limits.lower,
        model.limits.upper,
        targets,
        w,
        angles,
        root,
        update == "exact",
        max_sweeps,
        tolerance,
    )
    rotation, translation = root[:9].reshape(3, 3), root[9:]
    return Fit(
        angles=angles,
        rotation=rotation,
        translation=translation,
        joints=model.joints(angles, rotation, translation),
        objective=objective,
        sweeps=sweeps,
        variance=_variance(model, angles, root, w, objective),
        status=_STATES[state] if _determined(targets, w) else "underdetermined",
    )


def _observations(joints: ArrayLike, weights: ArrayLike | None) -> tuple[Array, Array]:
    targets = np.array(joints, dtype=np.float64)
    if targets.shape != (N_JOINTS, 3):
        raise InputError(f"joints have shape {targets.shape}, expected (21, 3)")
    if np.isinf(targets).any():
        raise InputError("a joint is infinite, expected metres or NaN")
    w = np.ones(N_JOINTS) if weights is None else np.array(weights, dtype=np.float64)
    if w.shape != (N_JOINTS,):
        raise InputError(f"weights have shape {w.shape}, expected (21,)")
    if not np.isfinite(w).all() or w.min() < 0:
        raise InputError("weights must be finite and not negative")
    missing = np.isnan(targets).any(1)
    w[missing] = 0.0
    targets[missing] = 0.0
    if not w.any():
        raise InputError("every joint is missing or has no weight")
    return targets, w


def _start(model: HandModel, start: Fit | ArrayLike | None) -> tuple[Array, Array]:
    root = np.zeros(12)
    root[[0, 4, 8]] = 1.0
    if isinstance(start, Fit):
        root[:9], root[9:] = start.rotation.ravel(), start.translation
        given: ArrayLike = start.angles
    else:
        given = model.mean_angles if start is None else start
    angles = np.asarray(given, dtype=np.float64)
    if angles.shape != (N_ANGLES,) or not np.isfinite(angles).all():
        raise InputError(f"the start has shape {angles.shape}, expected 20 finite angles [rad]")
    return model.limits.clamp(angles), root


def _determined(targets: Array, w: Array) -> bool:
    """Whether the given joints fix the hand's place: three of them, not on one line."""
    points = targets[w > 0]
    if len(points) < 3:
        return False
    spread = np.linalg.svd(points - points.mean(0), compute_uv=False)
    return bool(spread[1] > _LINE_M)


def covariance(model: HandModel, fitted: Fit, weights: ArrayLike, noise: float) -> Array:
    """Covariance of a fitted pose from the Gauss-Newton Hessian.

    Args:
        model: the hand that was fitted.
        fitted: the fit.
        weights: (21,) of its joints, 0 where missing.
        noise: variance of the joints' noise per coordinate [m^2].

    Returns:
        (26, 26): angles [rad], a turn on the left of the rotation [rad], translation [m]; a
        diagonal of inf where nothing observes an angle.
    """
    root = np.concatenate([fitted.rotation.ravel(), fitted.translation])
    w = np.asarray(weights, dtype=np.float64)
    return _covariance(model, fitted.angles, root, w, noise)


def _covariance(model: HandModel, angles: Array, root: Array, w: Array, noise: float) -> Array:
    jacobian = np.empty((N_JOINTS, 3, N_ANGLES + 6))
    kernels.jacobian(model.rest_joints, model.axes, angles, root, jacobian)
    j = (jacobian * np.sqrt(w)[:, None, None]).reshape(3 * N_JOINTS, -1)
    seen = np.flatnonzero(np.einsum("ij,ij->j", j, j) > 0)
    out = np.diag(np.full(N_ANGLES + 6, np.inf))
    j = j[:, seen]
    out[np.ix_(seen, seen)] = noise * np.linalg.pinv(j.T @ j, rcond=1e-12, hermitian=True)
    return out


def _variance(model: HandModel, angles: Array, root: Array, w: Array, objective: float) -> Array:
    free = 3 * int((w > 0).sum()) - N_ANGLES - 6
    c = _covariance(model, angles, root, w, objective / max(free, 1))
    return np.diagonal(c)[:N_ANGLES].copy()


def warm_up() -> None:
    """Load the compiled kernels, or compile them on the machine's first run."""
    model = HandModel.default()
    fit(model, model.rest_joints)
