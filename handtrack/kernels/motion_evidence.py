"""How well assumed densities of the motion's noise fit what a smoother keeps of a sequence."""

from __future__ import annotations

import numpy as np

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.filter_state import BEGUN, NOTHING
from handtrack.kernels.linear_algebra import multiply
from handtrack.kernels.smoother import ADJOINT, SPEED, clear, over_measurement, over_transition
from handtrack.kernels.workspace import N_POSE

# matrices for work: the adjoint's covariance by blocks (poses, poses with velocities,
# velocities), and room
POSE, CROSS, VELOCITY, A, B, Y, Z, X = range(8)
MATRICES = 8


@kernel
def add_evidence(notes, kept, m, evidence):
    """How well the densities of the motion's noise fit, by the smoothed disturbances.

    (36) With r the adjoint and N its covariance, the score of density i is r' U r - tr(N U) over
    all transitions, U being its 2 x 2 noise at unit density (Koopman 1993).

    Args:
        notes, kept: as in `smooth_frames`.
        m: (MATRICES, 26, 26) for work.
        evidence: (2, 26); the sums of r' U r and of tr(N U) are added.
    """
    r = np.zeros((4, N_POSE))
    clear_covariance(m)
    for t in range(len(notes) - 1, -1, -1):
        if notes[t].kind == NOTHING or notes[t].kind == BEGUN:
            clear(r)
            clear_covariance(m)
            continue
        over_measurement(kept[t], r)
        covariance_over_measurement(kept[t], m)
        add_scores(kept[t], r, m, evidence)
        over_transition(kept[t], r)
        covariance_over_transition(kept[t], m)


@inline
def clear_covariance(m):
    for k in range(VELOCITY + 1):
        for i in range(N_POSE):
            for j in range(N_POSE):
                m[k, i, j] = 0.0


@inline
def add_scores(q, r, m, evidence):
    p, c, v = m[POSE], m[CROSS], m[VELOCITY]
    for i in range(N_POSE):
        a, b = r[ADJOINT, i], r[SPEED, i]
        evidence[0, i] += q.q00[i] * a * a + 2.0 * q.q01[i] * a * b + q.q11[i] * b * b
        noise = q.q00[i] * p[i, i] + 2.0 * q.q01[i] * c[i, i]
        evidence[1, i] += noise + q.q11[i] * v[i, i]


@inline
def covariance_over_measurement(kept, m):
    """N over the measurement, by blocks; K H changes the pose's columns only."""
    p, c, v, a, b, y, z, x = m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7]
    pa, pb, s = kept.pose_pose, kept.pose_speed, kept.information
    multiply(p, pa, a)
    multiply_transposed(c, pb, b)
    add_to(a, b)
    multiply(a, s, y)
    first_transposed(c, pa, a)
    multiply_transposed(v, pb, b)
    add_to(a, b)
    multiply(a, s, z)
    for i in range(N_POSE):
        for j in range(N_POSE):
            y[i, j] = p[i, j] - y[i, j]
            x[i, j] = c[j, i] - z[i, j]
    multiply(pa, y, a)
    multiply(pb, x, b)
    add_to(a, b)
    multiply(s, a, b)
    for i in range(N_POSE):
        for j in range(N_POSE):
            p[i, j] = y[i, j] - b[i, j] + s[i, j]
    for i in range(N_POSE):
        for j in range(N_POSE):
            c[i, j] -= z[j, i]


@inline
def covariance_over_transition(q, m):
    """N over the transition: F^T N F, by blocks."""
    p, c, v, y, x = m[POSE], m[CROSS], m[VELOCITY], m[Y], m[X]
    for i in range(N_POSE):
        f, g = q.f01[i], q.f11[i]
        for j in range(N_POSE):
            h, k = q.f01[j], q.f11[j]
            y[i, j] = f * p[i, j] * h + f * c[i, j] * k + g * c[j, i] * h + g * v[i, j] * k
            x[i, j] = p[i, j] * h + c[i, j] * k
    # what rounding makes unequal would grow
    for i in range(N_POSE):
        for j in range(N_POSE):
            v[i, j], c[i, j] = 0.5 * (y[i, j] + y[j, i]), x[i, j]
        for j in range(i):
            p[i, j] = p[j, i] = 0.5 * (p[i, j] + p[j, i])


@inline
def add_to(a, b):
    """a += b."""
    for i in range(N_POSE):
        for j in range(N_POSE):
            a[i, j] += b[i, j]


@inline
def multiply_transposed(a, b, out):
    """out = a b^T."""
    for i in range(N_POSE):
        for j in range(N_POSE):
            x = 0.0
            for k in range(N_POSE):
                x += a[i, k] * b[j, k]
            out[i, j] = x


@inline
def first_transposed(a, b, out):
    """out = a^T b."""
    for i in range(N_POSE):
        for j in range(N_POSE):
            out[i, j] = 0.0
    for k in range(N_POSE):
        for i in range(N_POSE):
            x = a[k, i]
            for j in range(N_POSE):
                out[i, j] += x * b[k, j]
