"""Frame after frame in compiled code: start, solve, report; one loop for one frame or many.

`Tracker.step` and `track` both come here, the one with a single frame: their results are the
same to the last bit.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from handtrack.kernels.compiled import call, inline, kernel
from handtrack.kernels.exchange import (
    load_frame,
    load_model,
    load_pose,
    store_joints,
    store_pose,
)
from handtrack.kernels.vectors import (
    add,
    apply,
    distance2,
    lane,
    matrix,
    part,
    quaternion,
    row,
    scale,
    sub,
)
from handtrack.kernels.workspace import (
    ANGLES,
    CONVERGED,
    FINGERS,
    FITTED,
    JOINTS,
    LOST,
    N_ANGLES,
    N_POSE,
    NEW,
    PAIR,
    STALLED,
    TOO_FEW,
    UNDERDETERMINED,
    WORK,
)

# joints nearer than this to one line leave the rotation about it open [m]
LINE = 1e-4

# a finger's other bend is tried in a cold start where alone it adds no more than this share, and
# must gain this share to be taken: next to nothing; after a fitted frame, which is under noise the
# better guess, the second
MISBENT = 0.02
COLD_GAIN, WARM_GAIN = 1e-9, 0.1


class Solvers(NamedTuple):
    """Addresses of what fits a frame. Compiled code is given plain tuples: those it takes faster.

    Attributes:
        descend, newton: Algorithm 1, the Newton steps; 0: Algorithm 1 alone.
        bends: the fingers' other bends; apart: `move_apart`; 0: none of it.
        covariance: of the pose, or its variances.
    """

    descend: int
    newton: int
    bends: int
    apart: int
    covariance: int


class FitNumbers(NamedTuple):
    """How frames are fitted.

    Attributes:
        cold_sweeps, max_sweeps, max_steps: sweeps of a cold start; sweeps and steps at most.
        tolerance: relative gain at which a solve ends.
        loss, spread, noise: the robust loss, its spread [m]; variance of the joints [m^2], or 0
            for what the residual shows.
        min_joints: a frame with fewer is not fitted; if it is more than 1, none on a line either.
        alone: 1 where every frame starts anew from the mean.
    """

    cold_sweeps: int
    max_sweeps: int
    max_steps: int
    tolerance: float
    loss: int
    spread: float
    noise: float
    min_joints: int = 1
    alone: int = 0


# a solve that stalls is handed to the sweeps and begun again so often
ATTEMPTS = 8

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
def load_settings(w, model, contacts, settings, full):
    """What holds for all frames: the hand, pairs that may meet, how a frame is solved."""
    load_model(w, model)
    w.contacts = len(contacts)
    for i in range(len(contacts)):
        for j in range(PAIR):
            w.contact[i, j] = contacts[i, j]
    w.max_steps, w.loss = settings.max_steps, settings.loss
    w.spread2 = settings.spread * settings.spread
    w.full = 1 if full else 0


@inline
def count_seen(weights):
    """How many joints have a weight, and the greatest weight."""
    seen, top = 0, 0.0
    for k in range(21):
        if weights[k] > 0.0:
            seen += 1
            top = max(top, weights[k])
    return seen, top


@inline
def skip_frame(row, seen, state):
    """The results of a frame that is not fitted."""
    row.angles[:] = row.root[:] = row.quaternion[:] = row.joints[:] = math.nan
    row.objective = row.noise = row.worst = math.nan
    row.variance[:] = math.inf
    row.seen, row.state = seen, state
    row.sweeps = row.steps = row.anew = 0


@inline
def solve(w, solvers, settings, cold):
    """Sweeps and Newton steps from the pose in the workspace, a cold start or a warm one."""
    newton, tolerance = solvers.newton, settings.tolerance
    w.state = STALLED
    w.cold = cold
    sweeps = settings.cold_sweeps if cold or newton == 0 else 0
    for _ in range(ATTEMPTS):
        if sweeps > 0:
            w.max_sweeps = sweeps if newton != 0 else settings.max_sweeps
            w.tolerance = 1e-12 if newton != 0 else tolerance
            call(solvers.descend, w)
        if newton != 0:
            w.tolerance = tolerance
            call(newton, w)
        if w.state != STALLED:
            break
        # a stalled step is handed back to the sweeps
        sweeps = 10


@inline
def solve_from_starts(w, solvers, settings, mean, keep, best_angles, best_root):
    """The best pose from the last one and, where that is not the frame before's, from the mean.

    Returns its objective and state.
    """
    best, state = math.inf, STALLED
    first = 0 if keep.memory > NEW else 1
    for cold in range(first, 1 if keep.memory == FITTED else 2):
        load_pose(w, mean if cold else keep.angles, keep.root)
        solve(w, solvers, settings, cold)
        if w.objective < best:
            best, state = w.objective, w.state
            store_pose(w, best_angles, best_root)
    return best, state


@inline
def try_other_bends(w, solvers, warm, best, best_angles, best_root):
    """The best objective after fingers that may be bent the wrong way are bent the other way."""
    load_pose(w, best_angles, best_root)
    call(solvers.bends, w)
    enough = best * (1.0 - (WARM_GAIN if warm else COLD_GAIN))
    for f in range(FINGERS):
        if w.rise[f] > (0.0 if warm else MISBENT * best):
            continue
        load_pose(w, best_angles, best_root)
        for a in range(ANGLES):
            w.angle[a, f] = w.trial[a, f]
        call(solvers.newton, w)
        if w.objective < enough and w.state == CONVERGED:
            best = enough = w.objective
            store_pose(w, best_angles, best_root)
    return best


@inline
def greatest_distance(w):
    """Greatest distance of a seen landmark to its fitted one, of the placed pose."""
    r, t, worst = matrix(w.rotation), part(w.translation, 0), 0.0
    for f in range(FINGERS + 1):
        for j in range(JOINTS):
            if w.weight[j, f] > 0.0:
                x = add(apply(r, lane(w.mark, j, f)), t)
                worst = max(worst, distance2(x, lane(w.target, j, f)))
    return math.sqrt(worst)


@inline
def store_pose_row(w, angles, root, out):
    """A pose's part of a row of results: angles, root, quaternion, joints."""
    store_joints(w, out.joints)
    for i in range(N_ANGLES):
        out.angles[i] = angles[i]
    for i in range(12):
        out.root[i] = root[i]
    q = quaternion(matrix(w.rotation))
    for i in range(4):
        out.quaternion[i] = q[i]


@inline
def store_results(w, out, objective, top, known, seen, state):
    """A fitted frame's numbers; those at unit weights are taken back to the frame's own."""
    objective *= top
    noise = known if known > 0.0 else objective / max(3 * seen - N_POSE, 1)
    out.objective, out.noise = objective, noise
    out.seen, out.state = seen, state
    out.sweeps, out.steps = int(w.sweeps), int(w.steps)
    for i in range(N_ANGLES):
        v = w.variance[i]
        out.variance[i] = v if math.isinf(v) else v / top * noise


@inline
def fit_in(
    works, model, contacts, solvers, settings, mean, kept, targets, weights, out, out_covariance
):
    """`fit_frames`, in a workspace (1,) that the caller keeps alive: a record does not."""
    min_joints = settings.min_joints
    for t in range(len(targets)):
        wrong = clean(targets[t], weights[t])
        if wrong != GOOD:
            return wrong
    w, keep = works[0], kept[0]
    full = len(out_covariance) > 0
    load_settings(w, model, contacts, settings, full)
    best_angles, best_root = np.empty(N_ANGLES), np.empty(12)
    for t in range(len(targets)):
        if settings.alone:
            keep.memory = NEW
        seen, top = count_seen(weights[t])
        line = seen < 3 or on_a_line(targets[t], weights[t])
        if seen < min_joints or (line and min_joints > 1):
            keep.memory = min(keep.memory, LOST)
            skip_frame(out[t], seen, TOO_FEW if seen < min_joints else UNDERDETERMINED)
            continue
        w.sweeps = w.steps = 0.0
        out[t].anew = 0
        load_frame(w, targets[t], weights[t], top)
        best, state = solve_from_starts(w, solvers, settings, mean, keep, best_angles, best_root)
        if solvers.newton != 0 and solvers.bends != 0 and state == CONVERGED:
            warm = keep.memory == FITTED
            best = try_other_bends(w, solvers, warm, best, best_angles, best_root)
        keep.memory = FITTED
        load_pose(w, best_angles, best_root)
        if solvers.apart != 0:
            call(solvers.apart, w)
            best = w.objective
        store_pose(w, keep.angles, keep.root)
        call(solvers.covariance, w)
        store_pose_row(w, keep.angles, keep.root, out[t])
        out[t].worst = greatest_distance(w)
        state = UNDERDETERMINED if line else state
        store_results(w, out[t], best, top, settings.noise, seen, state)
        if full:
            for i in range(N_POSE):
                for j in range(N_POSE):
                    out_covariance[t, i, j] = w.covariance[i, j] / top
    return GOOD


@kernel
def fit_frames(
    model, contacts, addresses, numbers, mean, keep, targets, weights, out, out_covariance
):
    """Fit frame after frame, each from the one before.

    Args:
        model: as `load_model` takes it.
        contacts: (P, 5) pairs of capsules (see `hand.capsules.contacts`); (0, 5) for none.
        addresses, numbers: those of Solvers and FitNumbers.
        mean: (20,) the pose of a cold start.
        keep: (1,) KEEP, overwritten.
        targets: (T, 21, 3), NaN = missing; weights: (T, 21). Overwritten: a joint is missing as
            a whole and has no weight then.
        out: (T,) RESULT, UNFITTED but for `seen` and `state` where nothing is fitted.
        out_covariance: (T, 26, 26) at unit noise, left as they are where nothing is fitted; or
            (0, 26, 26), and the variances of the angles are all that is computed.

    Returns:
        GOOD; INFINITE_JOINT or BAD_WEIGHT (negative or not finite), and nothing is fitted.
    """
    works = np.zeros(1, dtype=WORK)
    solvers, settings = Solvers(*addresses), FitNumbers(*numbers)
    return fit_in(
        works, model, contacts, solvers, settings, mean, keep, targets, weights, out, out_covariance
    )
