"""A pose moved by a step: kept, taken in part, brought back inside the limits."""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.limits import move_inside
from handtrack.kernels.vectors import dot, part, put_row, row, scale, turn_of, turned
from handtrack.kernels.workspace import ANGLES, LANES, ROOT, SHIFT, TURN


@inline
def clear_step(w):
    for a in range(ANGLES):
        for f in range(LANES):
            w.step[a, f] = 0.0
    for i in range(ROOT):
        w.root_step[i] = 0.0


@inline
def keep_pose(w):
    for a in range(ANGLES):
        for f in range(LANES):
            w.angle_before[a, f] = w.angle[a, f]
    for i in range(3):
        put_row(w.rotation_before, i, row(w.rotation, i))
        w.translation_before[i] = w.translation[i]


@inline
def take_step(w, share):
    """The pose before, moved by a share of the step, inside the limits (26).

    R exp(omega) and t + R v.
    """
    for a in range(ANGLES):
        for f in range(LANES):
            w.angle[a, f] = w.angle_before[a, f] + share * w.step[a, f]
    move_inside(w)
    # a row times exp(omega) is the row turned backwards
    back = turn_of(scale(-share, part(w.root_step, TURN)))
    v = scale(share, part(w.root_step, SHIFT))
    for i in range(3):
        r = row(w.rotation_before, i)
        put_row(w.rotation, i, turned(back, r))
        w.translation[i] = w.translation_before[i] + dot(r, v)
