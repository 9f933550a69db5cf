"""What a pose costs: squared distances of joints in space, and robust losses of them (eq. 6)."""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.kinematics import place_fingers, place_marks
from handtrack.kernels.losses import NO_LOSS, soft
from handtrack.kernels.vectors import apply_transposed, distance2, lane, matrix, part, put_lane, sub
from handtrack.kernels.workspace import FINGERS, JOINTS, LANES

loss_of = inline(soft)

# [m^2] an objective this small is zero
NOTHING = 1e-22


@inline
def place(w):
    """Place the pose, see the targets from it, and weigh it: the objective (eq. 6).

    `loss` in the workspace is one of `losses`, `spread2` the square of the
    distance at which it bends [m^2].
    """
    place_fingers(w)
    place_marks(w)
    # (7) y_j = R^T (target - t); the objective is sum_j w_j |l_j - y_j|^2
    r, t = matrix(w.rotation), part(w.translation, 0)
    for f in range(LANES):
        cost = 0.0
        for j in range(JOINTS):
            y = apply_transposed(r, sub(lane(w.target, j, f), t))
            put_lane(w.seen, j, f, y)
            weight = w.weight[j, f]
            w.pull[j, f] = weight
            cost += weight * distance2(lane(w.mark, j, f), y)
        w.cost[f] = cost
    if w.loss != NO_LOSS:
        soften(w)
    total = 0.0
    for f in range(LANES):
        total += w.cost[f]
    return total


@inline
def soften(w):
    """Costs and weights (the loss's slope) under a robust loss of the squared distance q (8)."""
    spread2 = w.spread2
    for f in range(FINGERS + 1):
        w.cost[f] = 0.0
        for j in range(JOINTS):
            q = distance2(lane(w.mark, j, f), lane(w.seen, j, f))
            weight = w.weight[j, f]
            cost, slope = loss_of(w.loss, q, spread2)
            w.pull[j, f] = weight * slope
            w.cost[f] += weight * cost
