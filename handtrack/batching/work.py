"""What is done with one clip: a pure function, for any engine that runs functions elsewhere."""

from __future__ import annotations

import json
import os
import socket
import time
import traceback
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple
from uuid import uuid4

from handtrack.batching.clip import Clip
from handtrack.batching.hands import Pooled, hand_for
from handtrack.batching.outputs import Outputs
from handtrack.batching.rows import FAILED, PASSED, SAME, Row, row_of, row_without
from handtrack.batching.settings import BatchSettings
from handtrack.batching.source import Read, at_hand, content_digest, read_clip, read_truth
from handtrack.batching.store import Store, StoreError
from handtrack.batching.warm import one_thread
from handtrack.errors import HandtrackError, InputError
from handtrack.evaluation.stability import Stability, stability, stability_of_pair
from handtrack.sequences.identity import repair_identity
from handtrack.sequences.readers.raw import NotJointsError
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.track import Track
from handtrack.video.pictured import track

JOURNAL = "journal"
"""Where rows wait until they are in the table."""
# what a fault of the program, or of a library, comes out as: a row, as any other failure
_FAULTS = (
    *(ArithmeticError, AssertionError, AttributeError, BufferError, EOFError, ImportError),
    *(LookupError, MemoryError, NameError, OSError, RuntimeError, TypeError, ValueError),
)


class Task(NamedTuple):
    """Some clips that a worker does one after another.

    Attributes:
        clips: they.
        digests: of the settings, for each clip.
        hands: the pooled hands of each clip's subject, by side.
        before: the digest of each clip's content when it was tracked by these settings; "" if it
            has not been.
    """

    clips: tuple[Clip, ...]
    digests: tuple[str, ...]
    hands: tuple[Mapping[str, Pooled], ...]
    before: tuple[str, ...]


class Done(NamedTuple):
    """What came of a task, told in a few words: the rows themselves are in the journal.

    Attributes:
        clips, frames: how many.
        failed: (clip, why) of those that failed.
        seconds: that they took.
        journal: the name of the file with the rows.
    """

    clips: int
    frames: int
    failed: tuple[tuple[str, str], ...]
    seconds: float
    journal: str


def do_task(task: Task, place: str, settings: BatchSettings) -> Done:
    """Track the clips of a task and put their rows into the journal.

    Raises:
        StoreError: results cannot be written.
    """
    start = time.perf_counter()
    store = Store(place)
    rows: list[Row] = []
    for clip, digest, hands, before in zip(*task, strict=True):
        if before and _digest(clip) == before:
            rows.append({"clip": clip.name, "input_stamp": clip.stamp, "state": SAME})
        else:
            rows += track_clip(clip, settings, place, hands, digest)
    journal = write_journal(store, rows)
    failed = tuple((row["path"], row["error"]) for row in rows if row["state"] == FAILED)
    frames = sum(row.get("frames", 0) for row in rows)
    return Done(len(task.clips), frames, failed, time.perf_counter() - start, journal)


def _digest(clip: Clip) -> str:
    """Of the clip's content as it is now, "" where it cannot be read."""
    try:
        with at_hand(clip.path, clip.group) as files:
            return content_digest(files)
    except HandtrackError:
        return ""  # tracking it will say what is wrong


def write_journal(store: Store, rows: list[Row]) -> str:
    """Keep rows until they are in the table; the file's name."""
    name = f"{JOURNAL}/{uuid4().hex}.jsonl"
    lines = (json.dumps(row, allow_nan=False) for row in rows)
    store.write(name, ("\n".join(lines) + "\n").encode())
    return name


def track_clip(
    clip: Clip,
    settings: BatchSettings | None = None,
    out: str | None = None,
    hands: Mapping[str, Pooled] | None = None,
    digest: str = "",
) -> list[Row]:
    """Track every hand of a clip.

    It depends on nothing but its arguments, which can all be pickled: any engine may call it.

    Args:
        clip: what to track.
        settings: how, and what is to be written.
        out: folder or URL to write recordings and tables to; None writes nothing.
        hands: the subject's hands, by side; a hand that is not there is found in the clip.
        digest: of the settings, and with a dash after it of all that the rows depend on beside
            the clip's content; kept with the rows.

    Returns:
        A row (`handtrack.batching.rows`) for each hand, or one that says what went wrong.

    Raises:
        StoreError: results cannot be written.
    """
    settings = settings or BatchSettings()
    start = time.perf_counter()
    said: dict[str, Any] = {
        "settings_digest": digest.partition("-")[0],
        "task_digest": digest.partition("-")[2],
        "worker": f"{socket.gethostname()}-{os.getpid()}",
    }

    def failed(state: str, error: BaseException | str, kind: str) -> list[Row]:
        times = {"seconds": time.perf_counter() - start, "finished": time.time()}
        return [row_without(clip, state, str(error), kind, said | times)]

    try:
        with one_thread():
            try:
                read = read_clip(clip, settings.reading)
            except StoreError as error:
                return failed(FAILED, error, "store")
            said["input_digest"] = read.digest
            return _tracked(clip, read, settings, out, hands or {}, said, start)
    except StoreError:
        raise
    except NotJointsError as error:
        return failed(FAILED if clip.listed else PASSED, error, "input")
    except HandtrackError as error:
        return failed(FAILED, error, "input")
    except _FAULTS as error:
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        return failed(FAILED, f"{type(error).__name__}: {error} ({where})", "program")


def _tracked(
    clip: Clip,
    read: Read,
    settings: BatchSettings,
    out: str | None,
    hands: Mapping[str, Pooled],
    said: dict[str, Any],
    start: float,
) -> list[Row]:
    if not read.sequences:
        raise InputError("no joint is left of it between start and end", clip.path)
    sequences = repair_identity(read.sequences) if settings.repair else read.sequences
    truths = read_truth(clip, settings.reading)
    tracks: list[Track] = []
    rows: list[Row] = []
    left_out: list[HandtrackError] = []
    for sequence in sequences:
        begun = time.perf_counter()
        try:
            hand = hand_for(sequence, settings, hands, out)
            made = track(sequence, hand.model, settings=settings.tracking.but(calibrate=hand.how))
            made = replace(made, settings={**made.settings, **hand.told})
            if (made.status == "lost").all():
                raise InputError(f"no frame could be fitted: {made.reason[0]}", clip.path)
            measured = _measured(made, truths)
        except HandtrackError as error:
            # a hand that is hardly seen must not take the others with it
            if isinstance(error, StoreError):
                raise
            left_out.append(error)
            continue
        about = said | {"hand_from": hand.source, "drift_mm": hand.drift_mm}
        about["seconds"] = time.perf_counter() - begun
        rows.append(row_of(clip, made, measured, about))
        tracks.append(made)
    if not tracks:
        raise left_out[0]
    written = Outputs.of(clip, tracks, settings, out)
    finished = time.time()
    for row in rows:
        row |= written.of_hand(row["hand"]) | {"finished": finished}
        if left_out:
            row["notes"] = "; ".join(filter(None, (row["notes"], f"left out: {left_out[0]}")))
    rows[0]["seconds"] += time.perf_counter() - start - sum(row["seconds"] for row in rows)
    return rows


def _measured(made: Track, truths: list[Sequence]) -> Stability:
    if not truths:
        return stability(made).overall
    fitting = [t for t in truths if len(truths) == 1 or t.hand == made.hand]
    if len(fitting) != 1:
        raise InputError(f"{len(fitting)} true sequences are of the {made.hand} hand, expected one")
    return stability_of_pair(made, fitting[0])
