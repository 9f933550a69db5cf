"""Positions in a picture that stand where joints in space are expected."""

from __future__ import annotations

import numpy as np

from handtrack.errors import InputError
from handtrack.sequences.readers.raw import Raw

_AT_ZERO = 1e-3
"""The wrist's z, which MediaPipe measures the others' from, as a share of the hand's extent."""


def refuse_pictures(raw: Raw, normalised: bool = False) -> None:
    """Refuse MediaPipe's landmarks in the picture: the wrist's z is 0 by definition, x and y are
    not. One frame tells where the source calls them normalised.

    Raises:
        InputError: they are, with the ones to take.
    """
    if raw.unit is not None or raw.joints.shape[1] != 21 or raw.order not in (None, "handtrack"):
        return
    seen = raw.joints[np.isfinite(raw.joints).all((1, 2))]
    if len(seen) < (1 if normalised else 2):
        return
    wrist, extent = seen[:, 0], float(np.ptp(seen, axis=(0, 1)).max())
    flat = np.abs(wrist[:, 2]).max() < _AT_ZERO * extent
    moves = normalised or np.ptp(wrist[:, :2], axis=0).max() > 10 * _AT_ZERO * extent
    deep = float(np.ptp(seen[..., 2])) > 0
    if not (flat and moves and deep) or seen[..., :2].min() < -0.5:
        return
    what = "shares of a picture" if seen[..., :2].max() < 2 else "pixels"
    raise InputError(
        f"x and y are {what} and the wrist's z is always 0: these are landmarks in a picture, not"
        " joints in space; take MediaPipe's world landmarks (hand_world_landmarks,"
        " multi_hand_world_landmarks)",
        raw.path,
    )
