"""Compiled blocks of the block-coordinate-descent fitter (Li et al. 2021, Algorithm 1).

Everything here works on one frame. Shapes: rest joints (21, 3) [m] and axes (20, 3) of the
model at rest; targets (21, 3) [m] in the world; weights (21,), 0 where a joint is missing (its
target is then never read); angles (20,) [rad]; root (12,): the rotation from the root frame to
the world, row by row, and the translation [m]. `exact` picks the constrained minimiser of each
block, else the paper's update (Procrustes, Euler angles, projection onto the limits).
"""

from __future__ import annotations

import math

import numpy as np

from handtrack.fitting.compiled import inline, kernel
from handtrack.fitting.vectors import (
    add,
    apply,
    apply_transposed,
    cross,
    distance2,
    dot,
    rotate,
    row,
    scale,
    sub,
    unit_cos_sin,
)

CONVERGED, SWEEP_LIMIT = 0, 1


@inline
def largest_eigenvector4(m):
    """Eigenvector of the largest eigenvalue of a symmetric 4x4 matrix (overwritten), Jacobi.

    Cyclic Jacobi is accurate for close and equal eigenvalues, where a polynomial is not.
    """
    v = np.eye(4)
    for _ in range(30):
        off = 0.0
        size = 0.0
        for i in range(4):
            size += m[i, i] * m[i, i]
            for j in range(i):
                off += m[i, j] * m[i, j]
        if off <= 1e-32 * size or off == 0.0:
            break
        for p in range(3):
            for q in range(p + 1, 4):
                if m[p, q] == 0.0:
                    continue
                h = 0.5 * (m[q, q] - m[p, p]) / m[p, q]
                t = 1.0 / (abs(h) + math.sqrt(1.0 + h * h))
                if h < 0.0:
                    t = -t
                c = 1.0 / math.sqrt(1.0 + t * t)
                s = t * c
                for k in range(4):
                    a, b = m[p, k], m[q, k]
                    m[p, k], m[q, k] = c * a - s * b, s * a + c * b
                for k in range(4):
                    a, b = m[k, p], m[k, q]
                    m[k, p], m[k, q] = c * a - s * b, s * a + c * b
                    a, b = v[k, p], v[k, q]
                    v[k, p], v[k, q] = c * a - s * b, s * a + c * b
    best = 0
    for i in range(1, 4):
        if m[i, i] > m[best, best]:
            best = i
    return v[0, best], v[1, best], v[2, best], v[3, best]


@inline
def procrustes(m):
    """Rotation R (rows) that maximises sum_i w_i b_i . R a_i, for m = sum_i w_i b_i a_i^T (rows).

    The quaternion is the largest eigenvector of a symmetric 4x4 matrix (Horn 1987): always a
    proper rotation, also for planar and collinear points.
    """
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = m
    k = np.empty((4, 4))
    k[0, 0] = xx + yy + zz
    k[1, 1] = xx - yy - zz
    k[2, 2] = -xx + yy - zz
    k[3, 3] = -xx - yy + zz
    k[0, 1] = k[1, 0] = zy - yz
    k[0, 2] = k[2, 0] = xz - zx
    k[0, 3] = k[3, 0] = yx - xy
    k[1, 2] = k[2, 1] = xy + yx
    k[1, 3] = k[3, 1] = xz + zx
    k[2, 3] = k[3, 2] = yz + zy
    w, x, y, z = largest_eigenvector4(k)
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


@inline
def outer_sum(m, w, b, a):
    """m + w b a^T."""
    return (
        add(m[0], scale(w * b[0], a)),
        add(m[1], scale(w * b[1], a)),
        add(m[2], scale(w * b[2], a)),
    )


ZERO = (0.0, 0.0, 0.0)
ZERO3 = (ZERO, ZERO, ZERO)


@inline
def root_rotation(root):
    return (
        (root[0], root[1], root[2]),
        (root[3], root[4], root[5]),
        (root[6], root[7], root[8]),
    )


@inline
def forward(rest, axes, angles, out):
    """Joints (21, 3) of a pose in the root frame, written to out (eq. 1, 2, 4, 5)."""
    for i in range(3):
        out[0, i] = rest[0, i]
    for f in range(5):
        k, a = 4 * f + 1, 4 * f
        b1 = sub(row(rest, k + 1), row(rest, k))
        b2 = sub(row(rest, k + 2), row(rest, k + 1))
        b3 = sub(row(rest, k + 3), row(rest, k + 2))
        # from the tip inwards: each joint turns all that hangs on it
        v = rotate(row(axes, a + 3), math.cos(angles[a + 3]), math.sin(angles[a + 3]), b3)
        c, s = math.cos(angles[a + 2]), math.sin(angles[a + 2])
        b2 = rotate(row(axes, a + 2), c, s, b2)
        b3 = rotate(row(axes, a + 2), c, s, v)
        cz, sz = math.cos(angles[a]), math.sin(angles[a])
        cy, sy = math.cos(angles[a + 1]), math.sin(angles[a + 1])
        nz, ny = row(axes, a), row(axes, a + 1)
        x = row(rest, k)
        out[k, 0], out[k, 1], out[k, 2] = x
        x = add(x, rotate(nz, cz, sz, rotate(ny, cy, sy, b1)))
        out[k + 1, 0], out[k + 1, 1], out[k + 1, 2] = x
        x = add(x, rotate(nz, cz, sz, rotate(ny, cy, sy, b2)))
        out[k + 2, 0], out[k + 2, 1], out[k + 2, 2] = x
        x = add(x, rotate(nz, cz, sz, rotate(ny, cy, sy, b3)))
        out[k + 3, 0], out[k + 3, 1], out[k + 3, 2] = x


@inline
def update_root(joints, targets, weights, root):
    """The best rigid transform of joints (root frame) onto the targets (Kabsch, barycentres)."""
    total = 0.0
    a0 = ZERO
    b0 = ZERO
    for k in range(21):
        w = weights[k]
        if w > 0.0:
            total += w
            a0 = add(a0, scale(w, row(joints, k)))
            b0 = add(b0, scale(w, row(targets, k)))
    a0 = scale(1.0 / total, a0)
    b0 = scale(1.0 / total, b0)
    m = ZERO3
    for k in range(21):
        w = weights[k]
        if w > 0.0:
            m = outer_sum(m, w, sub(row(targets, k), b0), sub(row(joints, k), a0))
    r = procrustes(m)
    t = sub(b0, apply(r, a0))
    for i in range(3):
        root[3 * i], root[3 * i + 1], root[3 * i + 2] = r[i]
        root[9 + i] = t[i]


@inline
def cost(joints, targets, weights, root):
    """Objective of eq. 6: sum of weighted squared distances [m^2]."""
    r = root_rotation(root)
    t = (root[9], root[10], root[11])
    e = 0.0
    for k in range(21):
        if weights[k] > 0.0:
            e += weights[k] * distance2(add(apply(r, row(joints, k)), t), row(targets, k))
    return e


@inline
def hinge_value(c, s, phi):
    return c * math.cos(phi) + s * math.sin(phi)


@inline
def best_hinge(c, s, lower, upper, current):
    """The angle in lower..upper that maximises c cos(phi) + s sin(phi)."""
    if c * c + s * s < 1e-300:
        return current  # nothing observes this angle
    phi = math.atan2(s, c)
    if lower <= phi <= upper:
        return phi
    # outside: the bound nearer on the circle
    return lower if hinge_value(c, s, lower) > hinge_value(c, s, upper) else upper


@inline
def semi_axis(lower, upper, positive):
    return upper if positive else -lower


@inline
def inside_ellipse(z, y, lz, uz, ly, uy):
    """Whether a saddle's angles keep the limits of eq. 3."""
    p = z / semi_axis(lz, uz, z >= 0.0)
    q = y / semi_axis(ly, uy, y >= 0.0)
    return p * p + q * q <= 1.0


@inline
def project_to_ellipse(z, y, lz, uz, ly, uy):
    """Nearest point of the ellipse to angles outside it, by Newton-Raphson.

    The root t of (a z / (a^2 + t))^2 + (b y / (b^2 + t))^2 = 1 gives the point
    (a^2 z / (a^2 + t), b^2 y / (b^2 + t)); the iteration climbs to it from below.
    """
    a = semi_axis(lz, uz, z >= 0.0)
    b = semi_axis(ly, uy, y >= 0.0)
    az, by = a * z, b * y
    t = max(math.sqrt(az * az + by * by) - max(a, b) ** 2, 0.0)
    for _ in range(60):
        da, db = a * a + t, b * b + t
        p, q = az / da, by / db
        g = p * p + q * q - 1.0
        step = g / (2.0 * (p * p / da + q * q / db))
        if step <= 1e-15 * (1.0 + t):
            break
        t += step
    z, y = a * a * z / (a * a + t), b * b * y / (b * b + t)
    p, q = z / a, y / b
    n = math.sqrt(p * p + q * q)
    return (z / n, y / n) if n > 1.0 else (z, y)


@inline
def saddle_value(k, cz, sz, cy, sy):
    """sum_i w_i b_i . exp(n_z z) exp(n_y y) a_i, from its 3x3 coefficients k (rows)."""
    v = (1.0, cy, sy)
    return dot(k[0], v) + cz * dot(k[1], v) + sz * dot(k[2], v)


@inline
def boundary_slopes(k, s, lz, uz, ly, uy):
    """Value and two derivatives of the saddle's objective along its ellipse at parameter s."""
    cs, sn = math.cos(s), math.sin(s)
    a = semi_axis(lz, uz, cs >= 0.0)
    b = semi_axis(ly, uy, sn >= 0.0)
    z, y = a * cs, b * sn
    cz, sz, cy, sy = math.cos(z), math.sin(z), math.cos(y), math.sin(y)
    v, dv, ddv = (1.0, cy, sy), (0.0, -sy, cy), (0.0, -cy, -sy)
    p, q, o = dot(k[1], v), dot(k[2], v), dot(k[0], v)
    dp, dq, do = dot(k[1], dv), dot(k[2], dv), dot(k[0], dv)
    f = o + cz * p + sz * q
    fz, fzz = -sz * p + cz * q, -cz * p - sz * q
    fy, fzy = do + cz * dp + sz * dq, -sz * dp + cz * dq
    fyy = dot(k[0], ddv) + cz * dot(k[1], ddv) + sz * dot(k[2], ddv)
    z1, y1 = -a * sn, b * cs
    first = fz * z1 + fy * y1
    second = fzz * z1 * z1 + 2 * fzy * z1 * y1 + fyy * y1 * y1 - fz * z - fy * y
    return f, first, second


@inline
def best_on_ellipse(k, lz, uz, ly, uy):
    """The angles on the ellipse's boundary that maximise the saddle's objective."""
    n = 16
    h = 2 * math.pi / n
    best, best_f = 0.0, -math.inf
    for i in range(n):
        f, _, _ = boundary_slopes(k, h * i, lz, uz, ly, uy)
        if f > best_f:
            best, best_f = h * i, f
    low, high, s = best - h, best + h, best
    for _ in range(50):
        _, first, second = boundary_slopes(k, s, lz, uz, ly, uy)
        if first > 0.0:
            low = s
        else:
            high = s
        # Newton where it stays in the bracket, else halve it
        new = s - first / second if second < 0.0 else high + 1.0
        if not low < new < high:
            new = 0.5 * (low + high)
        done = abs(new - s) < 1e-13
        s = new
        if done:
            break
    cs, sn = math.cos(s), math.sin(s)
    return semi_axis(lz, uz, cs >= 0.0) * cs, semi_axis(ly, uy, sn >= 0.0) * sn


@inline
def best_saddle(k, z, y, lz, uz, ly, uy):
    """The angles inside the ellipse that maximise the saddle's objective, from (z, y).

    Each angle has a closed form for the other one fixed; the two alternate. Both moves climb
    a sinusoid, so where they leave the ellipse its boundary holds a better point.
    """
    cz, sz, cy, sy = math.cos(z), math.sin(z), math.cos(y), math.sin(y)
    before = saddle_value(k, cz, sz, cy, sy)
    for _ in range(50):
        oz, oy = sz, sy
        v = (1.0, cy, sy)
        cz, sz = unit_cos_sin(dot(k[1], v), dot(k[2], v))
        cy, sy = unit_cos_sin(
            k[0][1] + cz * k[1][1] + sz * k[2][1], k[0][2] + cz * k[1][2] + sz * k[2][2]
        )
        if abs(sz - oz) + abs(sy - oy) < 1e-12:
            break
    new_z, new_y = math.atan2(sz, cz), math.atan2(sy, cy)
    if not inside_ellipse(new_z, new_y, lz, uz, ly, uy):
        new_z, new_y = best_on_ellipse(k, lz, uz, ly, uy)
    after = saddle_value(k, math.cos(new_z), math.sin(new_z), math.cos(new_y), math.sin(new_y))
    return (new_z, new_y) if after > before else (z, y)


@inline
def saddle_coefficients(nz, ny, w, b, a, k):
    """k + the coefficients that one pair of vectors adds to the saddle's objective.

    exp(n phi) = n n^T + cos(phi) (1 - n n^T) + sin(phi) [n]x on both sides of the product.
    """
    az = scale(dot(ny, a), ny)
    a1, a2 = sub(a, az), cross(ny, a)
    bz = scale(dot(nz, b), nz)
    b1, b2 = sub(b, bz), cross(b, nz)
    return (
        add(k[0], scale(w, (dot(bz, az), dot(bz, a1), dot(bz, a2)))),
        add(k[1], scale(w, (dot(b1, az), dot(b1, a1), dot(b1, a2)))),
        add(k[2], scale(w, (dot(b2, az), dot(b2, a1), dot(b2, a2)))),
    )


@inline
def euler_zy(r, nz, ny):
    """Angles (z, y) of a rotation taken as exp(n_z z) exp(n_y y) (eq. 8, 9).

    The axis perpendicular to both, x = n_y x n_z, is turned to
    x cos(z) cos(y) + n_y sin(z) cos(y) - n_z sin(y).
    """
    x = cross(ny, nz)
    v = apply(r, x)
    return math.atan2(dot(v, ny), dot(v, x)), math.asin(min(1.0, max(-1.0, -dot(v, nz))))


@inline
def update_finger(f, rest, axes, lower, upper, y, weights, angles, exact):
    """One pass over finger f in tree order; y (21, 3) are the targets in the root frame."""
    k, a = 4 * f + 1, 4 * f
    nz, ny, n2, n3 = row(axes, a), row(axes, a + 1), row(axes, a + 2), row(axes, a + 3)
    x1 = row(rest, k)
    b1 = sub(row(rest, k + 1), x1)
    b2 = sub(row(rest, k + 2), row(rest, k + 1))
    b3 = sub(row(rest, k + 3), row(rest, k + 2))
    w1, w2, w3 = weights[k + 1], weights[k + 2], weights[k + 3]
    y1 = row(y, k + 1) if w1 > 0.0 else ZERO
    y2 = row(y, k + 2) if w2 > 0.0 else ZERO
    y3 = row(y, k + 3) if w3 > 0.0 else ZERO
    if w1 + w2 + w3 <= 0.0:
        return

    # saddle: all three joints beyond it turn rigidly with it
    c2, s2 = math.cos(angles[a + 2]), math.sin(angles[a + 2])
    v3 = rotate(n3, math.cos(angles[a + 3]), math.sin(angles[a + 3]), b3)
    a2 = add(b1, rotate(n2, c2, s2, b2))
    a3 = add(b1, rotate(n2, c2, s2, add(b2, v3)))
    t1, t2, t3 = sub(y1, x1), sub(y2, x1), sub(y3, x1)
    lz, uz, ly, uy = lower[a], upper[a], lower[a + 1], upper[a + 1]
    if exact:
        q = saddle_coefficients(nz, ny, w1, t1, b1, ZERO3)
        q = saddle_coefficients(nz, ny, w2, t2, a2, q)
        q = saddle_coefficients(nz, ny, w3, t3, a3, q)
        z, yy = best_saddle(q, angles[a], angles[a + 1], lz, uz, ly, uy)
    else:
        m = outer_sum(outer_sum(outer_sum(ZERO3, w1, t1, b1), w2, t2, a2), w3, t3, a3)
        z, yy = euler_zy(procrustes(m), nz, ny)
        if not inside_ellipse(z, yy, lz, uz, ly, uy):
            z, yy = project_to_ellipse(z, yy, lz, uz, ly, uy)
    angles[a], angles[a + 1] = z, yy
    if w2 + w3 <= 0.0:
        return

    # first hinge, in the frame that the saddle now gives it
    cz, sz, cy, sy = math.cos(z), math.sin(z), math.cos(yy), math.sin(yy)
    x2 = add(x1, rotate(nz, cz, sz, rotate(ny, cy, sy, b1)))
    t2 = rotate(ny, cy, -sy, rotate(nz, cz, -sz, sub(y2, x2)))
    t3 = rotate(ny, cy, -sy, rotate(nz, cz, -sz, sub(y3, x2)))
    a3 = add(b2, v3)
    angles[a + 2] = best_angle(
        n2, w2, t2, b2, w3, t3, a3, lower[a + 2], upper[a + 2], angles[a + 2], exact
    )
    if w3 <= 0.0:
        return

    # second hinge
    c2, s2 = math.cos(angles[a + 2]), math.sin(angles[a + 2])
    t3 = sub(rotate(n2, c2, -s2, t3), b2)
    angles[a + 3] = best_angle(
        n3, w3, t3, b3, 0.0, t3, b3, lower[a + 3], upper[a + 3], angles[a + 3], exact
    )


@inline
def best_angle(n, w1, t1, a1, w2, t2, a2, lower, upper, current, exact):
    """A hinge's angle about n that brings vectors a onto targets t, inside its limits."""
    if exact:
        c = w1 * (dot(t1, a1) - dot(t1, n) * dot(a1, n)) + w2 * (
            dot(t2, a2) - dot(t2, n) * dot(a2, n)
        )
        s = w1 * dot(t1, cross(n, a1)) + w2 * dot(t2, cross(n, a2))
        return best_hinge(c, s, lower, upper, current)
    r = procrustes(outer_sum(outer_sum(ZERO3, w1, t1, a1), w2, t2, a2))
    # the bone's direction, turned by the Procrustes rotation and seen along the axis
    x = sub(a1, scale(dot(a1, n), n))
    v = apply(r, a1)
    phi = math.atan2(dot(v, cross(n, x)), dot(v, x))
    return min(max(phi, lower), upper)


@inline
def sweep(rest, axes, lower, upper, targets, weights, angles, root, exact, joints, local):
    """One sweep of Algorithm 1; returns the objective after it. joints, local: scratch."""
    update_root(joints, targets, weights, root)
    r = root_rotation(root)
    t = (root[9], root[10], root[11])
    for k in range(21):
        if weights[k] > 0.0:
            local[k, 0], local[k, 1], local[k, 2] = apply_transposed(r, sub(row(targets, k), t))
    for f in range(5):
        update_finger(f, rest, axes, lower, upper, local, weights, angles, exact)
    forward(rest, axes, angles, joints)
    return cost(joints, targets, weights, root)


@kernel
def bcd(rest, axes, lower, upper, targets, weights, angles, root, exact, max_sweeps, tolerance):
    """Algorithm 1: sweeps until the objective improves by less than `tolerance` (relative).

    angles and root are overwritten. Returns objective, sweeps, CONVERGED or SWEEP_LIMIT. The
    paper's update may raise the objective: the best pose seen is then returned.
    """
    joints = np.empty((21, 3))
    local = np.zeros((21, 3))
    best_angles = angles.copy()
    best_root = root.copy()
    forward(rest, axes, angles, joints)
    best = math.inf
    last = math.inf
    state = SWEEP_LIMIT
    sweeps = 0
    for i in range(max_sweeps):
        e = sweep(rest, axes, lower, upper, targets, weights, angles, root, exact, joints, local)
        sweeps = i + 1
        if e < best:
            best = e
            best_angles[:] = angles
            best_root[:] = root
        # 1e-20 m^2: the joints are met to 0.1 nm
        if last - e <= tolerance * e or e < 1e-20:
            state = CONVERGED
            break
        last = e
    angles[:] = best_angles
    # the last finger updates moved the joints: leave the root at its best for them
    forward(rest, axes, angles, joints)
    update_root(joints, targets, weights, best_root)
    root[:] = best_root
    return cost(joints, targets, weights, root), sweeps, state


@kernel
def jacobian(rest, axes, angles, root, out):
    """d joints / d (20 angles, rotation, translation), written to out (21, 3, 26); world frame.

    The rotation is perturbed on the left: exp(omega) R, about the hand's own root joint.
    """
    joints = np.empty((21, 3))
    forward(rest, axes, angles, joints)
    r = root_rotation(root)
    out[:] = 0.0
    for f in range(5):
        k, a = 4 * f + 1, 4 * f
        cz, sz = math.cos(angles[a]), math.sin(angles[a])
        cy, sy = math.cos(angles[a + 1]), math.sin(angles[a + 1])
        c2, s2 = math.cos(angles[a + 2]), math.sin(angles[a + 2])
        nz, ny = row(axes, a), row(axes, a + 1)
        u1 = rotate(nz, cz, sz, ny)
        u2 = rotate(nz, cz, sz, rotate(ny, cy, sy, row(axes, a + 2)))
        n3 = rotate(row(axes, a + 2), c2, s2, row(axes, a + 3))
        u3 = rotate(nz, cz, sz, rotate(ny, cy, sy, n3))
        for i in range(4):
            u = nz if i == 0 else (u1 if i == 1 else (u2 if i == 2 else u3))
            origin = k if i < 2 else k + i - 1
            for j in range(origin + 1, k + 4):
                d = apply(r, cross(u, sub(row(joints, j), row(joints, origin))))
                for x in range(3):
                    out[j, x, a + i] = d[x]
    for j in range(21):
        p = apply(r, sub(row(joints, j), row(joints, 0)))
        out[j, 0, 21], out[j, 0, 22] = p[2], -p[1]
        out[j, 1, 20], out[j, 1, 22] = -p[2], p[0]
        out[j, 2, 20], out[j, 2, 21] = p[1], -p[0]
        for x in range(3):
            out[j, x, 23 + x] = 1.0
