"""fit(): the pose of a hand model that best explains 21 joints of one frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.hand.capsules import contacts
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS
from handtrack.kernels import bends, covariance, workspace
from handtrack.kernels import frame_loop as frames
from handtrack.kernels.compiled import addresses
from handtrack.kernels.newton import newton

Array = NDArray[np.float64]
Update = Literal["exact", "li2021"]
Method = Literal["newton", "bcd"]
UPDATES: tuple[Update, Update] = ("exact", "li2021")
METHODS: tuple[Method, Method] = ("newton", "bcd")
Robust = Literal["none", "huber", "geman-mcclure"]
LOSSES: dict[str, int] = {
    "none": workspace.NO_LOSS,
    "huber": workspace.HUBER,
    "geman-mcclure": workspace.GEMAN_MCCLURE,
}
SPREAD_MM = 10.0

N_POSE = N_ANGLES + 6

MAX_SWEEPS = 1000
TOLERANCE = 1e-5
# sweeps before the Newton steps of a cold start, and the steps at most
COLD_SWEEPS = 2
MAX_STEPS = 100

_NO_CONTACTS = np.empty((0, workspace.PAIR))

STATUS = {
    workspace.CONVERGED: "converged",
    workspace.STALLED: "iteration limit",
    workspace.LIMIT: "iteration limit",
    workspace.UNDERDETERMINED: "underdetermined",
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
    noise_mm: float | None = None,
    collisions: bool = False,
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
        noise_mm: standard deviation of a joint's coordinates [mm], for the covariance; by
            default it is estimated from the residual.
        collisions: move bones apart that sink into each other (see `kernels.collisions`); what
            they sink in counts beside the objective, and the covariance knows nothing of it.

    Returns:
        The fit. Its status says where the joints do not determine the pose; angles that
        nothing observes keep their start value.

    Raises:
        InputError: wrong shapes, infinite joints, weights that are negative or not finite,
            or no joint with a positive weight.
        SettingsError: an unknown update or method, or limits of the iteration that make no
            sense.
    """
    if starts < 1:
        raise SettingsError(f"starts is {starts}, expected at least 1")
    program = Program(
        update, method, robust, spread_mm, max_sweeps, tolerance, noise_mm, collisions
    )
    targets, w = observations(joints, weights)
    keep = start_at(model, start)
    first = keep[: frames.KEEP_ROOT].copy()
    rng = np.random.default_rng(0)
    fits = []
    for i in range(starts):
        if i > 0:
            first = model.limits.clamp(rng.uniform(model.limits.lower, model.limits.upper))
            keep[frames.MEMORY] = frames.NEW
        results = Results(1)
        results.run(program, model, targets, w, keep, first)
        if not w.any():
            raise InputError("every joint is missing or has no weight")
        fits.append(results.fit(0))
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
        noise_mm: float | None = None,
        collisions: bool = False,
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
        if noise_mm is not None and not 0 < noise_mm < np.inf:
            raise SettingsError(f"noise_mm is {noise_mm}, expected a positive number")
        if update == "li2021":
            from handtrack.kernels.li2021 import bcd_li2021 as bcd
        else:
            from handtrack.kernels.descent import bcd_exact as bcd
        if (update, method) == ("exact", "newton"):
            parts = newton, bcd, bends.other_bends, covariance.unit_covariance
            step, sweep, other, known = addresses(*parts, meanwhile=_load_loop)
        else:
            sweep, known = addresses(bcd, covariance.unit_covariance)
            step = other = 0
        self.collisions, apart = collisions, 0
        if collisions:
            from handtrack.kernels.collisions import move_apart

            (apart,) = addresses(move_apart)
        self.solvers = (sweep, step, other, apart, known)
        # reweighting converges linearly: let it come as near
        share = tolerance if robust == "none" else 1e-2 * tolerance
        self.settings = (
            COLD_SWEEPS,
            max_sweeps,
            MAX_STEPS,
            share,
            LOSSES[robust],
            1e-3 * spread_mm,
            0.0 if noise_mm is None else (1e-3 * noise_mm) ** 2,
        )
        self._contacts: tuple[HandModel, Array] | None = None

    def contacts(self, model: HandModel) -> Array:
        """(P, 5) pairs of the hand's capsules that may meet; none where that is not asked."""
        if not self.collisions:
            return _NO_CONTACTS
        if self._contacts is None or self._contacts[0] is not model:
            self._contacts = model, contacts(model)
        return self._contacts[1]


class Results:
    """What `frame_loop.fit_frames` says of T frames; NaN where nothing is fitted.

    Attributes:
        rows: (T, OUT_SIZE) as in `frame_loop`; the arrays below are views of it.
        angles: (T, 20) [rad]; roots: (T, 12) rotation and translation [m];
            joints: (T, 21, 3) [m]; objective: (T,) [m^2].
        noise: (T,) variance of the joints per coordinate [m^2], given or from the residual.
        variance: (T, 20) of the angles [rad^2].
        covariance: (T, 26, 26) at unit noise, or (0, 26, 26).
    """

    def __init__(self, n: int, full: bool = True):
        """Args:
        n: how many frames.
        full: whether covariances are wanted, or only variances.
        """
        self.rows = np.empty((n, frames.OUT_SIZE))
        self.covariance = np.empty((n if full else 0, N_POSE, N_POSE))

    @property
    def angles(self) -> Array:
        return self.rows[:, _ANGLES]

    @property
    def roots(self) -> Array:
        return self.rows[:, _ROOT]

    @property
    def joints(self) -> Array:
        return self.rows[:, _JOINTS].reshape(-1, N_JOINTS, 3)

    @property
    def objective(self) -> Array:
        return self.rows[:, frames.OUT_OBJECTIVE]

    @property
    def noise(self) -> Array:
        return self.rows[:, frames.OUT_NOISE]

    @property
    def states(self) -> Array:
        """(T,) as `workspace` names them."""
        return self.rows[:, frames.OUT_STATE]

    @property
    def steps(self) -> Array:
        """(T,) Newton steps."""
        return self.rows[:, frames.OUT_STEPS]

    @property
    def worst(self) -> Array:
        """(T,) greatest distance of a joint to its fitted one [m]."""
        return self.rows[:, frames.OUT_WORST]

    @property
    def variance(self) -> Array:
        return self.rows[:, _VARIANCE]

    def part(self, frames: slice) -> Results:
        """Some of the frames, as views."""
        part = Results.__new__(Results)
        part.rows, part.covariance = self.rows[frames], self.covariance[frames]
        return part

    def run(
        self,
        program: Program,
        model: HandModel,
        targets: Array,
        weights: Array,
        keep: Array,
        start: Array,
        min_joints: int = 1,
        alone: bool = False,
    ) -> None:
        """Fit the frames, each from the one before.

        Args:
            targets, weights: (T, 21, 3) [m] and (T, 21); overwritten (see `frame_loop.fit_frames`).
            keep: (33,) from `start_at`, what is known of the frames before; overwritten.
            start: (20,) the angles of a cold start [rad].
            min_joints: a frame with fewer joints is not fitted, nor one with its joints on a
                line; with 1 every frame is that has a joint.
            alone: every frame is a cold start.

        Raises:
            InputError: a joint is infinite, or a weight negative or not finite.
        """
        wrong = frames.fit_frames(
            constants(model),
            program.contacts(model),
            program.solvers,
            (*program.settings, min_joints, int(alone)),
            start,
            keep,
            targets,
            weights,
            self.rows,
            self.covariance,
        )
        if wrong == frames.INFINITE_JOINT:
            raise InputError("a joint is infinite, expected metres or NaN")
        if wrong == frames.BAD_WEIGHT:
            raise InputError("a joint's weight (confidence) is negative or not finite")

    def row(self, t: int) -> Row:
        """Frame t, its arrays as views."""
        row = self.rows[t]
        objective, noise, seen, state, sweeps, steps = row[_NUMBERS].tolist()
        return Row(
            row[_ANGLES],
            row[_TURN].reshape(3, 3),
            row[_SHIFT],
            row[_QUATERNION],
            row[_JOINTS].reshape(N_JOINTS, 3),
            row[_VARIANCE],
            objective,
            noise,
            int(seen),
            int(state),
            int(sweeps),
            int(steps),
        )

    def fit(self, t: int) -> Fit:
        """Frame t as a Fit."""
        row = self.row(t)
        covariance = at_noise(self.covariance[t], row.noise)
        covariance[_DIAGONAL] = row.variance  # to the last digit
        return Fit(
            angles=row.angles,
            rotation=row.rotation,
            translation=row.translation,
            joints=row.joints,
            objective=row.objective,
            sweeps=row.sweeps,
            steps=row.steps,
            covariance=covariance,
            status=STATUS[row.state],
        )


_ANGLES, _TURN = slice(frames.OUT_ANGLES, frames.OUT_ROOT), slice(frames.OUT_ROOT, frames.OUT_SHIFT)
_ROOT = slice(frames.OUT_ROOT, frames.OUT_QUATERNION)
_SHIFT = slice(frames.OUT_SHIFT, frames.OUT_QUATERNION)
_QUATERNION = slice(frames.OUT_QUATERNION, frames.OUT_JOINTS)
_JOINTS = slice(frames.OUT_JOINTS, frames.OUT_OBJECTIVE)
_NUMBERS = slice(frames.OUT_OBJECTIVE, frames.OUT_VARIANCE)
_VARIANCE = slice(frames.OUT_VARIANCE, frames.OUT_WORST)


def pose_of(row: Array) -> tuple[Array, Array, Array, Array]:
    """Angles, quaternion, translation and joints of a row of results, as views."""
    return row[_ANGLES], row[_QUATERNION], row[_SHIFT], row[_JOINTS].reshape(N_JOINTS, 3)


_DIAGONAL = (np.arange(N_ANGLES), np.arange(N_ANGLES))


class Row(NamedTuple):
    """Results of one frame, as in `Results`; poses are NaN where nothing is fitted.

    Attributes:
        seen: joints with a weight.
        state: as `workspace` names them.
    """

    angles: Array
    rotation: Array
    translation: Array
    quaternion: Array
    joints: Array
    variance: Array
    objective: float
    noise: float
    seen: int
    state: int
    sweeps: int
    steps: int


def constants(model: HandModel) -> tuple[Array, Array, Array, Array, float]:
    """What `frame_loop.fit_frames` takes of a model."""
    limits = model.limits
    return model.rest_joints, model.axes, limits.lower, limits.upper, model.thumb_twist


def at_noise(unit: Array, noise: Any) -> Array:
    """Covariances or variances at unit noise, scaled; what is infinite stays so."""
    unseen = np.isinf(unit)
    return np.where(unseen, np.inf, np.where(unseen, 0.0, unit) * noise)


def observations(joints: ArrayLike, weights: ArrayLike | None) -> tuple[Array, Array]:
    """One frame for `Results.run`: targets (1, 21, 3) and weights (1, 21), as copies.

    Raises:
        InputError: wrong shapes.
    """
    targets = np.array(joints, dtype=np.float64, order="C")
    if targets.shape != (N_JOINTS, 3):
        raise InputError(f"joints have shape {targets.shape}, expected (21, 3)")
    w = _ONES.copy() if weights is None else np.array(weights, dtype=np.float64)
    if w.shape != (N_JOINTS,):
        raise InputError(f"weights (confidence) have shape {w.shape}, expected (21,)")
    return targets[None], w[None]


_ONES = np.ones(N_JOINTS)


def start_at(model: HandModel, start: Fit | ArrayLike | None = None) -> Array:
    """What `Results.run` keeps from frame to frame, before the first one (see `fit`)."""
    keep = np.zeros(frames.KEEP_SIZE)
    root = keep[frames.KEEP_ROOT : frames.MEMORY]
    root[[0, 4, 8]] = 1.0
    if isinstance(start, Fit):
        root[:9], root[9:] = start.rotation.ravel(), start.translation
        keep[frames.MEMORY] = frames.FITTED
        given: ArrayLike = start.angles
    else:
        given = model.mean_angles if start is None else start
    angles = np.asarray(given, dtype=np.float64)
    if angles.shape != (N_ANGLES,) or not np.isfinite(angles).all():
        raise InputError(f"the start has shape {angles.shape}, expected 20 finite angles [rad]")
    keep[: frames.KEEP_ROOT] = model.limits.clamp(angles)
    return keep


def _load_loop() -> None:
    """Load the frame loop's machine code, or compile it: run it with no frame."""
    model = HandModel.default()
    none = np.empty((0, N_JOINTS, 3)), np.empty((0, N_JOINTS))
    settings = (0, 1, 1, 0.0, workspace.NO_LOSS, 0.0, 0.0, 1, 0)
    arrays = (model.mean_angles, start_at(model), *none, Results(0).rows, Results(0).covariance)
    frames.fit_frames(constants(model), _NO_CONTACTS, (0, 0, 0, 0, 0), settings, *arrays)


def forget(keep: Array) -> None:
    """Make of what is kept that the frame before was lost: the next one starts anew as well."""
    keep[frames.MEMORY] = min(keep[frames.MEMORY], frames.LOST)


def warm_up() -> None:
    """Load the compiled code, or compile it (on the machine's first run) on two cores."""
    Program()
    model = HandModel.default()
    fit(model, model.rest_joints)
