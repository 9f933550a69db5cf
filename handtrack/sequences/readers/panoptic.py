"""Reader of CMU Panoptic hands: `hdHand3d/handRecon3D_hd%08d.json`, one file per frame.

A frame holds people, each with an id and up to two hands; a hand has landmarks (63 numbers,
cm, this project's order) and may have averageScore (21) and validity. Joo et al. 2017; layout
as in the Panoptic toolbox.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from handtrack.errors import InputError
from handtrack.files import budget
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.raw import Array, NoFramesError, NotJointsError, Raw, stem

FPS = 30000 / 1001
"""Frames per second of the HD cameras (29.97)."""
FILE_NAME = re.compile(r"handRecon3D_hd(\d{1,18})\.json")
FRAME = 16 * budget.MB
"""Bytes of one frame."""
_NUMBERED = re.compile(r"(.*?)(\d{1,18})\.json")
Frames = tuple[int, int] | None


class _Hand(msgspec.Struct):
    """One hand in one frame, as written."""

    landmarks: list[float | None]
    average_score: list[float | None] | None = msgspec.field(default=None, name="averageScore")
    validity: list[float | bool | None] | float | bool | None = None


class _Person(msgspec.Struct):
    id: int
    left_hand: _Hand | None = None
    right_hand: _Hand | None = None


class _Frame(msgspec.Struct):
    people: list[_Person]


@dataclass
class _Seen:
    """What was seen of one hand of one person so far."""

    frame: list[int] = field(default_factory=list)
    joints: list[Array] = field(default_factory=list)
    confidence: list[Array] = field(default_factory=list)


def frame_number(name: str) -> int | None:
    """The frame number at the end of a file's name, None if there is none."""
    match = _NUMBERED.fullmatch(name)
    return None if match is None else int(match[2])


def prefix(name: str) -> str | None:
    """A numbered file's name without the number; files that share it make one sequence."""
    match = _NUMBERED.fullmatch(name)
    return None if match is None else match[1]


def holds_pixels(fields: Mapping[str, msgspec.Raw]) -> bool:
    """Whether people of a file in JSON are of OpenPose, in a picture, and not of Panoptic."""
    return b"keypoints_" in bytes(fields["people"])


def _is_frame(fields: Mapping[str, msgspec.Raw], data: bytes) -> bool:
    return "people" in fields and not holds_pixels(fields)


def read_file(data: bytes, path: Path) -> list[Raw]:
    """The sequences, of one frame each, of one Panoptic file.

    Raises:
        NotJointsError: no hand in it.
        InputError: malformed, or a field that does not fit.
    """
    number = frame_number(path.name)
    return collect([(0 if number is None else number, path, data)], path, stem(path))


def read_files(paths: Iterable[Path], folder: Path, frames: Frames = None) -> list[Raw]:
    """The sequences of a folder's numbered files; only files inside `frames` are opened.

    Raises:
        NotJointsError: no hand in any file.
        InputError: no file in that range, or as `read_file`.
    """
    numbered = sorted((n, p) for p in paths if (n := frame_number(p.name)) is not None)
    chosen = in_range(numbered, frames, folder)
    return collect(
        ((n, p, budget.read(p, FRAME)) for n, p in chosen), folder, recording_name(folder)
    )


def recording_name(folder: Path) -> str:
    """The recording's name: hdHand3d itself says nothing."""
    folder = folder if folder.name else folder.resolve()
    if folder.name.lower() == "hdhand3d":
        parent = folder.parent if folder.parent.name else folder.resolve().parent
        return parent.name or "panoptic"
    return folder.name or folder.resolve().name or "panoptic"


def in_range(
    numbered: list[tuple[int, Path]], frames: Frames, where: Path
) -> list[tuple[int, Path]]:
    if frames is None:
        return numbered
    chosen = [item for item in numbered if frames[0] <= item[0] <= frames[1]]
    if not chosen:
        raise NoFramesError(
            f"no frame in {frames[0]}:{frames[1]}, there are {numbered[0][0]}:{numbered[-1][0]}",
            where,
        )
    return chosen


def collect(items: Iterable[tuple[int, Path, bytes]], where: Path, name: str) -> list[Raw]:
    seen: dict[tuple[int, Hand], _Seen] = {}
    files = unidentified = 0
    for number, path, data in items:
        files += 1
        frame: _Frame = decode(data, _Frame, path)
        for person in frame.people:
            if person.id < 0:  # the toolbox's mark for somebody it could not follow
                unidentified += 1
                continue
            for hand, given in zip(HANDS, (person.left_hand, person.right_hand), strict=True):
                if given is None:
                    continue
                label = f"{hand}_hand"
                if len(frame.people) > 1:
                    label = f"person {person.id}: {label}"
                joints, confidence = _joints(given, label, path)
                track = seen.setdefault((person.id, hand), _Seen())
                if track.frame and track.frame[-1] == number:
                    raise InputError(f"two {hand} hands of person {person.id} in one frame", path)
                track.frame.append(number)
                track.joints.append(joints)
                track.confidence.append(confidence)
    if not seen:
        raise NotJointsError(f"no hand of anybody in {files} Panoptic file(s)", where)
    note = f"{unidentified} time(s) a person without an id (-1) was left out"
    return [
        Raw(
            np.array(track.joints),
            where,
            f"{name} person{person}",
            hand=hand,
            unit="cm",
            frame_index=np.array(track.frame, dtype=np.int64),
            fps=FPS,
            confidence=np.array(track.confidence),
            subject=f"person{person}",
            tagged=True,
            notes=(note,) if unidentified else (),
        )
        for (person, hand), track in sorted(seen.items())
    ]


def _joints(given: _Hand, label: str, path: Path) -> tuple[Array, Array]:
    """(21, 3) joints [cm] and (21,) confidence of one hand; NaN and 0 where it was not seen."""
    if len(given.landmarks) != 3 * N_JOINTS:
        raise InputError(
            f"{label}.landmarks has {len(given.landmarks)} numbers, expected 63 (21 joints x 3)",
            path,
        )
    joints = np.array(given.landmarks, dtype=np.float64).reshape(N_JOINTS, 3)
    confidence = np.ones(N_JOINTS)
    if given.average_score is not None:
        confidence = _per_joint(given.average_score, f"{label}.averageScore", path)
    valid = np.ones(N_JOINTS)
    if isinstance(given.validity, list):
        valid = _per_joint(given.validity, f"{label}.validity", path)
    elif given.validity is not None:
        valid[:] = float(given.validity)
    missing = (joints == 0).all(1) | ~(confidence > 0) | ~(valid > 0) | np.isnan(joints).any(1)
    joints[missing] = np.nan
    confidence = np.clip(np.nan_to_num(confidence), 0, 1)
    confidence[missing] = 0
    return joints, confidence


def _per_joint(
    values: list[float | None] | list[float | bool | None], what: str, path: Path
) -> Array:
    if len(values) != N_JOINTS:
        raise InputError(f"{what} has {len(values)} numbers, expected 21", path)
    return np.array(values, dtype=np.float64)


FORMATS = (
    Format(
        "CMU Panoptic",
        "`hdHand3d/handRecon3D_hd*.json`: one, a folder, a .tar(.gz)",
        "openpose",
        "cm",
        "both, of several people",
        "`people` in the JSON",
        kinds={"panoptic": read_file},
        suffixes=(".tar", ".gz", ".tgz", ".bz2", ".xz"),
        ways=(
            Way(
                "fields",
                _is_frame,
                read_file,
            ),
        ),
    ),
)
