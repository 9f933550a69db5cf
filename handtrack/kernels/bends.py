"""The other bend of a finger: where most local minima of noisy frames are.

Two bones reach from the second-last joint to the tip, with the last joint on either side of the
straight line between them. A fit may end on the wrong side; here is where to start again.
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import Solver, inline
from handtrack.kernels.descent import update_finger_exact
from handtrack.kernels.joint_objective import place
from handtrack.kernels.limits import clip
from handtrack.kernels.vectors import dot, lane
from handtrack.kernels.workspace import ANGLES, FINGERS, HINGE_1, HINGE_2, LANES, TIP

# a finger's other bend is looked at where, as it stands, it adds no more than this share
WORTH = 0.1


@inline
def swap_trial(w, f):
    """Exchange a finger's angles with its trial."""
    for a in range(ANGLES):
        w.angle[a, f], w.trial[a, f] = w.trial[a, f], w.angle[a, f]


@inline
def bend_over(w, f):
    """Bend the last joint the other way, with the tip where it was, nearly."""
    bend, low, up = w.angle[HINGE_2, f], w.lower[HINGE_2, f], w.upper[HINGE_2, f]
    other = up if bend < 0.5 * (low + up) else low
    # the line to the tip leans away from the middle bone by this share of the bend
    middle, last = lane(w.rest_bone, 1, f), lane(w.rest_bone, 2, f)
    middle, last = math.sqrt(dot(middle, middle)), math.sqrt(dot(last, last))
    turn = w.angle[HINGE_1, f] + (bend - other) * last / (middle + last + 1e-9)
    w.angle[HINGE_1, f] = clip(turn, w.lower[HINGE_1, f], w.upper[HINGE_1, f])
    w.angle[HINGE_2, f] = other


@Solver
def other_bends(w):
    """Bend the last joint of every finger the other way, from the pose in the workspace.

    Where that may lead lower, the finger's angles are in `trial` and what they add to the
    objective is in `rise`; elsewhere `rise` is infinite. The pose stays.
    """
    total = place(w)
    for f in range(LANES):
        w.rise[f] = w.cost[f]
        for a in range(ANGLES):
            w.trial[a, f] = w.angle[a, f]
        bend_over(w, f)
    place(w)
    for f in range(FINGERS):
        rise = w.cost[f] - w.rise[f]
        shown = w.pull[TIP - 1, f] > 0.0 and w.pull[TIP, f] > 0.0
        w.rise[f] = rise if rise <= WORTH * total and shown else math.inf
        swap_trial(w, f)
    for f in range(FINGERS):
        if w.rise[f] == math.inf:
            continue
        swap_trial(w, f)
        place(w)
        update_finger_exact(w, f)
        w.rise[f] = place(w) - total
        swap_trial(w, f)
