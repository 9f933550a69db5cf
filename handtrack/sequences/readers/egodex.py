"""Reader of EgoDex (Hoque et al. 2025), and of what else records visionOS's hands in HDF5.

    transforms/NAME   (T, 4, 4) poses in ARKit's world [m]: camera, leftHand, leftThumbKnuckle,
                      leftIndexFingerMetacarpal, leftIndexFingerKnuckle ... rightHand ...
    confidences/NAME  (T,) 0..1, or none
    camera/intrinsic  (3, 3)

Frames are those of the video beside it, 30 a second. Each hand has 25 joints, of which the
fingers' metacarpals are none of ours.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.hand.skeleton import HANDS, JOINT_NAMES, N_JOINTS, Hand
from handtrack.sequences.names import UNUSED, joint_name, words
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.hdf5_file import (
    dataset,
    is_hdf5,
    member,
    names_in,
    numbers,
    read_hdf5,
)
from handtrack.sequences.readers.raw import Array, Raw, stem, usable_confidence
from handtrack.sequences.settled import settle

FPS = 30.0
_FEWEST = 4
"""Fewer joints by name are no hand."""


def read(file: Any, path: Path) -> list[Raw] | None:
    """The hands of an open HDF5 file; None where it is none of EgoDex.

    Raises:
        InputError: transforms that are none, or of different length.
    """
    group = member(file, "transforms", path)
    if group is None or not hasattr(group, "keys"):
        return None
    hands = _joints_by_hand(names_in(group, path))
    if not any(len(joints) >= _FEWEST for joints in hands.values()):
        there = shown(", ".join(names_in(group, path)[:8]))
        raise InputError(
            f"transforms holds no hand: expected leftHand, leftIndexFingerTip ..., found {there}",
            path,
        )
    sure = member(file, "confidences", path)
    raws = []
    for hand, joints in hands.items():
        if len(joints) >= _FEWEST:
            raws.append(_of_hand(group, sure, hand, joints, path))
    lengths = {len(raw.joints) for raw in raws}
    if len(lengths) > 1:
        raise InputError(f"the hands have {' and '.join(map(str, sorted(lengths)))} frames", path)
    return raws


def _joints_by_hand(names: list[str]) -> dict[Hand, dict[int, str]]:
    """Which of our joints each name is, by hand; bodies have joints that are none."""
    found: dict[Hand, dict[int, str]] = {}
    said = {name: joint_name(words(name)) for name in names}
    for hand in HANDS:
        own = [(name, s) for name, s in said.items() if s is not None and s.hand == hand]
        settled = settle(s for _, s in own)
        found[hand] = {
            joint: name
            for (name, _), joint in zip(own, settled, strict=True)
            if joint is not None and joint != UNUSED
        }
    return found


def _of_hand(group: Any, sure: Any, hand: Hand, joints: dict[int, str], path: Path) -> Raw:
    n = None
    places: Array = np.empty(0)
    confidence: Array | None = None
    for joint, name in sorted(joints.items()):
        data = dataset(group, name, path)
        if data is None or data.ndim != 3 or data.shape[1:] != (4, 4) or not len(data):
            shape = None if data is None else data.shape
            raise InputError(
                f"transforms/{shown(name, 60)} has shape {shape}, expected (frames, 4, 4)", path
            )
        if n is None:
            n = len(data)
            places = np.full((n, N_JOINTS, 3), np.nan)
        if len(data) != n:
            first = JOINT_NAMES[min(joints)]
            raise InputError(
                f"transforms/{shown(name, 60)} has {len(data)} frames, {first} has {n}", path
            )
        places[:, joint] = numbers(data, name, path)[:, :3, 3]
        given = None if sure is None or not hasattr(sure, "keys") else dataset(sure, name, path)
        if given is not None:
            if confidence is None:
                confidence = np.ones((n, N_JOINTS))
            if given.shape != (n,):
                raise InputError(
                    f"confidences/{shown(name, 60)} has shape {given.shape}, expected ({n},)", path
                )
            confidence[:, joint] = np.clip(numbers(given, name, path), None, 1.0)
    return Raw(
        places,
        path,
        stem(path),
        hand=hand,
        unit="m",
        order="handtrack",
        fps=FPS,
        confidence=None if confidence is None else usable_confidence(confidence),
        tagged=True,
    )


FORMATS = (
    Format(
        "EgoDex",
        "`N.hdf5`: `transforms/NAME`, `confidences/NAME`, 30 frames a second; other arrays in HDF5"
        " under the names of .npz",
        "by name",
        "m",
        "both",
        "file magic, `transforms`",
        "extra `formats`",
        ways=(Way("file", is_hdf5, read_hdf5),),
        suffixes=(".hdf5", ".h5", ".mat"),
        hdf5=read,
    ),
)
