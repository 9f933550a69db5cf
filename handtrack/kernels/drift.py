"""The filter where the joints' noise lasts: the drift that it gives the pose is in the state.

(38) The joints' noise is white noise and noise of the first order, b' = a b + e with
a = exp(-dt / tau). What b does to a fitted pose is the drift c, whose covariance is that of a
pose fitted to joints of b's variance. The state's pose is the one that is *seen*, s = x + c: a
frame measures it as without drift, its limits are the joints' own, and the hand's pose is s - c.
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import inline
from handtrack.kernels.filter_state import REST, move_pose
from handtrack.kernels.kalman import start_pose, take_in, take_pose, update_rest
from handtrack.kernels.linear_algebra import factor, invert
from handtrack.kernels.workspace import FINGERS, N_POSE

# information that a pose has at least, for unit noise [1/rad^2, 1/m^2]: a joint at 3 mm
LEAST_UNIT = 1e-5


@inline
def age_drift(s, dt, weights):
    """How much of the drift stays, and how it spreads, until a frame dt later.

    A finger that comes into sight again is detected anew, and so is the hand: their noise has
    nothing of what it was.
    """
    stays = math.exp(-dt / s.lasts)
    lost = True
    for f in range(FINGERS):
        lost = lost and s.fingers_seen[f] == 0
    for i in range(N_POSE):
        s.stays[i] = 0.0 if lost else stays
    for f in range(FINGERS):
        seen = 0
        for k in range(4):
            if weights[1 + 4 * f + k] > 0.0:
                seen += 1
        if seen and s.fingers_seen[f] == 0:
            for a in range(4):
                s.stays[4 * f + a] = 0.0
        s.fingers_seen[f] = seen
    for i in range(N_POSE):
        s.renewed[i] = math.sqrt(1.0 - s.stays[i] * s.stays[i])
        for j in range(N_POSE):
            s.spread[i, j] = s.colour * s.noise * s.unit[i, j]


@inline
def learn_unit(s, seen):
    """The covariance of a pose for unit noise of the joints, from the frame that was measured.

    Frames with fewer joints than an earlier one say nothing of it.
    """
    if seen < s.unit_seen:
        return
    s.unit_seen = seen
    scale = s.white * s.noise
    for i in range(N_POSE):
        for j in range(N_POSE):
            s.posterior[i, j] = scale * s.system[i, j]
        s.posterior[i, i] += LEAST_UNIT
    # the update wants s.factor as it is
    factor(s.posterior, s.work_2)
    invert(s.work_2, s.work, s.unit)


@inline
def begin_drifting(w, solver, s, targets, weights, raw, speed, seen):
    """Start from a raw fit, of which nobody knows how much is drift."""
    start_pose(w, solver, s, targets, weights, raw)
    s.unit_seen = 0
    learn_unit(s, seen)
    for i in range(N_POSE):
        s.velocity[i] = s.drift[i] = 0.0
        for j in range(REST):
            s.pose_rest[i, j] = 0.0
    for i in range(REST):
        for j in range(REST):
            s.rest_rest[i, j] = 0.0
    for i in range(N_POSE):
        s.rest_rest[i, i] = speed[i]
        for j in range(N_POSE):
            s.rest_rest[N_POSE + i, N_POSE + j] = s.colour * s.noise * s.unit[i, j]


@inline
def predict_drifting(s):
    """(39) As `predict`; the seen pose loses what the drift loses, and has what it gains."""
    for i in range(N_POSE):
        s.step[i] = s.f01[i] * s.velocity[i] + (s.stays[i] - 1.0) * s.drift[i]
    move_pose(s, s.step)
    cross, rest, top = s.pose_rest, s.rest_rest, s.wide
    for i in range(N_POSE):
        s.velocity[i] *= s.f11[i]
        s.drift[i] *= s.stays[i]
        # rows of F P: of poses in work, of the rest in wide
        f, b, c = s.f01[i], s.stays[i] - 1.0, N_POSE + i
        for j in range(N_POSE):
            s.work[i, j] = s.pose_pose[i, j] + f * cross[j, i] + b * cross[j, c]
        for j in range(REST):
            top[i, j] = cross[i, j] + f * rest[i, j] + b * rest[c, j]
    for i in range(N_POSE):
        e = s.renewed[i]
        for j in range(N_POSE):
            new = e * s.spread[i, j] * s.renewed[j]
            b = s.stays[j] - 1.0
            there = s.work[i, j] + top[i, j] * s.f01[j] + top[i, N_POSE + j] * b
            s.pose_pose[i, j] = there + new
            cross[i, j] = top[i, j] * s.f11[j]
            cross[i, N_POSE + j] = top[i, N_POSE + j] * s.stays[j] + new
            g, a = s.f11[i], s.stays[i]
            rest[i, j] *= g * s.f11[j]
            rest[i, N_POSE + j] *= g * s.stays[j]
            rest[N_POSE + i, j] *= a * s.f11[j]
            at = rest[N_POSE + i, N_POSE + j]
            rest[N_POSE + i, N_POSE + j] = a * at * s.stays[j] + new
    for i in range(N_POSE):
        s.pose_pose[i, i] += s.density[i] * s.q00[i]
        cross[i, i] += s.density[i] * s.q01[i]
        rest[i, i] += s.density[i] * s.q11[i]


@inline
def update_drifting(s, coupled, keep, information, pull):
    """As `kalman.update`: velocities and drift follow by their regression on the seen pose."""
    less = take_in(s, coupled, keep, information, pull)
    update_rest(s, s.pose_rest, s.rest_rest, s.wide, s.wide_2)
    for i in range(N_POSE):
        d = s.distance[i]
        for j in range(N_POSE):
            s.velocity[j] += s.wide[i, j] * d
            s.drift[j] += s.wide[i, N_POSE + j] * d
    take_pose(s, coupled)
    return less
