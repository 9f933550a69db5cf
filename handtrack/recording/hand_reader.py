"""The messages of one hand to Tracks."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import HandtrackError, InputError, shown
from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES, N_PARTS
from handtrack.mcap.schema import array_class
from handtrack.mcap.state_fields import ARRAYS
from handtrack.tracking.track import Event, Skin, Track

OURS = ("handtrack.Hand", "handtrack.State", "handtrack.Event")
VERSIONS = (1, 2)
"""Format versions that can be read: all that were ever written."""

_BLOCK = 1024  # frames decoded at a time

_SCALARS: dict[str, type] = {
    "time_ns": np.int64,
    "frame_index": np.int64,
    "objective": np.float64,
    "sweeps": np.int64,
    "status": np.str_,
    "reason": np.str_,
}


class HandReader:
    """Collects the messages of one hand.

    Args:
        topic: of the hand, such as "/right".
        path: of the file, for errors.
        first: number of the first frame that is wanted; None for whichever comes first.
    """

    def __init__(self, topic: str, path: Path, first: int | None = 0) -> None:
        self.topic, self._path = topic, path
        self.first = first
        self.frames = first or 0
        """Number of the next frame."""
        self._hand: Any = None
        self._model: HandModel | None = None
        self._events: dict[int, Event] = {}
        self._waiting: list[Any] = []
        self._clear()

    def _clear(self) -> None:
        names = (*(field.name for field in ARRAYS), *_SCALARS)
        self._blocks: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
        self.here = 0
        """Frames since the last `take`."""

    def add(self, schema: str, sequence: int, data: bytes) -> None:
        """The next message.

        Raises:
            InputError: it does not fit, or one is missing before it.
        """
        from google.protobuf.message import DecodeError

        try:
            message = array_class(schema).FromString(data)
        except DecodeError as error:
            raise self._wrong(f"a {schema} message cannot be decoded: {error}") from error
        if schema == "handtrack.Hand":
            self._hand = message
        elif schema == "handtrack.Event":
            event = Event(message.time_ns, message.level, message.text)
            if self._events.setdefault(sequence, event) != event:
                raise self._wrong(f"{self.topic}: there are two events {sequence}")
        else:
            if self.first is None:
                self.first = self.frames = sequence
            if sequence != self.frames & 0xFFFFFFFF:
                raise self._wrong(
                    f"frame {self.frames} of a hand is missing, the next one is {sequence}"
                )
            self.frames += 1
            self.here += 1
            self._waiting.append(message)
            if len(self._waiting) >= _BLOCK:
                self._decode()

    def _wrong(self, message: str) -> InputError:
        return InputError(message, self._path)

    def _decode(self) -> None:
        """Messages that wait, to a block of each array."""
        states, self._waiting = self._waiting, []
        for field in ARRAYS:
            parts = [getattr(state, field.name) for state in states]
            size = 8 * field.size
            if field.name == "truth" and not any(parts):
                continue
            if field.since > VERSIONS[0] and not any(parts):
                # an older file
                parts = [np.full(field.size, field.before).tobytes()] * len(states)
            wrong = next((len(part) for part in parts if len(part) != size), None)
            if wrong is not None:
                raise self._wrong(
                    f"a state's {field.name} has {wrong / 8:g} numbers, expected {field.size}"
                )
            block = np.frombuffer(b"".join(parts), "<f8").reshape(-1, *field.shape)
            self._blocks[field.name].append(block)
        for name, dtype in _SCALARS.items():
            values = [getattr(state, name) for state in states]
            self._blocks[name].append(np.array(values, dtype))

    def take(self, skin: Skin | None = None) -> Track:
        """The frames and events read since the last call, as a Track.

        Args:
            skin: of all frames, where the model has none that may be stored.

        Raises:
            InputError: the file does not say what hand this is, or something does not fit.
        """
        if self._hand is None:
            raise self._wrong(f"{self.topic}/model is missing, nothing says what hand this is")
        self._decode()
        hand, topic, path = self._hand, self.topic, self._path
        names = (tuple(hand.joint_names), tuple(hand.angle_names))
        if names != (JOINT_NAMES, ANGLE_NAMES):
            raise self._wrong(f"{topic}: joints or angles have other names or another order")
        arrays: dict[str, Any] = {
            field.name: np.concatenate(self._blocks[field.name] or [np.empty((0, *field.shape))])
            for field in ARRAYS
            if field.name != "truth" or hand.has_truth
        }
        arrays |= {name: np.concatenate(self._blocks[name]) for name in _SCALARS}
        try:
            settings = json.loads(hand.settings)
            self._model = self._model or _model(hand.model)
        except (ValueError, RecursionError, HandtrackError) as error:
            raise InputError(f"{shown(topic)}/model: {error}", path) from error
        if hand.hand != self._model.hand:
            raise self._wrong(
                f"{topic}/model: a {shown(hand.hand)} hand with a {self._model.hand} hand's model"
            )
        if any(len(array) != self.here for array in arrays.values()):
            raise self._wrong(f"{topic}: only some frames have a truth")
        if not isinstance(settings, dict):
            raise self._wrong(f"{topic}/model: settings are no JSON object")
        events = tuple(event for _, event in sorted(self._events.items()))
        self._events = {}
        self._clear()
        return Track(
            name=hand.sequence_name,
            hand=hand.hand,
            truth=arrays.pop("truth", None),
            model=self._model,
            settings=settings,
            version=hand.version,
            source=hand.source,
            subject=hand.subject,
            events=events,
            skin=skin,
            **arrays,
        )

    @property
    def licensed(self) -> bool:
        """Whether the model's own skin may not be stored."""
        return self._hand is not None and bool(self._hand.model.licensed)

    @property
    def skin_size(self) -> tuple[int, NDArray[np.int32]]:
        """How many vertices the skin has, and its triangles (F, 3)."""
        model = self._hand.model
        return model.n_vertices, np.array(model.faces, np.int32).reshape(-1, 3)


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
        shape=rows("shape"),
    )
