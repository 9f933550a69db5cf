"""Readers of pickled frames: HO-3D's `meta/*.pkl`, FrankMocap's `*_prediction_result.pkl`, and
arrays, lists and objects of joints, which are read as JSON's are.

Nothing in a pickle is run (`handtrack.hand.unpickle`).

HO-3D (Hampali et al. 2020): handJoints3D 21 x 3 in MANO's order with the tips last, thumb first;
m, OpenGL's camera axes, turned here to OpenCV's (y and z change sign). Right hands. The
evaluation split holds only the wrist.

FrankMocap (Rong et al. 2021), its hand demo with --save_pred_pkl: pred_output_list holds for each
person left_hand and right_hand (nothing where unseen), each with pred_joints_smpl 21 x 3, m,
this project's order, about the hand's own middle: sizes and shapes are real, places are not.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.hand.unpickle import plain, unpickle
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.json_file import from_value
from handtrack.sequences.readers.raw import Array, NoFramesError, NotJointsError, Raw

HO3D_NAME = re.compile(r"(\d{3,9})\.pkl")
FRANKMOCAP_NAME = re.compile(r"(.*?)(\d{0,18})_prediction_result\.pkl")
HO3D_FPS = 30.0
_TO_OPENCV = np.array([1.0, -1.0, -1.0])
_HO3D, _FRANKMOCAP = "handJoints3D", "pred_output_list"
_JOINTS = "pred_joints_smpl"
Frames = tuple[int, int] | None


def is_pickle(data: bytes, path: Path) -> bool:
    """Whether a file is one: protocols 0 and 1 have no mark of their own, but by their names."""
    named = path.suffix in (".pkl", ".pickle")
    return (named or data[:1] == b"\x80") and data[-1:] == b"."


def read_pickle(data: bytes, path: Path) -> list[Raw]:
    """The sequences of one pickle: of one frame, where it is HO-3D's or FrankMocap's.

    Raises:
        NotJointsError: another pickle.
        InputError: damaged, or not as its format says.
    """
    content = unpickle(data, path)
    if isinstance(content, list) and len(content) == 1 and isinstance(content[0], dict):
        content = content[0]  # np.save keeps an object as an array of one
    if isinstance(content, dict) and _HO3D in content:
        return _ho3d([(0, path, content)], path)
    if isinstance(content, dict) and _FRANKMOCAP in content:
        return _frankmocap([(0, path, content)], path)
    return from_value(_written_out(content, path), path)


def _written_out(value: Any, path: Path) -> Any:
    """A pickle's content as JSON would hold it; the budget of `unpickle` bounds its depth."""
    if isinstance(value, dict):
        return {str(key): _written_out(v, path) for key, v in value.items()}
    if isinstance(value, list | tuple):
        return [_written_out(v, path) for v in value]
    if value is None or isinstance(value, str | int | float):
        return value
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return _points(value, path, "an array").tolist()


def read_ho3d(paths: Iterable[Path], folder: Path, frames: Frames = None) -> list[Raw]:
    """The sequence of a `meta` folder; only files inside `frames` are opened.

    Raises:
        NotJointsError: these are pickles of another kind.
        InputError: no file in that range, or as `read_pickle`.
    """
    return _ho3d(_opened(paths, folder, HO3D_NAME, 1, frames), folder)


def read_frankmocap(paths: Iterable[Path], folder: Path, frames: Frames = None) -> list[Raw]:
    """A sequence for each hand of each person in a folder of FrankMocap's predictions.

    Raises:
        InputError: no file in that range, or as `read_pickle`.
    """
    return _frankmocap(_opened(paths, folder, FRANKMOCAP_NAME, 2, frames), folder)


_Opened = list[tuple[int, Path, dict[Any, Any]]]


def _opened(
    paths: Iterable[Path], folder: Path, name: re.Pattern[str], group: int, frames: Frames
) -> _Opened:
    """(number, path, content) of files that have that name, in order of their numbers."""
    named = [(m[group], p) for p in sorted(paths) if (m := name.fullmatch(p.name))]
    if all(digits for digits, _ in named):
        numbered = sorted((int(digits), p) for digits, p in named)
    else:
        numbered = [(i, p) for i, (_, p) in enumerate(named)]
    chosen = [(n, p) for n, p in numbered if frames is None or frames[0] <= n <= frames[1]]
    if not chosen:
        there = f"{numbered[0][0]}:{numbered[-1][0]}"
        raise NoFramesError(f"no frame in {frames}, there are {there}", folder)
    return [(n, p, _content(budget.read(p, budget.MODELS), p)) for n, p in chosen]


def _content(data: bytes, path: Path) -> dict[Any, Any]:
    content = unpickle(data, path)
    if not isinstance(content, dict):
        raise NotJointsError(f"holds a {type(content).__name__}, expected an object", path)
    return content


def _keys(content: dict[Any, Any]) -> str:
    return ", ".join(shown(key, 40) for key in list(content)[:5]) or "nothing"


def _ho3d(files: _Opened, folder: Path) -> list[Raw]:
    joints = np.full((len(files), N_JOINTS, 3), np.nan)
    for row, (_, path, content) in zip(joints, files, strict=True):
        if _HO3D not in content:
            raise NotJointsError(f"no {_HO3D} in it, found {_keys(content)}", path)
        given = content[_HO3D]
        if given is None:  # as HO-3D has it where there is no annotation
            continue
        points = _points(given, path, _HO3D)
        if points.shape == (3,):
            row[0] = points
        elif points.shape == (N_JOINTS, 3):
            row[:] = points
        else:
            raise InputError(f"{_HO3D} has shape {points.shape}, expected (21, 3)", path)
    if np.isnan(joints[:, 1:]).all():
        raise NotJointsError("only wrists: this is HO-3D's evaluation split", folder)
    place = folder.resolve()
    name = place.parent.name if place.name == "meta" else place.stem
    return [
        Raw(
            joints * _TO_OPENCV,
            folder,
            name,
            hand="right",
            unit="m",
            order="mano",
            frame_index=np.array([n for n, _, _ in files]),
            fps=HO3D_FPS,
        )
    ]


def _frankmocap(files: _Opened, folder: Path) -> list[Raw]:
    found: dict[tuple[int, Hand], Array] = {}
    for t, (_, path, content) in enumerate(files):
        people = content.get(_FRANKMOCAP)
        if not isinstance(people, list):
            raise InputError(f"{_FRANKMOCAP} is no list: a file of FrankMocap's?", path)
        for person, hands in enumerate(people):
            for hand in HANDS:
                joints = _predicted(hands, hand, path)
                if joints is not None:
                    key = (person, hand)
                    blank = np.full((len(files), N_JOINTS, 3), np.nan)
                    found.setdefault(key, blank)[t] = joints
    if not found:
        raise NotJointsError("no hand was found in any picture", folder)
    place = folder.resolve()
    name = place.parent.name if place.name == "mocap" else place.stem
    numbers = np.array([n for n, _, _ in files])
    several = len({person for person, _ in found}) > 1
    return [
        Raw(
            joints,
            folder,
            f"{name} person{person}" if several else name,
            hand=hand,
            unit="m",
            order="openpose",
            frame_index=numbers,
            tagged=True,
            notes=("FrankMocap: the hand about its own middle, not where it is in the room",),
        )
        for (person, hand), joints in sorted(found.items())
    ]


def _predicted(hands: Any, hand: Hand, path: Path) -> Array | None:
    of_hand = hands.get(f"{hand}_hand") if isinstance(hands, dict) else None
    if not of_hand:  # None, or an empty object, where nothing was found
        return None
    if not isinstance(of_hand, dict) or _JOINTS not in of_hand:
        raise InputError(
            f"{hand}_hand has no {_JOINTS}: older FrankMocap does not save joints", path
        )
    points = _points(of_hand[_JOINTS], path, _JOINTS)
    if points.shape != (N_JOINTS, 3):
        raise InputError(f"{_JOINTS} has shape {points.shape}, expected (21, 3)", path)
    return points


def _points(value: Any, path: Path, what: str) -> Array:
    try:
        array = plain(value)
    except (LookupError, OverflowError, RecursionError, TypeError, ValueError) as error:
        raise InputError(f"{what}: {shown(str(error))}, expected numbers", path) from None
    with np.errstate(invalid="ignore", over="ignore"):  # what is no number is missing
        return array.astype(np.float64)


FORMATS = (
    Format(
        "HO-3D",
        "a `meta` folder of .pkl, or the folders above; nothing in a pickle is run",
        "mano",
        "m, turned to OpenCV's axes",
        "right",
        "file names, `handJoints3D`",
        kinds={"ho3d": read_pickle},
        numbered=(HO3D_NAME, read_ho3d),
        ways=(Way("bytes", is_pickle, read_pickle),),
    ),
    Format(
        "FrankMocap's output",
        "a folder of `*_prediction_result.pkl` (`--save_pred_pkl`)",
        "openpose",
        "m, about the hand's middle",
        "both",
        "file names",
        kinds={"frankmocap": read_pickle},
        numbered=(FRANKMOCAP_NAME, read_frankmocap),
    ),
)
