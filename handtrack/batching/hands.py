"""The hand that a clip is tracked with: its subject's, or its own."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from handtrack.batching.settings import BatchSettings
from handtrack.batching.store import Store, StoreError
from handtrack.calibration.calibrate import calibrate
from handtrack.calibration.explain import Explained, explain
from handtrack.calibration.reach import reach
from handtrack.detectors.chosen import seen_by
from handtrack.errors import InputError
from handtrack.files.long_arrays import scratch
from handtrack.hand.hand_file import load_hand
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import PARENTS
from handtrack.sequences.sequence import Sequence

EXPLAINED = 100
"""Frames of a clip by which a pooled hand is judged."""
# a clip's own hand is asked for where the pooled one leaves so much more than any hand must [m],
# and as a ratio
_APART_M, _APART = 5e-5, 1.25
_FREE, _LASTS = 37, 10
"""Coordinates of a frame that a pose leaves, and frames for which an error lasts."""
_FREEDOMS = {"lengths": 20, "full": 60}
# a calibration may gain so many times what a few steps towards it do
_HOPED = 2.0
_SOURCE = {"lengths": "pooled, lengths own", "full": "pooled, own from there"}


class Pooled(NamedTuple):
    """A hand that was found in several clips of its subject.

    Attributes:
        name: of its file among the results.
        digest: of the file.
    """

    name: str
    digest: str


class Chosen(NamedTuple):
    """The hand for a clip.

    Attributes:
        model: it.
        how: how `track` is still to calibrate it.
        source: "pooled", "pooled, lengths own", "pooled, own from there", "own" or "given".
        told: what the track's settings are to say of it.
        drift_mm: greatest change of a bone's length against the pooled hand.
    """

    model: HandModel
    how: bool | str
    source: str
    told: Mapping[str, Any]
    drift_mm: float | None = None


def hand_for(
    sequence: Sequence, settings: BatchSettings, hands: Mapping[str, Pooled], place: str | None
) -> Chosen:
    """The hand to track a sequence with.

    Where the clip's bones clearly have other lengths than the pooled hand, these drift to the
    clip's; where that leaves too much as well, axes do, with the pooled hand as the prior. Each
    step must be worth its freedoms by the Bayesian information criterion (Schwarz 1978).

    Raises:
        InputError: the sequence shows too little.
        StoreError: the pooled hand cannot be read.
    """
    pooled = hands.get(sequence.hand)
    if pooled is None or place is None:
        model, how = settings.models.subject(sequence, settings.tracking.calibration.method)
        return Chosen(model, how, "given" if how == "none" else "own", {})
    base = settings.models.of(sequence.hand)
    hand = pooled_hand(place, pooled.name, pooled.digest, base)
    hand, profile = seen_by(hand, settings.tracking.detector, sequence.detector)
    sequence = sequence.corrected(profile)
    try:
        found = explain(hand, sequence, EXPLAINED)
    except InputError:  # too few joints to judge by, which is no reason not to track
        return Chosen(hand, "none", "pooled", {})
    pooled_lengths, source = _lengths(hand), "pooled"
    spent = 0
    for method, freedoms in _FREEDOMS.items():
        excess = found.fitted.mean - found.bound.mean
        if excess < _APART_M or found.fitted.mean < _APART * found.bound.mean:
            break
        if not _promising(hand, sequence, found, method, freedoms - spent):
            continue
        frames = settings.tracking.calibration.frames
        try:
            own = calibrate(hand, sequence, method, frames=frames)
        except InputError:  # too short for axes, which then stay the subject's
            break
        better = explain(own.model, sequence, EXPLAINED)
        if _worth(found, better.fitted.rms, freedoms - spent):
            hand, found, source, spent = own.model, better, _SOURCE[method], freedoms
    drift = 1e3 * float(np.abs(_lengths(hand) - pooled_lengths).max())
    about = {"method": source, "hand": pooled.name, **found.summary()}
    return Chosen(hand, "none", source, {"calibration": about}, drift)


def _promising(
    hand: HandModel, sequence: Sequence, found: Explained, method: str, freedoms: int
) -> bool:
    """Whether a calibration of the clip's own may be worth its freedoms, at a fifth of its cost."""
    # no hand leaves less than the bound
    if not _worth(found, found.bound.rms, freedoms):
        return False
    return _worth(found, reach(hand, sequence, method, EXPLAINED).rms, freedoms, _HOPED)


def _worth(before: Explained, rms: float, freedoms: int, hoped: float = 1.0) -> bool:
    """Whether a hand of more freedoms is the likelier one, by the information criterion."""
    values = _FREE * max(1.0, before.frames / _LASTS)
    gain = values * np.log(max(before.fitted.rms, 1e-9) / max(rms, 1e-9))
    return bool(2.0 * hoped * gain > freedoms * np.log(values))


def _lengths(hand: HandModel) -> Any:
    joints = hand.rest_joints
    return np.linalg.norm(joints[1:] - joints[PARENTS[1:]], axis=1)


def pooled_hand(place: str, name: str, digest: str, base: HandModel) -> HandModel:
    """A pooled hand, with the skin of the hand that its calibration began with.

    Raises:
        StoreError: it is not there, or not the one that was found.
    """
    data = _content(place, name, digest)
    with scratch() as folder:
        file = folder / Path(name).name
        file.write_bytes(data)
        return load_hand(file, base)


@lru_cache(maxsize=64)
def _content(place: str, name: str, digest: str) -> bytes:
    store = Store(place)
    try:
        data = store.read(name)
    except FileNotFoundError:
        raise StoreError(f"{store.shown(name)} is gone: was it removed meanwhile?") from None
    if file_digest(data) != digest:
        raise StoreError(f"{store.shown(name)} has changed meanwhile")
    return data


def file_digest(data: bytes) -> str:
    """A short name for a file's content."""
    return hashlib.blake2b(data, digest_size=12).hexdigest()
