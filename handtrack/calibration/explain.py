"""What a hand leaves unexplained of a sequence, and what any hand of rigid bones must leave."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.bundle import Clip, Poses, solve
from handtrack.calibration.chains import SIZE, Chains
from handtrack.calibration.material import Material, centred, excerpt, poses_of, sound
from handtrack.calibration.split import Split, residuals, split_of
from handtrack.errors import InputError
from handtrack.files.long_arrays import evenly
from handtrack.fitting import solver
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import without_landmarks
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

BALL_SIZE = 6


@dataclass(frozen=True, eq=False)
class Balls:
    """Five fingers whose bones keep their lengths and point anywhere.

    A finger's constants: its base (3) and the lengths of its three bones [m]. Its unknowns:
    (T, 5, 3, 3) unit directions of the bones in the root frame, moved in their tangent planes.
    """

    def points(self, shared: Array, local: Array) -> Array:
        """(T, 5, 4, 3) joints of the fingers, base to tip."""
        steps = np.empty((*local.shape[:2], 4, 3))
        steps[..., 0, :] = shared[:, :3]
        steps[..., 1:, :] = shared[:, 3:, None] * local
        return steps.cumsum(2)

    def linearised(self, shared: Array, local: Array) -> tuple[Array, Array, Array]:
        """Points and their derivatives by directions (two each) and by constants."""
        n = len(local)
        by_local = np.zeros((n, 5, 4, 3, 6))
        by_shared = np.zeros((n, 5, 4, 3, BALL_SIZE))
        by_shared[..., :3] = np.eye(3)
        planes = _planes(local)
        for i in range(3):
            moved = shared[:, 3 + i, None, None] * planes[:, :, i]
            by_local[:, :, i + 1 :, :, 2 * i : 2 * i + 2] = moved[:, :, None]
            by_shared[:, :, i + 1 :, :, 3 + i] = local[:, :, None, i]
        return self.points(shared, local), by_local, by_shared

    def moved(self, local: Array, step: Array) -> Array:
        """Directions after a step in their tangent planes."""
        planes = _planes(local)
        new = local + np.einsum("tfixc,tfic->tfix", planes, step.reshape(*local.shape[:3], 2))
        return np.asarray(new / np.linalg.norm(new, axis=-1, keepdims=True))

    def pull(self, local: Array) -> tuple[float, Array, Array]:
        """Nothing is expected of directions."""
        nothing = np.zeros((*local.shape[:2], 6))
        return 0.0, nothing, nothing


def _planes(u: Array) -> Array:
    """(..., 3, 2) two unit vectors at right angles to each unit vector and to each other."""
    least = np.eye(3)[np.abs(u).argmin(-1)]
    a = np.cross(u, least)
    a /= np.linalg.norm(a, axis=-1, keepdims=True)
    return np.stack([a, np.cross(u, a)], -1)


FRAMES = 200
"""Of a longer clip so many frames are looked at, evenly spread."""

# what a hand leaves is doubtful from so much beyond the bound, absolutely and relatively: a
# detector's landmarks, rightly read, reach 1.8 times, exchanged or mirrored ones mostly 2.2 to 10
_DOUBT_MM, _DOUBT = 0.5, 2.0

# noise of the joints [m]: the unit of the weak priors that keep what nothing observes
_NOISE = 1e-3
# a thousandth of the mean square is a twentieth of a percent of a residual
_TOLERANCE = 1e-3
# no pose is expected, and no limit holds
_ANY = np.full(4, 1e3)


@dataclass(frozen=True, eq=False)
class Look:
    """What of a clip a hand is judged by.

    Attributes:
        model: the hand, of joint centres.
        material, fits: all frames that can be used, (T, 21, 3) as seen, and the hand in them.
        sound: which are fitted, and not very much worse than most.
        index: some of these, evenly spread.
        joints, seen: there, (F, 21, 3) [m] and (F, 21).
    """

    model: HandModel
    material: Material
    fits: solver.Results
    sound: NDArray[np.int64]
    index: NDArray[np.int64]
    joints: Array
    seen: NDArray[np.bool_]

    @staticmethod
    def at(model: HandModel, sequence: Sequence, frames: int) -> Look:
        """At most so many frames of a sequence."""
        sequence = excerpt(sequence)
        if model.has_landmarks:
            sequence, model = centred(model, sequence), without_landmarks(model)
        material = Material.of(sequence, smooth=False)
        fits = material.fitted(model)
        good = sound(fits, material.weights)
        index = evenly(good, frames)
        joints = material.joints[index]
        return Look(model, material, fits, good, index, joints, np.isfinite(joints[..., 0]))

    @property
    def chains(self) -> Chains:
        """Its bones; no pose is expected, and no limit holds."""
        return Chains.of(self.model, _ANY, np.inf)

    @property
    def start(self) -> Poses:
        """The fitted poses."""
        return poses_of(self.model, self.fits, self.index)

    def clip(self, basis: Array) -> Clip:
        """The frames for `solve`, with what may change of the hand."""
        targets, weights = np.nan_to_num(self.joints), self.seen.astype(np.float64)
        return Clip(self.chains, targets, weights, np.zeros((5, SIZE)), basis, _NOISE)


@dataclass(frozen=True)
class Residual:
    """Distances of observed joints to explained ones [m]: mean, and root of the mean square."""

    mean: float
    rms: float

    @staticmethod
    def of(distances: Array) -> Residual:
        """Of distances of all joints that were seen."""
        return Residual(float(distances.mean()), float(np.sqrt(np.square(distances).mean())))


@dataclass(frozen=True)
class Explained:
    """How well a hand explains sequences, by least squares frame by frame.

    The three differ in what is free, so each is at most the one before it (in the mean square,
    which is what is minimised). What the bound leaves is no hand's fault: bones change their
    lengths in the data. What lies between it and `unlimited` is the model's, what lies between
    that and `fitted` is poses outside the limits.

    Attributes:
        fitted: as `fit` does, inside the limits.
        unlimited: the same hand without limits.
        bound: palm rigid and bone lengths constant, but chosen for these sequences; every joint
            a free ball.
        frames: frames that were looked at.
        split: what the residual of `fitted` is made of.
    """

    fitted: Residual
    unlimited: Residual
    bound: Residual
    frames: int
    split: Split

    def __str__(self) -> str:
        left, free, bound = (1e3 * of.mean for of in (self.fitted, self.unlimited, self.bound))
        return (
            f"the hand leaves {left:.2f} mm of its input, without limits {free:.2f};"
            f" any hand of rigid bones {bound:.2f} mm"
        )

    def summary(self) -> dict[str, object]:
        """The numbers, in millimetres, as plain JSON values."""
        return {
            f"{name}_{kind}_mm": 1e3 * getattr(getattr(self, field), kind)
            for name, field in (("residual", "fitted"), ("unlimited", "unlimited"), ("bound",) * 2)
            for kind in ("mean", "rms")
        } | {"split_mm": self.split.summary()}


def doubt(found: Mapping[str, object]) -> str | None:
    """What to say where a hand explains its input badly although some hand would not.

    Then the input is no hand's as it was read: in another joint order, of the other hand, of a
    mirrored world, or with joints exchanged.

    Args:
        found: `Explained.summary`, or what holds it.
    """
    residual, bound = found.get("residual_mean_mm"), found.get("bound_mean_mm")
    if not isinstance(residual, int | float) or not isinstance(bound, int | float):
        return None
    if residual - bound < _DOUBT_MM or residual < _DOUBT * bound:
        return None
    return (
        f"the calibrated hand leaves {residual:.1f} mm of its input, any hand of rigid bones"
        f" {bound:.1f}: is it the right joint order (--order), hand (--hand), world (--mirror)?"
    )


def explain(
    model: HandModel, sequences: Sequence | Iterable[Sequence], frames: int = FRAMES
) -> Explained:
    """How well a hand explains sequences, and how well any hand could.

    Args:
        model: the subject's hand.
        sequences: one or more of this hand; frames with few joints or that fit very badly are
            left out.
        frames: how many frames of each to look at.

    Raises:
        InputError: no sequence has a frame with at least 12 joints.
    """
    given = [sequences] if isinstance(sequences, Sequence) else list(sequences)
    looks = (Look.at(model, sequence, frames) for sequence in given)
    parts = [_explained(look) for look in looks if len(look.material)]
    if not parts:
        where = given[0].source if given else ""
        raise InputError("no frame has 12 joints, so the hand is not explained", where or None)
    fitted, unlimited, bound, counts, offs = zip(*parts, strict=True)
    left = Residual.of(np.concatenate(bound))
    return Explained(
        Residual.of(np.concatenate(fitted)),
        Residual.of(np.concatenate(unlimited)),
        left,
        sum(counts),
        split_of(offs, left.rms),
    )


def _explained(look: Look) -> tuple[Array, Array, Array, int, Array]:
    """Distances of all joints seen in a clip, three times, the number of frames, and the residuals
    of all frames that are sound, by bones; NaN in others."""
    model, fits, sound = look.model, look.fits, look.sound
    off = np.full_like(look.material.joints, np.nan)
    turn = fits.roots[sound, :9].reshape(-1, 3, 3)
    away = look.material.joints[sound] - fits.joints[sound]
    off[sound] = residuals(model, fits.angles[sound], turn, away)
    fitted = np.linalg.norm(fits.joints[look.index] - look.joints, axis=-1)[look.seen]
    nothing = np.zeros(0)
    clip = look.clip(np.zeros((5 * SIZE, 0)))
    free = solve([clip], np.zeros((0, 0)), nothing, [look.start], tolerance=_TOLERANCE)
    unlimited = clip.distances(nothing, free.poses[0])[look.seen]
    bound = _bound(model, clip.targets, look.seen, look.start)
    return fitted, unlimited, bound, len(look.index), off


def _bound(model: HandModel, targets: Array, seen: NDArray[np.bool_], start: Poses) -> Array:
    """Distances of the joints seen to the nearest hand with balls for joints."""
    fingers = (model.rest_joints[1:] - model.rest_joints[0]).reshape(5, 4, 3)
    lengths = np.linalg.norm(np.diff(fingers, axis=1), axis=-1)
    constants = np.concatenate([fingers[:, 0], lengths], 1)
    hand = Chains.of(model, _ANY, np.inf).points(np.zeros((5, SIZE)), start.local)
    # bones point as they are seen; one without an end as the hand's
    bones = np.diff(hand, axis=2)
    there = seen[:, 1:].reshape(-1, 5, 4)
    both = there[:, :, 1:] & there[:, :, :-1]
    found = np.diff(targets[:, 1:].reshape(-1, 5, 4, 3), axis=2) @ start.rotation[:, None]
    both &= np.linalg.norm(found, axis=-1) > 1e-6
    bones = np.where(both[..., None], found, bones)
    poses = Poses(
        bones / np.linalg.norm(bones, axis=-1, keepdims=True), start.rotation, start.translation
    )
    n = constants.size
    # the root frame's own place, and what is never seen, stay where they are
    precision = np.eye(n)
    clip = Clip(Balls(), targets, seen.astype(np.float64), constants, np.eye(n), _NOISE)
    best = solve([clip], precision, np.zeros(n), [poses], tolerance=_TOLERANCE)
    return clip.distances(best.free, best.poses[0])[seen]
