"""What the tests of recording share: comparing tracks, and reading a file with mcap's reader."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.model import HandModel
from handtrack.recording.read import read_mcap
from handtrack.tracking.track import Track


def differences(a: Track, b: Track) -> list[str]:
    """Names of the attributes in which two tracks differ, bit for bit."""
    out = []
    for field in dataclasses.fields(Track):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if field.name == "model":
            out += model_differences(x, y)
        elif isinstance(x, np.ndarray) and x.dtype.kind in "if":
            same = isinstance(y, np.ndarray) and x.shape == y.shape and x.dtype == y.dtype
            if not same or x.tobytes() != y.tobytes():
                out.append(field.name)
        elif isinstance(x, np.ndarray):
            if x.tolist() != y.tolist():
                out.append(field.name)
        elif x != y:
            out.append(field.name)
    return out


def model_differences(a: HandModel, b: HandModel) -> list[str]:
    out = []
    for field in dataclasses.fields(HandModel):
        x, y = getattr(a, field.name), getattr(b, field.name)
        if field.name == "limits":
            same = x.name == y.name and (x.lower == y.lower).all() and (x.upper == y.upper).all()
        elif isinstance(x, np.ndarray):
            same = x.shape == y.shape and x.dtype == y.dtype and x.tobytes() == y.tobytes()
        else:
            same = x == y
        if not same:
            out.append(f"model.{field.name}")
    return out


def first_frames(track: Track, count: int) -> Track:
    """The track's first frames, and the events up to them."""
    arrays = {
        field.name: getattr(track, field.name)[:count]
        for field in dataclasses.fields(Track)
        if isinstance(getattr(track, field.name), np.ndarray)
    }
    return dataclasses.replace(track, **arrays)


def messages(path: Path) -> dict[str, list[tuple[int, Any, bytes]]]:
    """Every topic's (log time, schema, data) by mcap's own reader, checksums checked."""
    from mcap.reader import make_reader

    out: dict[str, list[tuple[int, Any, bytes]]] = {}
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            out.setdefault(channel.topic, []).append((message.log_time, schema, message.data))
    return out


def decoder(schema: Any) -> Any:
    """A message class made only of what the file says about its schema."""
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message_factory import GetMessageClass

    pool = DescriptorPool()
    for file in FileDescriptorSet.FromString(schema.data).file:
        pool.Add(file)
    return GetMessageClass(pool.FindMessageTypeByName(schema.name))


def read_or_error(
    path: Path, start_ns: int | None = None, end_ns: int | None = None
) -> list[Track] | str:
    """What reading gives: tracks, or the text of the one error that is allowed."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)
            return read_mcap(path, start_ns=start_ns, end_ns=end_ns)
    except InputError as error:
        return str(error)


def rrd_columns(path: Path) -> dict[str, dict[str, list[Any]]]:
    """entity -> component or timeline -> its rows, static ones too; times in nanoseconds."""
    import pyarrow as pa
    from rerun.chunk import RrdReader

    out: dict[str, dict[str, list[Any]]] = {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        entity = out.setdefault(chunk.entity_path, {})
        for name in batch.schema.names:
            column = batch.column(name)
            if pa.types.is_duration(column.type) or pa.types.is_timestamp(column.type):
                column = column.cast(pa.int64())
            entity.setdefault(name, []).extend(column.to_pylist())
    return out
