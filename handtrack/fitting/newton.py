"""Newton steps for one frame that keep the limits, on the structure of the hand.

The Hessian is arrowhead-shaped: six unknowns of the root and five independent fingers of
four. Every finger's small bounded problem is solved exactly for a given step of the root
(`fingers.py`); how its solution answers the root makes up the Schur complement from which the
root's step comes. A step is taken only if it lowers the objective.
"""

from __future__ import annotations

import math

from handtrack.fitting.arrowhead import (
    SOUND_PIVOT,
    add_model_gradient,
    eliminate_fingers,
    factor_faces,
    lift_pivots,
    move_along_faces,
    root_hessian,
    solve_root,
)
from handtrack.fitting.compiled import Solver, inline
from handtrack.fitting.fingers import guess_faces, inverse_squares, keeps_limits, solve_finger
from handtrack.fitting.lanes import (
    ANGLE_2,
    ANGLE_Y,
    ANGLE_Z,
    BEFORE,
    CHANGE,
    CONVERGED,
    LANES,
    LIMIT,
    LOW_2,
    MAX_STEPS,
    OBJECTIVE,
    RHO,
    ROOT,
    ROOT_BEFORE,
    ROOT_GRAD,
    ROW,
    ROW_Z,
    STALLED,
    STATE,
    STEP_Z,
    STEPS,
    TOLERANCE,
    UP_2,
    G,
    differentiate,
    place,
)
from handtrack.fitting.vectors import cross, dot

# the root has answered the fingers once its change is this small a share (squared) of its step
INNER = 1e-2
# how sure the estimate of what remains must be
SURE = 100.0
# steps with well-lifted pivots, and what is sound after them
PATIENCE, WEAK_PIVOT = 8, 1e-3
# [m^2] an objective this small is zero
NOTHING = 1e-22


@inline
def clear_step(s):
    for i in range(4 * LANES):
        s[STEP_Z + i] = 0.0
    for i in range(6):
        s[RHO + i] = 0.0


@inline
def find_step(s):
    """The step that minimises the quadratic model inside the limits, in STEP and RHO.

    Returns False where the model has no minimum; the step is then of little use.
    """
    guess_faces(s)
    clear_step(s)
    sound = True
    for inner in range(5):
        # first all faces as guessed; then the root answers the fingers' bounded steps
        factor_faces(s)
        root_hessian(s)
        if inner > 0:
            add_model_gradient(s)
        eliminate_fingers(s)
        sound = solve_root(s)
        size = total = 0.0
        for i in range(6):
            s[RHO + i] += s[CHANGE + i]
            size += s[CHANGE + i] * s[CHANGE + i]
            total += s[RHO + i] * s[RHO + i]
        move_along_faces(s, inner == 0)
        solved = False
        for f in range(5):
            if not keeps_limits(s, f):
                solve_finger(s, f)
                solved = True
        if not solved or size < INNER * total:
            break
    return sound


@inline
def slope_of_step(s):
    """Directional derivative of half the objective along the step."""
    v = 0.0
    for a in range(4):
        for f in range(5):
            v += s[ROW_Z + a * ROW + G + f] * s[STEP_Z + a * LANES + f]
    for i in range(6):
        for f in range(6):
            v += s[ROOT_GRAD + i * LANES + f] * s[RHO + i]
    return v


@inline
def keep_pose(s):
    for i in range(4 * LANES):
        s[BEFORE + i] = s[ANGLE_Z + i]
    for i in range(12):
        s[ROOT_BEFORE + i] = s[ROOT + i]


@inline
def take_step(s, share):
    """The pose before, moved by a share of the step; limits hold to the last digit."""
    for i in range(4 * LANES):
        s[ANGLE_Z + i] = s[BEFORE + i] + share * s[STEP_Z + i]
    for i in range(2 * LANES):
        s[ANGLE_2 + i] = min(max(s[ANGLE_2 + i], s[LOW_2 + i]), s[UP_2 + i])
    for f in range(5):
        z, y = s[ANGLE_Z + f], s[ANGLE_Y + f]
        pz, py = inverse_squares(s, f, z, y)
        n = math.sqrt(z * z * pz + y * y * py)
        if n > 1.0:
            s[ANGLE_Z + f], s[ANGLE_Y + f] = z / n, y / n
    # R exp(omega) and t + R v
    w = (share * s[RHO], share * s[RHO + 1], share * s[RHO + 2])
    v = (share * s[RHO + 3], share * s[RHO + 4], share * s[RHO + 5])
    angle = math.sqrt(dot(w, w))
    k = math.sin(angle) / angle if angle > 1e-9 else 1.0
    h = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    h = 2.0 * h * h
    for i in range(3):
        b = ROOT_BEFORE + 3 * i
        r = (s[b], s[b + 1], s[b + 2])
        # a row times exp(omega) is the row turned backwards
        x = cross(r, w)
        xx = cross(x, w)
        for j in range(3):
            s[ROOT + 3 * i + j] = r[j] + k * x[j] + h * xx[j]
        s[ROOT + 9 + i] = s[ROOT_BEFORE + 9 + i] + dot(r, v)


@Solver
def newton(s):
    """Newton steps from the pose in the buffer until there is no more to gain.

    In the buffer: MAX_STEPS at most; TOLERANCE, to stop once less than this share of the
    objective is to be gained, as steps promise it or as the last one's promise was kept. Adds to
    STEPS; sets OBJECTIVE and STATE to CONVERGED, LIMIT or STALLED (no share of the step lowers
    the objective). The pose is never worse than before.
    """
    cost = math.inf
    promise = math.inf
    share = 0.0
    steps = 0.0
    state = LIMIT
    second = 0.0  # the exact Hessian pays once the pose is near
    keep_pose(s)
    clear_step(s)
    while True:
        take_step(s, share)
        new = place(s)
        if share > 0.0 and not new <= cost - 2e-4 * share * promise:
            # Armijo's test failed: a shorter step, or back to where it began
            share *= 0.5 if share > 0.2 else 0.2
            if share < 1e-9:
                share = 0.0
                state = CONVERGED if promise <= 1e-9 * cost + NOTHING else STALLED
            continue
        # What a step leaves is of the size of (broken promise)^2 / promise, if it is Newton's
        broken = new - (cost - promise)
        near = second == 1.0 and steps > 1.0 and promise <= SURE * s[TOLERANCE] * new
        if near and share == 1.0 and SURE * broken * broken <= s[TOLERANCE] * new * promise:
            state = CONVERGED
        cost = new
        # a full step squares the error; a shortened one may be rounding's
        if promise <= (s[TOLERANCE] if share == 1.0 else 1e-9) * cost + NOTHING:
            state = CONVERGED
        if state != LIMIT or steps == s[MAX_STEPS]:
            break
        while True:
            differentiate(s, second)
            # a pose that few joints determine has small pivots by nature: trust them in time
            lift_pivots(s, SOUND_PIVOT if steps < PATIENCE else WEAK_PIVOT)
            # far from the solution only Gauss-Newton's model surely has a minimum
            if find_step(s) or second == 0.0:
                break
            second = 0.0
        promise = -slope_of_step(s)
        if not promise > 0.0 or cost < NOTHING:
            # no descent: rounding's, or the fingers' limits misled the root
            rounding = abs(promise) <= 1e-12 * cost + NOTHING
            state = CONVERGED if rounding or cost < NOTHING else STALLED
            break
        keep_pose(s)
        share = 1.0
        second = 1.0
        steps += 1.0
    s[OBJECTIVE] = cost
    s[STATE] = state
    s[STEPS] += steps
