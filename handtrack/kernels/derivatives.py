"""Gradient and Hessian of half the objective of joints in space, finger by finger.

With p_a the joint that angle a turns about, u_a its axis, x_j the landmarks and d_j = x_j - p_a,
the Jacobian's columns are J_a,j = u_a x d_j for the joints j beyond (9). The root's turn is above
all angles, with p = 0.
"""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.vectors import (
    ZERO,
    ZERO3,
    add,
    cross,
    dot,
    lane,
    put_lane,
    scale,
    sub,
)
from handtrack.kernels.workspace import (
    ABDUCTION,
    ANGLES,
    FLEXION,
    GRADIENT,
    HINGE_1,
    HINGE_2,
    JOINTS,
    LANES,
    SHIFT,
    TURN,
)


@inline
def differentiate(w, second):
    """Gradient and Hessian at the placed pose.

    Args:
        w: the workspace, after `place`.
        second: 1 for the exact Hessian, 0 for Gauss-Newton's.
    """
    weigh_joints(w, second)
    # written out, so that each is compiled for its joint
    gather_beyond(w, 0)
    gather_beyond(w, 1)
    gather_beyond(w, 2)
    differentiate_angles(w)
    differentiate_pairs(w, second)
    scale_pivots(w)


@inline
def weigh_joints(w, second):
    """Forces w_j r_j of the residuals, where the Hessian aims, and the root's own share of both.

    (10) gradient: sum_j x_j x w_j r_j by the turn, sum_j w_j r_j by the shift.
    (11) Hessian: by the turn sum_j w_j (x.m 1 - (x m^T + m x^T) / 2), with m_j = y_j for the
    exact one and x_j for Gauss-Newton's; turn and shift couple by [sum_j w_j x_j]x.
    """
    for f in range(LANES):
        force, torque, lever, weight = ZERO, ZERO, ZERO, 0.0
        xx = yy = zz = xy = xz = yz = 0.0
        for j in range(JOINTS):
            x, pull = lane(w.mark, j, f), w.pull[j, f]
            r = sub(x, lane(w.seen, j, f))
            m, e, a = sub(x, scale(second, r)), scale(pull, r), scale(pull, x)
            put_lane(w.aim, j, f, m)
            put_lane(w.force, j, f, e)
            force, torque = add(force, e), add(torque, cross(x, e))
            weight, lever = weight + pull, add(lever, a)
            xx, yy, zz = xx + a[0] * m[0], yy + a[1] * m[1], zz + a[2] * m[2]
            xy += a[0] * m[1] + a[1] * m[0]
            xz += a[0] * m[2] + a[2] * m[0]
            yz += a[1] * m[2] + a[2] * m[1]
        for i in range(3):
            w.root_gradient[TURN + i, f], w.root_gradient[SHIFT + i, f] = torque[i], force[i]
            w.root_lever[i, f] = lever[i]
        w.root_weight[f] = weight
        w.root_moment[0, 0, f] = yy + zz
        w.root_moment[1, 1, f] = xx + zz
        w.root_moment[2, 2, f] = xx + yy
        w.root_moment[0, 1, f] = -0.5 * xy
        w.root_moment[0, 2, f] = -0.5 * xz
        w.root_moment[1, 2, f] = -0.5 * yz


@inline
def moment_of(pull, d, m, t):
    """t + w ((m . d) 1 - d m^T), which takes an axis u to w m x (u x d)."""
    k, a = pull * dot(m, d), scale(pull, d)
    return (
        (t[0][0] + k - a[0] * m[0], t[0][1] - a[0] * m[1], t[0][2] - a[0] * m[2]),
        (t[1][0] - a[1] * m[0], t[1][1] + k - a[1] * m[1], t[1][2] - a[1] * m[2]),
        (t[2][0] - a[2] * m[0], t[2][1] - a[2] * m[1], t[2][2] + k - a[2] * m[2]),
    )


@inline
def gather_beyond(w, p):
    """Sums over the joints beyond joint p, about it.

    (12) torque n_p = sum_j d_j x w_j r_j, moment T_p = sum_j w_j ((m_j . d_j) 1 - d_j m_j^T),
    lever c_p = sum_j w_j d_j.
    """
    for f in range(LANES):
        torque, lever, moment = ZERO, ZERO, ZERO3
        for j in range(p + 1, JOINTS):
            d, pull = sub(lane(w.mark, j, f), lane(w.joint, p, f)), w.pull[j, f]
            torque = add(torque, cross(d, lane(w.force, j, f)))
            lever = add(lever, scale(pull, d))
            moment = moment_of(pull, d, lane(w.aim, j, f), moment)
        put_lane(w.torque, p, f, torque)
        put_lane(w.lever, p, f, lever)
        for i in range(3):
            put_lane(w.moment[p], i, f, moment[i])


@inline
def differentiate_angles(w):
    """Every angle's gradient and coupling to the root.

    (13) gradient u_a . n_p; by the root's turn T_p u_a; by its shift u_a x c_p.
    """
    for f in range(LANES):
        for a in range(ANGLES):
            p = max(a - 1, 0)
            u = lane(w.axis, a, f)
            shift = cross(u, lane(w.lever, p, f))
            for i in range(3):
                w.row[a, TURN + i, f] = dot(lane(w.moment[p], i, f), u)
                w.row[a, SHIFT + i, f] = shift[i]
            w.row[a, GRADIENT, f] = dot(u, lane(w.torque, p, f))


@inline
def turn_about(w, a, p, f):
    """Angle a's coupling to a turn about joint p: row_a by the turn less p x row_a by the shift."""
    turn = (w.row[a, TURN, f], w.row[a, TURN + 1, f], w.row[a, TURN + 2, f])
    shift = (w.row[a, SHIFT, f], w.row[a, SHIFT + 1, f], w.row[a, SHIFT + 2, f])
    return sub(turn, cross(lane(w.joint, p, f), shift))


@inline
def differentiate_pairs(w, second):
    """The fingers' own Hessians, both triangles.

    (14) H_bc = u_b . (row_c by the turn - p_b x row_c by the shift), b not nearer the tip than c.
    """
    for f in range(LANES):
        z, y = lane(w.axis, FLEXION, f), lane(w.axis, ABDUCTION, f)
        first, second_axis = lane(w.axis, HINGE_1, f), lane(w.axis, HINGE_2, f)
        for c in range(ANGLES):
            about_base = turn_about(w, c, 0, f)
            w.hessian[FLEXION, c, f] = w.hessian[c, FLEXION, f] = dot(z, about_base)
            if c > FLEXION:
                w.hessian[ABDUCTION, c, f] = w.hessian[c, ABDUCTION, f] = dot(y, about_base)
        w.hessian[HINGE_1, HINGE_1, f] = dot(first, turn_about(w, HINGE_1, 1, f))
        both = dot(first, turn_about(w, HINGE_2, 1, f))
        w.hessian[HINGE_1, HINGE_2, f] = w.hessian[HINGE_2, HINGE_1, f] = both
        w.hessian[HINGE_2, HINGE_2, f] = dot(second_axis, turn_about(w, HINGE_2, 2, f))
        # turning about y, then about the bone, is not one turn about their sum
        order = cross(y, (w.along[0, f], w.along[1, f], w.along[2, f]))
        w.hessian[ABDUCTION, ABDUCTION, f] += second * w.twist[f] * dot(order, lane(w.torque, 0, f))


@inline
def square_of_columns(w, a, p, f):
    """sum_j w_j |J_a,j|^2 of an angle that turns about joint p."""
    total = 0.0
    for j in range(p + 1, JOINTS):
        column = cross(lane(w.axis, a, f), sub(lane(w.mark, j, f), lane(w.joint, p, f)))
        total += w.pull[j, f] * dot(column, column)
    return total


@inline
def scale_pivots(w):
    """(15) Gauss-Newton's diagonal, the scale of a sound pivot."""
    for f in range(LANES):
        w.diagonal[FLEXION, f] = square_of_columns(w, FLEXION, 0, f)
        w.diagonal[ABDUCTION, f] = square_of_columns(w, ABDUCTION, 0, f)
        w.diagonal[HINGE_1, f] = square_of_columns(w, HINGE_1, 1, f)
        w.diagonal[HINGE_2, f] = square_of_columns(w, HINGE_2, 2, f)
