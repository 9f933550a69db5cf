"""Compiled wrappers of the parts under test, made once, and a workspace to run them in."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numba import njit
from scipy.optimize import brentq

from handtrack.hand.model import HandModel
from handtrack.kernels import arrowhead, descent, exchange, finger_model, joint_objective, li2021
from handtrack.kernels import derivatives as kernel_derivatives
from handtrack.kernels import procrustes as kabsch
from handtrack.kernels.workspace import ANGLES, FINGERS, GRADIENT, ROOT, WORK

sys.path.append(str(Path(__file__).resolve().parents[1] / "fitting"))
from fit_cases import N_POSE

Array = np.ndarray


@njit
def load(works, model, targets, weights, angles, root):
    exchange.load_model(works[0], model)
    exchange.load_frame(works[0], targets, weights, 1.0)
    exchange.load_pose(works[0], angles, root)


@njit
def place(works):
    return joint_objective.place(works[0])


@njit
def derive(works, second):
    value = joint_objective.place(works[0])
    kernel_derivatives.differentiate(works[0], second)
    arrowhead.root_hessian(works[0])
    return value


@njit
def solve_finger(works, f):
    finger_model.solve_finger(works[0], f)


@njit
def procrustes(m):
    return kabsch.procrustes(m)


@njit
def hinge_exact(n, w, t, a, lower, upper, current):
    return descent.hinge_exact(n, w, t, a, lower, upper, current)


@njit
def saddle_exact(nz, ny, w, t, a, z, y, limits):
    return descent.saddle_exact(nz, ny, w, t, a, z, y, limits)


@njit
def saddle_li2021(nz, ny, w, t, a, z, y, limits):
    return li2021.saddle_li2021(nz, ny, w, t, a, z, y, limits)


@njit
def hinge_li2021(n, w, t, a, lower, upper, current):
    return li2021.hinge_li2021(n, w, t, a, lower, upper, current)


@njit
def euler_zy(r, nz, ny):
    return li2021.euler_zy(r, nz, ny)


_exact_pass = descent.finger_pass(descent.saddle_exact, descent.hinge_exact)
_paper_pass = descent.finger_pass(li2021.saddle_li2021, li2021.hinge_li2021)


@njit
def update_root(works):
    joint_objective.place(works[0])
    descent.update_root(works[0])


@njit
def update_finger(works, f):
    joint_objective.place(works[0])
    _exact_pass(works[0], f)


@njit
def update_finger_li2021(works, f):
    joint_objective.place(works[0])
    _paper_pass(works[0], f)


def vector(x) -> tuple[float, float, float]:
    return (float(x[0]), float(x[1]), float(x[2]))


def rows(m) -> tuple:
    return tuple(vector(row) for row in m)


def loaded(model: HandModel, joints, weights, angles, rotation, translation, twist=0.0) -> Array:
    """A workspace (1,) with model, frame and pose in it."""
    works = np.zeros(1, WORK)
    root = np.concatenate([np.ravel(rotation), translation])
    weights = np.where(np.isnan(joints).any(-1), 0.0, weights)
    load(
        works,
        (
            np.array(model.rest_joints),
            np.array(model.axes),
            np.array(model.limits.lower),
            np.array(model.limits.upper),
            twist,
            np.array(model.landmark_offsets),
        ),
        np.nan_to_num(joints),
        weights,
        np.array(angles),
        root,
    )
    return works


def by_finger(lanes: Array) -> Array:
    """(20,) numbers of the angles from their lanes (4, 8)."""
    return lanes[:, :FINGERS].T.ravel()


def derivatives(works: Array, second: float) -> tuple[float, Array, Array]:
    """Half the objective, its gradient (26,) and Hessian (26, 26) from the workspace."""
    value, w = derive(works, second) / 2, works[0]
    g, h = np.zeros(N_POSE), np.zeros((N_POSE, N_POSE))
    g[:20] = by_finger(w["row"][:, GRADIENT])
    for f in range(FINGERS):
        part = slice(ANGLES * f, ANGLES * f + ANGLES)
        h[part, part] = w["hessian"][:, :, f]
        h[part, 20:] = w["row"][:, :ROOT, f]
        h[20:, part] = h[part, 20:].T
    h[20:, 20:], g[20:] = w["system"][:, :ROOT], w["system"][:, GRADIENT]
    return value, g, h


def nearest_on_ellipse(point: Array, axes: Array) -> Array:
    """Nearest point (2,) of an ellipse to a point outside it: the multiplier by SciPy's search.

    x = a^2 p / (a^2 + t) is where p - x is t times half the ellipse's normal; on it at one t > 0.
    """
    square = np.square(axes)

    def outside(t: float) -> float:
        return float(np.square(axes * point / (square + t)).sum()) - 1.0

    t = brentq(outside, 0.0, np.linalg.norm(axes * point), xtol=1e-15, rtol=1e-14)
    return np.asarray(square * point / (square + t))
