"""The motion's noise: how it moves the state, and how a stream follows it.

For every pose number a bank of small filters, each with another noise density, sees what the
large filter makes of the frames; what they predict well gains weight, and the past is forgotten
in time. Each filter takes its number alone, which costs next to nothing.
"""

from __future__ import annotations

import math

from handtrack.fitting.compiled import inline

# the state: pose (angles, rotation by rows, translation), velocities, and what is remembered
ANGLES, ROTATION, SHIFT, VELOCITY = 0, 20, 29, 32
KNOWN, NOISE, NOISE_COUNT, FADE, READY, LOG_DETERMINANT = range(58, 64)
STATE = 64
# rows of a filter of the bank; and what all have learnt, in the first one's
X, V, PXX, PXV, PVV, LOG, LEARNT = range(7)
BANK = 7
# a squared innovation counts as at most this many variances
FAR = 16.0
# vectors for work
D, LD, GRAD, STEP, F01, F11, Q00, Q01, Q11, SPREAD, Z, R = range(12)
VECTORS = 12


@inline
def log_turn(a, at, b, bt):
    """The rotation vector that takes the rotation at b[bt..] to the one at a[at..], by rows."""
    # m = a b^T
    m00 = a[at] * b[bt] + a[at + 1] * b[bt + 1] + a[at + 2] * b[bt + 2]
    m01 = a[at] * b[bt + 3] + a[at + 1] * b[bt + 4] + a[at + 2] * b[bt + 5]
    m02 = a[at] * b[bt + 6] + a[at + 1] * b[bt + 7] + a[at + 2] * b[bt + 8]
    m10 = a[at + 3] * b[bt] + a[at + 4] * b[bt + 1] + a[at + 5] * b[bt + 2]
    m11 = a[at + 3] * b[bt + 3] + a[at + 4] * b[bt + 4] + a[at + 5] * b[bt + 5]
    m12 = a[at + 3] * b[bt + 6] + a[at + 4] * b[bt + 7] + a[at + 5] * b[bt + 8]
    m20 = a[at + 6] * b[bt] + a[at + 7] * b[bt + 1] + a[at + 8] * b[bt + 2]
    m21 = a[at + 6] * b[bt + 3] + a[at + 7] * b[bt + 4] + a[at + 8] * b[bt + 5]
    m22 = a[at + 6] * b[bt + 6] + a[at + 7] * b[bt + 7] + a[at + 8] * b[bt + 8]
    x, y, z = 0.5 * (m21 - m12), 0.5 * (m02 - m20), 0.5 * (m10 - m01)
    c = 0.5 * (m00 + m11 + m22 - 1.0)
    sine = math.sqrt(x * x + y * y + z * z)
    if sine < 1e-6 and c > 0.0:
        return x, y, z
    angle = math.atan2(sine, c)
    if c > -0.99:
        k = angle / sine
        return k * x, k * y, k * z
    # near half a turn the axis is in the symmetric part
    k = 1.0 / (1.0 - c)
    x2, y2, z2 = max((m00 - c) * k, 0.0), max((m11 - c) * k, 0.0), max((m22 - c) * k, 0.0)
    if x2 >= y2 and x2 >= z2:
        ux = math.sqrt(x2)
        uy, uz = 0.5 * (m01 + m10) * k / ux, 0.5 * (m02 + m20) * k / ux
    elif y2 >= z2:
        uy = math.sqrt(y2)
        ux, uz = 0.5 * (m01 + m10) * k / uy, 0.5 * (m12 + m21) * k / uy
    else:
        uz = math.sqrt(z2)
        ux, uy = 0.5 * (m02 + m20) * k / uz, 0.5 * (m12 + m21) * k / uz
    # the antisymmetric part says which way round
    if ux * x + uy * y + uz * z < 0.0:
        angle = -angle
    return angle * ux, angle * uy, angle * uz


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
def begin_bank(bank, covariance, process):
    """Start all filters at the state; the evidence so far is kept."""
    for b in bank:
        for i in range(26):
            b[X, i] = b[V, i] = b[PXV, i] = 0.0
            b[PXX, i], b[PVV, i] = covariance[i, i], process[2, i]
    for i in range(26):
        if bank[0, LEARNT, i] == 0.0:
            bank[0, LEARNT, i] = process[0, i]


@inline
def predict_bank(bank, grid, x, v, process):
    """Take all filters over the time step, before the state is; F, Q are in v.

    Their positions are counted from the state's.
    """
    for k in range(len(bank)):
        b = bank[k]
        for i in range(26):
            q = grid[0, k] * process[0, i]
            f, g = v[F01, i], v[F11, i]
            b[X, i] += f * (b[V, i] - x[VELOCITY + i])
            b[V, i] *= g
            c, d = b[PXV, i], b[PVV, i]
            b[PXX, i] += f * (2.0 * c + f * d) + q * v[Q00, i]
            b[PXV, i] = g * (c + f * d) + q * v[Q01, i]
            b[PVV, i] = g * g * d + q * v[Q11, i]


@inline
def learn(bank, grid, covariance, v, process, fade):
    """Weigh the filters by how well they predicted, after the state's update.

    What the update did to a number's mean and variance is what a scalar measurement with
    innovation z and variance r would have done; each filter takes that one.

    Args:
        bank: (K, BANK, 26); the densities learnt are in bank[0, LEARNT].
        grid: (3, K) factors on the expected densities, their logarithmic prior, their logarithms.
        covariance: the state's, after the update; v[R] holds its variances before, v[D] what the
            update added to the pose.
        fade: what share of the past's evidence is kept.
    """
    for i in range(26):
        before = v[R, i]
        gain = max(1.0 - covariance[i, i] / before, 1e-6)
        v[Z, i] = v[D, i] / gain
        v[R, i] = before / gain - before
    for k in range(len(bank)):
        b = bank[k]
        for i in range(26):
            s = b[PXX, i] + v[R, i]
            e = v[Z, i] - b[X, i]
            gx, gv = b[PXX, i] / s, b[PXV, i] / s
            b[X, i] += gx * e - v[D, i]
            b[V, i] += gv * e
            b[PVV, i] -= gv * b[PXV, i]
            b[PXV, i] *= 1.0 - gx
            b[PXX, i] *= 1.0 - gx
            # one stray frame is no evidence of wild motion
            b[LOG, i] = fade * b[LOG, i] - 0.5 * (math.log(s) + min(e * e / s, FAR))
    for i in range(26):
        top = -math.inf
        for k in range(len(bank)):
            top = max(top, bank[k, LOG, i] + grid[1, k])
        total = mean = 0.0
        for k in range(len(bank)):
            w = math.exp(bank[k, LOG, i] + grid[1, k] - top)
            total += w
            mean += w * grid[2, k]
        bank[0, LEARNT, i] = process[0, i] * math.exp(mean / total)
