"""The smoother of poses, backwards over what the filter kept.

The form of Bryson and Frazier (1963), which needs no inverse of the predicted covariance: an
adjoint r runs back through r = F^T (r + H^T S^-1 (z - H P r)), and the smoothed pose is the
predicted one plus P r. Its results are those of Rauch, Tung and Striebel (1965).
"""

from __future__ import annotations

import numpy as np

from handtrack.fitting.compiled import inline, kernel
from handtrack.fitting.dense import apply_matrix, multiply
from handtrack.tracking.kalman_kernel import BEGUN, KIND, NOTHING, move_pose, store_row

_R, _V, _Y, _T = range(4)


@inline
def back(t, w, k_prior, k_t, k_a):
    """Take the adjoint in w over the measurement of frame t."""
    apply_matrix(k_prior[t, 0], w[_R], w[_Y])
    apply_matrix(k_prior[t, 1], w[_V], w[_T])
    for i in range(26):
        w[_Y, i] += w[_T, i]
    apply_matrix(k_t[t], w[_Y], w[_T])
    for i in range(26):
        w[_R, i] += k_a[t, i] - w[_T, i]


@inline
def before(t, w, k_transition):
    """Take the adjoint over the transition to frame t."""
    for i in range(26):
        w[_V, i] = k_transition[t, 0, i] * w[_R, i] + k_transition[t, 1, i] * w[_V, i]


@inline
def smoothed(t, w, k_pose, k_prior, pose):
    """The smoothed pose (32,) of frame t, from the adjoint over its measurement."""
    apply_matrix(k_prior[t, 0], w[_R], w[_Y])
    apply_matrix(k_prior[t, 1], w[_V], w[_T])
    for i in range(26):
        w[_Y, i] += w[_T, i]
    for i in range(32):
        pose[i] = k_pose[t, i]
    move_pose(pose, w[_Y])


@inline
def run_back(first, last, end, notes, kept, w, pose, s, solver, angles, root, out, at):
    """Smoothed poses of the frames first..last - 1 given all before `end`, from out[at] on."""
    k_transition, k_pose, k_prior, k_t, k_a = kept
    for i in range(26):
        w[_R, i] = w[_V, i] = 0.0
    for t in range(end - 1, first - 1, -1):
        if notes[t, KIND] == NOTHING:
            for i in range(26):
                w[_R, i] = w[_V, i] = 0.0
            continue
        back(t, w, k_prior, k_t, k_a)
        if t < last:
            smoothed(t, w, k_pose, k_prior, pose)
            store_row(s, solver, pose, angles, root, out[at + t - first])
        if notes[t, KIND] == BEGUN:
            for i in range(26):
                w[_R, i] = w[_V, i] = 0.0
        else:
            before(t, w, k_transition)


@kernel
def smooth_frames(state, solver, first, last, notes, kept, out):
    """Smoothed poses of the frames first..last - 1 from all that is kept.

    Args:
        state, solver: as in `filter_frames`, for room and the model; the filter's is not touched.
        first, last: which poses are wanted.
        notes: (T, 3); kept: of the T frames, as in `filter_frames`.
        out: (last - first, OUT_SIZE); frames without a pose are left as they are.
    """
    w, pose = np.zeros((4, 26)), np.empty(32)
    s, angles, root = state[4], state[6], state[7]
    run_back(first, last, len(notes), notes, kept, w, pose, s, solver, angles, root, out, 0)


@kernel
def lag_frames(state, solver, lag, notes, kept, out):
    """Poses of the frames 0..T - lag - 1, each smoothed by the `lag` frames after it.

    Args: as in `smooth_frames`; out (T - lag, OUT_SIZE).
    """
    w, pose = np.zeros((4, 26)), np.empty(32)
    s, angles, root = state[4], state[6], state[7]
    for t in range(len(notes) - lag):
        run_back(t, t + 1, t + lag + 1, notes, kept, w, pose, s, solver, angles, root, out, t)


@kernel
def motion_evidence(notes, kept, m, evidence):
    """How well the densities of the motion's noise fit, by the smoothed disturbances.

    With r the adjoint and N its covariance, the score of density i is r' U r - tr(N U) over
    all transitions, U being its 2 x 2 noise at unit density (Koopman 1993).

    Args:
        notes, kept: as in `smooth_frames`.
        m: (10, 26, 26) for work.
        evidence: (2, 26); the sums of r' U r and of tr(N U) are added.
    """
    k_transition, _, k_prior, k_t, k_a = kept
    w = np.zeros((4, 26))
    p, c, v = m[0], m[1], m[2]
    a, b, y, z, x = m[3], m[4], m[5], m[6], m[7]
    for i in range(26):
        for j in range(26):
            p[i, j] = c[i, j] = v[i, j] = 0.0
    for t in range(len(notes) - 1, -1, -1):
        if notes[t, KIND] == NOTHING or notes[t, KIND] == BEGUN:
            for i in range(26):
                w[_R, i] = w[_V, i] = 0.0
                for j in range(26):
                    p[i, j] = c[i, j] = v[i, j] = 0.0
            continue
        back(t, w, k_prior, k_t, k_a)
        # N over the measurement, by blocks; K H changes the pose's columns only
        pa, pb, s = k_prior[t, 0], k_prior[t, 1], k_t[t]
        multiply(p, pa, a)
        multiply_transposed(c, pb, b)
        for i in range(26):
            for j in range(26):
                a[i, j] += b[i, j]
        multiply(a, s, y)
        first_transposed(c, pa, a)
        multiply_transposed(v, pb, b)
        for i in range(26):
            for j in range(26):
                a[i, j] += b[i, j]
        multiply(a, s, z)
        for i in range(26):
            for j in range(26):
                y[i, j] = p[i, j] - y[i, j]
                x[i, j] = c[j, i] - z[i, j]
        multiply(pa, y, a)
        multiply(pb, x, b)
        for i in range(26):
            for j in range(26):
                a[i, j] += b[i, j]
        multiply(s, a, b)
        for i in range(26):
            for j in range(26):
                p[i, j] = y[i, j] - b[i, j] + s[i, j]
        for i in range(26):
            for j in range(26):
                c[i, j] -= z[j, i]
        q = k_transition[t]
        for i in range(26):
            r, u = w[_R, i], w[_V, i]
            evidence[0, i] += q[2, i] * r * r + 2.0 * q[3, i] * r * u + q[4, i] * u * u
            evidence[1, i] += q[2, i] * p[i, i] + 2.0 * q[3, i] * c[i, i] + q[4, i] * v[i, i]
        before(t, w, k_transition)
        for i in range(26):
            f, g = q[0, i], q[1, i]
            for j in range(26):
                h, k = q[0, j], q[1, j]
                y[i, j] = f * p[i, j] * h + f * c[i, j] * k + g * c[j, i] * h + g * v[i, j] * k
                x[i, j] = p[i, j] * h + c[i, j] * k
        # what rounding makes unequal would grow
        for i in range(26):
            for j in range(26):
                v[i, j], c[i, j] = 0.5 * (y[i, j] + y[j, i]), x[i, j]
            for j in range(i):
                p[i, j] = p[j, i] = 0.5 * (p[i, j] + p[j, i])


@inline
def multiply_transposed(a, b, out):
    """out = a b^T."""
    for i in range(26):
        for j in range(26):
            x = 0.0
            for k in range(26):
                x += a[i, k] * b[j, k]
            out[i, j] = x


@inline
def first_transposed(a, b, out):
    """out = a^T b."""
    for i in range(26):
        for j in range(26):
            out[i, j] = 0.0
    for k in range(26):
        for i in range(26):
            x = a[k, i]
            for j in range(26):
                out[i, j] += x * b[k, j]
