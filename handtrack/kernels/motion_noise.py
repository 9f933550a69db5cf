"""The motion's noise: how it moves the state, and how a stream follows it.

For every pose number a bank of small filters, each with another noise density, sees what the
large filter makes of the frames; what they predict well gains weight, and the past is forgotten
in time. Each filter takes its number alone, which costs next to nothing.
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import inline
from handtrack.kernels.filter_state import BANK
from handtrack.kernels.workspace import N_POSE

# rows of `process`: noise density of the accelerations, decay rate of the velocities [1/s],
# variance of the first velocities
DENSITY, DECAY, FIRST = range(3)
# rows of `grid`: factors on the densities that are tried, their logarithmic prior, logarithms
FACTOR, PRIOR, LOG = range(3)
# a squared innovation counts as at most this many variances
FAR = 16.0


@inline
def unit_process(decay, dt):
    """Transition and noise of a number whose velocity decays, over dt, at unit density.

    dv = -decay v dt + dw, dx = v dt. Returns (x from v, v from v, var x, cov, var v).
    """
    g = decay * dt
    if g < 1e-2:
        f11 = 1.0 - g * (1.0 - 0.5 * g * (1.0 - g / 3.0 * (1.0 - 0.25 * g)))
        f01 = dt * (1.0 - 0.5 * g * (1.0 - g / 3.0 * (1.0 - 0.25 * g * (1.0 - 0.2 * g))))
        q00 = dt**3 / 3.0 * (1.0 - 0.75 * g + 0.35 * g * g - 0.125 * g * g * g)
        q11 = dt * (1.0 - g + 2.0 / 3.0 * g * g - g * g * g / 3.0)
    else:
        f11 = math.exp(-g)
        f01 = (1.0 - f11) / decay
        q11 = (1.0 - f11 * f11) / (2.0 * decay)
        q00 = (dt - 2.0 * f01 + q11) / (decay * decay)
    return f01, f11, q00, 0.5 * f01 * f01, q11


@inline
def begin_bank(s, process):
    """Start all filters at the state; the evidence so far is kept."""
    for k in range(BANK):
        for i in range(N_POSE):
            s.bank_x[k, i] = s.bank_v[k, i] = s.bank_xv[k, i] = 0.0
            s.bank_xx[k, i], s.bank_vv[k, i] = s.pose_pose[i, i], process[FIRST, i]
    for i in range(N_POSE):
        if s.learnt[i] == 0.0:
            s.learnt[i] = process[DENSITY, i]


@inline
def predict_bank(s, grid, process):
    """Take all filters over the time step, before the state is; its motion is known.

    Their positions are counted from the state's.
    """
    for k in range(BANK):
        for i in range(N_POSE):
            q = grid[FACTOR, k] * process[DENSITY, i]
            f, g = s.f01[i], s.f11[i]
            s.bank_x[k, i] += f * (s.bank_v[k, i] - s.velocity[i])
            s.bank_v[k, i] *= g
            c, d = s.bank_xv[k, i], s.bank_vv[k, i]
            s.bank_xx[k, i] += f * (2.0 * c + f * d) + q * s.q00[i]
            s.bank_xv[k, i] = g * (c + f * d) + q * s.q01[i]
            s.bank_vv[k, i] = g * g * d + q * s.q11[i]


@inline
def learn(s, grid, process):
    """Weigh the filters by how well they predicted, after the state's update.

    (37) What the update did to a number's mean and variance is what a scalar measurement with
    innovation z and variance r would have done; each filter takes that one. `before` holds the
    state's variances before the update, `distance` what the update added to the pose.

    Args:
        grid: (3, K) factors on the expected densities, their logarithmic prior, their logarithms.
    """
    as_scalars(s)
    for k in range(BANK):
        for i in range(N_POSE):
            v = s.bank_xx[k, i] + s.before[i]
            e = s.innovation[i] - s.bank_x[k, i]
            gx, gv = s.bank_xx[k, i] / v, s.bank_xv[k, i] / v
            s.bank_x[k, i] += gx * e - s.distance[i]
            s.bank_v[k, i] += gv * e
            s.bank_vv[k, i] -= gv * s.bank_xv[k, i]
            s.bank_xv[k, i] *= 1.0 - gx
            s.bank_xx[k, i] *= 1.0 - gx
            s.bank_log[k, i] = s.fade * s.bank_log[k, i] - 0.5 * misfit(e, v)
    draw_lesson(s, grid, process)


@inline
def as_scalars(s):
    """(37) The update as scalar measurements: innovations, and their variances in `before`."""
    for i in range(N_POSE):
        before = s.before[i]
        gain = max(1.0 - s.pose_pose[i, i] / before, 1e-6)
        s.innovation[i] = s.distance[i] / gain
        s.before[i] = before / gain - before


@inline
def misfit(e, v):
    """How badly an innovation of variance v was predicted [2 nats].

    One stray frame is no evidence of wild motion.
    """
    return math.log(v) + min(e * e / v, FAR)


@inline
def draw_lesson(s, grid, process):
    """The densities by the weights of the bank's filters."""
    for i in range(N_POSE):
        s.learnt[i] = process[DENSITY, i] * math.exp(mean_log_factor(s, grid, i))


@inline
def mean_log_factor(s, grid, i):
    """Mean logarithm of the tried factors of number i, by their weights."""
    top = -math.inf
    for k in range(BANK):
        top = max(top, s.bank_log[k, i] + grid[PRIOR, k])
    total = mean = 0.0
    for k in range(BANK):
        weight = math.exp(s.bank_log[k, i] + grid[PRIOR, k] - top)
        total += weight
        mean += weight * grid[LOG, k]
    return mean / total
