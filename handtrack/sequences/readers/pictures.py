"""Positions in a picture that stand where joints in space are expected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files.long_arrays import blocks, by_blocks
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw

FIT_IN_2D = (
    "fit them in the picture (handtrack track --camera LENS, or --image-size WxH and --fov DEGREES)"
)
ONLY_XY = (
    "only x and y of each joint: positions in a picture are no 3D joints; take MediaPipe's world"
    f" landmarks, triangulate two cameras' pictures, or {FIT_IN_2D}"
)
AT_ZERO = 1e-3
"""The wrist's z, which MediaPipe measures the others' from, as a share of the hand's extent."""
_AWAY = 0.05
"""So far from x and y of 0 the wrist of one frame in a picture is, as a share of it."""


def seen_in_picture(raw: Raw, normalised: bool = False) -> Raw:
    """The same, marked where it is MediaPipe's landmarks in the picture: the wrist's z is 0 by
    definition, x and y are not."""
    known = raw.unit is not None or raw.picture
    if known or raw.joints.shape[1] != 21 or raw.order not in (None, "handtrack"):
        return raw
    whole = by_blocks(lambda x: np.isfinite(x.reshape(len(x), -1)).all(1), raw.joints)
    if not whole.any() or _deep_at_the_wrist(raw.joints, whole):
        return raw
    seen = raw.joints[whole]
    wrist = seen[:, 0]
    with np.errstate(over="ignore"):  # what extends so far is no hand
        extent = float(np.ptp(seen, axis=(0, 1)).max())
        deep = float(np.ptp(seen[..., 2])) > 0
    flat = np.abs(wrist[:, 2]).max() < AT_ZERO * extent
    # a hand in its own frame is about its wrist
    away = len(seen) == 1 and np.abs(wrist[:, :2]).min() > _AWAY * extent
    moves = normalised or away or np.ptp(wrist[:, :2], axis=0).max() > 10 * AT_ZERO * extent
    if not (flat and moves and deep) or seen[..., :2].min() < -0.5:
        return raw
    return replace(raw, picture="deep")


def _deep_at_the_wrist(joints: Array, whole: NDArray[np.bool_]) -> bool:
    """Whether the wrist's depth is something over all that joints (T, N, 3) extend to."""
    n = joints.shape[1] * 3  # long rows are quick to go through
    low, high, deepest = np.full(n, np.inf), np.full(n, -np.inf), 0.0
    for part in blocks(len(joints)):
        rows = joints[part].reshape(-1, n)
        low = np.fmin(low, np.fmin.reduce(rows, axis=0))
        high = np.fmax(high, np.fmax.reduce(rows, axis=0))
        deepest = np.abs(joints[part, 0, 2][whole[part]]).max(initial=deepest)
    with np.errstate(over="ignore"):  # what extends so far is no hand
        extent = np.fmax.reduce(high.reshape(-1, 3)) - np.fmin.reduce(low.reshape(-1, 3))
    return bool(deepest >= AT_ZERO * extent.max())


def flat(raw: Raw) -> Raw:
    """Positions in a picture of which only x and y are given: z is 0 where these are known."""
    joints = raw.joints.copy()
    joints[..., 2] = np.where(np.isfinite(joints[..., :2]).all(-1), 0.0, np.nan)
    return replace(raw, joints=joints, picture="flat")


def refuse_picture(raw: Raw) -> None:
    """Refuse landmarks in a picture where joints in space are meant.

    Raises:
        NotJointsError: only x and y of each.
        InputError: MediaPipe's landmarks in the picture.
    """
    if raw.picture == "flat":
        raise NotJointsError(ONLY_XY, raw.path)
    if raw.picture == "deep":
        seen = raw.joints[np.isfinite(raw.joints).all((1, 2)), :, :2]
        what = "shares of a picture" if seen.size and seen.max() < 2 else "pixels"
        raise InputError(
            f"x and y are {what} and the wrist's z is always 0: these are landmarks in a picture,"
            " not joints in space; take MediaPipe's world landmarks (hand_world_landmarks,"
            f" multi_hand_world_landmarks), or {FIT_IN_2D}",
            raw.path,
        )
