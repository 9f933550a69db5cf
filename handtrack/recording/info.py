"""What a recording holds, told from its index."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import msgspec

from handtrack.errors import InputError, shown
from handtrack.mcap.hands import METADATA, Hands, check_version, listed
from handtrack.mcap.index import McapIndex, read_index
from handtrack.mcap.walk import Walk
from handtrack.recording.summary import SUMMARY, HandSummary, read_summary


def info(path: str | Path) -> dict[str, Any]:
    """What a recording holds: plain values for JSON.

    Of a complete file only the index and the summary are read, so that this takes the same
    few milliseconds whatever its size. Where they are missing (a stopped writer, format version
    1) all of it is read.

    Args:
        path: the recording, or the part of one that is being written.

    Returns:
        path, size (bytes), complete, format_version, version (of handtrack), compression, mesh,
        chunks, note (what is wrong, or ""), topics (topic -> schema, messages, bytes before
        compression) and hands (topic -> name, hand, model, limits, settings, version, frames,
        fitted, predicted, lost, events, warnings, first_ns, last_ns, fps, error_mm ("observed",
        "truth" -> mean, median, p95, max)). Bytes are None where only messages were counted.

    Raises:
        InputError: as `read_mcap`.
    """
    path = Path(path)
    index = read_index(path)
    if index is not None:
        if METADATA not in index.metadata:
            topics = listed(c.topic for c in index.channels.values())
            raise InputError(f"not a recording of handtrack, it has {topics}", path)
        check_version(index.metadata[METADATA], path)
        if SUMMARY in index.metadata:
            try:
                return _of_index(index, read_summary(index.metadata))
            except ValueError as error:
                told = f"{path}: its summary cannot be used, so all of it is read: {shown(error)}"
                warnings.warn(told, stacklevel=2)
    return _of_messages(path, index is not None)


def _of_index(index: McapIndex, summary: dict[str, Any]) -> dict[str, Any]:
    """Raises ValueError where index and summary do not go together."""
    topics = {
        channel.topic: {
            "schema": index.schemas.get(channel.schema_id, ""),
            "messages": index.counts.get(number, 0),
            "bytes": summary["bytes"].get(channel.topic),
        }
        for number, channel in index.channels.items()
    }
    hands = {}
    counts = {channel.topic: index.counts.get(n, 0) for n, channel in index.channels.items()}
    for topic, values in summary["hands"].items():
        record = index.metadata.get(f"{METADATA}/{topic}", {})
        if values["frames"] != counts.get(f"/{topic}/state", 0):
            raise ValueError(f"{shown(topic)} has {values['frames']} frames, its messages differ")
        hands[topic] = _hand(values, record)
    return _about(index.path, index.metadata[METADATA]) | {
        "complete": True,
        "compression": index.compression,
        "chunks": len(index.chunks),
        "note": "",
        "topics": topics,
        "hands": hands,
    }


def _of_messages(path: Path, indexed: bool) -> dict[str, Any]:
    """The same, from all messages of a file that has an index, or has none."""
    walk = Walk(path)
    hands = Hands(walk)
    counts: dict[int, list[int]] = {}
    for found in walk.messages(lambda channel: True):
        count = counts.setdefault(found.channel, [0, 0])
        count[0] += 1
        count[1] += len(found.data)
        hands.add(found)
    hands.check()
    values = {}
    for hand in hands.all:
        stretch = hand.take()
        head = stretch.head
        summary = HandSummary(head)
        summary.add(stretch)
        record = {"limits": head.model.limits.name, "version": head.version}
        record["settings"] = json.dumps(dict(head.settings))
        values[hand.topic.strip("/")] = _hand(summary.values(), record)
    topics = {
        channel.topic: {
            "schema": walk.schemas.get(channel.schema_id, ""),
            "messages": counts.get(number, [0, 0])[0],
            "bytes": counts.get(number, [0, 0])[1],
        }
        for number, channel in walk.channels.items()
    }
    return _about(path, walk.metadata[METADATA]) | {
        "complete": indexed,
        "compression": walk.compression or "none",
        "chunks": walk.chunks,
        "note": walk.cut or ("" if indexed else "all of its data is there, but not its index"),
        "topics": topics,
        "hands": values,
    }


def _about(path: Path, head: dict[str, str]) -> dict[str, Any]:
    return {
        "path": str(path),
        "size": path.stat().st_size,
        "format_version": head.get("format_version"),
        "version": head.get("version", ""),
        "mesh": head.get("mesh"),
    }


def _hand(values: dict[str, Any], record: dict[str, str]) -> dict[str, Any]:
    try:
        settings = msgspec.json.decode(record.get("settings", "{}"), type=dict[str, Any])
    except (msgspec.MsgspecError, RecursionError) as error:
        raise ValueError(f"the settings of {shown(values['name'])}: {error}") from error
    own = {"limits": record.get("limits", ""), "version": record.get("version", "")}
    return values | own | {"settings": settings}
