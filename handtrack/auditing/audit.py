"""Rank sequences by what cannot be true of them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from handtrack.auditing.bones import bone_findings, limit_findings, shape_findings, side_findings
from handtrack.auditing.exchanges import exchange_findings
from handtrack.auditing.findings import KINDS, Audited, Finding, merged
from handtrack.auditing.motion import jump_findings, time_findings
from handtrack.auditing.notes import note_findings
from handtrack.auditing.repeats import frozen_findings
from handtrack.auditing.shakes import shake_findings
from handtrack.errors import InputError
from handtrack.sequences.identity import repair_identity
from handtrack.sequences.sequence import Sequence

_CHECKS = (
    *(
        shape_findings,
        exchange_findings,
        side_findings,
        time_findings,
        frozen_findings,
        jump_findings,
    ),
    *(shake_findings,),
    *(bone_findings, limit_findings, note_findings),
)
_RESIDUAL_MM, _RESIDUAL = 3.0, 1.5
"""A calibrated hand that leaves so much more than any hand of rigid bones does."""


def audit(sequences: Sequence | Iterable[Sequence], fit: bool = True) -> list[Audited]:
    """What cannot be true of sequences, the worst first.

    Looked for are bones that jump or breathe, another hand's fingers, bends beyond limits, the
    shake of the whole hand apart from the fingers', repeated frames, exchanged identities,
    another unit or joint order, time that jumps, and what a calibrated hand leaves unexplained
    beside what any hand of rigid bones would.

    Args:
        sequences: as `load` gives them; those with the same `source` belong together.
        fit: also calibrate a hand to each and tell its residual (some 0.2 s each).

    Raises:
        InputError: there is no sequence.
    """
    given = [sequences] if isinstance(sequences, Sequence) else list(sequences)
    if not given:
        raise InputError("no sequence to audit")
    repaired = repair_identity([replace(s, remarks=()) for s in given])
    found = [_audited(s, r, fit) for s, r in zip(given, repaired, strict=True)]
    return sorted(found, key=lambda a: -a.score)


def _audited(s: Sequence, repaired: Sequence, fit: bool) -> Audited:
    numbers: dict[str, float] = {}
    findings = [*_swapped(s, repaired)]
    for check in _CHECKS:
        findings += check(s, numbers)
    if fit:
        findings += _unexplained(s, numbers)
    findings = [merged(same) for same in _by_kind(findings)]
    return Audited(
        s.name, s.hand, s.source, s.time_ns, s.frame_index, s.joints, tuple(findings), numbers
    )


def _by_kind(findings: list[Finding]) -> list[list[Finding]]:
    by_kind = [[f for f in findings if f.kind == kind] for kind in KINDS]
    return [same for same in by_kind if same]


def _swapped(s: Sequence, repaired: Sequence) -> list[Finding]:
    """Frames that `repair_identity` takes from another sequence, or that were put back before."""
    remarks = [r for r in (*s.remarks, *repaired.remarks) if r.kind == "exchanged"]
    if not remarks:
        return []
    marks = np.zeros(s.present.shape, dtype=bool)
    for remark in remarks:
        marks |= ((s.time_ns >= remark.first_ns) & (s.time_ns <= remark.last_ns))[:, None]
    return [Finding("swapped", "; ".join(r.text for r in remarks[:3]), marks, 4.0)]


def _unexplained(s: Sequence, numbers: dict[str, float]) -> list[Finding]:
    """What the subject's own hand leaves, beside what rigid bones must."""
    from handtrack.calibration.calibrate import calibrate
    from handtrack.calibration.explain import explain
    from handtrack.hand.model import HandModel

    for name in ("residual_mm", "bound_mm"):
        numbers[name] = float("nan")
    if (s.present.sum(1) >= 12).sum() < 3:
        return []
    hand = calibrate(HandModel.default(s.hand), s).model
    explained = explain(hand, s)
    residual, bound = 1e3 * explained.fitted.mean, 1e3 * explained.bound.mean
    numbers["residual_mm"], numbers["bound_mm"] = residual, bound
    if residual - bound < _RESIDUAL_MM or residual < _RESIDUAL * bound:
        return []
    text = (
        f"the calibrated hand leaves {residual:.1f} mm, any hand of rigid bones {bound:.1f}:"
        " poses of no hand's, or joints that are not where they are named"
    )
    return [Finding("residual", text, s.present.copy(), residual / max(_RESIDUAL * bound, 1e-9))]
