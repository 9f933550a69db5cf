"""Whether the joints' noise lasts, by what the fits of a whole sequence leave of the joints."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.files.long_arrays import ROWS
from handtrack.hand.skeleton import N_JOINTS
from handtrack.kernels import colour
from handtrack.tracking.filter_input import LongFrames

Array = NDArray[np.float64]

LASTS_S = 0.1
"""For how long noise lasts where nobody says it: to 1/e [s].

What a sequence shows of this is vague: longer ones are as likely, and bring no pose nearer.
"""


def lasting_share(frames: LongFrames, lasts_s: float) -> tuple[float, float]:
    """What share of the joints' noise lasts for `lasts_s` [s], 0 where it is white or not known;
    and what part of the residuals is not their mean.

    As `kernels.colour` follows it in a stream.
    """
    total, seen_of, whole = np.zeros((N_JOINTS, 3)), np.zeros(N_JOINTS, np.int64), 0.0
    for left, seen in _residuals(frames):
        total += left.sum(0)
        seen_of += seen.sum(0)
        whole += float(np.square(left).sum())
    mean = total / np.maximum(seen_of, 1)[:, None]
    both, products, moved, n_pairs = 0.0, 0.0, 0.0, 0
    last: tuple[Array, NDArray[np.bool_]] | None = None
    for left, seen in _residuals(frames):
        left -= mean
        moved += float(np.square(left).sum())
        if last is not None:
            left, seen = np.concatenate([last[0], left]), np.concatenate([last[1], seen])
        last = left[-1:], seen[-1:]
        pairs = (seen[1:] & seen[:-1])[..., None]
        before, after = np.where(pairs, left[:-1], 0.0), np.where(pairs, left[1:], 0.0)
        both += 0.5 * float(np.square(before).sum() + np.square(after).sum())
        products += float((before * after).sum())
        n_pairs += int(pairs.sum())
    noise = np.nanmedian(frames.column("noise")) if seen_of.any() else 0.0
    if n_pairs <= colour.LEAST_PAIRS or both == 0.0 or not noise > colour.FINE:
        return 0.0, 1.0
    dt = 1e-9 * float(np.median(np.diff(frames.times_ns)))
    share = float(colour.share_of.py_func(products / both, dt, lasts_s))
    return share, moved / whole


def _residuals(frames: LongFrames) -> Iterator[tuple[Array, NDArray[np.bool_]]]:
    """What the fits leave of the joints, in the hand's frame (n, 21, 3), 0 where nothing is seen,
    and where something is (n, 21): some frames at a time."""
    for t in range(0, len(frames), ROWS):
        _, joints, weights, raw = frames.part(slice(t, t + ROWS))
        seen = (weights > 0) & np.isfinite(raw["noise"])[:, None]
        turn = raw["root"][:, :9].reshape(-1, 3, 3)
        there = np.where(seen[..., None], joints, 0.0)
        left = np.where(seen[..., None], there - raw["joints"], 0.0)
        yield np.where(seen[..., None], left @ turn, 0.0), seen
