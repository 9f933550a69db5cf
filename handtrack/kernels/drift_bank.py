"""How a stream follows the motion's noise where the joints' noise lasts.

As `motion_noise`, with filters of three numbers: seen position, velocity, drift.
"""

from __future__ import annotations

from handtrack.kernels.compiled import inline
from handtrack.kernels.filter_state import BANK
from handtrack.kernels.motion_noise import (
    DENSITY,
    FACTOR,
    as_scalars,
    begin_bank,
    draw_lesson,
    misfit,
)
from handtrack.kernels.workspace import N_POSE


@inline
def begin_drifting_bank(s, process):
    """Start all filters at the state; the evidence so far is kept."""
    begin_bank(s, process)
    for k in range(BANK):
        for i in range(N_POSE):
            s.bank_c[k, i] = s.bank_xc[k, i] = s.bank_vc[k, i] = 0.0
            s.bank_cc[k, i] = s.rest_rest[N_POSE + i, N_POSE + i]


@inline
def predict_drifting_bank(s, grid, process):
    """Take all filters over the time step, before the state is."""
    for k in range(BANK):
        for i in range(N_POSE):
            q = grid[FACTOR, k] * process[DENSITY, i]
            f, g, a = s.f01[i], s.f11[i], s.stays[i]
            b = a - 1.0
            new = s.renewed[i] * s.renewed[i] * s.spread[i, i]
            s.bank_x[k, i] += f * (s.bank_v[k, i] - s.velocity[i])
            s.bank_x[k, i] += b * (s.bank_c[k, i] - s.drift[i])
            s.bank_v[k, i] *= g
            s.bank_c[k, i] *= a
            xv, xc, vc = s.bank_xv[k, i], s.bank_xc[k, i], s.bank_vc[k, i]
            vv, cc = s.bank_vv[k, i], s.bank_cc[k, i]
            both = 2.0 * (f * xv + b * xc + f * b * vc)
            s.bank_xx[k, i] += both + f * f * vv + b * b * cc + q * s.q00[i] + new
            s.bank_xv[k, i] = g * (xv + f * vv + b * vc) + q * s.q01[i]
            s.bank_xc[k, i] = a * (xc + f * vc + b * cc) + new
            s.bank_vv[k, i] = g * g * vv + q * s.q11[i]
            s.bank_vc[k, i] = g * a * vc
            s.bank_cc[k, i] = a * a * cc + new


@inline
def learn_drifting(s, grid, process):
    """Weigh the filters by how well they predicted, after the state's update (see `learn`)."""
    as_scalars(s)
    for k in range(BANK):
        for i in range(N_POSE):
            v = s.bank_xx[k, i] + s.before[i]
            e = s.innovation[i] - s.bank_x[k, i]
            xx, xv, xc = s.bank_xx[k, i], s.bank_xv[k, i], s.bank_xc[k, i]
            gx, gv, gc = xx / v, xv / v, xc / v
            s.bank_x[k, i] += gx * e - s.distance[i]
            s.bank_v[k, i] += gv * e
            s.bank_c[k, i] += gc * e
            s.bank_vv[k, i] -= gv * xv
            s.bank_vc[k, i] -= gv * xc
            s.bank_cc[k, i] -= gc * xc
            s.bank_xv[k, i] = xv * (1.0 - gx)
            s.bank_xc[k, i] = xc * (1.0 - gx)
            s.bank_xx[k, i] = xx * (1.0 - gx)
            s.bank_log[k, i] = s.fade * s.bank_log[k, i] - 0.5 * misfit(e, v)
    draw_lesson(s, grid, process)
