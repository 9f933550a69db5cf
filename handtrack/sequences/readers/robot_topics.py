"""Topics of robots' logs that hold hands: lists of poses, and markers by name or number."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.names import joint_name, without_hand, words
from handtrack.sequences.readers.both_hands import two_hands
from handtrack.sequences.readers.joint_frames import JOINT_COUNTS, PAIRS
from handtrack.sequences.readers.mcap_json import taken_or_logged
from handtrack.sequences.readers.message_rows import Ints
from handtrack.sequences.readers.raw import Array, Raw, stem
from handtrack.sequences.readers.robot_frames import FEWEST, columns_of
from handtrack.sequences.readers.robot_messages import Marker, Poses, turns_of

_LISTS = (6, 7, 8)  # markers of cubes, spheres and points
_SINGLE = (1, 2, 3)  # of a cube, a sphere, a cylinder
_ADDED = 0


class Told(NamedTuple):
    """What some messages of a topic say.

    Attributes:
        numbers: (n,) of the messages in the log, rising.
        logged: (n,) log times [ns].
        message: what they say.
    """

    numbers: Ints
    logged: Ints
    message: Poses


@dataclass
class Topic:
    """A topic of poses or markers.

    Attributes:
        name: its own.
        messages: how many were read.
        told: what they said; nothing where they are of frames.
    """

    name: str
    messages: int = 0
    told: list[Told] = field(default_factory=list)

    def about(self) -> str:
        """Its name, and how many poses most of its messages have."""
        if not self.told:
            return f"{self.name} (frames)"
        sizes: Counter[int] = Counter()
        for numbers, _, message in self.told:
            sizes[message.places.shape[1] or len(message.markers)] += len(numbers)
        kind = "markers" if self.told[0].message.markers else "poses"
        return f"{self.name} ({sizes.most_common(1)[0][0]} {kind})"

    def in_order(self) -> list[Told]:
        """What was said, by the first message that says it."""
        return sorted(self.told, key=lambda told: int(told.numbers[0]))

    def hands(self, path: Path) -> list[Raw]:
        """The hands of this topic; none where its lists are of no hand's length.

        Raises:
            InputError: lists of several lengths.
        """
        self.told = self.in_order()
        if any(t.message.markers for t in self.told):
            return self._of_markers(path)
        sizes: Counter[int] = Counter()
        for numbers, _, message in self.told:
            sizes[message.places.shape[1]] += len(numbers)
        del sizes[0]
        if not sizes:
            return []
        size = sizes.most_common(1)[0][0]
        if size not in (*JOINT_COUNTS, *PAIRS):
            return []
        everything = self._numbers()
        joints = np.full((len(everything), size, 3), np.nan)
        for numbers, _, message in self.told:
            rows, n = np.searchsorted(everything, numbers), message.places.shape[1]
            if n == size:
                joints[rows] = message.places
            elif n:
                said = f"message {rows[0]} has {n} poses, others {size}"
                raise InputError(f"{self.name}, {said}", path)
        hand = side_in(self.name, self.told[0].message.frame)
        return two_hands(self._raw(joints, path, hand))

    def _numbers(self) -> Ints:
        return np.sort(np.concatenate([told.numbers for told in self.told]))

    def _raw(self, joints: Array, path: Path, hand: Hand | None, order: str | None = None) -> Raw:
        numbers = np.concatenate([told.numbers for told in self.told])
        first = np.argsort(numbers)
        own = np.concatenate([told.message.stamp for told in self.told])[first]
        logged = np.concatenate([told.logged for told in self.told])[first]
        return Raw(
            joints,
            path,
            stem(path),
            hand=hand,
            unit="m",
            order=order,
            stamps=taken_or_logged(own, logged),
            subject=self.name.strip("/").replace("/", " "),
        )

    def _of_markers(self, path: Path) -> list[Raw]:
        """Markers by their names, or else by their numbers."""
        everything = self._numbers()
        kept: dict[Hand | None, list[tuple[Ints, dict[str, Array]]]] = {}
        for numbers, _, message in self.told:
            rows = np.searchsorted(everything, numbers)
            for hand, places in _marked(message.markers, self.name).items():
                kept.setdefault(hand, []).append((rows, places))
        raws = []
        for hand, parts in kept.items():
            names = list(dict.fromkeys(n for _, places in parts for n in places))
            columns = columns_of(names)
            if columns is None:
                continue
            width = max(columns.values()) + 1 if columns else 0
            named = not all(n.isdigit() for n in names)
            joints = np.full((len(everything), N_JOINTS if named else width, 3), np.nan)
            for rows, places in parts:
                for name, place in places.items():
                    if name in columns:
                        joints[rows, columns[name]] = place
            raws.append(self._raw(joints, path, hand, "handtrack" if named else None))
        return raws


def _marked(markers: tuple[Marker, ...], topic: str) -> dict[Hand | None, dict[str, Array]]:
    """Places (n, 3) by hand and by name, or number, of n messages."""
    found: dict[Hand | None, dict[str, Array]] = {}
    for marker in markers:
        if marker.action != _ADDED:
            continue
        hand = side_in(marker.space, marker.text, topic, marker.frame)
        places = found.setdefault(hand, {})
        if marker.kind in _LISTS and marker.points.shape[1] in JOINT_COUNTS:
            turns = turns_of(marker.pose)
            turns[~np.isfinite(turns).all((1, 2))] = np.eye(3)
            at = marker.points @ turns.transpose(0, 2, 1) + marker.pose[:, None, :3]
            places |= {str(i): at[:, i] for i in range(at.shape[1])}
        elif marker.kind in _SINGLE:
            named = (t for t in (marker.text, marker.space) if joint_name(words(t)) is not None)
            text = next((t for t in named if _says_which(t)), None)
            places[text or str(marker.number)] = marker.pose[:, :3]
    return {hand: places for hand, places in found.items() if len(places) >= FEWEST}


def _says_which(text: str) -> bool:
    """Whether a marker's name is of one joint, and not of a hand or a finger's number."""
    said = joint_name(words(text))
    return said is not None and not said.weak and (said.finger is not None or said.number is None)


def side_in(*texts: str) -> Hand | None:
    """The hand that the first text which names one names."""
    return next(
        (hand for text in texts if (hand := without_hand(words(text))[0]) is not None), None
    )
