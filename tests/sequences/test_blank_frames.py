"""Whatever says "not seen" in JSON is a missing frame or joint, in every form of joints."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES

FRAMES, AT = 5, 2
NAMES = [name.lower() for name in JOINT_NAMES]
FINGERS = ("thumb", "index", "middle", "ring", "little")
Shape = Callable[[np.ndarray], Any]


def _objects(joints: np.ndarray) -> list[dict[str, float]]:
    return [dict(zip("xyz", point, strict=True)) for point in joints.tolist()]


def _fingers(joints: np.ndarray) -> dict[str, Any]:
    of = {f: joints[1 + 4 * i : 5 + 4 * i].tolist() for i, f in enumerate(FINGERS)}
    return {"wrist": joints[0].tolist(), **of}


SHAPES: dict[str, Shape] = {
    "points": lambda j: j.tolist(),
    "flat": lambda j: j.ravel().tolist(),
    "objects": _objects,
    "named": lambda j: dict(zip(NAMES, j.tolist(), strict=True)),
    "named objects": lambda j: dict(zip(NAMES, _objects(j), strict=True)),
    "fingers": _fingers,
    "axes": lambda j: {axis: j[:, i].tolist() for i, axis in enumerate("xyz")},
}


def _filled(value: Any, by: Any) -> Any:
    if isinstance(value, dict):
        return {k: _filled(v, by) for k, v in value.items()}
    return [_filled(v, by) for v in value] if isinstance(value, list) else by


def blanks(full: Any) -> list[Any]:
    """A frame that holds nothing, in all the ways."""
    wholes = [None, {}, [None] * 21, [[None] * 3] * 21, [None] * 63, [{}] * 21, [[]] * 21]
    return wholes + [_filled(full, by) for by in (None, float("nan"), "NaN", "nan", "")]


def _lines(frames: list[Any], of: Callable[[int, Any], Any]) -> str:
    return "\n".join(json.dumps(of(i, frame)) for i, frame in enumerate(frames))


def _hands(i: int, frame: Any) -> Any:
    return {"time": i / 30, "hands": [{"handedness": "right", "joints": frame}]}


FILES: dict[str, tuple[str, Callable[[list[Any]], str]]] = {
    "list": ("a.json", json.dumps),
    "joints": ("a.json", lambda v: json.dumps({"joints": v})),
    "objects": (
        "a.json",
        lambda v: json.dumps([{"joints": f, "frame": i} for i, f in enumerate(v)]),
    ),
    "numbered": ("a.json", lambda v: json.dumps({f"frame_{i}": f for i, f in enumerate(v)})),
    "lines": ("a.jsonl", lambda v: _lines(v, lambda i, f: f)),
    "lines of sides": ("a.jsonl", lambda v: _lines(v, lambda i, f: {"right": f, "time": i / 30})),
    "lines of hands": ("a.jsonl", lambda v: _lines(v, _hands)),
    "MediaPipe": ("a.jsonl", lambda v: _lines(v, lambda i, f: {"worldLandmarks": [f]})),
}
# objects that say all frames at once, or that stand where only lists do
NEVER = {
    *(
        (shape, file)
        for shape in ("named", "named objects", "fingers", "axes")
        for file in ("joints", "numbered", "MediaPipe")
    ),
    ("axes", "list"),
}


def _read(folder: Path, file: str, frames: list[Any]) -> np.ndarray:
    name, text = FILES[file]
    path = folder / name
    path.write_text(text(frames))
    (sequence,) = ht.load(path, hand="right", fps=30)
    return sequence.joints


@pytest.fixture(scope="module")
def joints() -> np.ndarray:
    hand = ht.HandModel.default("right")
    angles = hand.mean_angles + np.linspace(0.0, 0.2, FRAMES)[:, None]
    turned = np.repeat(np.eye(3)[None], FRAMES, 0)
    return hand.joints(angles, turned, np.linspace(0.1, 0.13, 3 * FRAMES).reshape(FRAMES, 3))


@pytest.mark.parametrize("file", FILES)
@pytest.mark.parametrize("shape", SHAPES)
def test_a_frame_that_holds_nothing_is_missing(shape, file, joints, tmp_path):
    if (shape, file) in NEVER:
        pytest.skip("nobody writes this")
    frames = [SHAPES[shape](j) for j in joints]
    for at in (0, AT):
        expected = joints.copy()
        expected[at] = np.nan
        for blank in blanks(frames[at]):
            if shape == "flat" and file in ("list", "joints") and blank == [[None] * 3] * 21:
                continue  # points among numbers are of another shape
            given = [*frames[:at], blank, *frames[at + 1 :]]
            np.testing.assert_allclose(_read(tmp_path, file, given), expected, atol=1e-9)


@pytest.mark.parametrize("shape", ["points", "objects", "named", "named objects", "fingers"])
@pytest.mark.parametrize("file", ["objects", "lines", "lines of sides", "lines of hands"])
def test_a_joint_that_holds_nothing_is_missing(shape, file, joints, tmp_path):
    for at, joint in ((0, 0), (AT, 7)):
        expected = joints.copy()
        expected[at, joint] = np.nan
        for blank in (None, [], {}, "", [None] * 3, ["NaN"] * 3, [""] * 3):
            frames = [SHAPES[shape](j) for j in joints]
            _put(frames[at], joint, blank)
            np.testing.assert_allclose(_read(tmp_path, file, frames), expected, atol=1e-9)


def _put(frame: Any, joint: int, blank: Any) -> None:
    if isinstance(frame, list):
        frame[joint] = blank
    elif "index" in frame and joint:
        frame["index"][joint - 5] = blank
    else:
        frame[NAMES[joint]] = blank


def test_empty_texts_of_a_file_are_no_joints(joints, tmp_path):
    """Names and notes may be empty, or NaN, and say nothing by it."""
    path = tmp_path / "a.jsonl"
    lines = [{"name": "", "note": 'a, "", "NaN"', "joints": j.tolist()} for j in joints]
    path.write_text("\n".join(map(json.dumps, lines)))
    (sequence,) = ht.load(path, hand="right", fps=30)
    np.testing.assert_allclose(sequence.joints, joints)


def test_nothing_at_all_is_said(tmp_path):
    for file in FILES:
        with pytest.raises(ht.InputError):
            _read(tmp_path, file, [[None] * 21] * 4)
