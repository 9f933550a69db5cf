"""handtrack.Hand: what does not change of a recorded hand; its events, and its name in the file."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack import __version__
from handtrack.errors import SettingsError, shown
from handtrack.hand.limits import Limits
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES, N_JOINTS, N_PARTS, Hand
from handtrack.mcap.schema import array_class, message_class


@dataclass(frozen=True)
class Event:
    """Something worth a line in the log: a loss, a recovery, a rejected joint.

    Attributes:
        time_ns: when, on the sequence's clock [ns].
        level: "info" or "warning".
        text: one line.
    """

    time_ns: int
    level: str
    text: str


@dataclass(frozen=True, eq=False, kw_only=True)
class About:
    """What does not change of a tracked hand.

    Attributes:
        name, hand, source, subject: as in the Sequence.
        model: the hand that was fitted.
        settings: what made the track: plain JSON values by name.
        version: version of handtrack that made it.
    """

    name: str
    hand: Hand
    model: HandModel
    settings: Mapping[str, Any] = field(default_factory=dict)
    version: str = ""
    source: str = ""
    subject: str = ""

    def about(self) -> dict[str, Any]:
        """Those by name."""
        return {of.name: getattr(self, of.name) for of in fields(About)}


@dataclass(frozen=True, eq=False, kw_only=True)
class Head(About):
    """All of a Track that is not of its frames, as there.

    Attributes:
        has_truth: whether its frames have true joints.
        faces, n_vertices: of the skin.
    """

    has_truth: bool = False
    faces: NDArray[np.int32] = field(default_factory=lambda: np.empty((0, 3), np.int32))
    n_vertices: int = 0

    @property
    def filtered(self) -> bool:
        """Whether a filter steadies the poses."""
        return bool(self.settings.get("filter", "none") != "none")

    @staticmethod
    def of(
        model: HandModel,
        name: str,
        settings: Mapping[str, Any],
        *,
        source: str = "",
        subject: str = "",
        has_truth: bool = False,
    ) -> Head:
        """The head of what this version of handtrack tracks with a model; as the attributes."""
        return Head(
            name=name,
            hand=model.hand,
            model=model,
            settings=settings,
            version=__version__,
            source=source,
            subject=subject,
            has_truth=has_truth,
            faces=model.faces,
            n_vertices=len(model.rest_vertices),
        )


def encode_hand(head: Head) -> bytes:
    """handtrack.Hand.

    Raises:
        SettingsError: the settings are not plain JSON values, or the model is the other hand's.
    """
    model = head.model
    if head.hand != model.hand:
        raise SettingsError(f"{head.name} is a {head.hand} hand with a {model.hand} hand's model")
    try:
        settings = json.dumps(dict(head.settings))
    except (TypeError, ValueError) as error:
        raise SettingsError(f"settings of {head.name} cannot be written: {error}") from error
    message = message_class("handtrack.Hand")(
        hand=head.hand,
        sequence_name=text(head.name),
        subject=text(head.subject),
        source=text(head.source),
        version=text(head.version),
        settings=settings,
        has_truth=head.has_truth,
        joint_names=JOINT_NAMES,
        angle_names=ANGLE_NAMES,
    )
    out = message.model
    out.name, out.hand, out.licensed = text(model.name), model.hand, model.licensed
    out.limits_name = text(model.limits.name)
    out.thumb_twist = model.thumb_twist
    out.limits_lower.extend(model.limits.lower)
    out.limits_upper.extend(model.limits.upper)
    out.rest_joints.extend(model.rest_joints.ravel())
    out.axes.extend(model.axes.ravel())
    out.shape.extend(model.shape)
    if model.has_landmarks:
        out.landmark_offsets.extend(model.landmark_offsets.ravel())
    out.faces.extend(head.faces.ravel())
    out.n_vertices = head.n_vertices
    if not model.licensed:
        out.rest_vertices.extend(model.rest_vertices.ravel())
        out.weights.extend(model.weights.ravel())
    return bytes(message.SerializeToString())


def decode_hand(data: bytes) -> Head:
    """What `encode_hand` made.

    Raises:
        DecodeError: it is no such message.
        ValueError, RecursionError, HandtrackError: it says what cannot be.
    """
    message = array_class("handtrack.Hand").FromString(data)
    if (tuple(message.joint_names), tuple(message.angle_names)) != (JOINT_NAMES, ANGLE_NAMES):
        raise ValueError("joints or angles have other names or another order")
    settings = json.loads(message.settings)
    if not isinstance(settings, dict):
        raise ValueError("settings are no JSON object")
    model = _model(message.model)
    if message.hand != model.hand:
        raise ValueError(f"a {shown(message.hand)} hand with a {model.hand} hand's model")
    return Head(
        name=message.sequence_name,
        hand=message.hand,
        model=model,
        settings=settings,
        version=message.version,
        source=message.source,
        subject=message.subject,
        has_truth=message.has_truth,
        faces=_faces(message.model),
        n_vertices=message.model.n_vertices,
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
    offsets = rows("landmark_offsets", 3)
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
        # files from before detector profiles have none
        landmark_offsets=offsets if len(offsets) else np.zeros((N_JOINTS, 3)),
    )


def _faces(message: Any) -> NDArray[np.int32]:
    """(F, 3) triangles of the skin, whether the file holds that or not."""
    faces = np.array(message.faces, np.int64).reshape(-1, 3)
    if faces.size and faces.max() >= np.iinfo(np.int32).max:
        raise ValueError(f"there is a triangle of vertex {faces.max()}")
    return faces.astype(np.int32)


def encode_event(event: Event) -> bytes:
    """handtrack.Event."""
    message = message_class("handtrack.Event")(
        time_ns=event.time_ns, level=text(event.level), text=text(event.text)
    )
    return bytes(message.SerializeToString())


def decode_event(data: bytes) -> Event:
    """What `encode_event` made.

    Raises:
        DecodeError: it is no such message.
    """
    message = message_class("handtrack.Event").FromString(data)
    return Event(message.time_ns, message.level, message.text)


def text(value: str) -> str:
    """The text as it can be written: a lone surrogate (of an odd file name) as its escape."""
    return value.encode("utf-8", "backslashreplace").decode("utf-8")


def hand_topics(hands: Iterable[tuple[str, str]]) -> list[str]:
    """One name for each hand: "right" where that is enough, else "person0_left".

    Args:
        hands: (name of the sequence, "left" or "right") of every hand in the recording.

    Returns:
        As many names, all different, of the characters a-z, 0-9 and "_".
    """
    hands = list(hands)
    sides = [side for _, side in hands]
    if len(set(sides)) == len(sides):
        return sides
    topics: list[str] = []
    for name, side in hands:
        slug = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "hand"
        wanted = slug if slug.split("_")[-1] == side else f"{slug}_{side}"
        topic, n = wanted, 2
        while topic in topics:
            topic, n = f"{wanted}_{n}", n + 1
        topics.append(topic)
    return topics
