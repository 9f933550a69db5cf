"""The joints' noise, as a stream's residuals show it: how much there is, how much of it lasts.

What a fit leaves of the joints is noise that no motion explains. Of it each joint's mean is taken
away, which is the hand's and the detector's; where the rest is correlated from frame to frame,
the noise lasts.
"""

from __future__ import annotations

import math

from handtrack.kernels.compiled import inline
from handtrack.kernels.vectors import (
    add,
    apply_transposed,
    dot,
    matrix,
    put_row,
    row,
    scale,
    sub,
)

LEAST_NOISE = 1e-10
"""Variance of the joints below which no residual is believed [m^2]."""
CHANCE = 0.1
"""A correlation that white noise shows too, in few frames or on a hand that does not fit."""
FINE = 0.3e-3**2
"""Variance of the joints below which residuals are the hand's, and no detector's noise [m^2]."""
# of residuals that hardly change, this part counts as noise
LEAST_MOVING = 0.05
# what variances of corrected joints' noise that lasts, new and lasting, have beyond the residuals'
CORRECTED_NEW, CORRECTED_LASTS = 3.0, 0.375
# pairs of joints before anything is said; time over which means and correlations forget [s]
LEAST_PAIRS, MEAN_S, PRODUCTS_S = 300.0, 2.0, 5.0


@inline
def follow_noise(s, raw_noise, fixed, gain):
    """The joints' noise: as given, or a running mean of what the raw fits show."""
    if fixed > 0.0:
        s.noise = fixed
    elif math.isfinite(raw_noise):
        # a stray frame counts at most fourfold
        value = max(raw_noise, LEAST_NOISE)
        if s.noise_count > 0.0:
            value = min(value, 4.0 * s.noise)
        s.noise_count += 1.0
        s.noise += (value - s.noise) * max(1.0 / s.noise_count, gain)


@inline
def share_of(correlation, dt, lasts):
    """What share of the noise lasts for `lasts`, from the correlation of residuals dt apart."""
    if not correlation > CHANCE:
        return 0.0
    return min((correlation - CHANCE) / max(math.exp(-dt / lasts) - CHANCE, CHANCE), 1.0)


@inline
def parts_of(share, moving):
    """What is white of the joints' noise and what lasts, as variances over the noise's.

    Where noise lasts, what it is on the whole is no noise: no filter takes it away. The numbers
    are those that bring a real detector's poses nearest to the truth (tools/bench/rendered).
    """
    scale = 1.0 - share * (1.0 - max(moving, LEAST_MOVING))
    return (1.0 + 0.5 * share) * scale, 0.75 * share * scale


@inline
def corrected_parts(share, moving):
    """As `parts_of`, of joints that a profile has corrected.

    A correction draws the joints to hands that it knows, so residuals show less than the noise,
    and what is new in every frame goes through it as well.
    """
    scale = 1.0 - share * (1.0 - max(moving, LEAST_MOVING))
    return (1.0 + CORRECTED_NEW * share) * scale, CORRECTED_LASTS * share * scale


@inline
def follow_share(s, dt, targets, weights, raw):
    """Take in what a frame's raw fit leaves, in the root frame."""
    if not math.isfinite(raw.noise):
        for k in range(21):
            s.had[k] = 0
        return
    turn = matrix(raw.root[:9].reshape(3, 3))
    fade, gain = math.exp(-dt / PRODUCTS_S), 1.0 - math.exp(-dt / MEAN_S)
    s.pairs *= fade
    s.products *= fade
    s.squares *= fade
    s.whole *= fade
    for k in range(21):
        if not weights[k] > 0.0:
            s.had[k] = 0
            continue
        left = apply_transposed(turn, sub(row(targets, k), row(raw.joints, k)))
        s.usual_count[k] += 1.0
        step = max(1.0 / s.usual_count[k], gain)
        usual = add(row(s.usual, k), scale(step, sub(left, row(s.usual, k))))
        put_row(s.usual, k, usual)
        now, last = sub(left, usual), row(s.residual, k)
        if s.had[k]:
            s.pairs += 1.0
            s.products += dot(now, last)
            s.squares += 0.5 * (dot(now, now) + dot(last, last))
            s.whole += dot(left, left)
        put_row(s.residual, k, now)
        s.had[k] = 1
    enough = s.pairs > LEAST_PAIRS and s.squares > 0.0 and s.noise > FINE
    s.share = share_of(s.products / s.squares, dt, s.lasts) if enough else 0.0
    s.moving = min(s.squares / s.whole, 1.0) if enough and s.whole > 0.0 else 1.0
