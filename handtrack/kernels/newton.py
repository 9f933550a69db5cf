"""Newton steps for one frame that keep the limits, on the structure of the hand.

The Hessian is arrowhead-shaped: six unknowns of the root and five independent fingers of
four. Every finger's small bounded problem is solved exactly for a given step of the root
(`finger_model`); how its solution answers the root makes up the Schur complement from which the
root's step comes. A step is taken only if it lowers the objective.
"""

from __future__ import annotations

import math

from handtrack.kernels.arrowhead import (
    SOUND_PIVOT,
    add_model_gradient,
    eliminate_fingers,
    factor_faces,
    lift_pivots,
    move_along_faces,
    root_hessian,
    solve_root,
)
from handtrack.kernels.compiled import Solver, inline
from handtrack.kernels.derivatives import differentiate
from handtrack.kernels.faces import guess_faces, keeps_limits
from handtrack.kernels.finger_model import solve_finger
from handtrack.kernels.joint_objective import NOTHING, place
from handtrack.kernels.pose_steps import clear_step, keep_pose, take_step
from handtrack.kernels.workspace import (
    ANGLES,
    CONVERGED,
    FINGERS,
    GRADIENT,
    LIMIT,
    ROOT,
    STALLED,
)

# the root has answered the fingers once its change is this small a share (squared) of its step
INNER = 1e-2
# how sure the estimate of what remains must be
SURE = 100.0
# steps with well-lifted pivots, and what is sound after them
PATIENCE, WEAK_PIVOT = 8, 1e-3


@inline
def find_step(w):
    """The step that minimises the quadratic model inside the limits, in `step` and `root_step`.

    Returns False where the model has no minimum; the step is then of little use.
    """
    guess_faces(w)
    clear_step(w)
    sound = True
    for inner in range(5):
        # first all faces as guessed; then the root answers the fingers' bounded steps
        factor_faces(w)
        root_hessian(w)
        if inner > 0:
            add_model_gradient(w)
        eliminate_fingers(w)
        sound = solve_root(w)
        size = total = 0.0
        for i in range(ROOT):
            w.root_step[i] += w.root_change[i]
            size += w.root_change[i] * w.root_change[i]
            total += w.root_step[i] * w.root_step[i]
        move_along_faces(w, inner == 0)
        solved = False
        for f in range(FINGERS):
            if not keeps_limits(w, f):
                solve_finger(w, f)
                solved = True
        if not solved or size < INNER * total:
            break
    return sound


@inline
def slope_of_step(w):
    """Directional derivative of half the objective along the step."""
    v = 0.0
    for a in range(ANGLES):
        for f in range(FINGERS):
            v += w.row[a, GRADIENT, f] * w.step[a, f]
    for i in range(ROOT):
        for f in range(FINGERS + 1):
            v += w.root_gradient[i, f] * w.root_step[i]
    return v


@inline
def next_model(w, second, steps):
    """Derivatives and step at the placed pose; whether the exact Hessian is kept (1) or not (0)."""
    while True:
        differentiate(w, second)
        # a pose that few joints determine has small pivots by nature: trust them in time
        lift_pivots(w, SOUND_PIVOT if steps < PATIENCE else WEAK_PIVOT)
        # far from the solution only Gauss-Newton's model surely has a minimum
        if find_step(w) or second == 0.0:
            return second
        second = 0.0


@Solver
def newton(w):
    """Newton steps from the pose in the workspace until there is no more to gain.

    In the workspace: `max_steps` at most; `tolerance`, to stop once less than this share of the
    objective is to be gained, as steps promise it or as the last one's promise was kept. Adds to
    `steps`; sets `objective` and `state` to CONVERGED, LIMIT or STALLED (no share of the step
    lowers the objective). The pose is never worse than before.
    """
    cost = promise = math.inf
    share = steps = 0.0
    state = LIMIT
    second = 0.0  # the exact Hessian pays once the pose is near
    keep_pose(w)
    clear_step(w)
    while True:
        take_step(w, share)
        new = place(w)
        if share > 0.0 and not new <= cost - 2e-4 * share * promise:
            # Armijo's test failed: a shorter step, or back to where it began
            share *= 0.5 if share > 0.2 else 0.2
            if share < 1e-9:
                share = 0.0
                state = CONVERGED if promise <= 1e-9 * cost + NOTHING else STALLED
            continue
        # What a step leaves is of the size of (broken promise)^2 / promise, if it is Newton's
        broken = new - (cost - promise)
        near = second == 1.0 and steps > 1.0 and promise <= SURE * w.tolerance * new
        if near and share == 1.0 and SURE * broken * broken <= w.tolerance * new * promise:
            state = CONVERGED
        cost = new
        # a full step squares the error; a shortened one may be rounding's
        if promise <= (w.tolerance if share == 1.0 else 1e-9) * cost + NOTHING:
            state = CONVERGED
        if state != LIMIT or steps == w.max_steps:
            break
        second = next_model(w, second, steps)
        promise = -slope_of_step(w)
        if not promise > 0.0 or cost < NOTHING:
            # no descent: rounding's, or the fingers' limits misled the root
            rounding = abs(promise) <= 1e-12 * cost + NOTHING
            state = CONVERGED if rounding or cost < NOTHING else STALLED
            break
        keep_pose(w)
        share = second = 1.0
        steps += 1.0
    w.objective = cost
    w.state = state
    w.steps += steps
