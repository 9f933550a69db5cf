"""The messages of an MCAP file to Tracks."""

from __future__ import annotations

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import HandtrackError, InputError
from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES, N_PARTS
from handtrack.recording.mcap_walk import Walk
from handtrack.recording.mcap_write import FORMAT_VERSION, METADATA
from handtrack.recording.schema import array_class
from handtrack.tracking.track import Event, Track

_OURS = ("handtrack.Hand", "handtrack.State", "handtrack.Event")
_BLOCK = 1024  # frames decoded at a time

_SHAPES: dict[str, tuple[int, ...]] = {
    "observed": (21, 3),
    "confidence": (21,),
    "truth": (21, 3),
    "angles_raw": (20,),
    "angles": (20,),
    "quaternion_raw": (4,),
    "quaternion": (4,),
    "translation_raw": (3,),
    "translation": (3,),
    "fitted_joints": (21, 3),
    "filtered_joints": (21, 3),
    "angle_variance": (20,),
}
_SCALARS: dict[str, type] = {
    "time_ns": np.int64,
    "frame_index": np.int64,
    "objective": np.float64,
    "sweeps": np.int64,
    "status": np.str_,
    "reason": np.str_,
}


def read_tracks(path: Path) -> list[Track]:
    """The Tracks of a file; see `handtrack.recording.mcap_io.read_mcap`."""
    walk = Walk(path)
    hands: dict[str, _HandReader] = {}
    for channel_id, sequence, data in walk.messages(lambda schema: schema in _OURS):
        channel = walk.channels[channel_id]
        hand = hands.setdefault(channel.topic.rpartition("/")[0], _HandReader())
        hand.add(walk.schemas[channel.schema_id], sequence, data, path)
    if METADATA not in walk.metadata and not hands:
        topics = ", ".join(sorted(c.topic for c in walk.channels.values())) or "no topics"
        about = f"; {walk.cut}" if walk.cut else ""
        raise InputError(f"not a recording of handtrack, it has {topics}{about}", path)
    if METADATA not in walk.metadata:
        raise InputError(f"the metadata record {METADATA!r} is missing", path)
    version = walk.metadata[METADATA].get("format_version")
    if version != FORMAT_VERSION:
        raise InputError(
            f"format version {version}, this handtrack reads version {FORMAT_VERSION}", path
        )
    tracks = [hand.track(topic, path) for topic, hand in hands.items()]
    if walk.cut:
        if not any(len(track) for track in tracks):
            raise InputError(f"{walk.cut}, no frame is whole", path)
        last = max(t.time_ns[-1] - t.time_ns[0] for t in tracks if len(t)) * 1e-9
        frames = max(len(track) for track in tracks)
        warnings.warn(f"{path}: {walk.cut}; read {frames} whole frames, {last:.2f} s", stacklevel=3)
    return tracks


class _HandReader:
    """Collects the messages of one hand."""

    def __init__(self) -> None:
        self._hand: Any = None
        self._blocks: dict[str, list[NDArray[Any]]] = {name: [] for name in (*_SHAPES, *_SCALARS)}
        self._waiting: list[Any] = []
        self._events: dict[int, Event] = {}
        self._count = 0

    def add(self, schema: str, sequence: int, data: bytes, path: Path) -> None:
        from google.protobuf.message import DecodeError

        try:
            message = array_class(schema).FromString(data)
        except DecodeError as error:
            raise InputError(f"a {schema} message cannot be decoded: {error}", path) from error
        if schema == "handtrack.Hand":
            self._hand = message
        elif schema == "handtrack.Event":
            self._events[sequence] = Event(message.time_ns, message.level, message.text)
        else:
            if sequence != self._count & 0xFFFFFFFF:
                raise InputError(
                    f"frame {self._count} of a hand is missing, the next one is {sequence}", path
                )
            self._count += 1
            self._waiting.append(message)
            if len(self._waiting) >= _BLOCK:
                self._decode(path)

    def _decode(self, path: Path) -> None:
        """Messages that wait, to a block of each array."""
        states, self._waiting = self._waiting, []
        for name, shape in _SHAPES.items():
            parts = [getattr(state, name) for state in states]
            size = 8 * int(np.prod(shape))
            if name == "truth" and not any(parts):
                continue
            wrong = next((len(part) for part in parts if len(part) != size), None)
            if wrong is not None:
                raise InputError(
                    f"a state's {name} has {wrong / 8:g} numbers, expected {size // 8}", path
                )
            block = np.frombuffer(b"".join(parts), "<f8").reshape(-1, *shape)
            self._blocks[name].append(block)
        for name, dtype in _SCALARS.items():
            values = [getattr(state, name) for state in states]
            self._blocks[name].append(np.array(values, dtype))

    def track(self, topic: str, path: Path) -> Track:
        if self._hand is None:
            raise InputError(f"{topic}/model is missing, nothing says what hand this is", path)
        self._decode(path)
        hand = self._hand
        names = (tuple(hand.joint_names), tuple(hand.angle_names))
        if names != (JOINT_NAMES, ANGLE_NAMES):
            raise InputError(f"{topic}: joints or angles have other names or another order", path)
        arrays: dict[str, Any] = {
            name: np.concatenate(self._blocks[name] or [np.empty((0, *shape))])
            for name, shape in _SHAPES.items()
            if name != "truth" or hand.has_truth
        }
        arrays |= {name: np.concatenate(self._blocks[name]) for name in _SCALARS}
        try:
            settings = json.loads(hand.settings)
            model = _model(hand.model)
        except (ValueError, HandtrackError) as error:
            raise InputError(f"{topic}/model: {error}", path) from error
        if any(len(array) != self._count for array in arrays.values()):
            raise InputError(f"{topic}: only some frames have a truth", path)
        if not isinstance(settings, dict):
            raise InputError(f"{topic}/model: settings are no JSON object", path)
        return Track(
            name=hand.sequence_name,
            hand=hand.hand,
            truth=arrays.pop("truth", None),
            model=model,
            settings=settings,
            version=hand.version,
            source=hand.source,
            subject=hand.subject,
            events=tuple(event for _, event in sorted(self._events.items())),
            **arrays,
        )


def _model(message: Any) -> HandModel:
    """The hand model of a file.

    Raises:
        HandtrackError: HandModel or Limits do not accept it.
        ValueError: an array doesn't divide into its rows.
    """

    def rows(name: str, *shape: int) -> NDArray[np.float64]:
        return np.frombuffer(getattr(message, name), "<f8").reshape(-1, *shape)

    limits = Limits(message.limits_name, rows("limits_lower"), rows("limits_upper"))
    faces = np.array(message.faces, np.int64).reshape(-1, 3)
    if message.licensed:
        # a skin that may not be passed on: its triangles alone name no vertices
        faces = faces[:0]
    return HandModel(
        message.name,
        message.hand,
        rows("rest_joints", 3),
        rows("axes", 3),
        limits,
        rows("rest_vertices", 3),
        faces.astype(np.int32),
        rows("weights", N_PARTS),
        thumb_twist=message.thumb_twist,
        licensed=message.licensed,
    )
