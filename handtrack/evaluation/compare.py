"""Two or more methods on the frames that all of them have: paired differences in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.evaluation.arrays import Array
from handtrack.evaluation.bootstrap import Intervals, Uncertain, paired_difference
from handtrack.evaluation.frame_match import match_frames
from handtrack.evaluation.matching import same_name
from handtrack.evaluation.measure import summary
from handtrack.evaluation.results import Against, Material, Stability, StabilityReport

_SAME_REFERENCE_M = 1e-3
"""References of two methods that differ by more are not the same joints; recordings round."""

Statistic = Literal["mean", "std"]
_ASKED: tuple[tuple[str, Statistic], ...] = (
    ("pa_mpjpe_mm", "mean"),
    ("pa_mpjpe_mm", "std"),
    ("mpjpe_mm", "mean"),
    ("jitter_m_s3", "mean"),
)
_UNITS = {"pa_mpjpe_mm": "mm", "mpjpe_mm": "mm", "jitter_m_s3": "m/s³"}


@dataclass(frozen=True)
class PairedDifference:
    """One statistic of two methods on their common frames.

    Attributes:
        first, second: names of the methods.
        measure, statistic: what is compared: "pa_mpjpe_mm" and "std", say.
        values: of the first and of the second.
        of: first minus second, with its 95 % interval.
        block: frames in the bootstrap's blocks.
        against: what the errors are measured against.
        few: why there is no interval, or "".
    """

    first: str
    second: str
    measure: str
    statistic: Statistic
    values: tuple[float, float]
    of: Uncertain
    block: int
    against: Against
    few: str = ""

    @property
    def sentence(self) -> str:
        """What the difference says, better method first; whether it is clear."""
        (better, less), (worse, more), low, high, value = (
            (self.first, self.values[0]),
            (self.second, self.values[1]),
            self.of.low,
            self.of.high,
            self.of.value,
        )
        if value > 0:
            (better, less), (worse, more) = (worse, more), (better, less)
            low, high, value = -high, -low, -value
        what, label = _WORDS[self.measure, self.statistic]
        if self.against == "observed":
            what = _EXPLAINS.get((self.measure, self.statistic), what)
        unit = _UNITS[self.measure]
        # as many digits as the interval is worth, two at least
        width = high - low
        n = int(np.clip(np.ceil(1 - np.log10(width)), 2, 4)) if 0 < width < np.inf else 2
        numbers = f"{label} {less:.{n}f} vs {more:.{n}f} {unit}, difference {value:.{n}f}"
        if not np.isfinite(low):
            why = f" ({self.few})" if self.few else ""
            return f"Too few frames to tell {better} from {worse}: {numbers}{why}"
        numbers += f" [{low:.{n}f}, {high:.{n}f}]"
        if self.of.clear:
            return f"{better} {what} {worse}: {numbers}"
        return f"No clear difference between {better} and {worse}: {numbers}"

    @property
    def verdict(self) -> bool:
        """Whether one is better for sure: that a residual varies less is no merit."""
        residual = self.against == "observed" and self.statistic == "std"
        return self.of.clear and not residual

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "first": self.first,
            "second": self.second,
            "measure": self.measure,
            "statistic": self.statistic,
            "values": list(self.values),
            "difference": self.of.to_dict(),
            "clear": self.of.clear,
            "block_frames": self.block,
            "few": self.few,
            "sentence": self.sentence,
        }


_WORDS: dict[tuple[str, Statistic], tuple[str, str]] = {
    ("pa_mpjpe_mm", "mean"): ("is more accurate than", "PA-MPJPE"),
    ("pa_mpjpe_mm", "std"): ("is steadier than", "std"),
    ("mpjpe_mm", "mean"): ("is nearer to the truth than", "MPJPE"),
    ("jitter_m_s3", "mean"): ("jitters less than", "jitter"),
}
_EXPLAINS: dict[tuple[str, Statistic], str] = {
    ("pa_mpjpe_mm", "mean"): "explains the observed joints better than",
    ("mpjpe_mm", "mean"): "keeps nearer to the observed joints than",
    # steady is who jitters less, or whose error to a truth varies less
    ("pa_mpjpe_mm", "std"): "leaves a residual that varies less than",
}


@dataclass(frozen=True)
class Comparison:
    """Methods beside each other.

    Attributes:
        methods: name -> its report, on all frames it has; the first is what the others are
            compared with.
        common: name -> its numbers on the frames that all have, pooled.
        differences: of the first to each other method.
        notes: what could not be compared, one line each.
    """

    methods: Mapping[str, StabilityReport]
    common: Mapping[str, Stability]
    differences: tuple[PairedDifference, ...]
    notes: tuple[str, ...] = ()

    @property
    def frames(self) -> int:
        """How many frames all methods have."""
        return next(iter(self.common.values())).frames

    def to_dict(self) -> dict[str, Any]:
        """{"methods": {name: report}, "common": {name: numbers}, "differences": [...]}."""
        return {
            "methods": {name: report.to_dict() for name, report in self.methods.items()},
            "common": {name: row.to_dict() for name, row in self.common.items()},
            "differences": [d.to_dict() for d in self.differences],
            "notes": list(self.notes),
        }


def compare(methods: Mapping[str, StabilityReport]) -> Comparison:
    """Compare methods that were measured against the same joints.

    Sequences belong together by name and hand (or because each method has only one), their
    frames by number or by time; what a method has lost is left out for all.

    Args:
        methods: name -> report, two or more.

    Raises:
        InputError: fewer than two methods, nothing in common, or methods that were measured
            against different things.
    """
    if len(methods) < 2:
        raise InputError("only one method, expected two or more to compare")
    names = list(methods)
    kinds = {name: methods[name].overall.against for name in names}
    if len(set(kinds.values())) > 1:
        said = ", ".join(f"{name} against {kind}" for name, kind in kinds.items())
        raise InputError(f"methods are measured against different things: {said}; give --truth")
    groups, notes = _groups(methods)
    parts: dict[str, list[_Part]] = {name: [] for name in names}
    for group in groups:
        for name, part in zip(names, _common(group, names), strict=True):
            parts[name].append(part)
    common = {
        name: _pooled(name, parts[name], methods[name].overall.against, groups) for name in names
    }
    if not common[names[0]].frames:
        raise InputError(f"{', '.join(names)} have no frame in common")
    differences = [
        _difference(names[0], other, common, measure, statistic)
        for other in names[1:]
        for measure, statistic in _ASKED
        if not np.isnan(common[other].frame_values[measure]).all()
        and not (kinds[other] == "nothing" and measure != "jitter_m_s3")
    ]
    return Comparison(methods, common, tuple(differences), tuple(notes))


def _difference(
    first: str,
    second: str,
    common: Mapping[str, Stability],
    measure: str,
    statistic: Statistic,
) -> PairedDifference:
    a, b = (common[name].frame_values[measure] for name in (first, second))
    found: Intervals = paired_difference(a, b)
    of = found.mean if statistic == "mean" else found.std
    both = ~(np.isnan(a) | np.isnan(b))

    def value(x: Array) -> float:
        return float(x[both].mean() if statistic == "mean" else x[both].std())

    against = common[first].against
    return PairedDifference(
        first, second, measure, statistic, (value(a), value(b)), of, found.block, against, found.few
    )


@dataclass(frozen=True)
class _Part:
    """One method's frames of one sequence, those that all methods have."""

    row: Stability
    material: Material
    keep: NDArray[np.int64]


def _groups(methods: Mapping[str, StabilityReport]) -> tuple[list[list[Stability]], list[str]]:
    """The sequences that all methods have, each as one row per method."""
    names = list(methods)
    notes: list[str] = []
    single = all(len(report.sequences) == 1 for report in methods.values())
    groups: list[list[Stability]] = []
    for row in methods[names[0]].sequences:
        group = [row]
        for name in names[1:]:
            others = methods[name].sequences
            fitting = [
                r for r in others if r.hand == row.hand and (single or same_name(r.name, row.name))
            ]
            if len(fitting) == 1:
                group.append(fitting[0])
            elif single:
                raise InputError(f"{names[0]} has a {row.hand} hand, {name} a {others[0].hand} one")
            else:
                notes.append(
                    f"{row.name} ({row.hand}) is left out: {name} has {len(fitting)} of that name"
                )
                break
        else:
            groups.append(group)
    if not groups:
        raise InputError(f"{', '.join(names)} have no sequence in common: {'; '.join(notes[:3])}")
    used = {id(row) for group in groups for row in group}
    notes += [
        f"{row.name} ({row.hand}) is only in {name}"
        for name in names[1:]
        for row in methods[name].sequences
        if id(row) not in used
    ]
    return groups, notes


def _common(group: list[Stability], names: list[str]) -> list[_Part]:
    materials = [_material(row) for row in group]
    picks: list[NDArray[np.int64]] = [np.arange(len(materials[0]))]
    for name, other in zip(names[1:], materials[1:], strict=True):
        try:
            i, j, _ = match_frames(materials[0], other)
        except InputError as problem:
            raise InputError(f"{names[0]} and {name}, {group[0].name}: {problem}") from None
        place = np.full(len(materials[0]), -1)
        place[i] = j
        picks.append(place)
    together = np.all([p >= 0 for p in picks], axis=0)
    for p, row in zip(picks, group, strict=True):
        measure = "jitter_m_s3" if row.against == "nothing" else "pa_mpjpe_mm"
        together &= ~np.isnan(row.frame_values[measure][p])
    keep = [p[together] for p in picks]
    first = materials[0].reference[keep[0]]
    for name, material, k in zip(names[1:], materials[1:], keep[1:], strict=True):
        apart = np.abs(material.reference[k] - first)
        if (np.nan_to_num(apart) > _SAME_REFERENCE_M).any():
            raise InputError(
                f"{names[0]} and {name}, {group[0].name}: measured against different joints,"
                f" up to {1e3 * np.nanmax(apart):.0f} mm apart; give --truth"
            )
    return [_Part(row, m, k) for row, m, k in zip(group, materials, keep, strict=True)]


def _material(row: Stability) -> Material:
    if row.material is None:
        raise InputError(f"{row.name}: its frames are not there any more")
    return row.material


def _pooled(
    name: str, parts: list[_Part], against: Against, groups: list[list[Stability]]
) -> Stability:
    shared = set.intersection(*(set(p.row.frame_values) for p in parts))
    values = {
        key: np.concatenate([p.row.frame_values[key][p.keep] for p in parts])
        for key in parts[0].row.frame_values
        if key in shared
    }
    aligned = np.concatenate([p.material.joint_errors_mm[p.keep] for p in parts])
    plain = np.concatenate(
        [
            1e3
            * np.linalg.norm(p.material.estimate[p.keep] - p.material.reference[p.keep], axis=-1)
            for p in parts
        ]
    )
    hands = {group[0].hand for group in groups}
    return summary(
        name,
        hands.pop() if len(hands) == 1 else "both",
        (len(aligned), 0, 0),
        against,
        values,
        joint_errors=(aligned, plain),
    )
