"""Hands whose joints have frames of TF, or topics, of their own."""

from __future__ import annotations

import re
from collections.abc import Sequence as Items
from collections.abc import Set
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.files.long_arrays import blocks
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.clock import Stamps
from handtrack.sequences.names import UNUSED, joint_name, without_hand, words
from handtrack.sequences.readers.fields import JOINT_COUNTS
from handtrack.sequences.readers.raw import Array, Raw, stem
from handtrack.sequences.readers.robot_messages import Poses, Transform, turns_of
from handtrack.sequences.settled import settle
from handtrack.sequences.titles import few

FEWEST = 4
"""Fewer joints are no hand."""
_DEEPEST = 64
"""Frames above one another."""
_KIND = re.compile(r"(?i)[/_](pose|point|position|pose_stamped|point_stamped)s?$")
_STILL = (0.0, 0.0, 0.0, 1.0)


@dataclass
class Frames:
    """Frames of TF over time; `others` are topics of single places that are no joints."""

    static: dict[str, Transform] = field(default_factory=dict)
    moments: dict[int, dict[str, Transform]] = field(default_factory=dict)
    logged: dict[int, int] = field(default_factory=dict)
    others: list[str] = field(default_factory=list)

    def add(self, transforms: tuple[Transform, ...], log_time: int, static: bool) -> None:
        for transform in transforms:
            if static:
                self.static[transform.child] = transform
                continue
            time = transform.stamp or log_time
            self.moments.setdefault(time, {})[transform.child] = transform
            self.logged.setdefault(time, log_time)

    def take(self, topic: str, found: Items[Poses], logged: Items[int]) -> None:
        """The frames that a topic of single places stands for, where its name is a joint's."""
        name = _KIND.sub("", topic.strip("/"))
        if any(m.markers or len(m.places) > 1 for m in found):
            return
        if joint_name(words(name)) is None:
            self.others.append(name)
            return
        for message, log_time in zip(found, logged, strict=True):
            if len(message.places):
                pose = np.array([*message.places[0], *_STILL])
                one = Transform(message.stamp or log_time, message.frame, name, pose)
                self.add((one,), log_time, False)

    def hands(self, path: Path) -> list[Raw]:
        """Hands whose joints have frames of their own, in the frame above all others."""
        names = {c for moment in self.moments.values() for c in moment}
        raws = []
        for hand, columns in _by_hand(sorted(names | set(self.static))).items():
            self._check_names(hand, columns, path)
            times: list[int] = []
            chains: list[list[Transform]] = []
            spots: list[tuple[int, int]] = []
            latest: dict[str, Transform] = dict(self.static)
            for time, moment in together(self.moments, columns.keys()).items():
                latest |= moment
                if not columns.keys() & moment.keys():
                    continue
                for name, joint in columns.items():
                    # a joint is there in the moments that tell of it, or always
                    if name in moment or name in self.static:
                        chains.append(_chain(name, latest, path))
                        spots.append((len(times), joint))
                times.append(time)
            joints = np.full((len(times), N_JOINTS, 3), np.nan)
            if spots:
                at = np.array(spots)
                joints[at[:, 0], at[:, 1]] = _places(chains)
            raws.append(
                Raw(
                    joints,
                    path,
                    stem(path),
                    hand=hand,
                    unit="m",
                    order="handtrack",
                    stamps=Stamps(np.array(times, np.int64), "stamp", "ns"),
                )
            )
        return raws

    def _check_names(self, hand: Hand | None, columns: dict[str, int], path: Path) -> None:
        """Refuse a hand of which most joints have names that are not understood."""
        if hand is None:
            return  # frames of anything may be there
        names = {c for moment in self.moments.values() for c in moment}
        alike = [*self.others, *sorted(names | set(self.static))]
        others = [n for n in alike if n not in columns and without_hand(words(n))[0] == hand]
        others = [n for n in others if joint_name(words(n)) is None]
        if len(others) > len(columns):
            raise InputError(
                f"most joints of the {hand} hand are not understood: {few(others)}; understood are"
                f" {few(columns)}",
                path,
            )


def together(
    moments: dict[int, dict[str, Transform]], names: Set[str]
) -> dict[int, dict[str, Transform]]:
    """Moments in the order of time; where each tells of few of the names, as each joint has a
    stamp of its own, those of one round are one, at the time of its last."""
    times = sorted(moments)
    of_names = [t for t in times if moments[t].keys() & names]
    if sum(len(moments[t].keys() & names) for t in of_names) > len(of_names) * len(names) / 2:
        return {t: moments[t] for t in times}
    last: dict[str, int] = {}
    steps = []
    for time in of_names:
        for name in moments[time].keys() & names:
            if name in last:
                steps.append(time - last[name])
            last[name] = time
    if not steps:
        return {t: moments[t] for t in times}
    longest = float(np.median(steps)) / 2
    rounds: list[tuple[list[int], dict[str, Transform]]] = []
    for time in times:
        moment = moments[time]
        begun = rounds and not rounds[-1][1].keys() & moment.keys() & names
        if begun and time - rounds[-1][0][0] < longest:
            rounds[-1][0].append(time)
            rounds[-1][1].update(moment)
        else:
            rounds.append(([time], dict(moment)))
    return {times[-1]: moment for times, moment in rounds}


def _by_hand(names: list[str]) -> dict[Hand | None, dict[str, int]]:
    """Which joint each frame is, by hand."""
    said = {n: s for n in names if (s := joint_name(words(n))) is not None}
    found = {}
    for hand in dict.fromkeys(s.hand for s in said.values()):
        own = [n for n, s in said.items() if s.hand == hand]
        columns = columns_of(own)
        if columns is not None and not all(n.isdigit() for n in own):
            found[hand] = columns
    return found


def _places(chains: list[list[Transform]]) -> Array:
    """(n, 3) where frames' origins are in the frame above all others."""
    out = np.zeros((len(chains), 3))
    for part in blocks(len(chains)):
        some = chains[part]
        places = np.zeros((len(some), 3))
        for level in range(max(map(len, some))):
            rows = [i for i, chain in enumerate(some) if len(chain) > level]
            poses = np.array([some[i][level].pose for i in rows])
            turned = np.einsum("nij,nj->ni", turns_of(poses), places[rows])
            places[rows] = turned + poses[:, :3]
        out[part] = places
    return out


def _chain(name: str, frames: dict[str, Transform], path: Path) -> list[Transform]:
    """The frames above a frame, from its own."""
    chain: list[Transform] = []
    at = name
    for _ in range(_DEEPEST):
        above = frames.get(at)
        if above is None:
            return chain
        chain.append(above)
        at = above.parent
    raise InputError(f"frame {shown(name, 40)} has more than {_DEEPEST} frames above it", path)


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
