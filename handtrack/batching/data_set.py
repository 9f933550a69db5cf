"""Reports of whole data sets, from their tables."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.batching.journal import TABLE, read_table
from handtrack.batching.rows import DONE, FAILED, own_columns
from handtrack.batching.store import Store, is_remote
from handtrack.batching.sums import Sure, Units, row_sums, sure
from handtrack.errors import InputError, SettingsError

if TYPE_CHECKING:
    import pyarrow

Array = NDArray[np.float64]

_NUMERIC = (
    *("frames", "compared", "lost", "pa_mpjpe_mean_mm", "pa_mpjpe_std_mm", "jitter_m_s3"),
    *("input_jitter_m_s3", "input_pa_mpjpe_mean_mm", "residual_mm", "bound_mm"),
)
MOST_GROUPS = 200
"""Values of a column that a report tells apart."""
_UNKNOWN = "(unknown)"


def is_data_set(place: str) -> bool:
    """Whether `handtrack batch` has put its results there."""
    if is_remote(place):
        return Store(place).exists(TABLE)
    store = Store(place)
    return store.folder is not None and (store.folder / TABLE).is_file()


class Results(NamedTuple):
    """The rows of a data set that were tracked.

    Attributes:
        place: of the results.
        table: those rows.
        numbers: columns of numbers, NaN where unknown.
        units: sums by clip.
        clip_of_row: (N,) of each row the clip, 0..U-1.
        failed: (path, why) of clips that failed.
        passed: how many files held no hand joints.
        notes: what to know when reading the numbers.
    """

    place: str
    table: pyarrow.Table
    numbers: Mapping[str, Array]
    units: Units
    clip_of_row: NDArray[np.int64]
    subjects: list[str]
    failed: list[tuple[str, str]]
    passed: int
    notes: list[str]

    @staticmethod
    def read(place: str) -> Results:
        """The results of a data set.

        Raises:
            InputError: there are none, or nothing was tracked.
        """
        import pyarrow.compute as pc

        whole = read_table(Store(place))
        if whole is None:
            raise InputError(f"has no {TABLE}: no results of handtrack batch", place)
        bad = whole.filter(pc.equal(whole["state"], FAILED))
        failed = list(zip(bad["path"].to_pylist(), bad["error"].to_pylist(), strict=True))
        table = whole.filter(pc.equal(whole["state"], DONE))
        if not table.num_rows:
            raise InputError(f"nothing was tracked, {len(failed)} clips failed", place)
        numbers = {name: _numbers(table, name) for name in _NUMERIC}
        units, clip_of_row, subjects = _units(table, numbers)
        passed = whole.num_rows - len(failed) - table.num_rows
        notes = _notes(table, units)
        return Results(place, table, numbers, units, clip_of_row, subjects, failed, passed, notes)

    def column(self, name: str) -> list[str]:
        """A column's values as text.

        Raises:
            SettingsError: there is no such column.
        """
        if name not in self.table.column_names:
            own = own_columns(self.table.column_names)
            known = ", ".join(["subject", "hand", "against", "hand_from", "version", *own])
            raise SettingsError(f"--by {name}: there is no such column, but {known}")
        return [_UNKNOWN if v in (None, "") else str(v) for v in self.table[name].to_pylist()]


def _numbers(table: pyarrow.Table, name: str) -> Array:
    import pyarrow as pa

    return np.asarray(table[name].cast(pa.float64()).to_numpy(), dtype=np.float64)


def _units(
    table: pyarrow.Table, numbers: Mapping[str, Array]
) -> tuple[Units, NDArray[np.int64], list[str]]:
    clips, first, index = np.unique(
        table["clip"].to_numpy(), return_index=True, return_inverse=True
    )
    rows = row_sums(numbers)
    sums = np.zeros((len(clips), rows.shape[1]))
    np.add.at(sums, index, rows)
    named = [value or "" for value in table["subject"].to_pylist()]
    who = np.array([named[i] for i in first])
    known = bool((who != "").any())
    if not known:
        return Units(sums, np.zeros(len(clips), np.int64), 1, False), index, []
    # a clip of nobody known stands for itself
    who = np.where(who == "", np.char.add("\0", clips.astype(str)), who)
    names, subject = np.unique(who, return_inverse=True)
    return Units(sums, subject, len(names), True), index, names.tolist()


def _notes(table: pyarrow.Table, units: Units) -> list[str]:
    notes = []
    if not units.known:
        notes.append(
            "subjects are unknown: clips are taken for independent, intervals are too narrow if"
            " they are not (--subject of handtrack batch)"
        )
    elif units.subjects == 1:
        notes.append("all clips are of one subject: intervals say nothing of other people")
    against = sorted(set(table["against"].to_pylist()))
    if len(against) > 1:
        notes.append(
            f"errors are against {' and '.join(against)}, which are not the same: see --by against"
        )
    versions = sorted(set(table["version"].to_pylist()))
    if len(versions) > 1:
        notes.append(f"tracked by handtrack {' and '.join(versions)}")
    if len(set(table["settings_digest"].to_pylist())) > 1:
        notes.append("clips were tracked by different settings: run handtrack batch again")
    return notes


class Worst(NamedTuple):
    """A clip with a great error.

    Attributes:
        clip, subject, hand: which.
        value: its error [mm], or jitter where there are no errors.
        command: that shows it.
    """

    clip: str
    subject: str
    hand: str
    value: float
    command: str


class Report(NamedTuple):
    """What a data set says.

    Attributes:
        results: the rows.
        overall: all of them.
        groups: column -> value -> those; subjects first.
        worst: the clips with the greatest errors.
        worst_by: what of.
    """

    results: Results
    overall: Sure
    groups: Mapping[str, Mapping[str, Sure]]
    worst: list[Worst]
    worst_by: str

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        results = self.results
        return {
            "results": results.place,
            "overall": told(self.overall),
            "by": {
                column: {value: told(group) for value, group in groups.items()}
                for column, groups in self.groups.items()
            },
            "worst_by": self.worst_by,
            "worst": [worst._asdict() for worst in self.worst],
            "failed": [{"path": path, "error": error} for path, error in results.failed],
            "passed_over": results.passed,
            "notes": results.notes,
        }


def told(group: Sure) -> dict[str, Any]:
    """The numbers of some clips, as plain JSON values."""
    return {
        "clips": group.clips,
        "frames": group.frames,
        "subjects": group.subjects,
        **{name: value.to_dict() for name, value in group.values.items()},
    }


def report(place: str, by: Sequence[str] = (), worst: int = 10) -> Report:
    """The report of a data set.

    Args:
        place: its results, a folder or a URL.
        by: columns to report by, besides the subject.
        worst: how many of the worst clips to name.

    Raises:
        InputError: there are no results.
        SettingsError: a column is unknown, or has too many values.
    """
    results = Results.read(place)
    overall, each = sure(results.units)
    groups: dict[str, dict[str, Sure]] = {}
    if results.units.known and results.units.subjects > 1:
        names = [name for name in results.subjects if not name.startswith("\0")]
        at = {name: i for i, name in enumerate(results.subjects)}
        groups["subject"] = {name: each[at[name]] for name in names}
    for column in by:
        if column not in groups:
            groups[column] = _by(results, column)
    bad, of = _worst(results, worst)
    return Report(results, overall, groups, bad, of)


def _by(results: Results, column: str) -> dict[str, Sure]:
    values = np.array(results.column(column))
    names = np.unique(values)
    if len(names) > MOST_GROUPS:
        raise SettingsError(f"--by {column}: {len(names):,} values, expected {MOST_GROUPS} at most")
    rows = row_sums(results.numbers)
    found = {}
    for name in names.tolist():
        mine = values == name
        sums = np.zeros(results.units.sums.shape)
        np.add.at(sums, results.clip_of_row[mine], rows[mine])
        some = np.zeros(len(sums), bool)
        some[results.clip_of_row[mine]] = True
        found[name] = sure(results.units._replace(sums=sums).of(some))[0]
    return found


def _worst(results: Results, most: int) -> tuple[list[Worst], str]:
    name = "pa_mpjpe_mean_mm"
    if not np.isfinite(results.numbers[name]).any():
        name = "jitter_m_s3"
    values = results.numbers[name]
    order = np.argsort(-np.nan_to_num(values, nan=-np.inf), kind="stable")[:most]
    table = results.table.take(order)
    found = []
    for row, value in zip(table.to_pylist(), values[order].tolist(), strict=True):
        if not np.isfinite(value):
            break
        command = f"handtrack track {shlex.quote(row['path'])} --live"
        if row["recording"]:
            shown = Store(results.place).shown(row["recording"])
            command = f"handtrack replay {shlex.quote(shown)}"
        found.append(Worst(row["clip"], row["subject"] or "", row["hand"], value, command))
    return found, name
