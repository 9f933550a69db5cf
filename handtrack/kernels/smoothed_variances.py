"""What a smoother leaves of the angles' variances, each angle by itself.

(40) An angle and its velocity have, beside their covariance, the adjoint's, N: over a measurement
of gain g = (p - p+) / p^2 it is T N T^T + g with T = 1 - g (p, c), and p - (p, c) N (p, c)^T is
the smoothed variance, p and c being the predicted variance and its covariance with the velocity.
What a measurement says of an angle has the others in it by p+, the filter's own; what later
frames say of it through other angles is left out.
"""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.workspace import N_ANGLES, N_POSE

# the adjoint's covariance: of angles, with velocities, of velocities
ANGLE, CROSS, SPEED = range(3)


@inline
def keep_spread(s, kept):
    """What is predicted of each angle; nothing is measured yet."""
    for i in range(N_ANGLES):
        kept.prior[i], kept.cross[i] = s.pose_pose[i, i], s.pose_speed[i, i]
        kept.gain[i] = 0.0


@inline
def keep_gain(s, kept):
    """What a measurement took of each angle's variance."""
    for i in range(N_ANGLES):
        gain_of(kept, i, s.pose_pose[i, i])


@inline
def store_spread(s, out):
    """The angles' variances as they are."""
    for i in range(N_ANGLES):
        out.variance[i] = s.pose_pose[i, i]


@inline
def keep_undrifted_spread(s, kept):
    """As `keep_spread`, of the hand's angles: those seen less their drift."""
    for i in range(N_ANGLES):
        c = N_POSE + i
        kept.prior[i] = undrifted(s, i)
        kept.cross[i] = s.pose_rest[i, i] - s.rest_rest[c, i]
        kept.gain[i] = 0.0


@inline
def keep_undrifted_gain(s, kept):
    """As `keep_gain`."""
    for i in range(N_ANGLES):
        gain_of(kept, i, undrifted(s, i))


@inline
def store_undrifted_spread(s, out):
    """As `store_spread`."""
    for i in range(N_ANGLES):
        out.variance[i] = undrifted(s, i)


@inline
def undrifted(s, i):
    c = N_POSE + i
    return max(s.pose_pose[i, i] + s.rest_rest[c, c] - 2.0 * s.pose_rest[i, c], 0.0)


@inline
def gain_of(kept, i, after):
    p = kept.prior[i]
    kept.gain[i] = max(p - after, 0.0) / (p * p) if p > 0.0 else 0.0


@inline
def clear_spread(n):
    for k in range(3):
        for i in range(N_ANGLES):
            n[k, i] = 0.0


@inline
def spread_over_measurement(kept, n):
    """Take the adjoint's covariance back over a frame's measurement."""
    for i in range(N_ANGLES):
        g, p, c = kept.gain[i], kept.prior[i], kept.cross[i]
        a, b = 1.0 - g * p, -g * c
        cross = a * n[CROSS, i] + b * n[SPEED, i]
        n[ANGLE, i] = a * (a * n[ANGLE, i] + b * n[CROSS, i]) + b * cross + g
        n[CROSS, i] = cross


@inline
def spread_over_transition(kept, n):
    """Take it back over the transition to a frame."""
    for i in range(N_ANGLES):
        f, h = kept.f01[i], kept.f11[i]
        a, b, c = n[ANGLE, i], n[CROSS, i], n[SPEED, i]
        n[CROSS, i] = f * a + h * b
        n[SPEED, i] = f * f * a + 2.0 * f * h * b + h * h * c


@inline
def store_smoothed_spread(kept, n, out):
    """The smoothed variances of a frame."""
    for i in range(N_ANGLES):
        p, c = kept.prior[i], kept.cross[i]
        taken = p * p * n[ANGLE, i] + 2.0 * p * c * n[CROSS, i] + c * c * n[SPEED, i]
        out.variance[i] = max(p - taken, 0.0)
