"""Forward kinematics: where the angles put joints and axes (Li et al. 2021, eq. 1, 2, 4, 5)."""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.vectors import add, cos_sin, lane, put_lane, rotate
from handtrack.kernels.workspace import ABDUCTION, BASE, FLEXION, HINGE_1, HINGE_2, LANES


@inline
def rotation_about(w, a, f):
    """Angle a's rotation exp(n_a phi_a) in lane f: axis, cosine and sine (eq. 1)."""
    c, s = cos_sin(w.angle[a, f])
    return lane(w.rest_axis, a, f), c, s


@inline
def about(rotation, v):
    n, c, s = rotation
    return rotate(n, c, s, v)


@inline
def place_fingers(w):
    """Joints, axes and the first bone's direction, in the root frame, from the angles.

    With the thumb's inner turn about its first bone e: R_0 = exp(n_z phi_z) exp(n_y phi_y)
    exp(e alpha phi_y) (eq. 2), R_1, R_2 = exp(n phi) (eq. 1); A_i = A_(i-1) R_i (eq. 4) turns
    the bone behind joint i, x_(i+1) = x_i + A_i b_i (eq. 5).
    """
    for f in range(LANES):
        z, y = rotation_about(w, FLEXION, f), rotation_about(w, ABDUCTION, f)
        first, second = rotation_about(w, HINGE_1, f), rotation_about(w, HINGE_2, f)
        e = (w.rest_along[0, f], w.rest_along[1, f], w.rest_along[2, f])
        c, s = cos_sin(w.twist[f] * w.angle[ABDUCTION, f])
        inner = e, c, s
        # from the tip inwards: each joint turns all that hangs on it
        tip_bone = about(inner, about(first, about(second, lane(w.rest_bone, 2, f))))
        middle_bone = about(inner, about(first, lane(w.rest_bone, 1, f)))
        axis_2 = about(inner, about(first, second[0]))
        axis_1 = about(inner, first[0])
        base_bone = about(z, about(y, lane(w.rest_bone, 0, f)))
        middle_bone, tip_bone = about(z, about(y, middle_bone)), about(z, about(y, tip_bone))
        axis_1, axis_2 = about(z, about(y, axis_1)), about(z, about(y, axis_2))
        e = about(z, about(y, e))
        axis_y, twist = about(z, y[0]), w.twist[f]
        for i in range(3):
            w.axis[FLEXION, i, f] = z[0][i]
            # abduction also twists the thumb about its own bone
            w.axis[ABDUCTION, i, f] = axis_y[i] + twist * e[i]
            w.axis[HINGE_1, i, f], w.axis[HINGE_2, i, f] = axis_1[i], axis_2[i]
            w.along[i, f] = e[i]
        x = add(lane(w.joint, BASE, f), base_bone)
        put_lane(w.joint, 1, f, x)
        x = add(x, middle_bone)
        put_lane(w.joint, 2, f, x)
        put_lane(w.joint, 3, f, add(x, tip_bone))
