"""The results of `stability`: plain dataclasses, and the JSON values they stand for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.evaluation.arrays import Array, nan_mean, or_none
from handtrack.evaluation.bootstrap import Intervals
from handtrack.evaluation.shake import Shake
from handtrack.hand.limits import Limits
from handtrack.hand.skeleton import FINGERS, JOINT_NAMES
from handtrack.read_only import make_read_only

Against = Literal["observed", "truth", "nothing"]


@dataclass(frozen=True)
class Spread:
    """A quantity over frames; NaN where there was no frame.

    Attributes:
        mean, std, median, p95, max: std is the population's (divided by n); p95 is linear
            between frames.
    """

    mean: float
    std: float
    median: float
    p95: float
    max: float

    @staticmethod
    def of(values: ArrayLike) -> Spread:
        """The spread of what is not NaN."""
        values = np.asarray(values, dtype=np.float64)
        known = values[~np.isnan(values)]
        if not known.size:
            return Spread(*[float("nan")] * 5)
        mean, std, most = float(known.mean()), float(known.std()), float(known.max())
        median, p95 = np.percentile(known, [50, 95], overwrite_input=True)
        return Spread(mean, std, float(median), float(p95), most)

    def to_dict(self) -> dict[str, float | None]:
        """The five numbers; None for NaN."""
        return {name: or_none(getattr(self, name)) for name in self.__dataclass_fields__}


@dataclass(frozen=True, eq=False)
class Material:
    """What was measured, frame by frame, for comparisons and for drawing.

    Attributes:
        time_ns, frame_index: (T,) int64.
        estimate, reference: (T, 21, 3) [m], NaN = missing; `reference` is all NaN where the
            estimate was measured against nothing.
        joint_errors_mm: (T, 21) errors after similarity alignment of each frame.
        angles: (T, 20) [rad] or None; limits: those of the hand.
        timed, numbered: whether times and numbers are the source's (as in `Sequence`).
        settings: of the track, where it is one.
    """

    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    estimate: Array
    reference: Array
    joint_errors_mm: Array
    angles: Array | None = None
    limits: Limits | None = None
    timed: bool = True
    numbered: bool = True
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        make_read_only(self)

    def __len__(self) -> int:
        return len(self.time_ns)


@dataclass(frozen=True, eq=False)
class Stability:
    """The numbers of one sequence, or of all frames of several.

    Errors are in mm, over the frames in which something could be compared; frames that are
    lost have no error, so read the errors together with `lost`.

    Attributes:
        name, hand: of the sequence.
        frames: how many there are; fitted, predicted, lost: how many of each status.
        compared: frames that have a PA-MPJPE.
        against: "truth"; "observed": the joints that the hand was fitted to; "nothing": there
            is neither, and there are no errors.
        pa_mpjpe_mm: error after similarity alignment per frame.
        mpjpe_mm: error without alignment.
        jitter_m_s3: mean third derivative of the estimated joints (TransPose).
        acceleration_m_s2: mean second derivative of the estimated joints.
        input_jitter_m_s3, input_acceleration_m_s2: the same of the observed joints; NaN if
            there are none (a pair of estimate and truth).
        input_pa_mpjpe_mm, input_mpjpe_mm: error of the observed joints to the truth, None
            without one: the estimate is worth having where its own error is smaller.
        truth_jitter_m_s3, truth_acceleration_m_s2: of the truth, what a perfect estimate has.
        lag_frames: how many frames the estimate is late; NaN without a truth.
        root_mpjpe_mm: error with the wrists put on each other.
        pa_auc, auc: area under the PCK curve 0..50 mm (FreiHAND), with and without alignment.
        acceleration_error_mm: mean second difference of the error [mm per squared frame] (VIBE);
            NaN without a truth.
        bone_drift_percent: standard deviation of the bones' lengths over their mean, mean over
            bones; 0 for a hand whose bones keep their lengths.
        outside_limits_percent: frames in which an angle is outside its limits; NaN without
            angles.
        joint_pa_mm: (21,) mean error of each joint after alignment.
        intervals: 95 % block bootstrap intervals of mean and std, by the name of the measure;
            where there are none it says why.
        shake: how much the hand shakes as a whole, and its fingers by themselves;
            input_shake, truth_shake: the same of the observed joints and of the truth, None
            without them.
        reprojection_px: of joints that were fitted to pictures how far they are from what was
            seen there; such joints are measured against nothing else, without a truth. Or None.
        notes: what to know when reading the numbers, one line each.
        frame_values: name -> (frames,) the values per frame that the numbers above sum up.
        material: the frames themselves; None for several sequences pooled.
    """

    name: str
    hand: str
    frames: int
    fitted: int
    predicted: int
    lost: int
    compared: int
    against: Against
    pa_mpjpe_mm: Spread
    mpjpe_mm: Spread
    jitter_m_s3: float
    acceleration_m_s2: float
    input_jitter_m_s3: float = float("nan")
    input_acceleration_m_s2: float = float("nan")
    input_pa_mpjpe_mm: Spread | None = None
    input_mpjpe_mm: Spread | None = None
    truth_jitter_m_s3: float = float("nan")
    truth_acceleration_m_s2: float = float("nan")
    lag_frames: float = float("nan")
    root_mpjpe_mm: Spread | None = None
    pa_auc: float = float("nan")
    auc: float = float("nan")
    acceleration_error_mm: float = float("nan")
    bone_drift_percent: float = float("nan")
    outside_limits_percent: float = float("nan")
    joint_pa_mm: Array = field(default_factory=lambda: np.full(len(JOINT_NAMES), np.nan))
    intervals: Mapping[str, Intervals] = field(default_factory=dict)
    shake: Shake | None = None
    input_shake: Shake | None = None
    truth_shake: Shake | None = None
    reprojection_px: Spread | None = None
    notes: tuple[str, ...] = ()
    frame_values: Mapping[str, Array] = field(default_factory=dict, repr=False)
    material: Material | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        make_read_only(self)

    @property
    def finger_pa_mm(self) -> dict[str, float]:
        """Mean error after alignment of the wrist and of each finger's four joints."""
        out = {"wrist": float(self.joint_pa_mm[0])}
        for f, finger in enumerate(FINGERS):
            out[finger] = float(nan_mean(self.joint_pa_mm[1 + 4 * f : 5 + 4 * f]))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; None for what is not known."""
        out: dict[str, Any] = {}
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if name in ("frame_values", "material"):
                continue
            if name == "joint_pa_mm":
                value = {j: or_none(float(v)) for j, v in zip(JOINT_NAMES, value, strict=True)}
            elif name == "intervals":
                value = {measure: _interval_dict(i) for measure, i in value.items()}
            elif isinstance(value, Spread | Shake):
                value = value.to_dict()
            elif isinstance(value, float):
                value = or_none(value)
            elif isinstance(value, tuple):
                value = list(value)
            out[name] = value
        out["finger_pa_mm"] = {k: or_none(v) for k, v in self.finger_pa_mm.items()}
        return out


@dataclass(frozen=True, eq=False)
class StabilityReport:
    """Stability of sequences, one by one and pooled over all their frames.

    Attributes:
        sequences: one entry each, in the order given.
        overall: all frames pooled: a long sequence counts more than a short one.
    """

    sequences: tuple[Stability, ...]
    overall: Stability

    def to_dict(self) -> dict[str, Any]:
        """{"sequences": [...], "overall": {...}} of plain JSON values."""
        return {
            "sequences": [s.to_dict() for s in self.sequences],
            "overall": self.overall.to_dict(),
        }


def _interval_dict(intervals: Intervals) -> dict[str, Any]:
    """{"mean": [low, high], "std": [low, high], "block_frames", "few"}; null: not known, and
    `few` says why."""
    out: dict[str, Any] = {
        name: [or_none(part.low), or_none(part.high)]
        for name, part in (("mean", intervals.mean), ("std", intervals.std))
    }
    return out | {"block_frames": intervals.block, "few": intervals.few}
