"""Hands whose joints have frames of TF, or topics, of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence as Items
from collections.abc import Set
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import UNUSED, JointName, joint_name, without_hand, words
from handtrack.sequences.readers.joint_frames import JOINT_COUNTS
from handtrack.sequences.readers.message_rows import Ints
from handtrack.sequences.readers.raw import Array, Raw, stem
from handtrack.sequences.readers.robot_messages import (
    UNSTAMPED,
    Poses,
    Transform,
    turnable,
    turns_of,
)
from handtrack.sequences.settled import settle
from handtrack.sequences.titles import few

FEWEST = 4
"""Fewer joints are no hand."""
_DEEPEST = 64
"""Frames above one another."""
_KIND = re.compile(r"(?i)[/_](pose|point|position|pose_stamped|point_stamped)s?$")
_BACK_NS = 10**9
_AGAIN = "stamps of frames begin anew (several takes?): log times taken"
_STILL = (0.0, 0.0, 0.0, 1.0)


class _Told(NamedTuple):
    """What messages tell of one frame.

    Attributes:
        numbers: (n,) of the messages.
        times: (n,) [ns].
        logged: (n,) when the messages were logged [ns].
        above: (n,) which frame it is in: a number of `Frames.parents`.
        poses: (n, 7) where.
    """

    numbers: Ints
    times: Ints
    logged: Ints
    above: Ints
    poses: Array


@dataclass
class Frames:
    """Frames of TF over time; `others` are topics of single places that are no joints."""

    others: list[str] = field(default_factory=list)
    _static: dict[str, _Told] = field(default_factory=dict)
    _moving: dict[str, list[_Told]] = field(default_factory=dict)
    _parents: list[str] = field(default_factory=list)

    def add(
        self, transforms: tuple[Transform, ...], numbers: Ints, logged: Ints, static: bool
    ) -> None:
        """What some messages of one layout tell.

        Args:
            transforms: of each.
            numbers: (n,) of the messages, rising.
            logged: (n,) when they were logged [ns].
            static: their frames never move.
        """
        for given in transforms:
            if given.parent not in self._parents:
                self._parents.append(given.parent)
            above = np.full(len(numbers), self._parents.index(given.parent))
            times = np.where(_stamped(given.stamp), given.stamp, logged)
            told = _Told(numbers, times, logged, above, given.pose)
            if not static:
                self._moving.setdefault(given.child, []).append(told)
            elif given.child not in self._static or (
                self._static[given.child].numbers[-1] <= numbers[-1]
            ):
                self._static[given.child] = told

    def take(self, topic: str, told: Items[tuple[Ints, Ints, Poses]]) -> None:
        """The frames that a topic of single places stands for, where its name is a joint's.

        Args:
            topic: its name.
            told: numbers of messages, when they were logged, and what they say.
        """
        name = _KIND.sub("", topic.strip("/"))
        if any(m.markers or m.places.shape[1] > 1 for _, _, m in told):
            return
        if joint_name(words(name)) is None:
            self.others.append(name)
            return
        for numbers, logged, message in told:
            if message.places.shape[1]:
                pose = np.tile([0.0, 0.0, 0.0, *_STILL], (len(numbers), 1))
                pose[:, :3] = message.places[:, 0]
                own = np.where(_stamped(message.stamp), message.stamp, logged)
                self.add((Transform(own, message.frame, name, pose),), numbers, logged, False)

    def hands(self, path: Path) -> list[Raw]:
        """Hands whose joints have frames of their own, in the frame above all others.

        Raises:
            InputError: a frame that is above itself, or names that are not understood.
        """
        whole = {name: _as_logged(told) for name, told in self._moving.items()}
        again = any(map(_begin_anew, whole.values()))
        moving = {name: _in_time(told, again) for name, told in whole.items()}
        raws = []
        for hand, columns in _by_hand(sorted(moving.keys() | self._static.keys())).items():
            self._check_names(hand, columns, path)
            times, rows = _rows(moving, columns.keys())
            joints = np.full((len(times), N_JOINTS, 3), np.nan)
            for name, joint in columns.items():
                # a joint is there in the moments that tell of it, or always
                at = np.arange(len(times)) if name in self._static else rows[name]
                joints[at, joint] = self._placed(name, times[at], moving, path)
            raws.append(
                Raw(
                    joints,
                    path,
                    stem(path),
                    hand=hand,
                    unit="m",
                    order="handtrack",
                    stamps=Stamps(times, "log time" if again else "stamp", "ns"),
                    notes=(_AGAIN,) if again else (),
                )
            )
        return raws

    def _placed(self, name: str, times: Ints, moving: dict[str, _Told], path: Path) -> Array:
        """(n, 3) where a frame's origin is in the frame above all others at some times."""
        places = np.zeros((len(times), 3))
        waiting = [(name, np.arange(len(times)), 0)]
        while waiting:
            frame, rows, depth = waiting.pop()
            if depth > _DEEPEST:
                raise InputError(
                    f"frame {shown(name, 40)} has more than {_DEEPEST} frames above it", path
                )
            poses, above, there = self._latest(frame, times[rows], moving)
            rows = rows[there]
            if depth:
                turned = np.einsum("nij,nj->ni", turns_of(poses), places[rows])
            else:  # of the origin
                turned = np.where(turnable(poses)[:, None], 0.0, np.nan)
            places[rows] = turned + poses[:, :3]
            for parent in _different(above):
                waiting.append((self._parents[parent], rows[above == parent], depth + 1))
        return places

    def _latest(
        self, name: str, times: Ints, moving: dict[str, _Told]
    ) -> tuple[Array, Ints, NDArray[np.bool_]]:
        """Where a frame was last, in which frame, and at which of the times it had been told."""
        told = moving.get(name)
        if told is not None and np.array_equal(told.times, times):
            return told.poses, told.above, np.ones(len(times), bool)
        poses, above = np.empty((len(times), 7)), np.zeros(len(times), np.int64)
        there = np.full(len(times), name in self._static)
        if name in self._static:
            poses[:], above[:] = self._static[name].poses[-1], self._static[name].above[-1]
        if told is not None:
            last = np.searchsorted(told.times, times, "right") - 1
            known = last >= 0
            if known.all():
                return told.poses[last], told.above[last], known
            poses[known], above[known] = told.poses[last[known]], told.above[last[known]]
            there |= known
        return poses[there], above[there], there

    def _check_names(self, hand: Hand | None, columns: dict[str, int], path: Path) -> None:
        """Refuse a hand of which most joints have names that are not understood."""
        if hand is None:
            return  # frames of anything may be there
        alike = [*self.others, *sorted(self._moving.keys() | self._static.keys())]
        others = [n for n in alike if n not in columns and without_hand(words(n))[0] == hand]
        others = [n for n in others if joint_name(words(n)) is None]
        if len(others) > len(columns):
            raise InputError(
                f"most joints of the {hand} hand are not understood: {few(others)}; understood are"
                f" {few(columns)}",
                path,
            )


def _different(numbers: Ints) -> list[int]:
    """The numbers that there are."""
    if len(numbers) and (numbers == numbers[0]).all():
        return [int(numbers[0])]
    return [int(n) for n in np.unique(numbers)]


def _stamped(stamps: Ints) -> NDArray[np.bool_]:
    return np.asarray((stamps != 0) & (stamps != UNSTAMPED))


def _as_logged(told: list[_Told]) -> _Told:
    """All that was told of a frame, by message."""
    if len(told) == 1:
        return told[0]
    whole = _Told(
        np.concatenate([t.numbers for t in told]),
        np.concatenate([t.times for t in told]),
        np.concatenate([t.logged for t in told]),
        np.concatenate([t.above for t in told]),
        np.concatenate([t.poses for t in told]),
    )
    return _ordered(whole, np.argsort(whole.numbers, kind="stable"))


def _ordered(told: _Told, rows: Ints) -> _Told:
    numbers, times, logged, above, poses = told
    return _Told(numbers[rows], times[rows], logged[rows], above[rows], poses[rows])


def _begin_anew(told: _Told) -> bool:
    """Whether stamps fall far back between messages that were logged one after the other, as
    those of several takes do."""
    back = np.diff(told.times) < -_BACK_NS
    return bool(back.any()) and bool((np.diff(told.logged)[back] >= 0).all())


def _in_time(told: _Told, logged: bool) -> _Told:
    """The same by its time, or log time, and of one time by message."""
    if logged:
        told = told._replace(times=told.logged)
    if (np.diff(told.times) > 0).all():
        return told
    return _ordered(told, np.argsort(told.times, kind="stable"))


def _rows(moving: dict[str, _Told], names: Set[str]) -> tuple[Ints, dict[str, Ints]]:
    """Times in order, and at which of them each of the names is told of; where most times tell
    of few of the names, as each joint has a stamp of its own, those of one round are one, at the
    time of its last."""
    own = {name: _once(moving[name].times) for name in names if name in moving}
    times = _together(list(own.values()))
    if sum(map(len, own.values())) <= len(times) * len(names) / 2:
        steps = np.concatenate([np.diff(t) for t in own.values()] or [np.empty(0)])
        if len(steps):
            return _rounds(moving, names, float(np.median(steps)) / 2)
    empty = np.empty(0, np.int64)
    return times, {n: np.searchsorted(times, own[n]) if n in own else empty for n in names}


def _once(times: Ints) -> Ints:
    """Times that rise, each once."""
    return times[np.append(True, np.diff(times) > 0)] if len(times) else times


def _together(several: list[Ints]) -> Ints:
    """All times of some lists that rise."""
    if several and all(np.array_equal(several[0], times) for times in several[1:]):
        return several[0]
    return np.unique(np.concatenate([*several, np.empty(0, np.int64)]))


def _rounds(
    moving: dict[str, _Told], names: Set[str], longest: float
) -> tuple[Ints, dict[str, Ints]]:
    """Times of rounds that are no longer, and in which of them each of the names is told of."""
    moments: dict[int, set[str]] = {}
    for name, told in moving.items():
        for time in told.times.tolist():
            moments.setdefault(time, set()).add(name)
    rounds: list[tuple[int, int, set[str]]] = []
    for time in sorted(moments):
        said = moments[time]
        begun = rounds and not rounds[-1][2] & said & names
        if begun and time - rounds[-1][0] < longest:
            rounds[-1] = (rounds[-1][0], time, rounds[-1][2] | said)
        else:
            rounds.append((time, time, set(said)))
    rounds = [r for r in rounds if r[2] & names]
    times = np.array([last for _, last, _ in rounds], np.int64)
    at = {n: [i for i, (_, _, said) in enumerate(rounds) if n in said] for n in names}
    return times, {n: np.array(rows, np.int64) for n, rows in at.items()}


def _by_hand(names: list[str]) -> dict[Hand | None, dict[str, int]]:
    """Which joint each frame is, by hand."""
    said = {n: s for n in names if (s := joint_name(words(n))) is not None}
    found = {}
    for hand in dict.fromkeys(s.hand for s in said.values()):
        own = [n for n, s in said.items() if s.hand == hand]
        columns = columns_of(own) or _numbered(said, own)
        if columns is not None and not all(n.isdigit() for n in own):
            found[hand] = columns
    return found


def _numbered(said: dict[str, JointName], own: list[str]) -> dict[str, int] | None:
    """Joints that a hand's name and 21 numbers stand for ("left_hand_5"); None of others."""
    numbers = {n: s.number for n in own if (s := said[n]).finger is None and s.hand is not None}
    known = sorted(n for n in numbers.values() if n is not None)
    if len(known) != N_JOINTS or known != list(range(known[0], known[0] + N_JOINTS)):
        return None
    return {name: n - known[0] for name, n in numbers.items() if n is not None}


def columns_of(names: list[str]) -> dict[str, int] | None:
    """Which joint each name is; None where they are of no hand."""
    if all(n.isdigit() for n in names):
        numbers = sorted(int(n) for n in names)
        # ids often begin at 1, or go on from hand to hand
        if len(numbers) not in JOINT_COUNTS or numbers[-1] - numbers[0] != len(numbers) - 1:
            return None
        return {str(n): i for i, n in enumerate(numbers)}
    said = [(n, s) for n in names if (s := joint_name(words(n))) is not None]
    settled = settle(s for _, s in said)
    found = {n: j for (n, _), j in zip(said, settled, strict=True) if j is not None and j != UNUSED}
    return found if len(found) >= FEWEST else None
