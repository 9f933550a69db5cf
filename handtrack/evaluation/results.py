"""The results of `stability`: plain dataclasses, and the JSON values they stand for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from handtrack.evaluation.arrays import Array

Against = Literal["observed", "truth"]


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
        median, p95 = np.percentile(known, [50, 95])
        return Spread(
            float(known.mean()), float(known.std()), float(median), float(p95), float(known.max())
        )

    def to_dict(self) -> dict[str, float | None]:
        """The five numbers; None for NaN."""
        return {name: _number(getattr(self, name)) for name in self.__dataclass_fields__}


@dataclass(frozen=True, eq=False)
class Stability:
    """The numbers of one sequence, or of all frames of several.

    Errors are in mm, over the frames in which something could be compared; frames that are
    lost have no error, so read the errors together with `lost`.

    Attributes:
        name, hand: of the sequence.
        frames: how many there are; fitted, predicted, lost: how many of each status.
        compared: frames that have a PA-MPJPE.
        against: "truth", or "observed": the joints that the hand was fitted to.
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
        notes: what to know when reading the numbers, one line each.
        frame_values: name -> (frames,) the values per frame that the numbers above sum up.
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
    notes: tuple[str, ...] = ()
    frame_values: Mapping[str, Array] = field(default_factory=dict, repr=False)

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; None for what is not known."""
        out: dict[str, Any] = {}
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if name == "frame_values":
                continue
            if isinstance(value, Spread):
                value = value.to_dict()
            elif isinstance(value, float):
                value = _number(value)
            elif isinstance(value, tuple):
                value = list(value)
            out[name] = value
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


def _number(value: float) -> float | None:
    return value if np.isfinite(value) else None
