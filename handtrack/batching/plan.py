"""What is to be done of a data set, and in which portions."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import NamedTuple

from handtrack.batching.clip import Clip
from handtrack.batching.hands import Pooled
from handtrack.batching.journal import Earlier
from handtrack.batching.pool import Found
from handtrack.batching.rows import FAILED
from handtrack.batching.settings import BatchSettings, digest
from handtrack.batching.work import Task

TASK_S = 4.0
"""A task takes about so long: the engine's share is then below a thousandth."""
MOST = 256
"""Clips of a task at most."""
_PASSING = ("store", "worker")
"""Kinds of failures that another try may not meet."""


class Planned(NamedTuple):
    """A clip that is to be tracked.

    Attributes:
        clip: it.
        digest: of its settings.
        hands: its subject's, by side.
        before: digest of its content when it was tracked by these settings, or "".
    """

    clip: Clip
    digest: str
    hands: Mapping[str, Pooled]
    before: str = ""


class Plan(NamedTuple):
    """What is to be done.

    Attributes:
        todo: clips to track.
        done: how many have been tracked by the same settings.
        failed: (path, why) of those that failed, and would fail again.
    """

    todo: list[Planned]
    done: int
    failed: list[tuple[str, str]]


def plan(
    clips: Sequence[Clip],
    settings: BatchSettings,
    subjects: Mapping[str, Found],
    before: Mapping[str, Earlier],
    there: set[str] | None,
    errors: Mapping[str, str],
    again: bool = False,
) -> Plan:
    """What is still to be done of the clips.

    Args:
        clips: all of them.
        settings: how they are tracked.
        subjects: the pooled hands.
        before: what the table says of each clip.
        there: files among the results; None: do not look.
        errors: of clips that failed, by name.
        again: try those again that failed by their own fault.
    """
    told = digest(settings.told())
    made = Plan([], 0, [])
    done = 0
    for clip in clips:
        found = subjects.get(clip.subject)
        hands = {} if found is None else found.hands
        own = (
            told
            + "-"
            + digest([told, clip.told(), sorted((s, h.digest) for s, h in hands.items())])
        )
        old = before.get(clip.name)
        fits = old is not None and old.task == own.partition("-")[2]
        if old is None or not fits or _wants_another_try(old, there, again):
            made.todo.append(Planned(clip, own, hands))
        elif old.stamp != clip.stamp:
            made.todo.append(Planned(clip, own, hands, old.content))
        elif old.state == FAILED:
            made.failed.append((clip.path, errors.get(clip.name, "")))
            done += 1
        else:
            done += 1
    return made._replace(done=done)


def _wants_another_try(old: Earlier, there: set[str] | None, again: bool) -> bool:
    if old.state == FAILED:
        return again or old.kind in _PASSING
    return there is not None and any(file not in there for file in old.files)


class Portions:
    """Tasks of as many clips as take a few seconds, fewer at the end."""

    def __init__(self, todo: Iterable[Planned], workers: int) -> None:
        self._waiting = deque(todo)
        self._workers = max(workers, 1)
        self._seconds = self._clips = 0.0

    def took(self, clips: int, seconds: float) -> None:
        """So long a task of so many clips took."""
        self._seconds += seconds
        self._clips += clips

    def next(self) -> Task | None:
        """The next task."""
        if not self._waiting:
            return None
        size = 1
        if self._clips:
            size = int(TASK_S * self._clips / max(self._seconds, 1e-6))
        # the last tasks are small, so that no worker waits for another for long
        fair = len(self._waiting) // (3 * self._workers)
        size = max(1, min(size, MOST, fair))
        return task_of([self._waiting.popleft() for _ in range(size)])


def task_of(planned: Sequence[Planned]) -> Task:
    """A task of these clips."""
    return Task(
        tuple(p.clip for p in planned),
        tuple(p.digest for p in planned),
        tuple(p.hands for p in planned),
        tuple(p.before for p in planned),
    )


def parts_of(task: Task) -> list[Planned]:
    """The clips of a task, each by itself."""
    return [Planned(*part) for part in zip(*task, strict=True)]
