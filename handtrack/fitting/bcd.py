"""fit(): the pose of a hand model that best explains 21 joints of one frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.fitting import covariance, frames, lanes
from handtrack.fitting import newton as solve
from handtrack.fitting.compiled import compile_beside
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS

Array = NDArray[np.float64]
Update = Literal["exact", "li2021"]
Method = Literal["newton", "bcd"]
UPDATES: tuple[Update, Update] = ("exact", "li2021")
METHODS: tuple[Method, Method] = ("newton", "bcd")
Robust = Literal["none", "huber", "geman-mcclure"]
LOSSES: dict[str, int] = {
    "none": lanes.NO_LOSS,
    "huber": lanes.HUBER,
    "geman-mcclure": lanes.GEMAN_MCCLURE,
}
SPREAD_MM = 10.0

N_POSE = N_ANGLES + 6

MAX_SWEEPS = 1000
TOLERANCE = 1e-5
# sweeps before the Newton steps of a cold start, and the steps at most
COLD_SWEEPS = 2
MAX_STEPS = 100

STATUS = {
    lanes.CONVERGED: "converged",
    lanes.STALLED: "iteration limit",
    lanes.LIMIT: "iteration limit",
    lanes.UNDERDETERMINED: "underdetermined",
}


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
        steps: Newton steps that were taken after them.
        covariance: (26, 26) of the 20 angles [rad], a small turn of the world on the left of
            the rotation [rad] and the translation [m], from the Gauss-Newton Hessian, at the
            noise that the residual shows. An angle that a limit holds has none; one that no
            given joint depends on has inf on the diagonal.
        status: "converged", "iteration limit", or "underdetermined" where the given joints
            leave the hand's rotation or position open.
    """

    angles: Array
    rotation: Array
    translation: Array
    joints: Array
    objective: float
    sweeps: int
    steps: int
    covariance: Array
    status: str

    @property
    def variance(self) -> Array:
        """(20,) variances of the angles [rad^2]."""
        return np.diagonal(self.covariance)[:N_ANGLES].copy()


def fit(
    model: HandModel,
    joints: ArrayLike,
    start: Fit | ArrayLike | None = None,
    weights: ArrayLike | None = None,
    update: Update = "exact",
    method: Method = "newton",
    robust: Robust = "none",
    spread_mm: float = SPREAD_MM,
    starts: int = 1,
    max_sweeps: int = MAX_SWEEPS,
    tolerance: float = TOLERANCE,
) -> Fit:
    """Fit a hand model to joints (Li et al. 2021, eq. 6).

    Args:
        model: the hand; its limits hold for the result.
        joints: (21, 3) in the world [m]; NaN = missing.
        start: the pose to start from: a Fit, or (20,) angles [rad]; by default the model's
            mean pose. Angles outside the limits are moved to the nearest valid ones.
        weights: (21,) non-negative weight of each joint; 1 by default.
        update: "exact", the constrained minimiser of each block, or "li2021", the paper's
            Procrustes, Euler angles and projection (always plain Algorithm 1).
        method: "newton", sweeps of Algorithm 1 and then Newton steps on the hand's structure
            to the constrained optimum; or "bcd", Algorithm 1 alone.
        robust: loss of a joint's distance: "none" (squared), "huber" or "geman-mcclure",
            which give joints that are far off little weight, or next to none.
        spread_mm: distance at which the robust loss bends [mm].
        starts: how many poses to start from: the start and random ones; the best fit is kept.
        max_sweeps: sweeps of plain Algorithm 1 at most.
        tolerance: stop when a sweep, or a step's promise, improves the objective by less than
            this share of it.

    Returns:
        The fit. Its status says where the joints do not determine the pose; angles that
        nothing observes keep their start value.

    Raises:
        InputError: wrong shapes, infinite joints, weights that are negative or not finite,
            or no joint with a positive weight.
        SettingsError: an unknown update or method, or limits of the iteration that make no
            sense.
    """
    if update not in UPDATES:
        raise SettingsError(f"update {update!r} is unknown, expected exact or li2021")
    if method not in METHODS:
        raise SettingsError(f"method {method!r} is unknown, expected newton or bcd")
    if max_sweeps < 1 or not tolerance >= 0:
        raise SettingsError("max_sweeps must be at least 1 and tolerance at least 0")
    if starts < 1:
        raise SettingsError(f"starts is {starts}, expected at least 1")
    targets, w = observations(joints, weights)
    angles, root = _start(model, start)
    program = Program(update, method, robust, spread_mm, max_sweeps, tolerance)
    rng = np.random.default_rng(0)
    fits = []
    for i in range(starts):
        if i > 0:
            angles = model.limits.clamp(rng.uniform(model.limits.lower, model.limits.upper))
        results = Results(1)
        memory = 2 if isinstance(start, Fit) and i == 0 else 0
        results.run(program, model, targets[None], w[None], angles, root, memory, 1)
        fits.append(results.fit(0, int((w > 0).sum())))
    return min(fits, key=lambda f: f.objective)


class Program:
    """Which compiled solvers fit a frame, and their settings."""

    def __init__(
        self,
        update: Update = "exact",
        method: Method = "newton",
        robust: Robust = "none",
        spread_mm: float = SPREAD_MM,
        max_sweeps: int = MAX_SWEEPS,
        tolerance: float = TOLERANCE,
    ):
        """As in `fit`.

        Raises:
            SettingsError: an unknown update, method or loss, or numbers that make no sense.
        """
        if update not in UPDATES:
            raise SettingsError(f"update {update!r} is unknown, expected exact or li2021")
        if method not in METHODS:
            raise SettingsError(f"method {method!r} is unknown, expected newton or bcd")
        if robust not in LOSSES:
            raise SettingsError(f"robust {robust!r} is unknown, expected {', '.join(LOSSES)}")
        if not 0 < spread_mm < np.inf:
            raise SettingsError(f"spread_mm is {spread_mm}, expected a positive number")
        if max_sweeps < 1 or not tolerance >= 0:
            raise SettingsError("max_sweeps must be at least 1 and tolerance at least 0")
        if update == "exact":
            from handtrack.fitting.descent import bcd_exact as bcd
        else:
            from handtrack.fitting.li2021 import bcd_li2021 as bcd
        newton = solve.newton.address if (update, method) == ("exact", "newton") else 0
        self.solvers = (bcd.address, newton, covariance.unit_covariance.address)
        # reweighting converges linearly: let it come as near
        share = tolerance if robust == "none" else 1e-2 * tolerance
        self.settings = (
            COLD_SWEEPS,
            max_sweeps,
            MAX_STEPS,
            share,
            LOSSES[robust],
            1e-3 * spread_mm,
        )


class Results:
    """The arrays that `frames.fit_frames` writes, for T frames; NaN where nothing is fitted."""

    def __init__(self, n: int, full: bool = True):
        """Args:
        n: how many frames.
        full: whether covariances are wanted, or only variances.
        """
        self.full = full
        self.angles = np.full((n, N_ANGLES), np.nan)
        self.roots = np.full((n, 12), np.nan)
        self.joints = np.full((n, N_JOINTS, 3), np.nan)
        self.objective = np.full(n, np.nan)
        self.iterations = np.zeros((n, 2), dtype=np.int64)
        self.state = np.zeros(n, dtype=np.int64)
        self.variance = np.full((n, N_POSE), np.nan)
        self.covariance = np.full((n if full else 0, N_POSE, N_POSE), np.nan)

    def run(
        self,
        program: Program,
        model: HandModel,
        targets: Array,
        weights: Array,
        angles: Array,
        root: Array,
        memory: int,
        min_joints: int,
        alone: bool = False,
    ) -> int:
        """Fit the frames, each from the one before; angles and root are overwritten.

        A cold start begins at `angles` with memory 0, else at the model's mean pose; alone,
        every frame is a cold start at `angles`. Returns the memory for the next frames (see
        `frames.fit_frames`).
        """
        state = np.array([memory])
        # one type of array: compiled code is made anew for read-only ones
        targets, weights = np.array(targets, order="C"), np.array(weights, order="C")
        self._fit(
            model,
            program.solvers,
            (*program.settings, int(alone), int(self.full)),
            targets,
            weights,
            angles.copy() if memory == 0 else model.mean_angles,
            angles,
            root,
            state,
            min_joints,
        )
        return int(state[0])

    def load(self, model: HandModel) -> None:
        """Have the frame loop's machine code ready, without its solvers."""
        n = len(self.objective)
        joints, w = np.zeros((n, N_JOINTS, 3)), np.zeros((n, N_JOINTS))
        angles, root, state = model.mean_angles, np.zeros(12), np.zeros(1, dtype=np.int64)
        self._fit(
            model,
            (0, 0, 0),
            (0, 1, 1, 0.0, 0, 0.0, 0, 0),
            joints,
            w,
            angles,
            angles.copy(),
            root,
            state,
            1,
        )

    def _fit(self, model: HandModel, *arguments: Any) -> None:
        limits = model.limits
        frames.fit_frames(
            (model.rest_joints, model.axes, limits.lower, limits.upper, model.thumb_twist),
            *arguments,
            self.angles,
            self.roots,
            self.joints,
            self.objective,
            self.iterations,
            self.state,
            self.variance,
            self.covariance,
        )

    def fit(self, t: int, seen: int) -> Fit:
        """Frame t as a Fit, with the noise of its own residual (`seen` joints)."""
        return Fit(
            angles=self.angles[t],
            rotation=self.roots[t, :9].reshape(3, 3),
            translation=self.roots[t, 9:],
            joints=self.joints[t],
            objective=float(self.objective[t]),
            sweeps=int(self.iterations[t, 0]),
            steps=int(self.iterations[t, 1]),
            covariance=at_noise(self.covariance[t], residual_noise(self.objective[t], seen)),
            status=STATUS[int(self.state[t])],
        )


def residual_noise(objective: Any, seen: Any) -> Any:
    """Variance of the joints per coordinate [m^2] that the residual of a fit shows.

    Args:
        objective: sums of squared distances [m^2].
        seen: joints that were fitted, which leave 3 seen - 26 degrees of freedom.
    """
    return objective / np.maximum(3 * seen - N_POSE, 1)


def at_noise(unit: Array, noise: Any) -> Array:
    """Covariances or variances at unit noise, scaled; what is infinite stays so."""
    unseen = np.isinf(unit)
    return np.where(unseen, np.inf, np.where(unseen, 0.0, unit) * noise)


def observations(joints: ArrayLike, weights: ArrayLike | None) -> tuple[Array, Array]:
    """Targets (21, 3) without NaN and weights (21,), 0 where a joint is missing.

    Raises:
        InputError: as `fit`.
    """
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


def warm_up() -> None:
    """Load the compiled code, or compile it (on the machine's first run) on two cores."""
    from handtrack.fitting import descent

    beside = None
    if not (solve.newton.cached or descent.bcd_exact.cached):
        beside = compile_beside(
            {descent.__name__: "bcd_exact", covariance.__name__: "unit_covariance"}
        )
    model = HandModel.default()
    ready = [solve.newton.address]
    Results(0).load(model)
    if beside is not None:
        beside.wait()
    ready += [descent.bcd_exact.address, covariance.unit_covariance.address]
    fit(model, model.rest_joints)
