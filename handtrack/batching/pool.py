"""One hand for each subject, from well-chosen clips: the first stage of a data set."""

from __future__ import annotations

import json
from collections.abc import Mapping
from collections.abc import Sequence as Several
from typing import NamedTuple

import numpy as np

from handtrack.batching.clip import Clip
from handtrack.batching.hands import Pooled, file_digest
from handtrack.batching.settings import BatchSettings, digest
from handtrack.batching.source import read_clip
from handtrack.batching.store import Store, StoreError
from handtrack.batching.warm import one_thread
from handtrack.calibration.calibrate import Calibration, calibrate
from handtrack.calibration.explain import explain
from handtrack.calibration.settings import MIN_FRAMES
from handtrack.detectors.chosen import seen_by
from handtrack.errors import HandtrackError
from handtrack.files.long_arrays import evenly, scratch
from handtrack.hand.hand_file import save_hand
from handtrack.sequences.identity import repair_identity
from handtrack.sequences.sequence import Sequence

HANDS = "hands"
"""Where pooled hands are."""
LOOKED_AT = 24
"""Clips of a subject that are read for its hand, evenly spread over all."""
POOLED = 8
"""Clips of these that a hand is found in: those with the most motion of the fingers."""
_FRAMES = 400
"""Frames that are looked at closely, in all."""


class Pool(NamedTuple):
    """What a subject's hands are found in.

    Attributes:
        subject: whose.
        clips: candidates.
        digest: of them and of all that makes a difference.
    """

    subject: str
    clips: tuple[Clip, ...]
    digest: str

    @property
    def folder(self) -> str:
        """Of the subject's hands among the results."""
        return f"{HANDS}/{file_name(self.subject)}"


class Found(NamedTuple):
    """The hands of a subject.

    Attributes:
        subject: whose.
        hands: by side.
        notes: what the user should know.
    """

    subject: str
    hands: Mapping[str, Pooled]
    notes: tuple[str, ...]


def file_name(text: str) -> str:
    """A text as the name of a file or folder, another one for another text."""
    from urllib.parse import quote

    name = quote(text, safe=" ")
    if len(name) > 150:
        name = f"{name[:120]}-{digest(text)[:12]}"
    return "%2E" + name[1:] if name.startswith(".") else name


def pools(clips: Several[Clip], settings: BatchSettings) -> list[Pool]:
    """For each subject the clips to find its hands in, in the order of the subjects."""
    of: dict[str, list[Clip]] = {}
    for clip in clips:
        if clip.subject:
            of.setdefault(clip.subject, []).append(clip)
    made = []
    for subject in sorted(of):
        mine = sorted(of[subject], key=lambda clip: clip.name)
        # sides that the data set names each get their share
        sides = {clip.hand for clip in mine}
        chosen: list[Clip] = []
        for side in sorted(sides, key=str):
            part = [clip for clip in mine if clip.hand == side]
            n = max(1, LOOKED_AT // len(sides))
            chosen += [part[i] for i in evenly(np.arange(len(part)), n)]
        told = [settings.of_hand(), [[c.path, c.name, c.stamp, c.told()] for c in chosen]]
        made.append(Pool(subject, tuple(chosen), digest(told)))
    return made


def known(store: Store, pool: Pool) -> Found | None:
    """The hands of a subject, if they have been found in the very same."""
    try:
        said = json.loads(store.read(f"{pool.folder}/pool.json"))
    except (FileNotFoundError, ValueError):
        return None
    if not isinstance(said, dict) or said.get("digest") != pool.digest:
        return None
    hands = {side: Pooled(*pair) for side, pair in said["hands"].items()}
    if not all(store.exists(hand.name) for hand in hands.values()):
        return None
    return Found(pool.subject, hands, tuple(said["notes"]))


def find_hands(pool: Pool, place: str, settings: BatchSettings) -> Found:
    """Find the hands of a subject and write them beside the results.

    Raises:
        StoreError: they cannot be written, or the clips' store does not answer.
    """
    with one_thread():
        return _hands_of(pool, Store(place), settings)


def _hands_of(pool: Pool, store: Store, settings: BatchSettings) -> Found:
    sequences: list[Sequence] = []
    notes: list[str] = []
    for clip in pool.clips:
        try:
            read = read_clip(clip, settings.reading).sequences
            sequences += repair_identity(read) if settings.repair else read
        except StoreError:
            raise
        except HandtrackError as error:
            notes.append(f"not looked at for the hand of {pool.subject}: {error}")
    hands: dict[str, Pooled] = {}
    scales: dict[str, float] = {}
    for side in ("left", "right"):
        mine = [s for s in sequences if s.hand == side]
        if not mine:
            continue
        try:
            hands[side], scales[side] = _found(pool, side, mine, store, settings)
        except StoreError:
            raise
        except HandtrackError as error:
            notes.append(f"no pooled {side} hand of {pool.subject}: {error}")
    if len(scales) == 2 and abs(np.log(scales["left"] / scales["right"])) > np.log(1.1):
        notes.append(
            f"{pool.subject}: the left hand is {scales['left'] / scales['right']:.2f} times as"
            " large as the right one: are all clips of one person?"
        )
    said = {"digest": pool.digest, "hands": hands, "notes": notes}
    store.write(f"{pool.folder}/pool.json", json.dumps(said, indent=1).encode())
    return Found(pool.subject, hands, tuple(notes))


def _found(
    pool: Pool, side: str, sequences: list[Sequence], store: Store, settings: BatchSettings
) -> tuple[Pooled, float]:
    chosen = best_clips(sequences, POOLED)
    method = settings.tracking.calibration.by
    frames = max(MIN_FRAMES, min(settings.tracking.calibration.frames, _FRAMES // len(chosen)))
    base = settings.models.of(chosen[0].hand)
    base, profile = seen_by(base, settings.tracking.detector, chosen[0].detector)
    noise = None if profile is None else profile.noise
    chosen = [clip.corrected(profile) for clip in chosen]
    calibration = calibrate(base, chosen, method, frames=frames, noise=noise)
    about: dict[str, object] = _told(calibration) | {"sources": [s.source for s in chosen]}
    if calibration.method in ("full", "lengths"):
        about |= explain(calibration.model, chosen, frames).summary()
    with scratch() as folder:
        file = save_hand(calibration.model, folder / "hand.json", about)
        data = file.read_bytes()
    name = f"{pool.folder}/{side}/hand.json"
    store.write(name, data)
    return Pooled(name, file_digest(data)), calibration.scale


def _told(calibration: Calibration) -> dict[str, object]:
    return calibration.summary() | {"notes": list(calibration.notes)}


def best_clips(sequences: Several[Sequence], most: int) -> list[Sequence]:
    """Those that say most of a hand: half of them for the motion of their fingers, half evenly.

    A clip in which the fingers hardly move says little of axes, and one that is hardly seen
    little of lengths; but clips that move most are also those with the worst errors.
    """
    if len(sequences) <= most:
        return list(sequences)
    worth = np.array([_worth(s) for s in sequences])
    first = np.argsort(-worth, kind="stable")[: most // 2]
    rest = np.setdiff1d(np.arange(len(sequences)), first)
    even = evenly(rest, most - len(first))
    return [sequences[i] for i in np.sort(np.concatenate([first, even]))]


def _worth(sequence: Sequence) -> float:
    """Variance of the fingertips' distances to the wrist, times the share that is seen."""
    tips = sequence.joints[:, 4::4] - sequence.joints[:, :1]
    reach = np.linalg.norm(tips, axis=-1)
    seen = np.isfinite(reach).all(1)
    if seen.sum() < MIN_FRAMES:
        return 0.0
    return float(reach[seen].var(0).sum() * sequence.present.mean())
