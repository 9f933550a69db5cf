"""What an audit finds: faults of a sequence, with the frames and joints that they are in."""

from __future__ import annotations

from collections.abc import Mapping
from collections.abc import Sequence as Items
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.evaluation.arrays import or_none
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.read_only import make_read_only

Marks = NDArray[np.bool_]

KINDS = (
    *("swapped", "other hand", "order", "unit", "time", "frozen", "jump", "joint jumps"),
    *("bone jumps", "bones breathe", "beyond limits", "hand shakes", "fingers shake", "residual"),
)
"""From what makes a sequence another's to what makes it noisy."""


@dataclass(frozen=True, eq=False)
class Finding:
    """One kind of fault in one sequence.

    Attributes:
        kind: of `KINDS`.
        text: one sentence with its number and what it should be.
        marks: (T, 21) the frames and joints it is in.
        severity: how many times as large as what is let pass; at least 1.
    """

    kind: str
    text: str
    marks: Marks
    severity: float

    def __post_init__(self) -> None:
        make_read_only(self)

    @property
    def frames(self) -> int:
        """How many frames it is in."""
        return int(self.marks.any(1).sum())


def some(names: Items[str], most: int = 4) -> str:
    """The first names, and how many more there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def merged(findings: list[Finding]) -> Finding:
    """One finding of several of one kind in one sequence."""
    if len(findings) == 1:
        return findings[0]
    marks = np.any([f.marks for f in findings], axis=0)
    text = "; ".join(f.text for f in findings)
    return Finding(findings[0].kind, text, marks, max(f.severity for f in findings))


@dataclass(frozen=True, eq=False)
class Audited:
    """What cannot be true of a sequence.

    Attributes:
        name, hand, source: of the sequence.
        time_ns, frame_index: (T,) of the sequence.
        joints: (T, 21, 3) [m] of the sequence.
        findings: the worst kinds first.
        numbers: what was measured, found wanting or not; NaN where it could not be.
    """

    name: str
    hand: str
    source: str
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    joints: NDArray[np.float64]
    findings: tuple[Finding, ...]
    numbers: Mapping[str, float]

    def __post_init__(self) -> None:
        make_read_only(self)

    @property
    def share(self) -> float:
        """Part of the frames in which something was found, 0..1."""
        marked = np.zeros(len(self.time_ns), dtype=bool)
        for finding in self.findings:
            marked |= finding.marks.any(1)
        return float(marked.mean())

    @property
    def score(self) -> float:
        """What sequences are ranked by: the kinds that were found, each by how much of the
        sequence it is in (square root, so that single frames count) and by how much it is
        beyond what is let pass (logarithm)."""
        n = max(1, len(self.time_ns))
        return float(
            sum(np.sqrt(f.frames / n) * (1 + np.log2(max(1.0, f.severity))) for f in self.findings)
        )

    def worst_frames(self, most: int = 6) -> list[int]:
        """Frames with the most joints found wanting, far from one another."""
        count = np.zeros(len(self.time_ns))
        for finding in self.findings:
            part = finding.marks.sum(1)
            # what is in most frames says nothing of one
            count += part * (2 * finding.frames <= len(self.time_ns)) * finding.severity
        chosen: list[int] = []
        for t in np.argsort(-count, kind="stable"):
            if len(chosen) == most or count[t] == 0:
                break
            if all(abs(int(t) - c) > 3 for c in chosen):
                chosen.append(int(t))
        return chosen

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values; None for what is not known."""
        return {
            "name": self.name,
            "hand": self.hand,
            "source": self.source,
            "frames": len(self.time_ns),
            "score": round(self.score, 4),
            "share": round(self.share, 4),
            "findings": [
                {
                    "kind": f.kind,
                    "text": f.text,
                    "frames": f.frames,
                    "severity": round(f.severity, 3),
                    "joints": [JOINT_NAMES[j] for j in np.flatnonzero(f.marks.any(0))],
                    "first": int(self.frame_index[np.argmax(f.marks.any(1))]),
                }
                for f in self.findings
            ],
            "numbers": {k: or_none(v) for k, v in self.numbers.items()},
            "worst_frames": [int(self.frame_index[t]) for t in self.worst_frames()],
        }


def mask_table(audits: list[Audited]) -> Any:
    """A row for every joint of every frame that something was found in.

    Returns:
        `pyarrow.Table` of sequence, source, hand, frame, time_ns, joint and reason.
    """
    import pyarrow as pa

    columns: dict[str, list[Any]] = {name: [] for name in _COLUMNS}
    for audit in audits:
        for finding in audit.findings:
            t, j = np.nonzero(finding.marks)
            columns["sequence"] += [audit.name] * len(t)
            columns["source"] += [audit.source] * len(t)
            columns["hand"] += [audit.hand] * len(t)
            columns["frame"] += audit.frame_index[t].tolist()
            columns["time_ns"] += audit.time_ns[t].tolist()
            columns["joint"] += [JOINT_NAMES[i] for i in j]
            columns["reason"] += [finding.kind] * len(t)
    whole = {"frame": pa.int64(), "time_ns": pa.int64()}
    return pa.table({k: pa.array(v, whole.get(k, pa.string())) for k, v in columns.items()})


_COLUMNS = ("sequence", "source", "hand", "frame", "time_ns", "joint", "reason")
