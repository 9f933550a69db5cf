"""The compiled Kalman filter of poses: 26 pose numbers and their velocities, full covariance.

The covariance is kept as three 26 x 26 blocks, of poses, of poses with velocities, of
velocities. The rotation's part of the state is a small turn of the world away from a reference
that is moved along, so there is no wrap-around.
"""

from __future__ import annotations

import math

from handtrack.fitting.compiled import call, inline, kernel
from handtrack.fitting.dense import (
    apply_matrix,
    divide,
    factor,
    hold_faces,
    invert,
    leave_faces,
    multiply,
    solve_one,
    subtract_square,
)
from handtrack.fitting.fingers import guess_faces
from handtrack.fitting.frames import (
    OUT_ANEW,
    OUT_ANGLES,
    OUT_JOINTS,
    OUT_NOISE,
    OUT_OBJECTIVE,
    OUT_QUATERNION,
    OUT_ROOT,
    store_quaternion,
)
from handtrack.fitting.information import HESSIAN
from handtrack.fitting.lanes import (
    FULL,
    GRADIENT,
    LANES,
    OBJECTIVE,
    RHO,
    ROW,
    ROW_Z,
    STEP_Z,
    G,
    load_frame,
    load_model,
    load_pose,
    store_joints,
    store_pose,
)
from handtrack.fitting.newton import keep_pose, take_step
from handtrack.fitting.vectors import add, cross, dot, scale
from handtrack.tracking.process_kernel import (
    ANGLES,
    F01,
    F11,
    FADE,
    GRAD,
    KNOWN,
    LD,
    LEARNT,
    LOG_DETERMINANT,
    NOISE,
    NOISE_COUNT,
    Q00,
    Q01,
    Q11,
    READY,
    ROTATION,
    SHIFT,
    SPREAD,
    STEP,
    VELOCITY,
    D,
    R,
    Z,
    begin_bank,
    learn,
    log_turn,
    predict_bank,
    unit_process,
)

# matrices of the state, and for work
A, B, C, LAMBDA, U, W, W2, POST, S = range(9)
MATRICES = 9
# what happened to a frame
NOTHING, PREDICTED, UPDATED, BEGUN = range(4)
# a frame's notes: that, its log likelihood [nats], the joints' noise variance [m^2]
KIND, LIKELIHOOD, JOINT_NOISE = range(3)

_STEPS = 12
# [nats] a step that promises less is not worth taking; is the last; a start that is doubted
_PROMISE, _NEAR, _SURPRISE = 1e-6, 0.03, 100.0
LEAST_NOISE = 1e-10
"""Variance of the joints below which no residual is believed [m^2]."""
WEAK = 1e-2
"""Least information of a measured pose [1/rad^2, 1/m^2]: ten radians, ten metres."""
VAGUE = 1.0
"""Information of a first pose that no joint gives [1/rad^2, 1/m^2]."""


@inline
def turn_by(x, at, w):
    """The rotation at x[at..] turned by the rotation vector w on the left (Rodrigues)."""
    angle = math.sqrt(dot(w, w))
    k = math.sin(angle) / angle if angle > 1e-9 else 1.0
    h = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    h = 2.0 * h * h
    for j in range(3):
        c = (x[at + j], x[at + 3 + j], x[at + 6 + j])
        m = cross(w, c)
        mm = cross(w, m)
        c = add(c, add(scale(k, m), scale(h, mm)))
        x[at + j], x[at + 3 + j], x[at + 6 + j] = c


@inline
def move_pose(x, d):
    """Add d (26,) to the pose: angles, turn on the left, translation."""
    for i in range(20):
        x[ANGLES + i] += d[i]
    turn_by(x, ROTATION, (d[20], d[21], d[22]))
    for i in range(3):
        x[SHIFT + i] += d[23 + i]


@inline
def pose_less(angles, root, x, d):
    """d (26,): how far a pose is from the state's."""
    for i in range(20):
        d[i] = angles[i] - x[ANGLES + i]
    d[20], d[21], d[22] = log_turn(root, 0, x, ROTATION)
    for i in range(3):
        d[23 + i] = root[9 + i] - x[SHIFT + i]


@inline
def predict(x, p, v):
    """Constant velocity that decays, white noise in the acceleration.

    F, and Q at unit density, are in v.
    """
    for i in range(26):
        v[STEP, i] = v[F01, i] * x[VELOCITY + i]
    move_pose(x, v[STEP])
    for i in range(26):
        x[VELOCITY + i] *= v[F11, i]
    for i in range(26):
        # F P F^T by blocks; only the transition of row and column differ
        f, g = v[F01, i], v[F11, i]
        for j in range(26):
            b, c = p[B, i, j], p[C, i, j]
            h, k = v[F01, j], v[F11, j]
            p[W, i, j] = p[A, i, j] + b * h + f * p[B, j, i] + f * c * h
            p[W2, i, j] = (b + f * c) * k
            p[C, i, j] = g * c * k
    for i in range(26):
        for j in range(26):
            p[A, i, j] = p[W, i, j]
            p[B, i, j] = p[W2, i, j]
    for i in range(26):
        p[A, i, i] += v[SPREAD, i] * v[Q00, i]
        p[B, i, i] += v[SPREAD, i] * v[Q01, i]
        p[C, i, i] += v[SPREAD, i] * v[Q11, i]


@inline
def prior_gradient(v):
    """From the prior's precision times the distance to its gradient, in place in v[GRAD].

    The turn's distance is a logarithm; its slope is the inverse left Jacobian of rotations,
    here to second order.
    """
    d = (v[D, 20], v[D, 21], v[D, 22])
    g = (v[LD, 20], v[LD, 21], v[LD, 22])
    for i in range(26):
        v[GRAD, i] = v[LD, i]
    # transposed: 1 + [d]x / 2 + [d]x^2 / 12
    m = cross(d, g)
    g = add(g, add(scale(0.5, m), scale(1.0 / 12.0, cross(d, m))))
    v[GRAD, 20], v[GRAD, 21], v[GRAD, 22] = g


@inline
def weigh(s, solver, x, p, v, angles, root, precision):
    """Objective of the pose in the buffer, prior and joints together [nats]."""
    call(solver, s)
    store_pose(s, angles, root)
    pose_less(angles, root, x, v[D])
    apply_matrix(p[LAMBDA], v[D], v[LD])
    q = precision * s[OBJECTIVE]
    for i in range(26):
        q += v[D, i] * v[LD, i]
    return 0.5 * q


@inline
def load_inside(s, angles, root):
    """Put a pose into the buffer, moved inside the limits."""
    load_pose(s, angles, root)
    for i in range(4 * LANES):
        s[STEP_Z + i] = 0.0
    for i in range(6):
        s[RHO + i] = 0.0
    keep_pose(s)
    take_step(s, 0.0)


@inline
def best_pose(s, solver, x, p, v, angles, root, row, precision):
    """The pose of least objective under the limits, from the prediction or the raw fit.

    The objective is half the squared distances times `precision`, and half the squared distance
    from the state's pose by the precision in p[LAMBDA]. On return the buffer, angles and root
    hold the pose, v[D] and v[LD] its distance, and the buffer its Hessian. Where no limit held
    the last step, x[READY] is 1, p[U] the factor of the whole system, and x[LOG_DETERMINANT]
    the logarithm of its determinant.

    Returns the objective [nats].
    """
    s[FULL] = 1.0
    load_inside(s, x[ANGLES:ROTATION], x[ROTATION:VELOCITY])
    cost = weigh(s, solver, x, p, v, angles, root, precision)
    if cost > _SURPRISE and math.isfinite(row[OUT_ANGLES]):
        # a hand that moved far may be where the frame alone says
        load_pose(s, row[:20], row[20:32])
        raw = weigh(s, solver, x, p, v, angles, root, precision)
        if raw > cost:
            load_inside(s, x[ANGLES:ROTATION], x[ROTATION:VELOCITY])
            raw = weigh(s, solver, x, p, v, angles, root, precision)
        cost = raw
    for _ in range(_STEPS):
        prior_gradient(v)
        for i in range(26):
            v[GRAD, i] += precision * s[GRADIENT + i]
        for i in range(26):
            v[STEP, i] = -v[GRAD, i]
            for j in range(26):
                p[S, i, j] = p[LAMBDA, i, j] + precision * s[HESSIAN + 26 * i + j]
            p[S, i, i] += WEAK
        for f in range(5):
            for i in range(4):
                s[ROW_Z + i * ROW + G + f] = v[GRAD, 4 * f + i]
        guess_faces(s)
        x[READY] = 0.0 if hold_faces(s, p[S], v[STEP]) else 1.0
        x[LOG_DETERMINANT] = factor(p[S], p[U])
        solve_one(p[U], v[STEP])
        leave_faces(s, v[STEP])
        promise = 0.0
        for i in range(26):
            promise -= v[GRAD, i] * v[STEP, i]
        if not promise > _PROMISE:
            break
        # the root's step in its own frame
        for b in range(2):
            for i in range(3):
                w = 0.0
                for j in range(3):
                    w += root[3 * j + i] * v[STEP, 20 + 3 * b + j]
                s[RHO + 3 * b + i] = w
        keep_pose(s)
        # a step so short changes neither gradient nor Hessian
        near = promise < _NEAR
        s[FULL] = 0.0 if near else 1.0
        x[READY] = x[READY] if near else 0.0
        share = 1.0
        while True:
            take_step(s, share)
            new = weigh(s, solver, x, p, v, angles, root, precision)
            if new <= cost or share == 0.0:
                break
            share = 0.3 * share if share > 1e-3 else 0.0
        cost = new
        if near or share == 0.0:
            break
    return cost


@inline
def measure_frame(s, solver, x, p, v, angles, root, targets, weights, row, noise, coupled):
    """What a frame says: its pose in v[D], from the state's, and its information in p[S].

    Coupled, the pose is the best under prior and joints together, else the raw fit. v[LD] is
    v[D] times p[LAMBDA], the inverse of the prior's covariance p[A].

    Returns the objective less the prior's normalisation [nats].
    """
    top = 0.0
    for k in range(21):
        top = max(top, weights[k])
    precision = top / noise
    load_frame(s, targets, weights, top)
    log = factor(p[A], p[U])
    invert(p[U], p[W], p[LAMBDA])
    if coupled:
        cost = best_pose(s, solver, x, p, v, angles, root, row, precision)
    else:
        load_pose(s, row[:20], row[20:32])
        s[FULL] = 1.0
        cost = weigh(s, solver, x, p, v, angles, root, precision)
    for i in range(26):
        for j in range(26):
            p[S, i, j] = precision * s[HESSIAN + 26 * i + j]
        p[S, i, i] += WEAK
    return cost + 0.5 * log


@inline
def update(x, p, v, angles, root, coupled, keep, out_t, out_a):
    """Take in what `measure_frame` found, by the inverses of covariances.

    Args:
        keep: whether to leave H^T S^-1 H and H^T S^-1 z in out_t, out_a, for a smoother.

    Returns what the logarithm of the likelihood has less than what `measure_frame` returned.
    """
    before = after = 0.0
    if not coupled:
        for i in range(26):
            before += v[D, i] * v[LD, i]
            v[Z, i] = v[D, i]
            v[GRAD, i] = 0.0
            for j in range(26):
                v[GRAD, i] += p[S, i, j] * v[D, j]
    log = x[LOG_DETERMINANT]
    if not coupled or x[READY] == 0.0:
        # else `best_pose` has left it
        for i in range(26):
            for j in range(26):
                p[S, i, j] += p[LAMBDA, i, j]
        log = factor(p[S], p[U])
    invert(p[U], p[W], p[POST])
    if not coupled:
        # P+ M z
        apply_matrix(p[POST], v[GRAD], v[D])
        apply_matrix(p[LAMBDA], v[D], v[LD])
        for i in range(26):
            after += v[Z, i] * v[LD, i]
    if keep:
        # prior's precision less what the posterior keeps of it
        for i in range(26):
            for j in range(26):
                p[W, i, j] = out_t[i, j] = p[LAMBDA, i, j]
        divide(p[U], p[W])
        subtract_square(p[W], out_t)
        for i in range(26):
            out_a[i] = v[LD, i]
    # the velocity follows by its regression on the pose
    multiply(p[LAMBDA], p[B], p[W])
    for i in range(26):
        d = v[D, i]
        for j in range(26):
            x[VELOCITY + j] += p[W, i, j] * d
    if coupled:
        for i in range(20):
            x[ANGLES + i] = angles[i]
        for i in range(12):
            x[ROTATION + i] = root[i]
    else:
        move_pose(x, v[D])
    multiply(p[POST], p[W], p[W2])
    for k in range(0, 26, 2):
        for i in range(26):
            d, e = p[B, k, i] - p[W2, k, i], p[B, k + 1, i] - p[W2, k + 1, i]
            for j in range(i, 26):
                p[C, i, j] -= d * p[W, k, j] + e * p[W, k + 1, j]
    for i in range(26):
        for j in range(26):
            p[A, i, j] = p[POST, i, j]
            p[B, i, j] = p[W2, i, j]
        for j in range(i):
            p[C, i, j] = p[C, j, i]
    # the objective had the prior's distance where the innovation's belongs
    return 0.5 * (log + after - before)


@inline
def begin(s, solver, x, p, v, targets, weights, row, noise, speed):
    """Start from a raw fit; the velocities are zero, with variances `speed`."""
    for i in range(20):
        x[ANGLES + i] = row[i]
    for i in range(12):
        x[ROTATION + i] = row[20 + i]
    top = 0.0
    for k in range(21):
        top = max(top, weights[k])
    load_frame(s, targets, weights, top)
    load_pose(s, row[:20], row[20:32])
    s[FULL] = 1.0
    call(solver, s)
    for i in range(26):
        x[VELOCITY + i] = 0.0
        for j in range(26):
            p[S, i, j] = top / noise * s[HESSIAN + 26 * i + j]
            p[B, i, j] = p[C, i, j] = 0.0
        p[S, i, i] += VAGUE
        p[C, i, i] = speed[i]
    factor(p[S], p[U])
    invert(p[U], p[W], p[A])
    x[KNOWN] = 1.0


@inline
def pass_time(x, times, v, settings, process, now, raw_noise):
    """What a frame's time means: whether the state still holds, transition, joints' noise.

    Returns NOTHING where there is no state, BEGUN where this frame begins one, or PREDICTED.
    """
    _, _, fixed_noise, gain, coast_ns, memory = settings
    fitted = math.isfinite(raw_noise)
    if x[KNOWN] > 0.0 and now - times[1] > coast_ns:
        x[KNOWN] = 0.0
    if fixed_noise > 0.0:
        x[NOISE] = fixed_noise
    elif fitted:
        # running mean; a stray frame counts at most fourfold
        value = max(raw_noise, LEAST_NOISE)
        if x[NOISE_COUNT] > 0.0:
            value = min(value, 4.0 * x[NOISE])
        x[NOISE_COUNT] += 1.0
        x[NOISE] += (value - x[NOISE]) * max(1.0 / x[NOISE_COUNT], gain)
    dt = (now - times[0]) * 1e-9
    x[FADE] = math.exp(-dt / memory)
    times[0] = now
    if fitted:
        times[1] = now
    if x[KNOWN] == 0.0:
        return BEGUN if fitted else NOTHING
    for i in range(26):
        f01, f11, q00, q01, q11 = unit_process(process[1, i], dt)
        v[F01, i], v[F11, i] = f01, f11
        v[Q00, i], v[Q01, i], v[Q11, i] = q00, q01, q11
    return PREDICTED


@inline
def store_row(s, solver, pose, angles, root, row):
    """A pose (32,), inside the limits, as a row of results (see `fitting.frames`)."""
    load_inside(s, pose[ANGLES:ROTATION], pose[ROTATION:VELOCITY])
    s[FULL] = 0.0
    call(solver, s)
    store_pose(s, angles, root)
    for i in range(20):
        row[OUT_ANGLES + i] = angles[i]
    for i in range(12):
        row[OUT_ROOT + i] = root[i]
    store_quaternion(row, OUT_QUATERNION, root)
    store_joints(s, row[OUT_JOINTS:OUT_OBJECTIVE].reshape(21, 3))


@kernel
def load(s, rest, axes, lower, upper, twist):
    """Write a model's constants into the fitter's buffer."""
    load_model(s, rest, axes, lower, upper, twist)


@kernel
def filter_frames(
    state, solver, settings, process, grid, time_ns, targets, weights, raw, out, notes, keep, kept
):
    """Filter frame after frame.

    Args:
        state: (x, times, matrices, vectors, fitter's buffer with the model, bank, angles, root),
            what is remembered and room for work.
        solver: address of `information`.
        settings: (1 to couple, 1 to follow the motion's noise, joints' noise variance [m^2] or 0
            to follow it, its gain, time to coast [ns], time over which the bank forgets [s]).
        process: (3, 26): noise density of the accelerations, decay rate of the velocities
            [1/s], variance of the first velocities.
        grid: (3, K) factors on the densities that are tried (see `learn`).
        time_ns: (T,); targets (T, 21, 3); weights (T, 21), 0 where missing.
        raw: (T, OUT_SIZE) the raw fits, as `fit_frames` leaves them.
        out: (T, OUT_SIZE) filtered poses, quaternions and joints; rows without a pose are left
            as they are.
        notes: (T, 3) what happened (see KIND).
        keep: 1 to fill `kept`, which the smoother needs: transitions (T, 5, 26), predicted poses
            (T, 32), prior blocks (T, 2, 26, 26), H^T S^-1 H (T, 26, 26), H^T S^-1 z (T, 26).
    """
    p, v = state[2], state[3]
    no_t, no_a = p[W], v[GRAD]
    k_transition, k_pose, k_prior, k_t, k_a = kept
    for t in range(len(time_ns)):
        kind = _before(state, solver, settings, process, grid, time_ns[t], targets[t], weights[t],
                       raw[t], notes[t])  # fmt: skip
        if kind == PREDICTED:
            predict(state[0], p, v)
        if keep and kind != NOTHING:
            for i in range(26):
                for j in range(26):
                    k_prior[t, 0, i, j] = p[A, i, j]
                    k_prior[t, 1, i, j] = p[B, i, j]
                    k_t[t, i, j] = 0.0
                for j in range(5):
                    k_transition[t, j, i] = v[F01 + j, i]
                k_a[t, i] = 0.0
            for i in range(32):
                k_pose[t, i] = state[0][i]
        if _measure(state, solver, settings, targets[t], weights[t], raw[t], notes[t]):
            tt, ta = (k_t[t], k_a[t]) if keep else (no_t, no_a)
            notes[t, LIKELIHOOD] -= update(
                state[0], p, v, state[6], state[7], settings[0], keep, tt, ta
            )
        _after(state, solver, settings, process, grid, raw[t], out[t], notes[t])


# The stages of a frame around prediction and update, so that another filter can do those.


@inline
def _before(state, solver, settings, process, grid, now, targets, weights, row, note):
    x, times, p, v, s, bank, _, _ = state
    follow = settings[1]
    if row[OUT_ANEW] > 0.0:
        x[KNOWN] = 0.0
    kind = pass_time(x, times, v, settings, process, now, row[OUT_NOISE])
    note[KIND], note[LIKELIHOOD], note[JOINT_NOISE] = kind, 0.0, x[NOISE]
    for i in range(26):
        v[SPREAD, i] = process[0, i]
    if kind == BEGUN:
        begin(s, solver, x, p, v, targets, weights, row, x[NOISE], process[2])
        if follow:
            begin_bank(bank, p[A], process)
    elif kind == PREDICTED and follow:
        for i in range(26):
            v[SPREAD, i] = bank[0, LEARNT, i]
        predict_bank(bank, grid, x, v, process)
    return kind


@inline
def _measure(state, solver, settings, targets, weights, row, note):
    x, _, p, v, s, _, angles, root = state
    coupled = settings[0]
    some = math.isfinite(row[OUT_NOISE])
    if coupled:
        for k in range(21):
            some = some or weights[k] > 0.0
    v[R, 0] = 0.0
    if note[KIND] != PREDICTED or not some:
        return False
    note[LIKELIHOOD] = -measure_frame(
        s, solver, x, p, v, angles, root, targets, weights, row, x[NOISE], coupled
    )
    for i in range(26):
        v[R, i] = p[A, i, i]
    return True


@inline
def _after(state, solver, settings, process, grid, row, out, note):
    x, _, p, v, s, bank, angles, root = state
    if note[KIND] == NOTHING:
        return
    if note[KIND] == PREDICTED and v[R, 0] > 0.0:
        if settings[1]:
            learn(bank, grid, p[A], v, process, x[FADE])
        if math.isfinite(row[OUT_NOISE]):
            note[KIND] = UPDATED
    store_row(s, solver, x[:VELOCITY], angles, root, out)


@kernel
def before_frame(state, solver, settings, process, grid, now, targets, weights, row, note):
    """What comes before a prediction; whether one is to be made."""
    return (
        _before(state, solver, settings, process, grid, now, targets, weights, row, note)
        == PREDICTED
    )


@kernel
def measure(state, solver, settings, targets, weights, row, note):
    """What comes between prediction and update (see `measure_frame`); whether there is one."""
    return _measure(state, solver, settings, targets, weights, row, note)


@kernel
def after_frame(state, solver, settings, process, grid, row, out, note):
    """What comes after an update."""
    _after(state, solver, settings, process, grid, row, out, note)


@kernel
def shift_pose(x, d):
    """Move the state's pose by d (26,)."""
    move_pose(x, d)
