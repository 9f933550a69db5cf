"""What the paper compares its fit with: GDC and MLP, behind the same interface.

GDC is gradient descent on the pose parameters of a hand whose joints turn freely, all 45 of them
or their first principal components, as models of the MANO kind are fitted throughout the
literature: Adam (Kingma and Ba 2015) with analytic gradients from the mean pose, the palm laid on
the joints first. MLP is a perceptron of six layers from joints to rotations (Zhou et al. 2020,
IKNet). Neither knows joint limits; the MLP has learned from poses inside them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.fitting.result import N_POSE, Fit
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import matrix_to_vector, vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES, N_JOINTS, PALM
from tools.paper import free_pose
from tools.paper.free_pose import FreeFit

Array = NDArray[np.float64]
Baseline = Literal["gdc", "gdc-pca", "mlp"]
BASELINES: tuple[Baseline, ...] = ("gdc", "gdc-pca", "mlp")

_BLOCK = 256
"""Frames fitted side by side."""


@dataclass(frozen=True)
class GDCSettings:
    """Settings of the gradient descent, the best of a small grid on random poses at 0-5 mm.

    Attributes:
        steps: Adam's steps.
        rate: its first step size [rad, and 0.1 m]; it falls to a tenth along a cosine.
        prior: weight of the squared pose parameters about the mean pose [m^2 / rad^2]: noise
            over spread, squared.
        components: principal components of "gdc-pca".
    """

    steps: int = 300
    rate: float = 0.1
    prior: float = 1e-5
    components: int = 20


DEFAULT_GDC = GDCSettings()


def fit(
    model: HandModel,
    joints: ArrayLike,
    method: Baseline = "gdc",
    settings: GDCSettings = DEFAULT_GDC,
) -> Fit:
    """Fit one frame by a baseline; as `handtrack.fit`.

    Args:
        model: the hand.
        joints: (21, 3) in the world [m]; NaN = missing. The MLP needs all of them, GDC three
            of the palm's.
        method: "gdc", "gdc-pca" or "mlp".
        settings: of the gradient descent.

    Returns:
        A Fit whose joints are those of freely turning joints, and whose angles, the nearest of
        ours, may lie outside the limits; its covariance is not known (infinite).

    Raises:
        InputError: wrong shapes, or too many joints are missing.
        SettingsError: an unknown method.
    """
    given = np.asarray(joints, dtype=np.float64)
    if given.shape != (N_JOINTS, 3):
        raise InputError(f"joints have shape {given.shape}, expected (21, 3)")
    found = fit_batch(model, given[None], method, settings)
    if found.status[0] == "missing":
        needed = "all 21" if method == "mlp" else "three of the palm's"
        raise InputError(f"joints are missing: {method} needs {needed}")
    return Fit(
        angles=found.angles[0],
        rotation=found.rotation[0],
        translation=found.translation[0],
        joints=found.joints[0],
        objective=float(found.objective[0]),
        sweeps=0,
        steps=0 if method == "mlp" else settings.steps,
        covariance=np.full((N_POSE, N_POSE), np.inf),
        status=str(found.status[0]),
    )


def fit_batch(
    model: HandModel,
    joints: ArrayLike,
    method: Baseline = "gdc",
    settings: GDCSettings = DEFAULT_GDC,
    components: tuple[Array, Array] | None = None,
) -> FreeFit:
    """Fit many frames by a baseline, each from the mean pose; as `handtrack.fit_batch`.

    Args:
        model: the hand.
        joints: (N, 21, 3) in the world [m]; NaN = missing. Frames of which too much is missing
            (see `fit`) come back "missing".
        method: "gdc", "gdc-pca" or "mlp".
        settings: of the gradient descent.
        components: mean (45,) and components (n, 45) of the pose for "gdc-pca", in the order of
            our parts; by default those of random poses inside the model's limits.

    Raises:
        InputError: wrong shapes.
        SettingsError: an unknown method.
    """
    if method not in BASELINES:
        raise SettingsError(f"baseline {method!r} is unknown, expected {', '.join(BASELINES)}")
    given = np.asarray(joints, dtype=np.float64)
    if given.ndim != 3 or given.shape[1:] != (N_JOINTS, 3):
        raise InputError(f"joints have shape {given.shape}, expected (frames, 21, 3)")
    present: NDArray[np.bool_] = np.asarray(np.isfinite(given).all(2))
    complete: NDArray[np.bool_] = np.asarray(
        present.all(1) if method == "mlp" else present[:, PALM].sum(1) >= 3
    )
    use = given[complete]
    parts = []
    for start in range(0, len(use), _BLOCK):
        block = use[start : start + _BLOCK]
        if method == "mlp":
            from tools.paper.mlp import predict

            parts.append(predict(model, block))
        else:
            parts.append(
                _descend(model, block, _space(model, method, settings, components), settings)
            )
    return _spread(parts, complete)


def _space(
    model: HandModel,
    method: Baseline,
    settings: GDCSettings,
    components: tuple[Array, Array] | None,
) -> tuple[Array, Array]:
    """Mean (45,) and basis (n, 45) of the pose parameters."""
    n = 3 * free_pose.N_FREE
    if method == "gdc":
        relaxed = model.local_rotations(model.rotations(model.mean_angles))
        return matrix_to_vector(relaxed).ravel(), np.eye(n)
    mean, basis = components or free_pose.pose_components(model)
    return mean, basis[: settings.components]


def _descend(
    model: HandModel, joints: Array, space: tuple[Array, Array], settings: GDCSettings
) -> FreeFit:
    """Adam on the pose parameters, the root's rotation and its translation."""
    mean, basis = space
    n = len(joints)
    rotation, translation = free_pose.palm_pose(model, joints)
    z = np.zeros((n, len(basis)))
    first, second = np.zeros((n, z.shape[1] + 6)), np.zeros((n, z.shape[1] + 6))
    for step in range(1, settings.steps + 1):
        vectors = (mean + z @ basis).reshape(n, free_pose.N_FREE, 3)
        local = vector_to_matrix(vectors)
        turns, places = free_pose.accumulated(model, local, rotation, translation)
        fitted = free_pose.joints_of(model, turns, places)
        by_vectors, by_turn, by_move = free_pose.gradient(
            vectors, turns, places, fitted, 2.0 * np.nan_to_num(fitted - joints), translation
        )
        slope = np.concatenate(
            [
                by_vectors.reshape(n, -1) @ basis.T + 2.0 * settings.prior * z,
                by_turn,
                0.1 * by_move,
            ],
            1,
        )
        # Kingma and Ba 2015, algorithm 1
        first = 0.9 * first + 0.1 * slope
        second = 0.999 * second + 0.001 * slope**2
        hot = first / (1 - 0.9**step) / (np.sqrt(second / (1 - 0.999**step)) + 1e-12)
        fall = 0.55 + 0.45 * np.cos(np.pi * step / settings.steps)
        move = -settings.rate * fall * hot
        z = z + move[:, : z.shape[1]]
        rotation = vector_to_matrix(move[:, -6:-3]) @ rotation
        translation = translation + 0.1 * move[:, -3:]
    local = vector_to_matrix((mean + z @ basis).reshape(n, free_pose.N_FREE, 3))
    return free_pose.free_fit(model, joints, local, rotation, translation)


def _spread(parts: list[FreeFit], complete: NDArray[np.bool_]) -> FreeFit:
    """The results in their places; NaN where frames are missing."""
    n = len(complete)
    shapes = {
        "angles": (n, N_ANGLES),
        "rotation": (n, 3, 3),
        "translation": (n, 3),
        "joints": (n, N_JOINTS, 3),
        "objective": (n,),
        "variance": (n, N_ANGLES),
        "local": (n, free_pose.N_FREE, 3, 3),
    }
    out = {name: np.full(shape, np.nan) for name, shape in shapes.items()}
    out["variance"][:] = np.inf
    status = np.full(n, "missing", dtype="<U15")
    if parts:
        for name, value in out.items():
            value[complete] = np.concatenate([getattr(part, name) for part in parts])
        status[complete] = np.concatenate([part.status for part in parts])
    return FreeFit(**out, status=status)
