"""A subject's own hand, from sequences of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.bundle import Solution
from handtrack.calibration.chains import SIZE, Chains
from handtrack.calibration.freedoms import FEW, freedoms, unknown
from handtrack.calibration.material import MIN_SEEN, Material, centred, chosen, excerpt
from handtrack.calibration.proportions import Proportions, proportions
from handtrack.calibration.rounds import Round
from handtrack.calibration.settings import METHODS, MIN_FRAMES, CalibrationSettings
from handtrack.deprecated import old_positions
from handtrack.detectors.profile import Noise
from handtrack.errors import InputError, ModelError, SettingsError
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import landmarks_on, reshaped, without_landmarks
from handtrack.hand.skeleton import ANGLE_NAMES
from handtrack.read_only import make_read_only
from handtrack.sequences.sequence import Sequence

Array = NDArray[np.float64]

FRAMES = CalibrationSettings().frames

# angles are expected to be this far from the relaxed hand, and outside their limits [rad]
_LOOSE = np.deg2rad([180.0, 75.0, 180.0, 180.0])
_STRICT = np.deg2rad(3.0)
# the first round: frames, noise [m], steps
_FIRST, _FIRST_NOISE, _FIRST_STEPS = 40, 1e-3, 8
# an axis is sought where its angle's standard deviation over the frames is at least this [rad],
# and so many times that of its error
_MOVING, _CLEARLY = np.deg2rad(1.5), 1.5


@dataclass(frozen=True, eq=False)
class Calibration:
    """What sequences say of a hand.

    Attributes:
        model: the hand with what was found.
        method: "full" (joints and axes), "lengths" (joints, axes kept), "proportions" (medians
            of lengths and palm) or "scale" (size alone).
        scale: size of the subject's hand over the prior's.
        noise: noise of the joints seen in the sequences [m per coordinate]; 0 if too short.
        frames: frames that were used.
        kept: names of the joints whose bone, or place in the palm, was never seen, so that
            the scaled prior's was kept.
        kept_axes: names of the angles whose axes the prior's were kept: all where the method
            does not seek them, else those that too little motion shows.
        drift: for each sequence that was used, greatest change of a bone's length against the
            subject's hand [m]; one sequence does not drift.
        notes: what the user should know, one line each.
        rest_covariance: (63, 63) of the hand's rest joints about the subject's [m^2], in the root
            frame, the wrist its origin: what the data leave of how people vary.
    """

    model: HandModel
    method: str
    scale: float
    noise: float
    frames: int
    kept: tuple[str, ...] = ()
    kept_axes: tuple[str, ...] = ANGLE_NAMES
    drift: tuple[float, ...] = ()
    notes: tuple[str, ...] = ()
    rest_covariance: Array = field(default_factory=lambda: np.zeros((63, 63)))

    def __post_init__(self) -> None:
        make_read_only(self)

    def summary(self) -> dict[str, object]:
        """What was found, as plain JSON values."""
        return {
            "method": self.method,
            "frames": self.frames,
            "scale": self.scale,
            "noise_mm": 1e3 * self.noise,
            "kept_joints": list(self.kept),
            "kept_axes": list(self.kept_axes),
            "drift_mm": [1e3 * d for d in self.drift],
        }


@old_positions("frames")
def calibrate(
    model: HandModel,
    sequences: Sequence | Iterable[Sequence],
    method: str = "auto",
    *,
    frames: int = FRAMES,
    noise: Noise | None = None,
) -> Calibration:
    """The hand of a subject.

    The full calibration finds what is constant together with the pose of every frame: where
    the fingers start, their bones' lengths, the axes of all joints, and bones that are not at
    right angles to their hinge, drawn to the prior hand at the subject's size and robust to
    strays (a sparse bundle adjustment). Noisy joints are smoothed first. Of several sequences
    the axes are shared, and lengths may drift a little from one to the next.

    Args:
        model: the prior; what the sequences do not show stays as it is there, scaled. The
            calibration minds its limits. With `landmark_offsets` the sequences are of its
            landmarks.
        sequences: one or more of the same hand of the same subject; joints may be missing.
        method: "full"; "lengths" keeps the axes as the model has them; "proportions" takes
            medians of lengths and palm, and "scale" the size alone; "auto" is full where there
            are frames enough, else proportions.
        frames: how many frames of each sequence to look at closely: those that differ most.
        noise: of the detector, as its profile has it: what lasts in it is not taken for the
            subject's own. By default what the sequences themselves show.

    Returns:
        The calibrated hand, in the prior's root frame, with the prior's limits.

    Raises:
        InputError: a sequence is of the other hand, no bone was seen, there are fewer than ten
            frames for a full calibration, or it comes to no hand.
        SettingsError: an unknown method, or no sequence.
    """
    given = [sequences] if isinstance(sequences, Sequence) else list(sequences)
    given = [excerpt(sequence) for sequence in given]
    if method not in METHODS:
        raise SettingsError(f"method {method!r} is unknown, expected one of {', '.join(METHODS)}")
    if not given:
        raise SettingsError("no sequence to calibrate from")
    if frames < MIN_FRAMES:
        raise SettingsError(f"frames is {frames}, expected at least {MIN_FRAMES}")
    for sequence in given:
        if sequence.hand != model.hand:
            raise InputError(
                f"the model is a {model.hand} hand, the sequence a {sequence.hand} one",
                sequence.source or None,
            )
    if model.has_landmarks:
        return _from_landmarks(model, given, method, frames, noise)
    # sizes and medians are taken of the joints as seen
    smooth = method not in ("scale", "proportions")
    materials = [Material.of(sequence, smooth) for sequence in given]
    level = float(np.sqrt(np.mean([m.noise**2 for m in materials])))
    joints = np.concatenate([sequence.joints for sequence in given])
    found = proportions(model, joints, level, given[0].source)
    usable = sum(map(len, materials))
    if method == "scale":
        return _plain(found.scaled, "scale", found, level, len(joints), found.unseen)
    if method == "proportions":
        return _plain(found.model, "proportions", found, level, len(joints), found.kept)
    if usable < MIN_FRAMES:
        short = (
            f"{usable} frames with {MIN_SEEN} joints or more, a full calibration needs {MIN_FRAMES}"
        )
        if method != "auto":
            raise InputError(short, given[0].source or None)
        note = f"only lengths and palm were calibrated: {short}"
        return _plain(found.model, "proportions", found, level, len(joints), found.kept, note)
    try:
        usable_ones = [m for m in materials if len(m)]
        return _bundled(model, found, usable_ones, level, method, frames, noise)
    except (ModelError, np.linalg.LinAlgError) as error:
        failed = f"a full calibration came to no hand ({error})"
        if method != "auto":
            raise InputError(failed, given[0].source or None) from None
    note = f"only lengths and palm were calibrated: {failed}"
    return _plain(found.model, "proportions", found, level, len(joints), found.kept, note)


def _from_landmarks(
    model: HandModel, given: list[Sequence], method: str, frames: int, noise: Noise | None
) -> Calibration:
    """As `calibrate`, of landmarks: joint centres follow from the hand so far and its poses."""
    bare = without_landmarks(model)
    found = calibrate(bare, given, "scale")
    for way in ("scale", "scale", method, method):
        hand = landmarks_on(model, found.model)
        found = calibrate(bare, [centred(hand, s) for s in given], way, frames=frames, noise=noise)
    return replace(found, model=landmarks_on(model, found.model))


def _plain(
    hand: HandModel,
    method: str,
    found: Proportions,
    noise: float,
    frames: int,
    kept: tuple[str, ...],
    *notes: str,
) -> Calibration:
    return Calibration(
        hand, method, found.scale, noise, frames, kept, notes=notes, rest_covariance=unknown(hand)
    )


def _bundled(
    model: HandModel,
    found: Proportions,
    materials: list[Material],
    level: float,
    method: str,
    frames: int,
    noise: Noise | None,
) -> Calibration:
    """Full calibration, or of lengths alone, from where the medians are."""
    start = found.model
    # what is expected is the prior hand at the subject's size, where to begin the medians
    chains = Chains.of(found.scaled, _LOOSE, _STRICT)
    few = sum(map(len, materials)) < FEW
    moves = freedoms(chains, np.full((5, 4), method != "lengths"), few)
    picks = [chosen(m.fitted(start), m.weights, frames) for m in materials]
    few_picks = [pick[:: max(1, len(pick) // _FIRST)] for pick in picks]
    rough = Round(chains, start, materials, few_picks, [_FIRST_NOISE] * len(materials))
    begin = np.asarray(np.linalg.lstsq(moves.basis, chains.shared_of(start).ravel())[0])
    first = rough.solve(moves, begin, _FIRST_STEPS, 1e-2)
    near = _as_model(model, chains, moves.basis @ first.free[: moves.n])
    fine = Round(chains, near, materials, picks, rough.misfits(moves, first), noise)
    solution = fine.solve(moves, first.free[: moves.n])
    if method != "lengths":
        known = _known(solution)
        if not known.all():
            fewer = freedoms(chains, known, few)
            shared = moves.basis @ solution.free[: moves.n]
            where = np.asarray(np.linalg.lstsq(fewer.basis, shared)[0])
            moves, solution = fewer, fine.solve(fewer, where)
    hand = _as_model(model, chains, fine.constants(moves, solution))
    kept_axes = [n for n, t in zip(ANGLE_NAMES, moves.twists.ravel(), strict=True) if t < 0]
    return Calibration(
        hand,
        "lengths" if method == "lengths" else "full",
        found.scale,
        level,
        fine.frames,
        found.kept,
        tuple(kept_axes),
        fine.drifts(moves, solution),
        rest_covariance=fine.rest_covariance(moves, solution),
    )


def _as_model(model: HandModel, chains: Chains, shared: Array) -> HandModel:
    """The hand of constants (100,), with the skin carried along."""
    base, bones, axes = chains.constants(shared.reshape(5, SIZE))
    fingers = np.concatenate([base[:, None], bones], 1).cumsum(1)
    wrist = chains.wrist
    return reshaped(model, np.vstack([wrist, wrist + fingers.reshape(20, 3)]), axes.reshape(20, 3))


def _known(solution: Solution) -> NDArray[np.bool_]:
    """(5, 4) which axes the frames tell about: those of angles that move, and not by noise."""
    angles = np.concatenate([poses.local for poses in solution.poses])
    least = np.maximum(_CLEARLY * np.sqrt(np.median(solution.variance, 0)), _MOVING)
    return np.asarray(angles.std(0) > least)
