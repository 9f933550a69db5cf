"""Fit: a fitted pose, or many."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import N_ANGLES
from handtrack.read_only import make_read_only

Array = NDArray[np.float64]

N_POSE = N_ANGLES + 6


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit:
    """A fitted pose and how it was reached; of a batch N poses, with N in front of every shape.

    Its arrays can only be read. A batch is one Fit and no list of them, so that its arrays are
    whole; `batch[i]` is the Fit of frame i.

    Attributes:
        angles: (20,) [rad], inside the model's limits.
        rotation: (3, 3) from the root frame to the world.
        translation: (3,) of the root frame's origin in the world [m].
        joints: (21, 3) of the fitted pose in the world [m].
        objective: sum of weighted squared distances to the given joints [m^2] (eq. 6); of
            pictures that of the (robust) squared reprojection errors and the prior [px^2].
        status: "converged", "iteration limit", or "underdetermined" where the given joints
            leave the hand's rotation or position open (pictures: its turn by more than 30
            degrees, or its distance by more than 20 %). In a batch also "missing", where a frame
            has no joint at all: its pose is NaN, its variances infinite.
        sweeps: sweeps of Algorithm 1 that were made.
        steps: Newton steps that were taken after them.
        covariance: (26, 26) of the 20 angles [rad], a small turn of the world on the left of
            the rotation [rad] and the translation [m], from the Gauss-Newton Hessian, at the
            noise that the residual shows. An angle that a limit holds has none; one that no
            given joint depends on has inf on the diagonal. A batch has (0, 26, 26) unless
            `fit_batch` was asked for them.
        variance: (20,) of the angles [rad^2], the covariance's diagonal.
        reprojection: (C, 21) distance of each joint to where each camera saw it [px], NaN where
            it was not seen; None where no picture was fitted.
    """

    angles: Array
    rotation: Array
    translation: Array
    joints: Array
    objective: Any
    status: Any
    sweeps: Any = 0
    steps: Any = 0
    covariance: Array = field(default_factory=lambda: np.empty((0, N_POSE, N_POSE)))
    variance: Array = None  # type: ignore[assignment]
    reprojection: Array | None = None

    def __post_init__(self) -> None:
        given: Array | None = self.variance
        if given is None:
            known = self.covariance.size > 0
            diagonal = np.diagonal(self.covariance, axis1=-2, axis2=-1)[..., :N_ANGLES].copy()
            variance = diagonal if known else np.full_like(self.angles, np.inf)
            object.__setattr__(self, "variance", variance)
        make_read_only(self)

    @property
    def iterations(self) -> Any:
        """Sweeps and steps together."""
        return self.sweeps + self.steps

    def __getitem__(self, i: int | slice) -> Self:
        """The fit of frame i of a batch, or a batch of some frames."""
        if self.angles.ndim == 1:
            raise TypeError("a fit of one frame has no frames to choose from")
        part: dict[str, Any] = {}
        for of in fields(self):
            value = getattr(self, of.name)
            if isinstance(value, np.ndarray) and len(value) == len(self.angles):
                one: Any = value[i]
                part[of.name] = one if isinstance(one, np.ndarray) else one.item()
        return replace(self, **part)
