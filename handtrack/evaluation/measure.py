"""One estimate beside its reference: every number of `Stability`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.evaluation import anatomy, metrics
from handtrack.evaluation.alignment import joint_errors_mm
from handtrack.evaluation.arrays import Array, mean_of_frames, nan_mean
from handtrack.evaluation.bootstrap import Intervals, intervals
from handtrack.evaluation.matching import size_ratio
from handtrack.evaluation.results import Against, Material, Spread, Stability
from handtrack.evaluation.shake import Shake, shake_values
from handtrack.files.long_arrays import blocks, by_blocks, release
from handtrack.hand.limits import Limits
from handtrack.hand.skeleton import Hand
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.settings import reprojection_px
from handtrack.tracking.track import Track

BOOTSTRAPPED = ("pa_mpjpe_mm", "mpjpe_mm", "jitter_m_s3")
"""Measures that get intervals."""
_FAR_MM = 150.0
"""An error of so much, more than a hand's length, is not one of the hand's pose."""
_SIZE = 0.1
"""Hands whose sizes differ by more are worth a note: alignment takes the difference out."""
_LATE = 0.5
"""A lag of so many frames is worth a note."""
_LAG_FRAMES = 2000
"""Frames that are enough to find a lag."""
_RANGE_MM = (0.0, 50.0)
_SHAKE = "shake_"


@dataclass(frozen=True, eq=False)
class Estimate:
    """Joints to be judged, from a track or from anywhere else.

    Attributes:
        name, hand: for tables.
        time_ns, frame_index: (T,) int64.
        joints: (T, 21, 3) [m], NaN = missing.
        counts: frames fitted, predicted, lost.
        observed: (T, 21, 3) what the joints were made from, or None.
        truth: (T, 21, 3) that came with them, or None.
        angles: (T, 20) [rad] or None, with the limits they should keep.
        timed, numbered: whether times and numbers are the source's (as in `Sequence`).
        settings: of the track.
    """

    name: str
    hand: Hand
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    joints: Array
    counts: tuple[int, int, int]
    observed: Array | None = None
    truth: Array | None = None
    angles: Array | None = None
    limits: Limits | None = None
    timed: bool = True
    numbered: bool = True
    settings: Mapping[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.time_ns)

    @staticmethod
    def of_track(track: Track) -> Estimate:
        """The filtered output of a track, where anything was seen of it."""
        fitted, predicted, lost = (
            int((track.status == status).sum()) for status in ("fitted", "predicted", "lost")
        )
        return Estimate(
            track.name,
            track.hand,
            track.time_ns,
            track.frame_index,
            _only(track.filtered_joints, track.measured_joints),
            (fitted, predicted, lost),
            _used(track),
            _known(track.truth),
            track.angles,
            track.model.limits,
            track.timed,
            track.numbered,
            track.settings,
        )

    @staticmethod
    def of_sequence(sequence: Sequence) -> Estimate:
        """The joints of a sequence, as they are; frames without any count as lost."""
        seen = int(sequence.present.any(1).sum())
        return Estimate(
            sequence.name,
            sequence.hand,
            sequence.time_ns,
            sequence.frame_index,
            sequence.joints,
            (seen, 0, len(sequence) - seen),
            truth=_known(sequence.truth),
            timed=sequence.timed,
            numbered=sequence.numbered,
        )


def reprojection_spread(settings: Mapping[str, Any]) -> Spread | None:
    """Of a hand that was fitted to the pictures of cameras: how far it is from them [px]."""
    pixels = reprojection_px(settings)
    if pixels is None:
        return None
    values = {n: v for n, v in pixels.items() if isinstance(v, int | float)}
    return Spread(*(float(values.get(n, np.nan)) for n in Spread.__dataclass_fields__))


def _only(joints: Array, measured: NDArray[np.bool_]) -> Array:
    """The joints that are measured, NaN for the others."""
    if measured.all():
        return joints
    return by_blocks(lambda x: np.where(measured[:, None], x, np.nan), joints)


def _known(truth: Array | None) -> Array | None:
    return None if truth is None or np.isnan(truth).all() else truth


def measure(
    estimate: Estimate, reference: Array | None, against: Against, notes: Iterable[str] = ()
) -> Stability:
    """The numbers of an estimate.

    Args:
        estimate: what is judged.
        reference: (T, 21, 3) [m] what it is judged by, None for "nothing".
        against: what the reference is.
        notes: to be kept with the result.
    """
    time_ns, joints = estimate.time_ns, estimate.joints
    bare = np.broadcast_to(np.nan, joints.shape) if reference is None else reference
    aligned, plain, rooted = joint_errors_mm(joints, bare)
    values = {
        "pa_mpjpe_mm": by_blocks(nan_mean, aligned),
        "mpjpe_mm": by_blocks(nan_mean, plain),
        "root_mpjpe_mm": by_blocks(nan_mean, rooted),
        "jitter_m_s3": metrics.jitter(joints, time_ns=time_ns),
        "acceleration_m_s2": metrics.acceleration(joints, time_ns=time_ns),
        **shake_values(joints, time_ns, _SHAKE),
    }
    observed = estimate.observed
    if observed is not None:
        values["input_jitter_m_s3"] = metrics.jitter(observed, time_ns=time_ns)
        values["input_acceleration_m_s2"] = metrics.acceleration(observed, time_ns=time_ns)
        values |= shake_values(observed, time_ns, f"input_{_SHAKE}")
    late = float("nan")
    if against == "truth":
        values["truth_jitter_m_s3"] = metrics.jitter(bare, time_ns=time_ns)
        values["truth_acceleration_m_s2"] = metrics.acceleration(bare, time_ns=time_ns)
        values |= shake_values(bare, time_ns, f"truth_{_SHAKE}")
        values["acceleration_error_mm"] = 1e3 * metrics.acceleration_error(joints, bare, time_ns)
        if observed is not None:
            values["input_pa_mpjpe_mm"] = metrics.pa_mpjpe(observed, bare) * 1e3
            values["input_mpjpe_mm"] = metrics.mpjpe(observed, bare) * 1e3
        part = slice(0, _LAG_FRAMES)
        late = metrics.lag(joints[part], bare[part], time_ns=time_ns[part])
        ratio = size_ratio(joints[part], bare[part])
        if abs(ratio - 1) > _SIZE:
            notes = [*notes, f"the truth's hand is {ratio:.2f} times as large as the output's"]
        apart = Spread.of(values["mpjpe_mm"]).median
        if apart > _FAR_MM:
            notes = [*notes, f"the output is {apart:.0f} mm from the truth: another world frame?"]
        if abs(late) >= _LATE:
            notes = [
                *notes,
                f"the output is {abs(late):.1f} frames {'late' if late > 0 else 'early'}",
            ]
    outside = float("nan")
    if estimate.angles is not None and estimate.limits is not None:
        outside = 100 * anatomy.share_outside(estimate.angles, estimate.limits)
    drift = anatomy.bone_length_drift(joints)
    found = summary(
        estimate.name,
        estimate.hand,
        estimate.counts,
        against,
        values,
        joint_errors=(aligned, plain),
        lag=late,
        drift=100 * float(nan_mean(drift)),
        outside=outside,
        notes=tuple(notes),
        material=Material(
            time_ns,
            estimate.frame_index,
            joints,
            bare,
            aligned,
            estimate.angles,
            estimate.limits,
            estimate.timed,
            estimate.numbered,
            estimate.settings,
        ),
    )
    return replace(found, reprojection_px=reprojection_spread(estimate.settings))


def summary(
    name: str,
    hand: str,
    counts: tuple[int, int, int],
    against: Against,
    values: Mapping[str, Array],
    joint_errors: tuple[Array, Array],
    lag: float = float("nan"),
    drift: float = float("nan"),
    outside: float = float("nan"),
    notes: tuple[str, ...] = (),
    material: Material | None = None,
) -> Stability:
    """A `Stability` from values per frame.

    Args:
        values: name -> (T,).
        joint_errors: (T, 21) with and without alignment [mm].
        counts: frames fitted, predicted, lost.
        lag, drift, outside, notes, material: as they stand in `Stability`.
    """

    def mean(key: str) -> float:
        return float(mean_of_frames(values[key])) if key in values else float("nan")

    def spread(key: str) -> Spread | None:
        found = Spread.of(values[key]) if key in values else None
        release()
        return found

    def shake(prefix: str) -> Shake | None:
        known = any(key.startswith(prefix) for key in values)
        return Shake.of(values, prefix) if known else None

    aligned, plain = joint_errors
    return Stability(
        name=name,
        hand=hand,
        frames=sum(counts),
        fitted=counts[0],
        predicted=counts[1],
        lost=counts[2],
        compared=int((~np.isnan(values["pa_mpjpe_mm"])).sum()),
        against=against,
        pa_mpjpe_mm=Spread.of(values["pa_mpjpe_mm"]),
        mpjpe_mm=Spread.of(values["mpjpe_mm"]),
        jitter_m_s3=mean("jitter_m_s3"),
        acceleration_m_s2=mean("acceleration_m_s2"),
        input_jitter_m_s3=mean("input_jitter_m_s3"),
        input_acceleration_m_s2=mean("input_acceleration_m_s2"),
        input_pa_mpjpe_mm=spread("input_pa_mpjpe_mm"),
        input_mpjpe_mm=spread("input_mpjpe_mm"),
        truth_jitter_m_s3=mean("truth_jitter_m_s3"),
        truth_acceleration_m_s2=mean("truth_acceleration_m_s2"),
        lag_frames=lag,
        root_mpjpe_mm=spread("root_mpjpe_mm"),
        pa_auc=metrics.auc_of_errors(aligned, *_RANGE_MM),
        auc=metrics.auc_of_errors(plain, *_RANGE_MM),
        acceleration_error_mm=mean("acceleration_error_mm"),
        bone_drift_percent=drift,
        outside_limits_percent=outside,
        joint_pa_mm=mean_of_frames(aligned),
        intervals=_intervals(values),
        shake=shake(_SHAKE),
        input_shake=shake(f"input_{_SHAKE}"),
        truth_shake=shake(f"truth_{_SHAKE}"),
        notes=notes,
        frame_values=values,
        material=material,
    )


def pool(rows: list[Stability], note: str = "", name: str = "overall") -> Stability:
    """All frames of the rows as one; the rows must be against the same thing."""
    if len(rows) == 1:
        return replace(rows[0], name=name, notes=(note,) if note else ())
    shared = set.intersection(*(set(r.frame_values) for r in rows))
    values = {
        key: np.concatenate([r.frame_values[key] for r in rows])
        for key in rows[0].frame_values
        if key in shared
    }
    hands = {r.hand for r in rows}
    materials = [r.material for r in rows if r.material is not None]
    weights = [r.frames for r in rows]
    return summary(
        name,
        hands.pop() if len(hands) == 1 else "both",
        (
            sum(r.fitted for r in rows),
            sum(r.predicted for r in rows),
            sum(r.lost for r in rows),
        ),
        rows[0].against,
        values,
        joint_errors=(
            np.concatenate([m.joint_errors_mm for m in materials]),
            np.concatenate([metrics.errors(m.estimate, m.reference) * 1e3 for m in materials]),
        ),
        lag=float(nan_mean(np.array([r.lag_frames for r in rows]))),
        drift=_weighted([r.bone_drift_percent for r in rows], weights),
        outside=_weighted([r.outside_limits_percent for r in rows], weights),
        notes=(note,) if note else (),
    )


def _weighted(values: list[float], weights: list[int]) -> float:
    known = [(v, w) for v, w in zip(values, weights, strict=True) if np.isfinite(v)]
    total = sum(w for _, w in known)
    return sum(v * w for v, w in known) / total if total else float("nan")


def _intervals(values: Mapping[str, Array]) -> dict[str, Intervals]:
    found = {}
    for key in BOOTSTRAPPED:
        if key in values and not np.isnan(values[key]).all():
            found[key] = intervals(values[key])
            release()
    return found


def _used(track: Track) -> Array:
    """The joints observed; what the fit was told to ignore counts for nothing."""
    seen, weights = track.observed, track.confidence
    if any(
        (~np.isnan(seen[part, :, 0]) & ~(weights[part] > 0)).any() for part in blocks(len(seen))
    ):
        return by_blocks(lambda x, w: np.where(w[..., None] > 0, x, np.nan), seen, weights)
    return seen
