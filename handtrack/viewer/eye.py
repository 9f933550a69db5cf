"""Where the viewer looks from: so that the hands fill the picture, at rest or going with them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import BASES
from handtrack.tracking.track import Part

Array = NDArray[np.float64]

GRID_M = 0.05
"""Between the lines of the grid below the hands [m]."""
_MOST = 2000  # frames looked at of each hand
_SLOPE = float(np.tan(np.deg2rad(55 / 2)))  # of the edge above in Rerun's 3D views
_FILLED = 0.86  # of the picture, from the middle to an edge
_SKIN_M = 0.012  # around the joints
_FARTHER = 1.15  # so much nearer must the hand be when the eye goes with it
_LEAST_M = 0.06  # half of what is seen, at least
_REACH_M = (1.0, 5.0)  # how far the ground goes about what an eye goes along with


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
    """Where to look from, in the world.

    Attributes:
        position: of the eye [m].
        target: what it looks at [m].
        up: the direction that is up in the picture.
        extent: half of the width and of the height of what is to be seen, about the target [m].
        floor: where all of the motion is above, along `up` from the origin [m].
        goes_along: the eye keeps its place beside the hand, of which `target` is the middle.
        reach: how far from the target the hand comes [m].
    """

    position: Array
    target: Array
    up: Array
    extent: tuple[float, float] = (0.1, 0.1)
    floor: float = -0.1
    goes_along: bool = False
    reach: float = _REACH_M[0]

    @property
    def distance(self) -> float:
        """To the target [m]."""
        return float(np.linalg.norm(self.position - self.target))

    @property
    def looked_at(self) -> Array:
        """The target in the frame that is drawn: the world, or that of the hand beside which the
        eye stays."""
        return np.zeros(3) if self.goes_along else self.target

    @property
    def right(self) -> Array:
        """The direction to the right of the picture."""
        across = np.cross(self.target - self.position, self.up)
        return np.asarray(across / np.linalg.norm(across))

    @property
    def upward(self) -> Array:
        """The direction upwards in the picture, square to where the eye looks."""
        upward = np.cross(self.right, self.target - self.position)
        return np.asarray(upward / np.linalg.norm(upward))

    def farther(self, factor: float) -> Eye:
        """The same view from so many times as far."""
        return self._replace(position=self.target + factor * (self.position - self.target))


def middles(joints: Array) -> Array:
    """(n, 3) middle of the joints (n, 21, 3) that are there: what an eye goes with."""
    known = np.asarray(np.isfinite(joints).all(-1))
    total = np.where(known[..., None], joints, 0.0).sum(1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(total / known.sum(1)[:, None])


def eye(
    hands: Sequence[Seen], *, aspect: float = 1.0, still: bool = False, along: bool = False
) -> Eye:
    """An eye that sees the hands, from as near as shows all of the motion.

    The frame of the world is the source's: nothing says which way is up. So the hands say it:
    fingers upwards, seen from the back of the hand. Where the motion is much larger than the
    hand the eye goes along with it.

    Args:
        hands: what is to be seen.
        aspect: width of the picture, as a share of its height.
        still: never go along, as where there are several hands.
        along: go along in any case.
    """
    joints = np.concatenate([hand.joints for hand in hands])
    whole = joints[np.isfinite(joints).all((1, 2))]
    up = _direction(whole[:, BASES[2]] - whole[:, 0], np.array([0.0, 0.0, 1.0]))
    away = _direction(np.concatenate([_backs(h) for h in hands]), np.array([1.0, 0.0, 0.0]))
    away = away - (away @ up) * up
    if np.linalg.norm(away) < 1e-3:
        away = np.cross(up, np.eye(3)[np.argmin(np.abs(up))])
    away /= np.linalg.norm(away)
    # a little from above and from the side shows depth
    towards = away + 0.25 * np.cross(up, away) + 0.3 * up
    towards /= np.linalg.norm(towards)
    right = np.cross(up, towards)
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(towards, right), towards])
    points = _points(joints)
    at_rest, centre, extent = _framed(points @ axes.T, aspect)
    floor = float(np.percentile(points @ up, 0.5) if len(points) else -0.1) - 2 * _SKIN_M
    found = Eye(centre @ axes + at_rest * towards, centre @ axes, up, extent, floor)
    if still:
        return found
    places = middles(joints)
    beside = _points(joints - places[:, None]) @ axes.T
    distance, _, extent = _framed(beside, aspect, centred=False)
    if not along and at_rest < _FARTHER * distance:
        return found
    known = places[np.isfinite(places).all(1)]
    target = np.median(known, axis=0) if len(known) else np.zeros(3)
    farthest = np.linalg.norm(known - target, axis=1).max() if len(known) else 0.0
    reach = float(np.clip(farthest + _REACH_M[0] / 2, *_REACH_M))
    return Eye(target + distance * towards, target, up, extent, floor, True, reach)


def _points(joints: Array) -> Array:
    """The joints that are there, in a row."""
    return joints[np.isfinite(joints).all(-1)]


def _framed(
    points: Array, aspect: float, centred: bool = True
) -> tuple[float, Array, tuple[float, float]]:
    """How far away the eye must be, from which point, and half the width and height there [m].

    Args:
        points: (n, 3) to the right, upwards and towards the eye [m].
        aspect: width of the picture, as a share of its height.
        centred: look at the middle of the points, instead of at the origin.
    """
    if not len(points):
        points = np.array([[-0.1] * 3, [0.1] * 3])
    low, high = np.percentile(points, [1, 99], axis=0)
    centre = (low + high) / 2 if centred else np.zeros(3)
    beside = points - centre
    across = np.abs(beside[:, :2]) + _SKIN_M
    needed = beside[:, 2] + (across / (_FILLED * _SLOPE * np.array([aspect, 1.0]))).max(1)
    least = _LEAST_M / (_FILLED * _SLOPE * min(aspect, 1.0))
    width, height = (float(v) for v in np.percentile(across, 99, axis=0))
    return max(float(np.percentile(needed, 99)), least), centre, (width, height)


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
