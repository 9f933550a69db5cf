"""Readers of hands in pictures as detectors of bodies store them: JSON of pixels and confidences.

OpenPose: `*_keypoints.json`, a file for each picture: people with `hand_left_keypoints_2d` and
`hand_right_keypoints_2d`, 63 numbers x, y, confidence; all 0: not seen.
mmpose: `instance_info` of `{frame_id, instances: [{keypoints, keypoint_scores}]}`, or a list of
instances of one picture; 21 points of one hand, or COCO-WholeBody's 133, of which 91 to 111 are the
left hand and 112 to 132 the right one.
COCO-WholeBody: `annotations` with `image_id`, `lefthand_kpts` and `righthand_kpts`, 63 numbers
x, y, visibility; results of detectors are lists of `{image_id, keypoints, score}`.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from handtrack.errors import InputError
from handtrack.files import budget
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.jsontext import decode
from handtrack.sequences.readers.number_text import Forms
from handtrack.sequences.readers.openpose_alike import HAND_KEYS, of_one_person
from handtrack.sequences.readers.panoptic import FRAME, Frames, holds_pixels, in_range
from handtrack.sequences.readers.pictures import flat
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw, stem

FILE_NAME = re.compile(r"(.*?)_?(\d{1,18})_keypoints\.json")
"""OpenPose's files: of a video's name, its frame's number."""
_COCO_KEYS: dict[Hand, str] = {"left": "lefthand_kpts", "right": "righthand_kpts"}
_WHOLE_BODY, _LEFT = 133, 91
_AT_ONCE = 512
"""Files whose numbers become arrays together."""


@dataclass
class _Seen:
    """One hand in the pictures: its points x, y, confidence (21, 3) by number."""

    frame: list[int] = field(default_factory=list)
    points: list[Array] = field(default_factory=list)


_Key = tuple[str, Hand | None]


def openpose_prefix(name: str) -> str | None:
    """What OpenPose's files of one video share; None of another name."""
    match = FILE_NAME.fullmatch(name)
    return None if match is None else match[1]


def read_openpose(paths: Iterable[Path], folder: Path, frames: Frames = None) -> list[Raw]:
    """The hands in a video's pictures, of OpenPose's files; only those inside `frames` are opened.

    Raises:
        NotJointsError: no hand in any file.
        InputError: no file in that range, one that is damaged, or numbers that do not fit.
    """
    found = [(FILE_NAME.fullmatch(p.name), p) for p in paths]
    numbered = sorted((int(m[2]), p) for m, p in found if m is not None)
    chosen = in_range(numbered, frames, folder)
    hands: dict[_Key, _Seen] = {}
    for begin in range(0, len(chosen), _AT_ONCE):
        some = chosen[begin : begin + _AT_ONCE]
        values = [decode(budget.read(path, FRAME), dict[str, Any], path) for _, path in some]
        if not _add_alike(hands, [number for number, _ in some], values):
            for (number, path), value in zip(some, values, strict=True):
                _add_people(hands, number, value, path)
    name = openpose_prefix(chosen[0][1].name) or folder.resolve().name
    return _raws(hands, [n for n, _ in chosen], folder, name)


def _is_frame(fields: Mapping[str, msgspec.Raw], data: bytes) -> bool:
    return "people" in fields and holds_pixels(fields)


def read_one(data: bytes, path: Path) -> list[Raw]:
    """The hands in one of OpenPose's files; errors as `read_openpose`."""
    hands: dict[_Key, _Seen] = {}
    _add_people(hands, 0, decode(data, dict[str, Any], path), path)
    return _raws(hands, [0], path, stem(path))


def read_other(value: Any, path: Path) -> list[Raw] | None:
    """The hands of mmpose's and COCO's files; None where it is neither.

    Raises:
        NotJointsError: no hand in it.
        InputError: numbers that do not fit.
    """
    records = list(_records(value))
    if not records:
        return None
    hands = _alike(records)
    if hands is not None:
        return _raws(hands, sorted({number for number, _ in records}), path, stem(path))
    hands = {}
    count: dict[int, int] = {}
    for number, record in records:
        place = count.get(number, 0)
        count[number] = place + 1
        for hand, points in _of_record(record, f"picture {number}", path):
            _put(hands, (_person(place), hand), number, points)
    return _raws(hands, sorted(count), path, stem(path))


def _records(value: Any) -> Iterator[tuple[int, dict[str, Any]]]:
    """Instances, each with its picture's number; none where it is another kind of file."""
    if isinstance(value, dict) and isinstance(value.get("instance_info"), list):
        for i, frame in enumerate(value["instance_info"]):
            if not isinstance(frame, dict):
                return
            number, inside = frame.get("frame_id", i), frame.get("instances")
            for one in inside if isinstance(inside, list) else ():
                if isinstance(one, dict) and isinstance(number, int):
                    yield number, one
        return
    given = value.get("annotations") if isinstance(value, dict) else value
    if not isinstance(given, list) or not given or not isinstance(given[0], dict):
        return
    coco = "image_id" in given[0] and ("keypoints" in given[0] or "lefthand_kpts" in given[0])
    if not coco and not {"keypoints", "keypoint_scores"} <= given[0].keys():
        return
    numbers: dict[Any, int] = {}
    for one in given:
        if not isinstance(one, dict):
            continue
        image = str(one.get("image_id", 0))
        digits = re.findall(r"\d{1,18}", image)
        number = int(digits[-1]) if digits else numbers.setdefault(image, len(numbers))
        yield number, one


def _alike(records: list[tuple[int, dict[str, Any]]]) -> dict[_Key, _Seen] | None:
    """The hands of records that are all of one hand of 21 points in a picture of its own, read
    together; None of others."""
    first = records[0][1]
    numbers = [number for number, _ in records]
    scored = "keypoint_scores" in first
    if len(set(numbers)) < len(numbers) or any(key in first for key in _COCO_KEYS.values()):
        return None
    if any(r.keys() != first.keys() for _, r in records):
        return None
    try:
        points = np.array([r["keypoints"] for _, r in records], dtype=np.float64)
        sure = np.array([r["keypoint_scores"] for _, r in records]) if scored else None
    except (ValueError, TypeError, OverflowError, KeyError):
        return None
    if points.shape[1:] != (N_JOINTS, 2 if scored else 3) or not np.isfinite(points).all():
        return None
    if sure is not None:
        if sure.shape != points.shape[:2] or sure.dtype.kind != "f":
            return None
        points = np.concatenate([points, sure[..., None]], axis=2)
    seen = np.flatnonzero((points[..., 2] > 0).any(1)).tolist()
    if not seen:
        return None
    return {(_person(0), None): _Seen([numbers[i] for i in seen], list(points[seen]))}


def of_forms(forms: Forms | None, path: Path) -> list[Raw] | None:
    """The hands of mmpose's `instance_info` whose pictures all are written alike, each with one
    instance; None of others."""
    if forms is None or len(forms.forms) != 1:
        return None
    form = forms.forms[0]
    # the first picture with each number's column, counted from 1, in its place
    parts, end = [], 0
    for c, (a, b) in enumerate(form.spans.tolist(), 1):
        parts += [form.first[end:a], str(c).encode()]
        end = b
    first = decode(b"".join((*parts, form.first[end:])), Any, path)
    records = list(_records({"instance_info": [first]}))
    if len(records) != 1 or "frame_id" not in first or "keypoint_scores" not in records[0][1]:
        return None
    column, record = records[0]
    values, whole = form.numbers.whole(), form.whole.get(column - 1)
    if whole is None or len(set(numbers := whole.whole().tolist())) < len(numbers):
        return None
    hands: dict[_Key, _Seen] = {}
    for hand, columns in _of_record(record, f"picture {numbers[0]}", path):
        points = values[:, columns.astype(np.int64) - 1]
        rows = np.flatnonzero((points[..., 2] > 0).any(1))
        if len(rows):
            seen = [numbers[i] for i in rows.tolist()]
            hands[_person(0), hand] = _Seen(seen, list(points[rows]))
    return _raws(hands, sorted(numbers), path, stem(path)) if hands else None


def _of_record(
    record: dict[str, Any], place: str, path: Path
) -> Iterator[tuple[Hand | None, Array]]:
    coco = [(hand, record[key]) for hand, key in _COCO_KEYS.items() if record.get(key) is not None]
    for hand, value in coco:
        if record.get(f"{hand}hand_valid", True):
            yield hand, _points(value, f"{place}: {hand}hand_kpts", path)
    value = record.get("keypoints")
    if coco or value is None:
        return
    points = _points(value, f"{place}: keypoints", path)
    sure = record.get("keypoint_scores")
    if sure is not None:
        if len(value) and isinstance(value[0], list) and len(value[0]) == 3:
            raise InputError(f"{place}: keypoints have x, y and z: give them as joints", path)
        points[:, 2] = _numbers(sure, len(points), f"{place}: keypoint_scores", path)
    if len(points) == N_JOINTS:
        yield None, points
    elif len(points) == _WHOLE_BODY:
        yield "left", points[_LEFT : _LEFT + N_JOINTS]
        yield "right", points[_LEFT + N_JOINTS :]
    elif len(points) == 2 * N_JOINTS:  # InterHand's order of hands
        yield "right", points[:N_JOINTS]
        yield "left", points[N_JOINTS:]


def _add_people(hands: dict[_Key, _Seen], number: int, value: dict[str, Any], path: Path) -> None:
    people = value.get("people")
    if not isinstance(people, list):
        raise NotJointsError("no people in it, as OpenPose has them", path)
    for i, person in enumerate(people):
        if not isinstance(person, dict):
            raise InputError(f"people[{i}] is no object", path)
        known = person.get("person_id", [-1])
        known = known[0] if isinstance(known, list) and known else known
        name = _person(known if isinstance(known, int) and known >= 0 else i)
        for hand, key in HAND_KEYS.items():
            if person.get(key):
                _put(hands, (name, hand), number, _points(person[key], f"people[{i}].{key}", path))


def _add_alike(hands: dict[_Key, _Seen], numbers: list[int], values: list[dict[str, Any]]) -> bool:
    """Add the hands of pictures together; False, and nothing done, where they are not alike."""
    found = of_one_person(numbers, values)
    if found is None:
        return False
    keys: dict[Hand, _Key] = {hand: (_person(0), hand) for hand in found}
    if any(hands[keys[h]].frame[-1:] == f[:1] for h, (f, _) in found.items() if keys[h] in hands):
        return False  # of files with one number the first counts
    for hand, (frame, points) in found.items():
        seen = hands.setdefault(keys[hand], _Seen())
        seen.frame += frame
        seen.points += list(points)
    return True


def _person(number: int) -> str:
    return f"person {number}"


def _put(hands: dict[_Key, _Seen], key: _Key, number: int, points: Array) -> None:
    if not (points[:, 2] > 0).any():
        return
    seen = hands.setdefault(key, _Seen())
    if not seen.frame or seen.frame[-1] != number:
        seen.frame.append(number)
        seen.points.append(points)


def _points(value: Any, place: str, path: Path) -> Array:
    """(N, 3) x, y and confidence."""
    try:
        array = np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        array = np.zeros(0)
    if array.ndim == 3 and array.shape[0] == 1:
        array = array[0]
    if array.ndim == 1 and array.size and array.size % 3 == 0:
        array = array.reshape(-1, 3)
    if array.ndim != 2 or array.shape[1] not in (2, 3) or np.isinf(array).any():
        raise InputError(f"{place} holds no list of x, y and confidence", path)
    if array.shape[1] == 2:
        array = np.concatenate([array, np.ones((len(array), 1))], axis=1)
    return array


def _numbers(value: Any, n: int, place: str, path: Path) -> Array:
    try:
        array = np.array(value, dtype=np.float64).ravel()
    except (ValueError, TypeError, OverflowError):
        array = np.zeros(0)
    if len(array) != n:
        raise InputError(f"{place} holds {len(array)} numbers for {n} points", path)
    return array


def _raws(hands: dict[_Key, _Seen], numbers: list[int], path: Path, name: str) -> list[Raw]:
    """A sequence of each hand, over all pictures."""
    if not hands:
        raise NotJointsError("people in pictures, but no hand is seen (OpenPose: --hand)", path)
    index = np.array(numbers, dtype=np.int64)
    row = {n: i for i, n in enumerate(numbers)}
    several = len({person for person, _ in hands}) > 1
    found = []
    for person, hand in sorted(hands, key=lambda key: (key[0], key[1] or "")):
        seen = hands[person, hand]
        joints = np.full((len(numbers), N_JOINTS, 3), np.nan)
        sure = np.zeros((len(numbers), N_JOINTS))
        for n, points in zip(seen.frame, seen.points, strict=True):
            if points.shape != (N_JOINTS, 3):
                raise InputError(f"picture {n}: a hand of {len(points)} points, expected 21", path)
        at, points = [row[n] for n in seen.frame], np.array(seen.points)
        joints[at, :, :2] = np.where(points[..., 2:] > 0, points[..., :2], np.nan)
        # COCO's visibility is 2 where seen, 1 where guessed
        sure[at] = np.clip(points[..., 2], 0, None)
        if sure.max() > 1.5:
            sure = np.where(sure > 0, np.clip(sure / 2, 0.5, 1.0), 0.0)
        raw = Raw(joints, path, f"{name} {person}" if several else name, hand=hand)
        raw.frame_index, raw.confidence = index, np.clip(sure, 0, 1)
        found.append(flat(raw))
    return found


FORMATS = (
    Format(
        "Landmarks in pictures: MediaPipe, OpenPose, mmpose, COCO-WholeBody",
        "tables, JSON, .npy and .npz of x and y (with MediaPipe's z or without), in pixels or"
        " shares of the picture; OpenPose's `*_keypoints.json` (`hand_left_keypoints_2d` ...), a"
        " folder of them; mmpose's `instance_info` (21 or 133 points); COCO's `keypoints`,"
        " `lefthand_kpts`",
        "handtrack, or by name",
        "px",
        "both, of several people",
        "no z, or a wrist whose z is always 0",
        "`--camera LENS`, or `--image-size WxH` and `--fov`",
        numbered=(FILE_NAME, read_openpose),
        ways=(Way("fields", _is_frame, read_one),),
    ),
)
