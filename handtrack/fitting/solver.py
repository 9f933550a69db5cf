"""Compiled fits of frames, one after another: which solvers, what they take, what they write."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.fitting.result import N_POSE, Fit
from handtrack.fitting.settings import LOSSES, FitSettings
from handtrack.hand.capsules import contacts
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS
from handtrack.kernels import bends, pose_information, workspace
from handtrack.kernels import frame_loop as frames
from handtrack.kernels.compiled import addresses
from handtrack.kernels.losses import NO_LOSS
from handtrack.kernels.newton import newton
from handtrack.kernels.workspace import Records
from handtrack.read_only import read_only

Array = NDArray[np.float64]

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


class Program:
    """Which compiled solvers fit a frame, and their settings."""

    def __init__(
        self,
        settings: FitSettings | None = None,
        *,
        meanwhile: Callable[[], object] | None = None,
        **options: Any,
    ):
        """Args:
        settings, options: as in `fit`.
        meanwhile: is called where there is to be compiled, so that what it compiles is done at
            the same time.

        Raises:
            SettingsError: an option is unknown, or a value makes no sense.
        """
        chosen = FitSettings.of(settings, options)
        update, method = chosen.update, chosen.method
        if update == "li2021":
            from handtrack.kernels.li2021 import bcd_li2021 as bcd
        else:
            from handtrack.kernels.descent import bcd_exact as bcd
        if (update, method) == ("exact", "newton"):
            parts = newton, bcd, bends.other_bends, pose_information.unit_covariance
            beside = load_loop if meanwhile else None
            found = addresses(*parts, meanwhile=meanwhile or load_loop, beside=beside)
            step, sweep, other, known = found
        else:
            sweep, known = addresses(bcd, pose_information.unit_covariance)
            step = other = 0
        self.collisions, apart = chosen.collisions, 0
        if chosen.collisions:
            from handtrack.kernels.collisions import move_apart

            (apart,) = addresses(move_apart)
        self.solvers = frames.Solvers(sweep, step, other, apart, known)
        # reweighting converges linearly: let it come as near
        share = chosen.tolerance if chosen.robust == "none" else 1e-2 * chosen.tolerance
        self.settings = frames.FitNumbers(
            cold_sweeps=COLD_SWEEPS,
            max_sweeps=chosen.max_sweeps,
            max_steps=MAX_STEPS,
            tolerance=share,
            loss=LOSSES.index(chosen.robust),
            spread=1e-3 * chosen.spread_mm,
            noise=chosen.noise_m2,
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
        rows: (T,) RESULT of `kernels.workspace`, which says what the fields are; `angles` and
            those below are views of them.
        covariance: (T, 26, 26) at unit noise, or (0, 26, 26).
    """

    def __init__(self, n: int, full: bool = True):
        """Args:
        n: how many frames.
        full: whether covariances are wanted, or only variances.
        """
        self.rows = np.empty(n, workspace.RESULT)
        self.covariance = np.empty((n if full else 0, N_POSE, N_POSE))

    @property
    def angles(self) -> Array:
        return self.rows["angles"]

    @property
    def roots(self) -> Array:
        return self.rows["root"]

    @property
    def joints(self) -> Array:
        return self.rows["joints"]

    def landmarks(self, model: HandModel) -> Array:
        """(T, 21, 3) where the poses have the model's landmarks [m]."""
        if not model.has_landmarks:
            return self.joints
        return self.joints + model.landmarks_from_joints(
            self.angles, self.roots[:, :9].reshape(-1, 3, 3)
        )

    @property
    def objective(self) -> Array:
        return self.rows["objective"]

    @property
    def worst(self) -> Array:
        return self.rows["worst"]

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
        keep: Records,
        start: Array,
        min_joints: int = 1,
        alone: bool = False,
    ) -> None:
        """Fit the frames, each from the one before.

        Args:
            targets, weights: (T, 21, 3) [m] and (T, 21); overwritten (see `frame_loop.fit_frames`).
            keep: (1,) KEEP from `start_at`, what is known of the frames before; overwritten.
            start: (20,) the angles of a cold start [rad].
            min_joints: a frame with fewer joints is not fitted, nor one with its joints on a
                line; with 1 every frame is that has a joint.
            alone: every frame is a cold start.

        Raises:
            InputError: a joint is infinite, or a weight negative or not finite.
        """
        if start.flags.writeable:  # one type of argument, or the loop is compiled once more
            start = read_only(start)
        wrong = frames.fit_frames(
            constants(model),
            program.contacts(model),
            tuple(program.solvers),
            (*program.settings[:-2], min_joints, int(alone)),
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
        return Row(*self.rows.item(t))

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
            variance=row.variance,
            status=STATUS[row.state],
        )


_DIAGONAL = (np.arange(N_ANGLES), np.arange(N_ANGLES))


class Row(NamedTuple):
    """A record RESULT of `kernels.workspace`, field by field."""

    angles: Array
    root: Array
    quaternion: Array
    joints: Array
    objective: float
    noise: float
    seen: int
    state: int
    sweeps: int
    steps: int
    variance: Array
    worst: float
    anew: int

    @property
    def rotation(self) -> Array:
        """(3, 3)."""
        return self.root[:9].reshape(3, 3)

    @property
    def translation(self) -> Array:
        return self.root[9:]


def constants(model: HandModel) -> tuple[Array, Array, Array, Array, float, Array]:
    """What `frame_loop.fit_frames` takes of a model."""
    limits = model.limits
    bounds = limits.lower, limits.upper
    return model.rest_joints, model.axes, *bounds, model.thumb_twist, model.landmark_offsets


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


def start_at(model: HandModel, start: Fit | ArrayLike | None = None) -> Records:
    """What `Results.run` keeps from frame to frame, before the first one (see `fit`)."""
    keep = np.zeros(1, workspace.KEEP)
    root = keep["root"][0]
    root[[0, 4, 8]] = 1.0
    if isinstance(start, Fit):
        root[:9], root[9:] = start.rotation.ravel(), start.translation
        keep["memory"] = workspace.FITTED
        given: ArrayLike = start.angles
    else:
        given = model.mean_angles if start is None else start
    angles = np.asarray(given, dtype=np.float64)
    if angles.shape != (N_ANGLES,) or not np.isfinite(angles).all():
        raise InputError(f"the start has shape {angles.shape}, expected 20 finite angles [rad]")
    keep["angles"] = model.limits.clamp(angles)
    return keep


def load_loop() -> None:
    """Load the frame loop's machine code, or compile it: run it with no frame."""
    model = HandModel.default()
    none = np.empty((0, N_JOINTS, 3)), np.empty((0, N_JOINTS))
    settings = (0, 1, 1, 0.0, NO_LOSS, 0.0, 0.0, 1, 0)
    arrays = (model.mean_angles, start_at(model), *none, Results(0).rows, Results(0).covariance)
    frames.fit_frames(constants(model), _NO_CONTACTS, (0, 0, 0, 0, 0), settings, *arrays)


def forget(keep: Records) -> None:
    """Make of what is kept that the frame before was lost: the next one starts anew as well."""
    keep["memory"] = np.minimum(keep["memory"], workspace.LOST)
