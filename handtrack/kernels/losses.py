"""Losses of a squared distance: their names, and what they make of it.

Another loss is a name and a branch here. The command line, settings and recordings know it by its
name, compiled code by its place among the names.
"""

from __future__ import annotations

import math
from typing import Any, Literal, get_args

Robust = Literal["none", "huber", "geman-mcclure"]
LOSSES: tuple[Robust, ...] = get_args(Robust)
NO_LOSS, HUBER, GEMAN_MCCLURE = range(3)


def soft(loss: Any, q: Any, spread2: Any) -> tuple[Any, Any]:
    """(8) The loss of a squared distance q, and its slope, the factor on a weight.

    Huber: q up to spread^2, then 2 spread sqrt(q) - spread^2. Geman-McClure:
    q spread^2 / (q + spread^2). Compiled where it is called.
    """
    if loss == HUBER:
        slope = math.sqrt(spread2 / q) if q > spread2 else 1.0
        return (2.0 * slope * q - spread2 if q > spread2 else q), slope
    if loss == GEMAN_MCCLURE:
        g = spread2 / (q + spread2)
        return q * g, g * g
    return q, 1.0
