"""Two runs over the same data set, compared on the clips that both have."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from handtrack.batching.data_set import Report, told
from handtrack.batching.sums import SUMS, Sure, differences, row_sums, sure
from handtrack.errors import InputError
from handtrack.evaluation.bootstrap import Uncertain


class Comparison(NamedTuple):
    """Two runs over the same clips.

    Attributes:
        names: of the two.
        reports: of each, over all that it has.
        common: (first, second) over the clips that both have.
        differences: of measures, second minus first, on those clips.
        clips, subjects: that both have.
        notes: what to know when reading it.
    """

    names: tuple[str, str]
    reports: tuple[Report, Report]
    common: tuple[Sure, Sure]
    differences: Mapping[str, Uncertain]
    clips: int
    subjects: int
    notes: list[str]

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "runs": {
                name: report.to_dict()
                for name, report in zip(self.names, self.reports, strict=True)
            },
            "common": {
                name: told(group) for name, group in zip(self.names, self.common, strict=True)
            },
            "differences": {name: value.to_dict() for name, value in self.differences.items()},
            "clips": self.clips,
            "subjects": self.subjects,
            "notes": self.notes,
        }


def compare_runs(names: tuple[str, str], reports: tuple[Report, Report]) -> Comparison:
    """Two runs, compared on the clips and hands that both have.

    Raises:
        InputError: they have none in common.
    """
    rows = []
    for report_ in reports:
        table = report_.results.table
        columns = [table[name].to_pylist() for name in ("clip", "sequence", "hand")]
        rows.append({key: i for i, key in enumerate(zip(*columns, strict=True))})
    shared = sorted(rows[0].keys() & rows[1].keys())
    if not shared:
        raise InputError(f"{names[0]} and {names[1]} have no clip in common")
    first = reports[0].results
    sums, picks = [], []
    clips = [first.clip_of_row[rows[0][key]] for key in shared]
    for report_, index in zip(reports, rows, strict=True):
        mine = np.array([index[key] for key in shared])
        whole = np.zeros((len(first.units.sums), len(SUMS)))
        np.add.at(whole, clips, row_sums(report_.results.numbers)[mine])
        sums.append(whole)
        picks.append(mine)
    some = np.zeros(len(first.units.sums), bool)
    some[clips] = True
    both = first.units._replace(sums=np.concatenate(sums, axis=1)).of(some)
    common = tuple(sure(first.units._replace(sums=whole).of(some))[0] for whole in sums)
    notes = [*first.notes]
    against = [
        set(r.results.table["against"].take(pick).to_pylist())
        for r, pick in zip(reports, picks, strict=True)
    ]
    if against[0] != against[1]:
        notes.append("the two are against different things: their errors cannot be compared")
    left = sum(r.results.table.num_rows - len(shared) for r in reports)
    if left:
        notes.append(f"{left:,} rows that only one of them has are left out of the comparison")
    return Comparison(
        names,
        reports,
        (common[0], common[1]),
        differences(both),
        int(some.sum()),
        both.subjects if both.known else 0,
        notes,
    )
