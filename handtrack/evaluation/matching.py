"""Whether a truth belongs to an estimate and is what it claims to be: name, size, unit, side,
joint order."""

from __future__ import annotations

import numpy as np

from handtrack.evaluation.alignment import pa_mpjpe, reflection_pa_mpjpe
from handtrack.evaluation.arrays import Array, nan_mean
from handtrack.files.long_arrays import evenly
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.skeleton_check import Picks, orders_of

LOOK = 200
"""Frames that are enough to tell a wrong unit, side or order."""
_POINT = 1e-9
"""A hand so small is one point, to rounding [m]."""


def same_name(a: str, b: str) -> bool:
    """Whether two names mean the same: "clip person0 left" and "person0_left" do."""
    short, long = sorted((name.replace("_", " ").lower() for name in (a, b)), key=len)
    return f" {long}".endswith(f" {short}")


def size_ratio(a: Array, b: Array) -> float:
    """How many times as large the hands of b (T, 21, 3) are as those of a, in common joints."""
    both = np.asarray(~(np.isnan(a).any(-1) | np.isnan(b).any(-1)))[..., None]
    size = _size(np.where(both, a, np.nan))
    return _size(np.where(both, b, np.nan)) / size if size > _POINT else float("nan")


def truth_problem(estimate: Array, truth: Array) -> str:
    """What is wrong with the truth as a whole, in one line, or "".

    Told apart: another unit, another scale, another joint order, a mirrored hand.

    Args:
        estimate, truth: (T, 21, 3) [m], frames that belong together, NaN = missing.
    """
    both = np.asarray(~(np.isnan(estimate).any(-1) | np.isnan(truth).any(-1)))
    frames = np.flatnonzero(both.sum(1) >= 4)
    if not len(frames):
        return ""
    frames = evenly(frames, LOOK)
    common = both[frames][..., None]
    a, b = np.where(common, estimate[frames], np.nan), np.where(common, truth[frames], np.nan)
    size_a, size_b = _size(a), _size(b)
    if not min(size_a, size_b) > _POINT:
        return "all joints of a frame are at one point"
    ratio = size_b / size_a
    if not 0.4 < ratio < 2.5:
        for factor, found, expected in (
            (1000, "mm", "m"),
            (100, "cm", "m"),
            (10, "mm", "cm"),
        ):
            for r, words in (
                (ratio, f"the truth's hand is {ratio:.4g} times the estimate's"),
                (1 / ratio, f"the estimate's hand is {1 / ratio:.4g} times the truth's"),
            ):
                if 0.6 < r / factor < 1.6:
                    return f"{words}: {found} read as {expected}?"
        return f"the truth's hand is {ratio:.2g} times as large as the estimate's"
    plain = typical(pa_mpjpe(a, b))
    # the rest is only worth a word if the error is a good part of the hand
    if not plain > 0.05 * size_b:
        return ""
    for name, order in orders_of(N_JOINTS).items():
        for words, error in (
            ("truth", typical(pa_mpjpe(a, _picked(b, order)))),
            ("estimate", typical(pa_mpjpe(_picked(a, order), b))),
        ):
            if error < 0.4 * plain:
                return (
                    f"the {words} seems to be in joint order {name!r}: PA-MPJPE is"
                    f" {plain * 1e3:.1f} mm as given, {error * 1e3:.1f} mm in that order"
                )
    mirrored = typical(reflection_pa_mpjpe(a, b))
    if mirrored < 0.4 * plain:
        return (
            f"the truth looks mirrored: PA-MPJPE is {plain * 1e3:.1f} mm as given,"
            f" {mirrored * 1e3:.1f} mm for its mirror image"
        )
    return ""


def _picked(x: Array, picks: Picks) -> Array:
    places = np.array(picks)
    return np.where((places < 0)[:, None], np.nan, x[:, places])


def _size(x: Array) -> float:
    """Typical distance of the joints from their barycentre, whatever their order."""
    centred = x - nan_mean(x, -2)[..., None, :]
    return typical(np.sqrt(nan_mean((centred**2).sum(-1))))


def typical(values: Array) -> float:
    """The median of what is known; NaN where nothing is."""
    known = values[~np.isnan(values)]
    return float(np.median(known)) if known.size else float("nan")
