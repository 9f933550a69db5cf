"""The observed joints in handtrack's own MCAP recordings, for tracking them again.

Messages are decoded by the descriptors that the file itself carries, so that any version's
file can be read: `/HAND/model` (handtrack.Hand) once, `/HAND/state` (handtrack.State) per frame.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.sequences.readers.mcap_file import McapFile, Message
from handtrack.sequences.readers.raw import Array, Raw, stem

STATE = "handtrack.State"
HAND = "handtrack.Hand"


def read(file: McapFile, path: Path) -> list[Raw]:
    """One sequence per recorded hand: observed joints, confidence and truth, not the fits.

    Raises:
        InputError: no states, or a message that does not fit.
    """
    offset = _offset(file, path)
    decoders: dict[tuple[str, bytes], Callable[[bytes], Any]] = {}

    def decoded(message: Message) -> Any:
        key = (message.schema_name, message.schema)
        if key not in decoders:
            decoders[key] = _decoder(message, path)
        return decoders[key](message.data)

    models: dict[str, Any] = {}
    states: dict[str, list[tuple[int, Any]]] = {}
    for message in file.messages:
        topic = message.topic.rpartition("/")[0]
        if message.schema_name == HAND:
            models.setdefault(topic, decoded(message))
        elif message.schema_name == STATE:
            states.setdefault(topic, []).append((message.log_time + offset, decoded(message)))
    if not states:
        raise InputError(f"a handtrack recording without {STATE} messages", path)
    return [
        _sequence(topic, models.get(topic), frames, path)
        for topic, frames in sorted(states.items())
    ]


def _sequence(topic: str, model: Any, frames: list[tuple[int, Any]], path: Path) -> Raw:
    hand: Hand | None = None
    name, subject = "", ""
    if model is not None:
        label = str(getattr(model, "hand", ""))
        hand = next((h for h in HANDS if h == label), None)
        if hand is None:
            raise InputError(f"{topic}/model: hand is {label!r}, expected left or right", path)
        name = str(getattr(model, "sequence_name", ""))
        subject = str(getattr(model, "subject", ""))
    joints, confidence, truth, numbers, times = [], [], [], [], []
    for i, (time, state) in enumerate(frames):
        where = f"{topic}/state, message {i}"
        joints.append(_floats(state, "observed", 3 * N_JOINTS, where, path))
        confidence.append(_floats(state, "confidence", N_JOINTS, where, path))
        if len(getattr(state, "truth", b"")):
            truth.append(_floats(state, "truth", 3 * N_JOINTS, where, path))
        numbers.append(int(state.frame_index))
        times.append(time)
    if truth and len(truth) != len(frames):
        raise InputError(
            f"{topic}/state: {len(truth)} of {len(frames)} messages have a truth", path
        )
    if max(map(abs, times)) > np.iinfo(np.int64).max:
        raise InputError(f"{topic}/state: a time beyond 64 bits", path)
    return Raw(
        np.array(joints).reshape(-1, N_JOINTS, 3),
        path,
        name or f"{stem(path)} {topic.strip('/')}".strip(),
        hand=hand,
        unit="m",
        order="handtrack",
        time_ns=np.array(times, dtype=np.int64),
        frame_index=np.array(numbers, dtype=np.int64),
        confidence=np.array(confidence),
        truth=np.array(truth).reshape(-1, N_JOINTS, 3) if truth else None,
        subject=subject,
    )


def _floats(state: Any, name: str, n: int, where: str, path: Path) -> Array:
    """(n,) float64 of a field: packed numbers, or bytes that hold them little-endian."""
    value = getattr(state, name, ())
    if isinstance(value, bytes):
        if len(value) % 8:
            raise InputError(f"{where}: {name} is {len(value)} bytes, expected {8 * n}", path)
        numbers = np.frombuffer(value, dtype="<f8").astype(np.float64)
    else:
        numbers = np.fromiter(value, np.float64)
    if len(numbers) != n:
        raise InputError(f"{where}: {name} has {len(numbers)} numbers, expected {n}", path)
    return numbers


def _offset(file: McapFile, path: Path) -> int:
    """[ns] to add to log times, which cannot be negative in MCAP."""
    text = file.metadata.get("handtrack", {}).get("time_offset_ns", "0")
    try:
        return int(text)
    except ValueError:
        raise InputError(
            f"metadata time_offset_ns is {text[:30]!r}, expected a whole number", path
        ) from None


def _decoder(message: Message, path: Path) -> Callable[[bytes], Any]:
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.descriptor_pool import DescriptorPool
    from google.protobuf.message import DecodeError
    from google.protobuf.message_factory import GetMessageClass

    if message.encoding != "protobuf":
        raise InputError(f"{message.topic} is {message.encoding}, expected protobuf", path)
    pool = DescriptorPool()
    try:
        for file in FileDescriptorSet.FromString(message.schema).file:
            pool.Add(file)
        kind = GetMessageClass(pool.FindMessageTypeByName(message.schema_name))
    except (DecodeError, TypeError, KeyError, ValueError) as error:
        raise InputError(f"the schema of {message.topic} is damaged ({error})", path) from None

    def decode(data: bytes) -> Any:
        try:
            return kind.FromString(data)
        except DecodeError as error:
            raise InputError(f"a message of {message.topic} is damaged ({error})", path) from None

    return decode
