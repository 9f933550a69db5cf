"""Frame after frame in compiled code: start, solve, report; one loop for one frame or many.

`Tracker.step` and `track` both come here, the one with a single frame: their results are the
same to the last bit.
"""

from __future__ import annotations

import math

import numpy as np

from handtrack.fitting.compiled import call, inline, kernel
from handtrack.fitting.lanes import (
    ANGLE_Z,
    COLD,
    CONTACTS,
    CONVERGED,
    COVARIANCE,
    FULL,
    LANES,
    LOSS,
    MAX_STEPS,
    MAX_SWEEPS,
    OBJECTIVE,
    PAIR,
    RISE,
    SPREAD2,
    STALLED,
    STATE,
    STEPS,
    SWEEPS,
    TOLERANCE,
    TOO_FEW,
    TRIAL,
    UNDERDETERMINED,
    VARIANCE,
    load_frame,
    load_model,
    load_pose,
    store_joints,
    store_pose,
)
from handtrack.fitting.vectors import add, distance2, row, scale, sub

# joints nearer than this to one line leave the rotation about it open [m]
LINE = 1e-4

# a finger's other bend is tried in a cold start where alone it adds no more than this share
MISBENT = 0.02
# and must gain this share to be taken; next to nothing then, but after a fitted frame that one
# is, under noise, the better guess
COLD_GAIN, WARM_GAIN = 1e-9, 0.1

# a frame's row of results: angles, rotation, translation, quaternion, joints, objective, noise
# (variance per coordinate), joints seen, state, sweeps, steps, variances of the angles, the
# greatest distance of a joint to its fitted one; 1 where what was before means nothing (which is
# for others to say), else 0
OUT_ANGLES, OUT_ROOT, OUT_SHIFT, OUT_QUATERNION, OUT_JOINTS, OUT_OBJECTIVE = 0, 20, 29, 32, 36, 99
OUT_NOISE, OUT_SEEN, OUT_STATE, OUT_SWEEPS, OUT_STEPS, OUT_VARIANCE = range(100, 106)
OUT_WORST = OUT_VARIANCE + 20
OUT_ANEW = OUT_WORST + 1
OUT_SIZE = OUT_ANEW + 1

# what is kept from frame to frame: angles, root, and whether they mean anything
KEEP_ROOT, MEMORY = 20, 32
KEEP_SIZE = 33
NEW, LOST, FITTED = 0, 1, 2

# what is wrong with a frame's input
GOOD, INFINITE_JOINT, BAD_WEIGHT = range(3)


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


@inline
def clean(targets, weights):
    """Make joints with a NaN missing, with no weight; what is wrong with the frame otherwise."""
    wrong = GOOD
    for k in range(21):
        if not 0.0 <= weights[k] < math.inf:
            wrong = BAD_WEIGHT
        x = row(targets, k)
        if math.isinf(x[0]) or math.isinf(x[1]) or math.isinf(x[2]):
            wrong = INFINITE_JOINT
        elif math.isnan(x[0]) or math.isnan(x[1]) or math.isnan(x[2]):
            targets[k, 0] = targets[k, 1] = targets[k, 2] = math.nan
            weights[k] = 0.0
    return wrong


@inline
def store_quaternion(out, i, root):
    """Unit quaternion wxyz, w >= 0, of the rotation (9,) that root begins with, at out[i:i + 4].

    From the largest of the four squared components, so it is accurate at any angle.
    """
    xx, yy, zz = root[0], root[4], root[8]
    x, y, z = root[7] - root[5], root[2] - root[6], root[3] - root[1]
    xy, xz, yz = root[1] + root[3], root[2] + root[6], root[5] + root[7]
    trace = xx + yy + zz
    if trace >= max(xx, yy, zz):
        q = (1.0 + trace, x, y, z)
    elif xx >= yy and xx >= zz:
        q = (x, 1.0 + xx - yy - zz, xy, xz)
    elif yy >= zz:
        q = (y, xy, 1.0 - xx + yy - zz, yz)
    else:
        q = (z, xz, yz, 1.0 - xx - yy + zz)
    n = 1.0 / math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    if q[0] < 0.0:
        n = -n
    for j in range(4):
        out[i + j] = n * q[j]


@kernel
def fit_frames(
    model, contacts, solvers, settings, mean, keep, targets, weights, out, out_covariance
):
    """Fit frame after frame, each from the one before.

    Args:
        model: (rest joints (21, 3), axes (20, 3), lower (20,), upper (20,), twist).
        contacts: (P, 5) pairs of capsules (see `hand.capsules.contacts`); (0, 5) for none.
        solvers: addresses of Algorithm 1, of the Newton steps (0: Algorithm 1 alone), of the
            fingers' other bends (0: none are tried), of `move_apart` (0: nothing is) and of the
            covariance.
        settings: (sweeps of a cold start, sweeps at most, steps at most, tolerance, robust loss,
            its spread [m], variance of the joints [m^2] or 0 for what the residual shows, joints
            below which a frame is not fitted, 1 where every frame starts anew from `mean`). With
            at least one joint every frame is fitted that has one, else also none with its joints
            on a line.
        mean: (20,) the pose of a cold start.
        keep: (KEEP_SIZE,) the last fitted pose, and MEMORY: NEW before anything was fitted, LOST
            after a loss, FITTED after a fitted frame; overwritten.
        targets: (T, 21, 3), NaN = missing; weights: (T, 21). Overwritten: a joint is missing as
            a whole and has no weight then.
        out: (T, OUT_SIZE) results, NaN where nothing is fitted and variances infinite.
        out_covariance: (T, 26, 26) at unit noise, left as they are where nothing is fitted; or
            (0, 26, 26), and the variances of the angles are all that is computed.

    Returns:
        GOOD; INFINITE_JOINT or BAD_WEIGHT (negative or not finite), and nothing is fitted.
    """
    rest, axes, lower, upper, twist = model
    descend, newton, bends, apart, covariance = solvers
    cold_sweeps, max_sweeps, max_steps, tolerance, loss, spread, known, min_joints, alone = settings
    for t in range(len(targets)):
        wrong = clean(targets[t], weights[t])
        if wrong != GOOD:
            return wrong
    s = np.zeros(CONTACTS + 1 + PAIR * len(contacts))
    s[CONTACTS] = len(contacts)
    for i in range(len(contacts)):
        for j in range(PAIR):
            s[CONTACTS + 1 + PAIR * i + j] = contacts[i, j]
    load_model(s, rest, axes, lower, upper, twist)
    full = len(out_covariance) > 0
    s[MAX_STEPS] = max_steps
    s[FULL] = 1.0 if full else 0.0
    s[LOSS] = loss
    s[SPREAD2] = spread * spread
    angles, root = keep[:KEEP_ROOT], keep[KEEP_ROOT:MEMORY]
    best_angles = np.empty(20)
    best_root = np.empty(12)
    for t in range(len(targets)):
        if alone:
            keep[MEMORY] = NEW
        seen = 0
        scale = 0.0
        for k in range(21):
            if weights[t, k] > 0.0:
                seen += 1
                scale = max(scale, weights[t, k])
        s[SWEEPS] = s[STEPS] = 0.0
        line = seen < 3 or on_a_line(targets[t], weights[t])
        out[t, OUT_ANEW] = 0.0
        if seen < min_joints or (line and min_joints > 1):
            keep[MEMORY] = min(keep[MEMORY], LOST)
            for i in range(OUT_VARIANCE):
                out[t, i] = math.nan
            for i in range(20):
                out[t, OUT_VARIANCE + i] = math.inf
            out[t, OUT_WORST] = math.nan
            out[t, OUT_SEEN] = seen
            out[t, OUT_STATE] = TOO_FEW if seen < min_joints else UNDERDETERMINED
            out[t, OUT_SWEEPS] = out[t, OUT_STEPS] = 0.0
            continue
        load_frame(s, targets[t], weights[t], scale)
        best = math.inf
        state = STALLED
        # from the last pose; where that is not the frame before's, from the mean pose as well
        first = 0 if keep[MEMORY] > NEW else 1
        for cold in range(first, 1 if keep[MEMORY] == FITTED else 2):
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
        if newton != 0 and bends != 0 and state == CONVERGED:
            # a finger may be bent the wrong way
            load_pose(s, best_angles, best_root)
            call(bends, s)
            warm = keep[MEMORY] == FITTED
            enough = best * (1.0 - (WARM_GAIN if warm else COLD_GAIN))
            for f in range(5):
                if s[RISE + f] > (0.0 if warm else MISBENT * best):
                    continue
                load_pose(s, best_angles, best_root)
                for a in range(4):
                    s[ANGLE_Z + a * LANES + f] = s[TRIAL + a * LANES + f]
                call(newton, s)
                if s[OBJECTIVE] < enough and s[STATE] == CONVERGED:
                    best = enough = s[OBJECTIVE]
                    store_pose(s, best_angles, best_root)
        keep[MEMORY] = FITTED
        load_pose(s, best_angles, best_root)
        if apart != 0:
            call(apart, s)
            best = s[OBJECTIVE]
        store_pose(s, angles, root)
        call(covariance, s)
        store_joints(s, out[t, OUT_JOINTS:OUT_OBJECTIVE].reshape(21, 3))
        worst = 0.0
        for k in range(21):
            if weights[t, k] > 0.0:
                j = OUT_JOINTS + 3 * k
                fitted = (out[t, j], out[t, j + 1], out[t, j + 2])
                worst = max(worst, distance2(fitted, row(targets[t], k)))
        out[t, OUT_WORST] = math.sqrt(worst)
        for i in range(20):
            out[t, OUT_ANGLES + i] = angles[i]
        for i in range(12):
            out[t, OUT_ROOT + i] = root[i]
        store_quaternion(out[t], OUT_QUATERNION, root)
        objective = best * scale
        noise = known if known > 0.0 else objective / max(3 * seen - 26, 1)
        out[t, OUT_OBJECTIVE] = objective
        out[t, OUT_NOISE] = noise
        out[t, OUT_SEEN] = seen
        out[t, OUT_STATE] = UNDERDETERMINED if line else state
        out[t, OUT_SWEEPS], out[t, OUT_STEPS] = s[SWEEPS], s[STEPS]
        for i in range(20):
            v = s[VARIANCE + i]
            out[t, OUT_VARIANCE + i] = v if math.isinf(v) else v / scale * noise
        if full:
            for i in range(26):
                for j in range(26):
                    out_covariance[t, i, j] = s[COVARIANCE + 26 * i + j] / scale
    return GOOD
