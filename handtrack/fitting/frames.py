"""Frame after frame in compiled code: start, solve, report; one loop for one frame or many.

`Tracker.step` and `track` both come here, the one with a single frame: their results are the
same to the last bit.
"""

from __future__ import annotations

import math

import numpy as np

from handtrack.fitting.compiled import call, inline, kernel
from handtrack.fitting.lanes import (
    COLD,
    COVARIANCE,
    FULL,
    LOSS,
    MAX_STEPS,
    MAX_SWEEPS,
    OBJECTIVE,
    SIZE,
    SPREAD2,
    STALLED,
    STATE,
    STEPS,
    SWEEPS,
    TOLERANCE,
    TOO_FEW,
    UNDERDETERMINED,
    load_frame,
    load_model,
    load_pose,
    store_joints,
    store_pose,
)
from handtrack.fitting.vectors import add, row, scale, sub

# joints nearer than this to one line leave the rotation about it open [m]
LINE = 1e-4


@inline
def on_a_line(targets, weights):
    """Whether the weighted joints lie on one line, so that they do not fix a rotation."""
    n = 0.0
    mean = (0.0, 0.0, 0.0)
    for k in range(21):
        if weights[k] > 0.0:
            mean = add(mean, row(targets, k))
            n += 1.0
    mean = scale(1.0 / n, mean)
    # second and third invariants' bound on the middle eigenvalue of the scatter matrix
    xx = yy = zz = xy = xz = yz = 0.0
    for k in range(21):
        if weights[k] > 0.0:
            d = sub(row(targets, k), mean)
            xx += d[0] * d[0]
            yy += d[1] * d[1]
            zz += d[2] * d[2]
            xy += d[0] * d[1]
            xz += d[0] * d[2]
            yz += d[1] * d[2]
    minors = xx * yy - xy * xy + xx * zz - xz * xz + yy * zz - yz * yz
    return not minors > LINE * LINE * (xx + yy + zz)


@kernel
def fit_frames(
    model,
    solvers,
    settings,
    targets,
    weights,
    mean,
    angles,
    root,
    memory,
    min_joints,
    out_angles,
    out_roots,
    out_joints,
    out_objective,
    out_iterations,
    out_state,
    out_variance,
    out_covariance,
):
    """Fit frame after frame, each from the one before.

    Args:
        model: (rest joints (21, 3), axes (20, 3), lower (20,), upper (20,), twist).
        solvers: addresses of Algorithm 1, of the Newton steps (0: Algorithm 1 alone) and of
            the covariance.
        settings: (sweeps of a cold start, sweeps at most, steps at most, tolerance, robust loss,
            its spread [m], 1 where every frame starts anew from `mean`, 1 for the full
            covariance or 0 for the variances of the angles alone).
        targets: (T, 21, 3); weights: (T, 21), 0 where a joint is missing.
        mean: (20,) the pose of a cold start.
        angles, root: (20,), (12,) the last fitted pose; overwritten.
        memory: (1,) 0 before anything was fitted, 1 after a loss, 2 after a fitted frame;
            overwritten.
        min_joints: a frame with fewer joints is not fitted, nor one with its joints on a
            line; with 1 every frame is.
        out_*: results of every frame, left as they are where nothing is fitted; iterations
            (T, 2) are sweeps and steps;
            out_variance (T, 26) and out_covariance (T, 26, 26) at unit noise.
    """
    rest, axes, lower, upper, twist = model
    descend, newton, covariance = solvers
    cold_sweeps, max_sweeps, max_steps, tolerance, loss, spread, alone, full = settings
    s = np.zeros(SIZE)
    load_model(s, rest, axes, lower, upper, twist)
    s[MAX_STEPS] = max_steps
    s[FULL] = full
    s[LOSS] = loss
    s[SPREAD2] = spread * spread
    best_angles = np.empty(20)
    best_root = np.empty(12)
    for t in range(len(targets)):
        if alone:
            memory[0] = 0
        seen = 0
        scale = 0.0
        for k in range(21):
            if weights[t, k] > 0.0:
                seen += 1
                scale = max(scale, weights[t, k])
        s[SWEEPS] = s[STEPS] = 0.0
        line = seen < 3 or on_a_line(targets[t], weights[t])
        if seen < min_joints or (line and min_joints > 1):
            memory[0] = min(memory[0], 1)
            # the arrays came filled with "nothing fitted"
            out_state[t] = TOO_FEW if seen < min_joints else UNDERDETERMINED
            continue
        load_frame(s, targets[t], weights[t], scale)
        best = math.inf
        state = STALLED
        # from the last pose; where that is not the frame before's, from the mean pose as well
        for cold in range(0 if memory[0] > 0 else 1, 1 if memory[0] == 2 else 2):
            load_pose(s, mean if cold else angles, root)
            s[STATE] = STALLED
            s[COLD] = cold
            sweeps = cold_sweeps if cold or newton == 0 else 0
            for _ in range(4):
                if sweeps > 0:
                    s[MAX_SWEEPS] = sweeps if newton != 0 else max_sweeps
                    s[TOLERANCE] = 1e-12 if newton != 0 else tolerance
                    call(descend, s)
                if newton != 0:
                    s[TOLERANCE] = tolerance
                    call(newton, s)
                if s[STATE] != STALLED:
                    break
                # a stalled step is handed back to the sweeps
                sweeps = 10
            if s[OBJECTIVE] < best:
                best = s[OBJECTIVE]
                state = int(s[STATE])
                store_pose(s, best_angles, best_root)
        memory[0] = 2
        load_pose(s, best_angles, best_root)
        store_pose(s, angles, root)
        call(covariance, s)
        store_joints(s, out_joints[t])
        for i in range(20):
            out_angles[t, i] = angles[i]
        for i in range(12):
            out_roots[t, i] = root[i]
        out_objective[t] = best * scale
        out_iterations[t, 0] = s[SWEEPS]
        out_iterations[t, 1] = s[STEPS]
        out_state[t] = UNDERDETERMINED if line else state
        for i in range(26):
            out_variance[t, i] = s[COVARIANCE + 27 * i] / scale
            if full:
                for j in range(26):
                    out_covariance[t, i, j] = s[COVARIANCE + 26 * i + j] / scale
