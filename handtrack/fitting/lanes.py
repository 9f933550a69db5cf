"""Five fingers side by side: layout, kinematics and derivatives of the structured solver.

One flat buffer holds everything that the solver needs for a frame. A slot is a row of eight
lanes; lanes 0-4 are the fingers, thumb first, so that a loop over the lanes is a loop over
fingers that the compiler turns into vector instructions. Lane 5 carries the wrist as the base
joint of a finger without bones; lanes 6 and 7 stay zero. A slot's name is the index of its
lane 0; a vector takes three slots.

Quantities are in the root frame unless said otherwise. A finger's four unknowns are in the
order z, y (its saddle), 2, 3 (its hinges); the root's six are a turn omega and a shift v:
the world rotation and translation R, t become R exp(omega), t + R v.
"""

from __future__ import annotations

import math

from handtrack.fitting.compiled import inline
from handtrack.fitting.vectors import (
    add,
    apply,
    apply_transposed,
    cross,
    distance2,
    dot,
    rotate,
    scale,
    sub,
)

LANES = 8
WRIST = 5
VECTOR = 3 * LANES

# the model: base joint, bones, axes, unit first bone, limits and twist factor of the base
X1, B1, B2, B3, NX, NZ, NY, N2, N3 = range(0, 27 * LANES, VECTOR)
LOW_Z, LOW_Y, LOW_2, LOW_3, UP_Z, UP_Y, UP_2, UP_3, TWIST = range(27 * LANES, 36 * LANES, LANES)
# the frame: weights and world targets of the joints base..tip
W1, W2, W3, W4 = range(36 * LANES, 40 * LANES, LANES)
T1, T2, T3, T4 = range(40 * LANES, 52 * LANES, VECTOR)
# the pose, and what follows from it: joints, axes, targets; weights under the robust loss, and
# each finger's part of the objective
ANGLE_Z, ANGLE_Y, ANGLE_2, ANGLE_3 = range(52 * LANES, 56 * LANES, LANES)
X2, X3, X4, UX, UY, U2, U3, Y1, Y2, Y3, Y4 = range(56 * LANES, 89 * LANES, VECTOR)
L1, L2, L3, L4, COST = range(89 * LANES, 94 * LANES, LANES)
# derivatives. A row per angle: coupling to omega, to v, and the gradient
ROW = 7 * LANES
ROW_Z, ROW_Y, ROW_2, ROW_3 = range(94 * LANES, 122 * LANES, ROW)
V, G = VECTOR, 2 * VECTOR
H_ZZ, H_ZY, H_Z2, H_Z3, H_YY, H_Y2, H_Y3, H_22, H_23, H_33 = range(122 * LANES, 132 * LANES, LANES)
# Gauss-Newton's diagonal, and each finger's share of the root's gradient and Hessian
D_Z, D_Y, D_2, D_3 = range(132 * LANES, 136 * LANES, LANES)
ROOT_GRAD = 136 * LANES
ROOT_HESS, ROOT_W, ROOT_WX = 142 * LANES, 148 * LANES, 149 * LANES
# the active face: free (1) or fixed (0) for the saddle's normal and tangent and the hinges;
# the normal itself; the boundary's curvature
FREE_N, FREE_T, FREE_2, FREE_3 = range(152 * LANES, 156 * LANES, LANES)
NORMAL_Z, NORMAL_Y, CURVE = range(156 * LANES, 159 * LANES, LANES)
# the factored face: 1/pivots and multipliers
P_0, P_1, P_2, P_3 = range(159 * LANES, 163 * LANES, LANES)
L_01, L_02, L_03, L_12, L_13, L_23 = range(163 * LANES, 169 * LANES, LANES)
# the step, and the angles before it
STEP_Z, STEP_Y, STEP_2, STEP_3 = range(169 * LANES, 173 * LANES, LANES)
BEFORE = 173 * LANES
# the rows through L^-1, and each finger's share of the root's equations (6 x 7)
R_0, R_1, R_2, R_3 = range(177 * LANES, 205 * LANES, ROW)
SCHUR = 205 * LANES
# a finger bent the other way: its angles, and what they add to the objective
TRIAL, RISE = 247 * LANES, 251 * LANES
# after the lanes. An equation of the root takes eight places: six unknowns, the gradient,
# the least sound pivot
ROOT = 252 * LANES
ROOT_BEFORE = ROOT + 12
RHO = ROOT_BEFORE + 12
CHANGE = RHO + 8
SYSTEM = CHANGE + 8
# settings and results of the solvers; the angles' variances, the pose's covariance (26 x 26) and
# a dense gradient
MAX_SWEEPS, MAX_STEPS, TOLERANCE, LOSS, SPREAD2, COLD, FULL = range(
    SYSTEM + 6 * LANES, SYSTEM + 6 * LANES + 7
)
OBJECTIVE, SWEEPS, STEPS, STATE = range(FULL + 1, FULL + 5)
VARIANCE = STATE + 1
COVARIANCE = VARIANCE + 20
GRADIENT = COVARIANCE + 26 * 26
SIZE = GRADIENT + 26
# behind the buffer, where collisions are to be avoided: how many pairs of capsules may meet, and
# the numbers of each (see `hand.capsules.contacts`)
CONTACTS, PAIR = SIZE, 5

# what STATE says
CONVERGED, LIMIT, STALLED, TOO_FEW, UNDERDETERMINED = range(5)

NO_LOSS, HUBER, GEMAN_MCCLURE = 0, 1, 2


@inline
def get(s, i):
    """The 3-vector at a slot's place in a lane."""
    return (s[i], s[i + LANES], s[i + 2 * LANES])


@inline
def put(s, i, v):
    s[i], s[i + LANES], s[i + 2 * LANES] = v


@inline
def load_model(s, rest, axes, lower, upper, twist):
    """Write a model's constants into a buffer of zeros."""
    for f in range(5):
        k, a = 4 * f + 1, 4 * f
        for i in range(3):
            s[X1 + i * LANES + f] = rest[k, i]
            for b in range(3):
                s[B1 + b * VECTOR + i * LANES + f] = rest[k + b + 1, i] - rest[k + b, i]
            for n in range(4):
                s[NZ + n * VECTOR + i * LANES + f] = axes[a + n, i]
        b1 = get(s, B1 + f)
        put(s, NX + f, scale(1.0 / math.sqrt(dot(b1, b1)), b1))
        for n in range(4):
            s[LOW_Z + n * LANES + f] = lower[a + n]
            s[UP_Z + n * LANES + f] = upper[a + n]
    s[TWIST] = twist
    for i in range(3):
        s[X1 + i * LANES + WRIST] = rest[0, i]


@inline
def load_frame(s, targets, weights, scale):
    """Write a frame's targets (21, 3) and weights (21,) over scale; a missing target is not read.

    Weights of at most one keep the solver's absolute floors in proportion.
    """
    for f in range(6):
        for j in range(4):
            k = 0 if f == WRIST else 4 * f + 1 + j
            w = weights[k] / scale if f < WRIST or j == 0 else 0.0
            s[W1 + j * LANES + f] = w
            for i in range(3):
                s[T1 + j * VECTOR + i * LANES + f] = targets[k, i] if w > 0.0 else 0.0


@inline
def load_pose(s, angles, root):
    for f in range(5):
        for a in range(4):
            s[ANGLE_Z + a * LANES + f] = angles[4 * f + a]
    for i in range(12):
        s[ROOT + i] = root[i]


@inline
def store_pose(s, angles, root):
    for f in range(5):
        for a in range(4):
            angles[4 * f + a] = s[ANGLE_Z + a * LANES + f]
    for i in range(12):
        root[i] = s[ROOT + i]


@inline
def store_joints(s, out):
    """Joints (21, 3) of the placed pose in the world."""
    t = (s[ROOT + 9], s[ROOT + 10], s[ROOT + 11])
    r = buffer_rotation(s)
    out[0, 0], out[0, 1], out[0, 2] = add(apply(r, get(s, X1 + WRIST)), t)
    for f in range(5):
        for j in range(4):
            i = X1 + f if j == 0 else X2 + (j - 1) * VECTOR + f
            k = 4 * f + 1 + j
            out[k, 0], out[k, 1], out[k, 2] = add(apply(r, get(s, i)), t)


@inline
def buffer_rotation(s):
    return (
        (s[ROOT], s[ROOT + 1], s[ROOT + 2]),
        (s[ROOT + 3], s[ROOT + 4], s[ROOT + 5]),
        (s[ROOT + 6], s[ROOT + 7], s[ROOT + 8]),
    )


@inline
def cos_sin(x):
    """Cosine and sine of an angle in -pi..pi, to 4e-16, by straight-line code.

    Taylor series at a quarter of the angle, then the double-angle formulae twice; unlike the
    library's functions this turns into vector instructions.
    """
    t = 0.25 * x
    q = t * t
    sine = 1.0 - q / 210.0 * (1.0 - q / 272.0)
    sine = 1.0 - q / 110.0 * (1.0 - q / 156.0 * sine)
    sine = t * (1.0 - q / 6.0 * (1.0 - q / 20.0 * (1.0 - q / 42.0 * (1.0 - q / 72.0 * sine))))
    # one minus the cosine keeps its digits at small angles
    versed = 1.0 - q / 182.0 * (1.0 - q / 240.0 * (1.0 - q / 306.0))
    versed = 1.0 - q / 90.0 * (1.0 - q / 132.0 * versed)
    versed = 0.5 * q * (1.0 - q / 12.0 * (1.0 - q / 30.0 * (1.0 - q / 56.0 * versed)))
    cosine = 1.0 - versed
    sine, versed = 2.0 * sine * cosine, 2.0 * sine * sine
    cosine = 1.0 - versed
    return 1.0 - 2.0 * sine * sine, 2.0 * sine * cosine


@inline
def place(s):
    """Forward kinematics (eq. 1, 2, 4, 5), targets in the root frame, and the objective.

    LOSS in the buffer is NO_LOSS, HUBER or GEMAN_MCCLURE, SPREAD2 the square of the distance
    at which the loss bends [m^2].
    """
    for f in range(LANES):
        cz, sz = cos_sin(s[ANGLE_Z + f])
        cy, sy = cos_sin(s[ANGLE_Y + f])
        ct, st = cos_sin(s[TWIST + f] * s[ANGLE_Y + f])
        c2, s2 = cos_sin(s[ANGLE_2 + f])
        c3, s3 = cos_sin(s[ANGLE_3 + f])
        nx, ny, nz = get(s, NX + f), get(s, NY + f), get(s, NZ + f)
        n2, n3 = get(s, N2 + f), get(s, N3 + f)
        # from the tip inwards: each joint turns all that hangs on it
        b3 = rotate(nx, ct, st, rotate(n2, c2, s2, rotate(n3, c3, s3, get(s, B3 + f))))
        b2 = rotate(nx, ct, st, rotate(n2, c2, s2, get(s, B2 + f)))
        u3 = rotate(nx, ct, st, rotate(n2, c2, s2, n3))
        u2 = rotate(nx, ct, st, n2)
        b1 = rotate(nz, cz, sz, rotate(ny, cy, sy, get(s, B1 + f)))
        b2 = rotate(nz, cz, sz, rotate(ny, cy, sy, b2))
        b3 = rotate(nz, cz, sz, rotate(ny, cy, sy, b3))
        put(s, U3 + f, rotate(nz, cz, sz, rotate(ny, cy, sy, u3)))
        put(s, U2 + f, rotate(nz, cz, sz, rotate(ny, cy, sy, u2)))
        put(s, UX + f, rotate(nz, cz, sz, rotate(ny, cy, sy, nx)))
        put(s, UY + f, rotate(nz, cz, sz, ny))
        x2 = add(get(s, X1 + f), b1)
        x3 = add(x2, b2)
        put(s, X2 + f, x2)
        put(s, X3 + f, x3)
        put(s, X4 + f, add(x3, b3))

    # eq. 6, seen from the root frame
    r = buffer_rotation(s)
    t = (s[ROOT + 9], s[ROOT + 10], s[ROOT + 11])
    total = 0.0
    for f in range(LANES):
        y1 = apply_transposed(r, sub(get(s, T1 + f), t))
        y2 = apply_transposed(r, sub(get(s, T2 + f), t))
        y3 = apply_transposed(r, sub(get(s, T3 + f), t))
        y4 = apply_transposed(r, sub(get(s, T4 + f), t))
        put(s, Y1 + f, y1)
        put(s, Y2 + f, y2)
        put(s, Y3 + f, y3)
        put(s, Y4 + f, y4)
        w1, w2, w3, w4 = s[W1 + f], s[W2 + f], s[W3 + f], s[W4 + f]
        s[L1 + f], s[L2 + f], s[L3 + f], s[L4 + f] = w1, w2, w3, w4
        cost = w1 * distance2(get(s, X1 + f), y1) + w2 * distance2(get(s, X2 + f), y2)
        cost += w3 * distance2(get(s, X3 + f), y3) + w4 * distance2(get(s, X4 + f), y4)
        s[COST + f] = cost
        total += cost
    return total if s[LOSS] == NO_LOSS else soften(s, s[LOSS], s[SPREAD2])


@inline
def soften(s, loss, spread2):
    """Objective and weights (the loss's slope) under a robust loss of the squared distance q.

    Huber: q up to spread^2, then 2 spread sqrt(q) - spread^2. Geman-McClure:
    q spread^2 / (q + spread^2).
    """
    total = 0.0
    for f in range(6):
        s[COST + f] = 0.0
        for j in range(4):
            x = get(s, X1 + f) if j == 0 else get(s, X2 + (j - 1) * VECTOR + f)
            q = distance2(x, get(s, Y1 + j * VECTOR + f))
            w = s[W1 + j * LANES + f]
            if loss == HUBER:
                slope = math.sqrt(spread2 / q) if q > spread2 else 1.0
                s[L1 + j * LANES + f] = w * slope
                s[COST + f] += w * (2.0 * slope * q - spread2 if q > spread2 else q)
            else:
                g = spread2 / (q + spread2)
                s[L1 + j * LANES + f] = w * g * g
                s[COST + f] += w * q * g
        total += s[COST + f]
    return total


@inline
def moment_matrix(w, d, y, m):
    """m + w ((y . d) 1 - d y^T), which takes an axis u to w y x (u x d)."""
    k = w * dot(y, d)
    a = scale(w, d)
    return (
        (m[0][0] + k - a[0] * y[0], m[0][1] - a[0] * y[1], m[0][2] - a[0] * y[2]),
        (m[1][0] - a[1] * y[0], m[1][1] + k - a[1] * y[1], m[1][2] - a[1] * y[2]),
        (m[2][0] - a[2] * y[0], m[2][1] - a[2] * y[1], m[2][2] + k - a[2] * y[2]),
    )


_Z = (0.0, 0.0, 0.0)
_Z3 = (_Z, _Z, _Z)


@inline
def differentiate(s, second):
    """Gradient and Hessian of half the objective at the placed pose.

    With J_b,i = u_b x (x_i - p_b) the columns of the Jacobian, half the objective has the
    exact Hessian u_b . sum_i w_i (y_i - p_b) x J_c,i for b above c in the chain, the root's
    turn being above all with p = 0; with x_i for the target y_i it is Gauss-Newton's.

    Args:
        s: the buffer, after `place`.
        second: 1 for the exact Hessian, 0 for Gauss-Newton.
    """
    for f in range(LANES):
        x1, x2, x3, x4 = get(s, X1 + f), get(s, X2 + f), get(s, X3 + f), get(s, X4 + f)
        y1, y2 = get(s, Y1 + f), get(s, Y2 + f)
        y3, y4 = get(s, Y3 + f), get(s, Y4 + f)
        w1, w2, w3, w4 = s[L1 + f], s[L2 + f], s[L3 + f], s[L4 + f]
        uz, u2, u3 = get(s, NZ + f), get(s, U2 + f), get(s, U3 + f)
        # abduction also twists the thumb about its own bone
        twist, ux = s[TWIST + f], get(s, UX + f)
        uy0 = get(s, UY + f)
        uy = add(uy0, scale(twist, ux))
        d2, d3, d4 = sub(x2, x1), sub(x3, x1), sub(x4, x1)
        h3, h4 = sub(x3, x2), sub(x4, x2)
        k4 = sub(x4, x3)
        r1, r2, r3, r4 = sub(x1, y1), sub(x2, y2), sub(x3, y3), sub(x4, y4)

        # gradient: u_b . sum_i w_i (x_i - p_b) x r_i
        e2, e3, e4 = scale(w2, r2), scale(w3, r3), scale(w4, r4)
        n1 = add(cross(d2, e2), add(cross(d3, e3), cross(d4, e4)))
        s[ROW_Z + G + f] = dot(uz, n1)
        s[ROW_Y + G + f] = dot(uy, n1)
        s[ROW_2 + G + f] = dot(u2, add(cross(h3, e3), cross(h4, e4)))
        s[ROW_3 + G + f] = dot(u3, cross(k4, e4))

        # targets of the Hessian: the joints themselves for Gauss-Newton
        m1, m2 = sub(x1, scale(second, r1)), sub(x2, scale(second, r2))
        m3, m4 = sub(x3, scale(second, r3)), sub(x4, scale(second, r4))
        t1 = moment_matrix(w2, d2, m2, _Z3)
        t1 = moment_matrix(w3, d3, m3, t1)
        t1 = moment_matrix(w4, d4, m4, t1)
        t2 = moment_matrix(w4, h4, m4, moment_matrix(w3, h3, m3, _Z3))
        t3 = moment_matrix(w4, k4, m4, _Z3)
        c1 = add(scale(w2, d2), add(scale(w3, d3), scale(w4, d4)))
        c2 = add(scale(w3, h3), scale(w4, h4))
        sz, sy, s2 = cross(uz, c1), cross(uy, c1), cross(u2, c2)
        s3 = cross(u3, scale(w4, k4))
        mz, my, mm2, mm3 = apply(t1, uz), apply(t1, uy), apply(t2, u2), apply(t3, u3)
        put(s, ROW_Z + f, mz)
        put(s, ROW_Z + V + f, sz)
        put(s, ROW_Y + f, my)
        put(s, ROW_Y + V + f, sy)
        put(s, ROW_2 + f, mm2)
        put(s, ROW_2 + V + f, s2)
        put(s, ROW_3 + f, mm3)
        put(s, ROW_3 + V + f, s3)
        qz, qy = sub(mz, cross(x1, sz)), sub(my, cross(x1, sy))
        q2, q3 = sub(mm2, cross(x1, s2)), sub(mm3, cross(x1, s3))
        s[H_ZZ + f] = dot(uz, qz)
        s[H_ZY + f] = dot(uz, qy)
        s[H_Z2 + f] = dot(uz, q2)
        s[H_Z3 + f] = dot(uz, q3)
        # turning about y, then about x, is not one turn about their sum
        order = second * twist * dot(cross(uy0, ux), n1)
        s[H_YY + f] = dot(uy, qy) + order
        s[H_Y2 + f] = dot(uy, q2)
        s[H_Y3 + f] = dot(uy, q3)
        s[H_22 + f] = dot(u2, sub(mm2, cross(x2, s2)))
        s[H_23 + f] = dot(u2, sub(mm3, cross(x2, s3)))
        s[H_33 + f] = dot(u3, sub(mm3, cross(x3, s3)))

        # Gauss-Newton's diagonal, the scale of a sound pivot
        a2, a3, a4 = cross(uz, d2), cross(uz, d3), cross(uz, d4)
        s[D_Z + f] = w2 * dot(a2, a2) + w3 * dot(a3, a3) + w4 * dot(a4, a4)
        a2, a3, a4 = cross(uy, d2), cross(uy, d3), cross(uy, d4)
        s[D_Y + f] = w2 * dot(a2, a2) + w3 * dot(a3, a3) + w4 * dot(a4, a4)
        a3, a4 = cross(u2, h3), cross(u2, h4)
        s[D_2 + f] = w3 * dot(a3, a3) + w4 * dot(a4, a4)
        a4 = cross(u3, k4)
        s[D_3 + f] = w4 * dot(a4, a4)

        # the root: sum_i w_i of x x r and r; of (x.m) 1 - (x m^T + m x^T) / 2; of 1 and x
        e1 = scale(w1, r1)
        torque = add(cross(x1, e1), add(cross(x2, e2), add(cross(x3, e3), cross(x4, e4))))
        put(s, ROOT_GRAD + f, torque)
        put(s, ROOT_GRAD + V + f, add(add(e1, e2), add(e3, e4)))
        a1, a2, a3, a4 = scale(w1, x1), scale(w2, x2), scale(w3, x3), scale(w4, x4)
        xx = a1[0] * m1[0] + a2[0] * m2[0] + a3[0] * m3[0] + a4[0] * m4[0]
        yy = a1[1] * m1[1] + a2[1] * m2[1] + a3[1] * m3[1] + a4[1] * m4[1]
        zz = a1[2] * m1[2] + a2[2] * m2[2] + a3[2] * m3[2] + a4[2] * m4[2]
        xy = a1[0] * m1[1] + a2[0] * m2[1] + a3[0] * m3[1] + a4[0] * m4[1]
        yx = a1[1] * m1[0] + a2[1] * m2[0] + a3[1] * m3[0] + a4[1] * m4[0]
        xz = a1[0] * m1[2] + a2[0] * m2[2] + a3[0] * m3[2] + a4[0] * m4[2]
        zx = a1[2] * m1[0] + a2[2] * m2[0] + a3[2] * m3[0] + a4[2] * m4[0]
        yz = a1[1] * m1[2] + a2[1] * m2[2] + a3[1] * m3[2] + a4[1] * m4[2]
        zy = a1[2] * m1[1] + a2[2] * m2[1] + a3[2] * m3[1] + a4[2] * m4[1]
        s[ROOT_HESS + f] = yy + zz
        s[ROOT_HESS + 1 * LANES + f] = -0.5 * (xy + yx)
        s[ROOT_HESS + 2 * LANES + f] = -0.5 * (xz + zx)
        s[ROOT_HESS + 3 * LANES + f] = xx + zz
        s[ROOT_HESS + 4 * LANES + f] = -0.5 * (yz + zy)
        s[ROOT_HESS + 5 * LANES + f] = xx + yy
        s[ROOT_W + f] = w1 + w2 + w3 + w4
        put(s, ROOT_WX + f, add(add(a1, a2), add(a3, a4)))
