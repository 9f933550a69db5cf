"""Systems of 26 unknowns as dense matrices, from what a workspace holds by fingers."""

from __future__ import annotations

import numpy as np
from plain import plain

from handtrack.kernels import arrowhead, derivatives
from handtrack.kernels.joint_objective import place
from handtrack.kernels.workspace import GRADIENT, ROOT

N, FINGERS = 26, 5


def directions(w) -> tuple[np.ndarray, np.ndarray]:
    """(26, n) What is free, and (26, 26) what the boundaries' curvature adds."""
    columns, bend = [], np.zeros((N, N))
    for f in range(FINGERS):
        c, s = w.normal[:, f]
        normal, tangent = np.zeros(N), np.zeros(N)
        normal[4 * f : 4 * f + 2], tangent[4 * f : 4 * f + 2] = (c, s), (-s, c)
        bend += w.curvature[f] * np.outer(tangent, tangent)
        made = [normal, tangent, np.eye(N)[4 * f + 2], np.eye(N)[4 * f + 3]]
        columns += [made[a] for a in range(4) if w.free[a, f]]
    return np.stack([*columns, *np.eye(N)[20:]], 1), bend


def dense(w, second: float) -> tuple[np.ndarray, np.ndarray]:
    """Gradient (26,) and Hessian (26, 26) of half the objective, in the root's frame."""
    plain(place)(w)
    plain(derivatives.differentiate)(w, second)
    plain(arrowhead.root_hessian)(w)
    g, h = np.zeros(N), np.zeros((N, N))
    for f in range(FINGERS):
        part = slice(4 * f, 4 * f + 4)
        h[part, part] = w.hessian[:, :, f]
        h[part, 20:] = w.row[:, :ROOT, f]
        h[20:, part] = h[part, 20:].T
        g[part] = w.row[:, GRADIENT, f]
    h[20:, 20:], g[20:] = w.system[:, :ROOT], w.system[:, GRADIENT]
    return g, h
