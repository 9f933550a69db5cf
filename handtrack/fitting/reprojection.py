"""Fitting a hand to what cameras see of it: reprojection errors under the same limits.

Half the objective is sum_c,k w rho(|pi_c(R x_k + t) - z_c,k|^2) / 2 [px^2], plus a prior on the
angles. Levenberg-Marquardt on the 26 unknowns of a pose (20 angles; turn and shift of the root:
R, t become R exp(omega), t + R v), with the joint limits as an active set. A step is taken only
where it lowers the objective.
"""

from __future__ import annotations

import math

import numpy as np

from handtrack.kernels.compiled import inline, kernel
from handtrack.kernels.lens import view
from handtrack.kernels.vectors import add, cross, dot, rotate, row, scale, sub

N = 26
# a joint that falls behind a camera costs as much as being so far off [px^2]
BEHIND = 1e8

CONVERGED, LIMIT, UNDERDETERMINED = 0, 1, 2


@inline
def place(model, angles, x, u):
    """Joints (21, 3) and turning axes (20, 3) of a pose in the root frame (eq. 1, 2, 4, 5)."""
    rest, axes, twist = model[0], model[1], model[4]
    x[0, 0], x[0, 1], x[0, 2] = rest[0, 0], rest[0, 1], rest[0, 2]
    for f in range(5):
        k, a = 4 * f + 1, 4 * f
        p = row(rest, k)
        b1, b2, b3 = (
            sub(row(rest, k + 1), p),
            sub(row(rest, k + 2), row(rest, k + 1)),
            sub(row(rest, k + 3), row(rest, k + 2)),
        )
        nz, ny, n2, n3 = row(axes, a), row(axes, a + 1), row(axes, a + 2), row(axes, a + 3)
        cz, sz = math.cos(angles[a]), math.sin(angles[a])
        cy, sy = math.cos(angles[a + 1]), math.sin(angles[a + 1])
        c2, s2 = math.cos(angles[a + 2]), math.sin(angles[a + 2])
        c3, s3 = math.cos(angles[a + 3]), math.sin(angles[a + 3])
        b3 = rotate(n2, c2, s2, rotate(n3, c3, s3, b3))
        b2 = rotate(n2, c2, s2, b2)
        u3 = rotate(n2, c2, s2, n3)
        uy = ny
        if f == 0 and twist != 0.0:
            nx = scale(1.0 / math.sqrt(dot(b1, b1)), b1)
            ct, st = math.cos(twist * angles[a + 1]), math.sin(twist * angles[a + 1])
            b3, b2, u3 = rotate(nx, ct, st, b3), rotate(nx, ct, st, b2), rotate(nx, ct, st, u3)
            n2 = rotate(nx, ct, st, n2)
            # abduction also turns about the bone
            uy = add(ny, scale(twist, rotate(ny, cy, sy, nx)))
        b1 = rotate(nz, cz, sz, rotate(ny, cy, sy, b1))
        b2 = rotate(nz, cz, sz, rotate(ny, cy, sy, b2))
        b3 = rotate(nz, cz, sz, rotate(ny, cy, sy, b3))
        u2 = rotate(nz, cz, sz, rotate(ny, cy, sy, n2))
        u3 = rotate(nz, cz, sz, rotate(ny, cy, sy, u3))
        uy = rotate(nz, cz, sz, uy)
        q = p
        x[k, 0], x[k, 1], x[k, 2] = q
        q = add(q, b1)
        x[k + 1, 0], x[k + 1, 1], x[k + 1, 2] = q
        q = add(q, b2)
        x[k + 2, 0], x[k + 2, 1], x[k + 2, 2] = q
        q = add(q, b3)
        x[k + 3, 0], x[k + 3, 1], x[k + 3, 2] = q
        u[a, 0], u[a, 1], u[a, 2] = nz
        u[a + 1, 0], u[a + 1, 1], u[a + 1, 2] = uy
        u[a + 2, 0], u[a + 2, 1], u[a + 2, 2] = u2
        u[a + 3, 0], u[a + 3, 1], u[a + 3, 2] = u3


@inline
def turn(root, v):
    return (
        root[0] * v[0] + root[1] * v[1] + root[2] * v[2],
        root[3] * v[0] + root[4] * v[1] + root[5] * v[2],
        root[6] * v[0] + root[7] * v[1] + root[8] * v[2],
    )


@inline
def turn_back(root, v):
    return (
        root[0] * v[0] + root[3] * v[1] + root[6] * v[2],
        root[1] * v[0] + root[4] * v[1] + root[7] * v[2],
        root[2] * v[0] + root[5] * v[1] + root[8] * v[2],
    )


@inline
def cost_of(cameras, pixels, weights, x, angles, root, spread2, prior, stiffness):
    """The objective: Huber's loss of the squared distances, and the prior; spread2 0: squares."""
    total = 0.0
    t = (root[9], root[10], root[11])
    for k in range(21):
        p = add(turn(root, row(x, k)), t)
        for c in range(len(cameras)):
            w = weights[c, k]
            if w > 0.0:
                there, u, v, _, _ = view(cameras[c], p)
                q = (u - pixels[c, k, 0]) ** 2 + (v - pixels[c, k, 1]) ** 2 if there else BEHIND
                if spread2 > 0.0 and q > spread2:
                    q = 2.0 * math.sqrt(spread2 * q) - spread2
                total += w * q
    for i in range(20):
        total += stiffness[i] * (angles[i] - prior[i]) ** 2
    return total


@inline
def differentiate(cameras, pixels, weights, x, u, angles, root, spread2, prior, stiffness, g, h):
    """Gradient and Gauss-Newton Hessian of half the objective, by angles, omega and v."""
    for i in range(N):
        g[i] = 0.0
        for j in range(N):
            h[i, j] = 0.0
    ju, jv = np.empty(10), np.empty(10)
    index = np.empty(10, dtype=np.int64)
    t = (root[9], root[10], root[11])
    for k in range(21):
        xk = row(x, k)
        p = add(turn(root, xk), t)
        # the angles that move this joint, and the root
        first = 4 * ((k - 1) // 4)
        n = 0
        moving = 0 if k == 0 else (k - 1) % 4
        if moving >= 1:
            n = 2 + (moving - 1)
            for i in range(n):
                index[i] = first + i
        for i in range(6):
            index[n + i] = 20 + i
        for c in range(len(cameras)):
            w = weights[c, k]
            if not w > 0.0:
                continue
            there, pu, pv, du, dv = view(cameras[c], p)
            if not there:
                continue
            ru, rv = pu - pixels[c, k, 0], pv - pixels[c, k, 1]
            q = ru * ru + rv * rv
            if spread2 > 0.0 and q > spread2:
                w *= math.sqrt(spread2 / q)
            # rows by the root frame
            du, dv = turn_back(root, du), turn_back(root, dv)
            for i in range(n):
                a = index[i]
                joint = first + 1 if i < 2 else first + i
                arm = cross(row(u, a), sub(xk, row(x, joint)))
                ju[i], jv[i] = dot(du, arm), dot(dv, arm)
            # omega x x_k, and v
            mu, mv = cross(xk, du), cross(xk, dv)
            for i in range(3):
                ju[n + i], jv[n + i] = mu[i], mv[i]
                ju[n + 3 + i], jv[n + 3 + i] = du[i], dv[i]
            for i in range(n + 6):
                wu, wv = w * ju[i], w * jv[i]
                a = index[i]
                g[a] += wu * ru + wv * rv
                for j in range(i + 1):
                    h[a, index[j]] += wu * ju[j] + wv * jv[j]
    for i in range(20):
        g[i] += stiffness[i] * (angles[i] - prior[i])
        h[i, i] += stiffness[i]
    for i in range(N):
        for j in range(i):
            h[j, i] = h[i, j]


@inline
def ellipse(model, f, z, y):
    """1/a^2 and 1/b^2 of a saddle's ellipse in the quadrant of (z, y) (eq. 3)."""
    lower, upper = model[2], model[3]
    a = upper[4 * f] if z >= 0.0 else lower[4 * f]
    b = upper[4 * f + 1] if y >= 0.0 else lower[4 * f + 1]
    return 1.0 / (a * a), 1.0 / (b * b)


@inline
def hold(model, angles, g, fixed, basis, bend):
    """The active set: unknowns that may move as columns of `basis` (26, n); returns n.

    A hinge at a bound that the gradient pushes outwards stays. A saddle on its ellipse with
    the gradient outwards moves along the tangent, with the boundary's curvature in `bend` (26,).
    So do those that are `fixed` (20,), a saddle by its first angle.
    """
    lower, upper = model[2], model[3]
    for i in range(N):
        bend[i] = 0.0
        for j in range(N):
            basis[i, j] = 0.0
    n = 0
    for f in range(5):
        a = 4 * f
        z, y = angles[a], angles[a + 1]
        pz, py = ellipse(model, f, z, y)
        nz, ny = z * pz, y * py
        size = math.sqrt(nz * nz + ny * ny)
        push = -(g[a] * nz + g[a + 1] * ny)
        if fixed[a] or (z * z * pz + y * y * py > 1.0 - 1e-9 and push > 0.0):
            tz, ty = -ny / size, nz / size
            basis[a, n], basis[a + 1, n] = tz, ty
            curve = max(push, 0.0) / (size * size) * (tz * tz * pz + ty * ty * py)
            bend[n] = curve
            n += 1
        else:
            basis[a, n] = 1.0
            basis[a + 1, n + 1] = 1.0
            n += 2
        for i in (a + 2, a + 3):
            stuck = (angles[i] <= lower[i] and g[i] > 0.0) or (angles[i] >= upper[i] and g[i] < 0.0)
            if not (stuck or fixed[i]):
                basis[i, n] = 1.0
                n += 1
    for i in range(20, N):
        basis[i, n] = 1.0
        n += 1
    return n


@inline
def reduced(h, g, basis, bend, n, hr, gr):
    """Basis^T H basis and basis^T g. Columns have at most two entries."""
    for a in range(n):
        ia = ib = -1
        for i in range(N):
            if basis[i, a] != 0.0:
                if ia < 0:
                    ia = i
                else:
                    ib = i
        gr[a] = basis[ia, a] * g[ia] + (basis[ib, a] * g[ib] if ib >= 0 else 0.0)
        for b in range(a + 1):
            v = 0.0
            for j in range(N):
                if basis[j, b] != 0.0:
                    m = basis[ia, a] * h[ia, j] + (basis[ib, a] * h[ib, j] if ib >= 0 else 0.0)
                    v += m * basis[j, b]
            hr[a, b] = hr[b, a] = v + (bend[a] if a == b else 0.0)


@inline
def factor(hr, n, damping, low):
    """Cholesky of H + damping D, D its diagonal; False where there is none."""
    for i in range(n):
        for j in range(i + 1):
            v = hr[i, j]
            if i == j:
                v += damping * hr[i, i] + 1e-9
            for k in range(j):
                v -= low[i, k] * low[j, k]
            if i == j:
                if not v > 0.0:
                    return False
                low[i, i] = math.sqrt(v)
            else:
                low[i, j] = v / low[j, j]
    return True


@inline
def back(low, gr, n, step):
    """The solution of L L^T step = -g."""
    for i in range(n):
        v = -gr[i]
        for k in range(i):
            v -= low[i, k] * step[k]
        step[i] = v / low[i, i]
    for i in range(n - 1, -1, -1):
        v = step[i]
        for k in range(i + 1, n):
            v -= low[k, i] * step[k]
        step[i] = v / low[i, i]


@inline
def expand(basis, n, step, full):
    for i in range(N):
        v = 0.0
        for j in range(n):
            v += basis[i, j] * step[j]
        full[i] = v


@inline
def leaving(model, angles, full, fixed):
    """Fix what is at a limit and would leave it by the step (26,); returns whether any is."""
    lower, upper = model[2], model[3]
    found = False
    for f in range(5):
        a = 4 * f
        z, y = angles[a], angles[a + 1]
        pz, py = ellipse(model, f, z, y)
        out = full[a] * z * pz + full[a + 1] * y * py
        if not fixed[a] and z * z * pz + y * y * py > 1.0 - 1e-9 and out > 1e-12:
            fixed[a] = found = True
        for i in (a + 2, a + 3):
            low = angles[i] <= lower[i] and full[i] < 0.0
            if not fixed[i] and (low or (angles[i] >= upper[i] and full[i] > 0.0)):
                fixed[i] = found = True
    return found


@inline
def move(model, angles, root, step, new_angles, new_root):
    """The pose moved by a step (26,), brought back inside the limits."""
    lower, upper = model[2], model[3]
    for f in range(5):
        a = 4 * f
        z, y = angles[a] + step[a], angles[a + 1] + step[a + 1]
        pz, py = ellipse(model, f, z, y)
        n = math.sqrt(z * z * pz + y * y * py)
        if n > 1.0:
            z, y = z / n, y / n
        new_angles[a], new_angles[a + 1] = z, y
        for i in (a + 2, a + 3):
            new_angles[i] = min(max(angles[i] + step[i], lower[i]), upper[i])
    w = (step[20], step[21], step[22])
    v = (step[23], step[24], step[25])
    angle = math.sqrt(dot(w, w))
    k = math.sin(angle) / angle if angle > 1e-9 else 1.0
    h = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    h = 2.0 * h * h
    for i in range(3):
        r = (root[3 * i], root[3 * i + 1], root[3 * i + 2])
        c = cross(r, w)
        d = cross(c, w)
        for j in range(3):
            new_root[3 * i + j] = r[j] + k * c[j] + h * d[j]
        new_root[9 + i] = root[9 + i] + dot(r, v)


@kernel
def fit_views(
    model,
    cameras,
    pixels,
    weights,
    spread,
    prior,
    stiffness,
    starts,
    roots,
    settings,
    out_joints,
    out_objective,
    out_steps,
    out_state,
    out_covariance,
):
    """Fit frames to what cameras see, each from its own start, which is overwritten.

    Args:
        model: (rest joints (21, 3), axes (20, 3), lower (20,), upper (20,), twist).
        cameras: (C, 25); pixels: (T, C, 21, 2); weights: (T, C, 21), 0 where not seen.
        spread: distance at which the loss bends from square to linear [px]; 0: never.
        prior: (T, 20) angles; stiffness: (20,) [px^2/rad^2] of the pull towards them.
        starts: (T, 20), inside the limits; roots: (T, 12). Both take the results.
        settings: (steps at most, relative promise of a step at which to stop).
        out_covariance: (T, 26, 26) at unit noise, by angles, omega and v on the active set.
    """
    most, tolerance = settings
    x, u = np.empty((21, 3)), np.empty((20, 3))
    x2 = np.empty((21, 3))
    g, gr, step, full = np.empty(N), np.empty(N), np.empty(N), np.empty(N)
    h, hr, low, basis = np.empty((N, N)), np.empty((N, N)), np.empty((N, N)), np.empty((N, N))
    angles2, root2 = np.empty(20), np.empty(12)
    u2 = np.empty((20, 3))
    fixed, bend = np.zeros(20, dtype=np.bool_), np.empty(N)
    spread2 = spread * spread
    for t in range(len(pixels)):
        angles, root = starts[t], roots[t]
        place(model, angles, x, u)
        cost = cost_of(
            cameras, pixels[t], weights[t], x, angles, root, spread2, prior[t], stiffness
        )
        damping = 1e-4
        steps = 0
        state = LIMIT
        while steps < most:
            differentiate(
                cameras, pixels[t], weights[t], x, u, angles, root,
                spread2, prior[t], stiffness, g, h,
            )  # fmt: skip
            fixed[:] = False
            again = True
            taken = False
            n = 0
            new = cost
            while damping < 1e12:
                if again:
                    n = hold(model, angles, g, fixed, basis, bend)
                    reduced(h, g, basis, bend, n, hr, gr)
                    again = False
                if not factor(hr, n, damping, low):
                    damping = max(10.0 * damping, 1e-6)
                    continue
                back(low, gr, n, step)
                expand(basis, n, step, full)
                if leaving(model, angles, full, fixed):
                    again = True
                    continue
                promise = 0.0
                for i in range(n):
                    promise -= gr[i] * step[i]
                if promise <= tolerance * cost + 1e-20:
                    break
                move(model, angles, root, full, angles2, root2)
                place(model, angles2, x2, u2)
                new = cost_of(
                    cameras, pixels[t], weights[t], x2, angles2, root2, spread2,
                    prior[t], stiffness,
                )  # fmt: skip
                if new < cost:
                    taken = True
                    break
                damping *= 10.0
            if not taken:
                state = CONVERGED
                break
            steps += 1
            damping = max(0.1 * damping, 1e-9)
            cost = new
            for i in range(20):
                angles[i] = angles2[i]
            for i in range(12):
                root[i] = root2[i]
            place(model, angles, x, u)
        out_objective[t] = cost
        out_steps[t] = steps
        tr = (root[9], root[10], root[11])
        for k in range(21):
            out_joints[t, k, 0], out_joints[t, k, 1], out_joints[t, k, 2] = add(
                turn(root, row(x, k)), tr
            )
        # the covariance on the active set
        differentiate(
            cameras, pixels[t], weights[t], x, u, angles, root,
            spread2, prior[t], stiffness, g, h,
        )  # fmt: skip
        fixed[:] = False
        n = hold(model, angles, g, fixed, basis, bend)
        reduced(h, g, basis, bend, n, hr, gr)
        out_state[t] = state
        sound = factor(hr, n, 0.0, low)
        for column in range(N):
            # basis (B^T H B)^-1 B^T e
            for j in range(n):
                gr[j] = -basis[column, j]
            back(low, gr, n, step)
            expand(basis, n, step, full)
            for i in range(N):
                out_covariance[t, i, column] = full[i] if sound else math.inf
