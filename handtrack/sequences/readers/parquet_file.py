"""Reader of Parquet: LeRobot's data sets, and tables with a column for each coordinate.

observation.state ...   lists of 63 numbers (21 joints x 3), of 126 (both hands), or of 21
                        lists of 3, in each row; of another length where meta/info.json names
                        its numbers as joints' coordinates
timestamp [s], frame_index, episode_index   as LeRobot has them; each episode is a sequence
wrist_x, wrist_y ...    as in CSV; `handtrack export` and `convert` write such
"""

from __future__ import annotations

import io
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.files.long_arrays import release, rows_of
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import as_side, words
from handtrack.sequences.readers import text_table
from handtrack.sequences.readers.both_hands import two_hands
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.list_columns import (
    is_flat,
    is_list,
    is_plain,
    rows_in_batches,
    rows_of_lists,
)
from handtrack.sequences.readers.long_text import DiffersError, Whole, join
from handtrack.sequences.readers.raw import NotJointsError, Raw, as_fps, stem, take_rows
from handtrack.sequences.readers.table_held import as_held
from handtrack.sequences.readers.table_rows import OBSERVED, TRUTH

if TYPE_CHECKING:
    import pyarrow

PARQUET_MAGIC = b"PAR1"
_WIDTHS = (63, 126)
_BATCH = 1 << 15
_MOST_COLUMNS = 5000
_INFO = 10_000_000


def read_parquet(path: Path) -> list[Raw]:
    """The hands of a Parquet file.

    Raises:
        NotJointsError: no column of joints.
        InputError: damaged, or columns that do not fit.
    """
    import pyarrow
    from pyarrow import parquet

    with _telling(path), parquet.ParquetFile(path) as file:
        about = file.metadata
        size = sum(about.row_group(i).total_byte_size for i in range(about.num_row_groups))
        budget.check(size, path, path.stat().st_size)
        schema = file.schema_arrow
        if not about.num_rows:
            raise InputError("a table without rows", path)
        if len(schema) > _MOST_COLUMNS:
            raise NotJointsError(f"a table of {len(schema)} columns is of no hands", path)
        lists = [f.name for f in schema if is_list(f.type)]
        if not lists:
            found = _in_batches(file, path) if about.num_rows > _BATCH else None
            if found is not None:
                return found
            table, hand = _of_export(file.read())
            raws = _read_flat(table, path)
            for raw in raws:
                raw.hand = raw.hand or hand
            return raws
        plain = [f.name for f in schema if not is_list(f.type) and is_plain(f.type, pyarrow)]
        table, arrays = file.read(columns=plain), _lists(file, lists, path)
        hand = as_side((schema.metadata or {}).get(b"hand", b"").decode("utf-8", "replace"))
    raws = _episodes(table, arrays, path)
    for raw in raws:
        raw.hand = raw.hand or hand
    return raws


def _batches(file: Any, columns: list[str] | None = None) -> Iterator[pyarrow.RecordBatch]:
    """Some rows at a time, of one group after another: asked for all it holds the whole file."""
    for group in range(file.num_row_groups):
        yield from file.iter_batches(_BATCH, row_groups=[group], columns=columns)


def _lists(file: Any, names: list[str], path: Path) -> dict[str, NDArray[np.float64] | None]:
    """(rows, numbers) of columns of lists, of a long table some rows at a time; None of lists that
    are not of one length."""
    found = None
    if file.metadata.num_rows > _BATCH:
        found = rows_in_batches(_batches(file, names), names, path)
    if found is not None:
        return {**found}
    table = file.read(columns=names)
    return {name: rows_of_lists(table, name, path) for name in names}


@contextmanager
def _telling(path: Path) -> Iterator[None]:
    """What damaged files raise, as InputError."""
    import pyarrow

    try:
        yield
    except InputError:
        raise
    except (pyarrow.ArrowException, OSError, ValueError, KeyError) as error:
        text = shown(str(error), 120)
        raise InputError(f"the Parquet file is damaged or cut short ({text})", path) from None


def _read_flat(table: pyarrow.Table, path: Path) -> list[Raw]:
    """A table of numbers and texts, as the same table in CSV is read."""
    from pyarrow import csv

    usable = [f.name for f in table.schema if is_flat(f.type)]
    held = as_held(table.select(usable), path)
    if held is not None:
        return text_table.read_made(held, path)
    text = io.BytesIO()
    csv.write_csv(table.select(usable), text, csv.WriteOptions(quoting_style="needed"))
    return text_table.read_table(text.getvalue(), path)


def _in_batches(file: Any, path: Path) -> list[Raw] | None:
    """The hands of a long table of numbers, some rows at a time; None of another."""
    import pyarrow

    kept: list[Whole] = []
    hand = None
    for batch in _batches(file):
        table, hand = _of_export(pyarrow.Table.from_batches([batch]))
        held = as_held(table.select([f.name for f in table.schema if is_flat(f.type)]), path, 1)
        try:
            if held is None:
                return None
            join(kept, text_table.read_made(held, path))
        except (InputError, DiffersError):  # the whole table says what is wrong, and where
            return None
        release()
    raws = [one.whole() for one in kept]
    for raw in raws:
        raw.hand = raw.hand or hand
    return raws


def _of_export(table: pyarrow.Table) -> tuple[pyarrow.Table, Any]:
    """What was observed, and the hand, of a table that `handtrack export` wrote; others whole."""
    about = (table.schema.metadata or {}).get(b"handtrack")
    observed = [n for n in table.column_names if n.startswith((OBSERVED, TRUTH))]
    if about is None or not observed:
        return table, as_side(
            (table.schema.metadata or {}).get(b"hand", b"").decode("utf-8", "replace")
        )
    try:
        hand = msgspec.json.decode(about, type=dict[str, Any]).get("hand")
    except msgspec.DecodeError:
        hand = None
    keep = [n for n in ("frame", "time_ns") if n in table.column_names]
    return table.select([*keep, *observed]), as_side(str(hand))


def _episodes(
    table: pyarrow.Table, arrays: dict[str, NDArray[np.float64] | None], path: Path
) -> list[Raw]:
    """The hands of each episode, in the order of the rows."""
    info = _info(path)
    joints = {n: v for n, v in arrays.items() if v is not None and v.shape[1] in _WIDTHS}
    # what a robot was told is no hand that was seen
    observed = {n: v for n, v in joints.items() if not n.startswith("action")} or joints
    named = {n: names for n, v in arrays.items() if v is not None and (names := _names(info, n, v))}
    if not observed and not named:
        what = [f"{n} ({'uneven' if v is None else v.shape[1]})" for n, v in arrays.items()]
        raise NotJointsError(
            f"no column of 63 or 21 x 3 numbers a row, lists are {', '.join(what[:6])}", path
        )
    raws: list[Raw] = []
    for rows, number in _by_episode(table, path):
        title = stem(path) if number is None else f"{_title(path)} episode {number}"
        by_name = [
            raw
            for name, names in named.items()
            if (value := arrays[name]) is not None
            for raw in _by_name(value[rows], names, table, rows, path, title, info)
        ]
        raws += by_name
        if not by_name:
            for name, values in observed.items():
                part = values if len(rows) == len(values) else rows_of(values, rows)
                part = part.reshape(len(rows), -1, 3)
                raw = Raw(part, path, title, hand=_side(name))
                raw = _timed(raw, table, rows, info)
                raws += two_hands(raw)
    if not raws:
        raise NotJointsError("no column whose numbers are named as joints", path)
    return raws


def _by_episode(table: pyarrow.Table, path: Path) -> Iterator[tuple[NDArray[np.int64], int | None]]:
    """Rows of each episode, and its number; all rows where there is none."""
    if "episode_index" not in table.column_names:
        yield np.arange(len(table)), None
        return
    episode = np.asarray(table.column("episode_index").to_numpy())
    if episode.dtype.kind not in "iu":
        raise InputError("episode_index holds something else than whole numbers", path)
    for number in dict.fromkeys(episode.tolist()):
        yield np.flatnonzero(episode == number), number


def _timed(raw: Raw, table: pyarrow.Table, rows: NDArray[np.int64], info: dict[str, Any]) -> Raw:
    """With the rows' times and frame numbers."""
    names = table.column_names
    if "timestamp" in names:
        raw.stamps = Stamps(table.column("timestamp").to_numpy()[rows], "timestamp", "s")
    elif info.get("fps"):
        raw.fps = as_fps(info["fps"], raw.path)
    if "frame_index" in names:
        frame = table.column("frame_index").to_numpy()[rows]
        if frame.dtype.kind in "iu" and (np.diff(frame.astype(np.int64)) > 0).all():
            raw.frame_index = frame.astype(np.int64)
    return raw


def _by_name(
    values: NDArray[np.float64],
    names: list[str],
    table: pyarrow.Table,
    rows: NDArray[np.int64],
    path: Path,
    title: str,
    info: dict[str, Any],
) -> list[Raw]:
    """The hands among numbers that have names, read as the columns of a table."""
    import pyarrow

    columns = {n: pyarrow.array(v, mask=~np.isfinite(v)) for n, v in zip(names, values.T)}  # noqa: B905
    try:
        raws = _read_flat(pyarrow.table(columns), path)
    except NotJointsError:  # the names of motors, or of nothing
        return []
    made = []
    for raw in raws:
        # a table leaves no row out, but may give a hand only some
        whole = raw if len(raw.joints) == len(rows) else take_rows(raw, np.arange(len(raw.joints)))
        whole.name = title
        made.append(_timed(whole, table, rows[: len(whole.joints)], info))
    return made


def _side(name: str) -> Any:
    sides = {side for word in words(name) if (side := as_side(word)) is not None}
    return next(iter(sides)) if len(sides) == 1 else None


def _title(path: Path) -> str:
    """A data set's name, where the file stands in one."""
    root = _root(path)
    return stem(path) if root is None else root.resolve().name


def _root(path: Path) -> Path | None:
    """The folder of the data set that a file belongs to."""
    return next((p for p in list(path.parents)[:4] if (p / "meta" / "info.json").is_file()), None)


def _info(path: Path) -> dict[str, Any]:
    """LeRobot's meta/info.json; nothing where there is none."""
    root = _root(path)
    if root is None:
        return {}
    file = root / "meta" / "info.json"
    try:
        return msgspec.json.decode(budget.read(file, _INFO), type=dict[str, Any])
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise InputError(f"is no JSON: {shown(str(error), 80)}", file) from None


def _names(info: dict[str, Any], column: str, values: NDArray[np.float64]) -> list[str]:
    """The names of a column's numbers; none where they are not said."""
    features = info.get("features")
    feature = features.get(column) if isinstance(features, dict) else None
    names = feature.get("names") if isinstance(feature, dict) else None
    if isinstance(names, dict):
        names = next((v for v in names.values() if isinstance(v, list)), None)
    if not isinstance(names, list) or len(names) != values.shape[1] or len(set(names)) < len(names):
        return []
    return [str(name) for name in names]


FORMATS = (
    Format(
        "LeRobot, Parquet",
        "a column of 63, 126 or 21 x 3 numbers a row (`observation.state` ...), or of more that"
        " `meta/info.json` names as joints; each episode a sequence; or the columns of a CSV table",
        "handtrack, or by name",
        "m, or as the columns say (`wrist_x_mm`)",
        "one or both",
        "file magic",
        suffixes=(".parquet",),
        ways=(Way("file", lambda head, path: head.startswith(PARQUET_MAGIC), read_parquet),),
    ),
)
