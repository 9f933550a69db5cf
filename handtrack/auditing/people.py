"""Whose hands a data set holds, told by bone lengths: no fault, but labels may say otherwise."""

from __future__ import annotations

from collections.abc import Sequence as Many
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.auditing.findings import Audited
from handtrack.evaluation.anatomy import bone_lengths
from handtrack.evaluation.arrays import Array, nan_mean
from handtrack.sequences.skeleton_check import median

APART = 0.07
"""Hands whose bones differ by more than so much (root mean square of logarithms) are of two."""
_UNSURE = ("unit", "order", "bones breathe", "residual")
"""What was found of these says nothing of whose hand it is."""


def people(audits: Many[Audited]) -> list[dict[str, Any]]:
    """The folders in which hands of several people are, with the sequences of each.

    Returns:
        For each: `folder`, `people` (names of sequences, the largest group first) and
        `apart_percent`, by how much bones of the first two groups differ.
    """
    folders: dict[str, list[Audited]] = {}
    for a in sorted(audits, key=lambda a: a.name):
        if a.source and not any(f.kind in _UNSURE for f in a.findings):
            folders.setdefault(str(Path(a.source).parent), []).append(a)
    found = []
    for folder, members in folders.items():
        groups: list[tuple[list[str], list[Array]]] = []
        for a in members:
            bones = np.log(np.maximum(median(bone_lengths(a.joints), 0), 1e-9))
            if np.isfinite(bones).sum() < 10:
                continue
            off = [_apart(bones, np.mean(g[1], axis=0)) for g in groups]
            k = int(np.argmin(off)) if off else -1
            if k < 0 or off[k] > APART:
                groups.append(([a.name], [bones]))
            else:
                groups[k][0].append(a.name)
                groups[k][1].append(bones)
        if len(groups) > 1:
            groups.sort(key=lambda g: -len(g[0]))
            apart = _apart(np.mean(groups[0][1], axis=0), np.mean(groups[1][1], axis=0))
            found.append(
                {
                    "folder": folder,
                    "people": [g[0] for g in groups],
                    "apart_percent": round(100 * float(np.expm1(apart)), 1),
                }
            )
    return found


def _apart(a: Array, b: Array) -> float:
    return float(np.sqrt(nan_mean(np.square(a - b)[None], 1)[0]))
