"""Where the viewer looks from when it opens."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import BASES
from handtrack.tracking.track import Part

Array = NDArray[np.float64]

_MOST = 2000  # frames looked at of each hand


class Seen(NamedTuple):
    """Joints (n, 21, 3) of a hand [m], NaN = missing, as far as they are to be in view."""

    hand: str
    joints: Array

    @staticmethod
    def of(track: Part, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> Seen:
        """The fitted joints of a track and the observed ones, moved by an offset."""
        some = slice(None, None, 1 + len(track) // _MOST)
        joints = np.concatenate([track.fitted_joints[some], track.observed[some]])
        return Seen(track.hand, joints + np.asarray(offset))


class Eye(NamedTuple):
    """Where to look from, where to [m], and which way is up, in the world."""

    position: Array
    target: Array
    up: Array

    @property
    def right(self) -> Array:
        """The direction to the right of the picture."""
        across = np.cross(self.target - self.position, self.up)
        return np.asarray(across / np.linalg.norm(across))

    def farther(self, factor: float) -> Eye:
        """The same view from so many times as far."""
        return self._replace(position=self.target + factor * (self.position - self.target))


def eye(hands: Sequence[Seen]) -> Eye:
    """An eye that sees the hands.

    The frame of the world is the source's: nothing says which way is up. So the hands say it:
    fingers upwards, seen from the back of the hand, from as far as shows all of the motion.
    """
    joints = np.concatenate([hand.joints for hand in hands])
    points = joints[np.isfinite(joints).all(-1)]
    whole = joints[np.isfinite(joints).all((1, 2))]
    low, high = np.array([-0.1] * 3), np.array([0.1] * 3)
    if len(points):
        low, high = np.percentile(points, [1, 99], axis=0)
    target = (low + high) / 2
    up = _direction(whole[:, BASES[2]] - whole[:, 0], np.array([0.0, 0.0, 1.0]))
    away = _direction(np.concatenate([_backs(h) for h in hands]), np.array([1.0, 0.0, 0.0]))
    away = away - (away @ up) * up
    if np.linalg.norm(away) < 1e-3:
        away = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    away /= np.linalg.norm(away)
    distance = 1.05 * max(float(np.linalg.norm(high - low)), 0.2)
    # a little from above and from the side shows depth
    side = np.cross(up, away)
    offset = away + 0.25 * side + 0.3 * up
    return Eye(target + distance * offset / np.linalg.norm(offset), target, up)


def _direction(vectors: Array, otherwise: Array) -> Array:
    """Mean direction of vectors (n, 3); `otherwise` where they cancel or there is none."""
    mean = vectors.mean(0) if len(vectors) else np.zeros(3)
    length = float(np.linalg.norm(mean))
    return mean / length if length > 1e-3 else otherwise


def _backs(hand: Seen) -> Array:
    """Directions (n, 3) out of the back of the hand [m^2, not normalised]."""
    joints = hand.joints[np.isfinite(hand.joints).all((1, 2))]
    index, little = joints[:, BASES[1]] - joints[:, 0], joints[:, BASES[4]] - joints[:, 0]
    normal = np.cross(little, index)
    return normal if hand.hand == "right" else -normal
