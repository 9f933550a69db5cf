"""The table of a data set, and the journal that its rows come from.

Workers write rows into files of their own, which appear whole. At the end of a run, and at the
start of one after a run that was killed, they are put into the table, which then takes the place
of the one before; only then the files go. So a row is in at least one of the two at any time.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from handtrack.batching.rows import SAME, Row, own_columns, schema, table_of
from handtrack.batching.store import Store, StoreError
from handtrack.batching.work import JOURNAL
from handtrack.errors import InputError

if TYPE_CHECKING:
    import pyarrow

TABLE = "clips.parquet"
"""The name of the table among the results."""
_AT_ONCE = 20_000
"""Rows that are text at the same time."""


class Earlier(NamedTuple):
    """What the table says of a clip.

    Attributes:
        task: digest of the settings and the hands that it was tracked by.
        stamp: of the clip's files.
        content: digest of what was in them.
        state, kind: what came of it; see `handtrack.batching.rows`.
        files: what was written of it.
    """

    task: str
    stamp: str
    content: str
    state: str
    kind: str
    files: tuple[str, ...]


def read_table(store: Store) -> pyarrow.Table | None:
    """The table of a data set, None if there is none yet.

    Raises:
        InputError: it cannot be read.
    """
    import pyarrow as pa
    from pyarrow import parquet

    try:
        data = store.read(TABLE)
    except (FileNotFoundError, NotADirectoryError):
        return None
    try:
        return parquet.read_table(pa.BufferReader(data))
    except (pa.ArrowInvalid, OSError) as error:
        raise InputError(f"is no table of a data set: {error}", store.shown(TABLE)) from error


def write_table(store: Store, table: pyarrow.Table) -> None:
    """Put the table in the place of the one before.

    Raises:
        StoreError: it cannot be written.
    """
    import pyarrow as pa
    from pyarrow import parquet

    sink = pa.BufferOutputStream()
    parquet.write_table(table, sink, compression="zstd")
    store.write(TABLE, sink.getvalue().to_pybytes())


def compact(store: Store) -> pyarrow.Table | None:
    """Put the rows of the journal into the table.

    Returns:
        The table; None where nothing has been tracked yet.

    Raises:
        StoreError: it cannot be written; the journal stays.
    """
    files = store.names(JOURNAL)
    before = read_table(store)
    if not files:
        return before
    new, same = _journal(store, files)
    table = _merged(before, new)
    if same:
        table = _restamped(table, same)
    write_table(store, table)
    for name in files:
        store.remove(name)
    if before is not None:
        kept = set(_outputs(table))
        for name in set(_outputs(before)) - kept:
            store.remove(name)
    return table


def _journal(store: Store, files: list[str]) -> tuple[list[pyarrow.Table], dict[str, str]]:
    """The journal's rows as tables, and new stamps by clip."""
    tables: list[pyarrow.Table] = []
    rows: list[Row] = []
    same: dict[str, str] = {}
    for name in files:
        try:
            lines = store.read(name).decode().splitlines()
        except FileNotFoundError:
            continue
        for row in map(json.loads, lines):
            if row["state"] == SAME:
                same[row["clip"]] = row["input_stamp"]
            else:
                rows.append(row)
        if len(rows) > _AT_ONCE:
            tables.append(table_of(rows))
            rows = []
    return [*tables, table_of(rows)] if rows else tables, same


def _merged(before: pyarrow.Table | None, new: list[pyarrow.Table]) -> pyarrow.Table:
    """One table in which each clip has the rows of the last time that it was tracked."""
    import pyarrow as pa

    tables = [*([] if before is None else [before]), *new]
    own = sorted({name for table in tables for name in own_columns(table.column_names)})
    wanted = schema(own)
    whole = pa.concat_tables(tables, promote_options="permissive")
    whole = whole.select(wanted.names).cast(wanted) if whole.num_rows else wanted.empty_table()
    _, index = np.unique(whole["clip"].to_numpy(zero_copy_only=False), return_inverse=True)
    finished = np.nan_to_num(whole["finished"].to_numpy(zero_copy_only=False))
    last = np.zeros(len(index))
    np.maximum.at(last, index, finished)
    whole = whole.filter(pa.array(finished == last[index]))
    return whole.sort_by([(name, "ascending") for name in ("clip", "sequence", "hand")])


def _restamped(table: pyarrow.Table, same: dict[str, str]) -> pyarrow.Table:
    import pyarrow as pa

    clips, stamps = table["clip"].to_pylist(), table["input_stamp"].to_pylist()
    made = [same.get(clip, stamp) for clip, stamp in zip(clips, stamps, strict=True)]
    at = table.schema.get_field_index("input_stamp")
    return table.set_column(at, "input_stamp", pa.array(made, pa.string()))


def _outputs(table: pyarrow.Table) -> Iterable[str]:
    for name in ("recording", "frames_file", "exports"):
        for value in table[name].to_pylist():
            yield from (value or "").split(" ") if name == "exports" else [value or ""]


def earlier(table: pyarrow.Table | None) -> dict[str, Earlier]:
    """What the table says of each clip, by name."""
    if table is None:
        return {}
    names = ("clip", "task_digest", "input_stamp", "input_digest", "state", "error_kind")
    columns: list[list[Any]] = [table[name].to_pylist() for name in names]
    columns.append(table["recording"].to_pylist())
    columns.append(table["frames_file"].to_pylist())
    found: dict[str, Earlier] = {}
    for clip, task, stamp, content, state, kind, recording, frames in zip(*columns, strict=True):
        files = tuple(filter(None, (recording, frames)))
        if clip in found:
            files += found[clip].files
        found[clip] = Earlier(task, stamp, content, state, kind, files)
    return found


def compacted_as_far_as_possible(store: Store) -> None:
    """`compact` when something else has gone wrong already, which is what is to be told."""
    with suppress(StoreError, InputError):
        compact(store)
