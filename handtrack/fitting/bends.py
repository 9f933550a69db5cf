"""The other bend of a finger: where most local minima of noisy frames are.

Two bones reach from the second-last joint to the tip, with the last joint on either side of the
straight line between them. A fit may end on the wrong side; here is where to start again.
"""

from __future__ import annotations

import math

from handtrack.fitting.compiled import Solver
from handtrack.fitting.descent import update_finger_exact
from handtrack.fitting.lanes import (
    ANGLE_2,
    ANGLE_3,
    ANGLE_Z,
    B2,
    B3,
    COST,
    L3,
    L4,
    LANES,
    LOW_2,
    LOW_3,
    RISE,
    TRIAL,
    UP_2,
    UP_3,
    get,
    place,
)
from handtrack.fitting.vectors import dot

# a finger's other bend is looked at where, as it stands, it adds no more than this share
WORTH = 0.1


@Solver
def other_bends(s):
    """Bend the last joint of every finger the other way, from the pose in the buffer.

    Where that may lead lower, the finger's angles are in TRIAL and what they add to the
    objective is in RISE; elsewhere RISE is infinite. The pose stays.
    """
    total = place(s)
    for f in range(LANES):
        s[RISE + f] = s[COST + f]
        bend, low, up = s[ANGLE_3 + f], s[LOW_3 + f], s[UP_3 + f]
        other = up if bend < 0.5 * (low + up) else low
        # the line to the tip leans away from the middle bone by this share of the bend, nearly
        b2, b3 = get(s, B2 + f), get(s, B3 + f)
        middle, last = math.sqrt(dot(b2, b2)), math.sqrt(dot(b3, b3))
        turn = s[ANGLE_2 + f] + (bend - other) * last / (middle + last + 1e-9)
        s[TRIAL + f], s[TRIAL + LANES + f] = s[ANGLE_Z + f], s[ANGLE_Z + LANES + f]
        s[TRIAL + 2 * LANES + f], s[TRIAL + 3 * LANES + f] = s[ANGLE_2 + f], bend
        s[ANGLE_2 + f] = min(max(turn, s[LOW_2 + f]), s[UP_2 + f])
        s[ANGLE_3 + f] = other
    place(s)
    for f in range(5):
        rise = s[COST + f] - s[RISE + f]
        worth = rise <= WORTH * total and s[L3 + f] > 0.0 and s[L4 + f] > 0.0
        s[RISE + f] = rise if worth else math.inf
    for a in range(4):
        for f in range(5):
            k = a * LANES + f
            s[ANGLE_Z + k], s[TRIAL + k] = s[TRIAL + k], s[ANGLE_Z + k]
    for f in range(5):
        if s[RISE + f] == math.inf:
            continue
        for a in range(4):
            k = a * LANES + f
            s[ANGLE_Z + k], s[TRIAL + k] = s[TRIAL + k], s[ANGLE_Z + k]
        place(s)
        update_finger_exact(s, f)
        s[RISE + f] = place(s) - total
        for a in range(4):
            k = a * LANES + f
            s[ANGLE_Z + k], s[TRIAL + k] = s[TRIAL + k], s[ANGLE_Z + k]
