"""JSON of many frames of few forms is read as if each frame were decoded."""

import json

import numpy as np
import pytest

from handtrack import InputError, load
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.readers import alike, json_file

N = 240


@pytest.fixture(scope="module")
def hand() -> np.ndarray:
    """(N, 21, 3) [m] a right hand that bends and goes on."""
    model = HandModel.default("right")
    bend = 0.5 + 0.4 * np.sin(np.arange(N) / 15)
    angles = np.zeros((N, 20))
    for finger in range(1, 5):
        angles[:, [4 * finger, 4 * finger + 2, 4 * finger + 3]] = bend[:, None]
    place = np.stack([0.1 * bend, 0.2 + 1e-6 * np.arange(N), np.full(N, 0.9)], axis=1)
    return model.joints(angles, np.broadcast_to(np.eye(3), (N, 3, 3)), place)


def named(points, **more):
    return {
        k: dict(zip("xyz", p, strict=True)) | more
        for k, p in zip(JOINT_NAMES, points.tolist(), strict=True)
    }


def sided(side, points):
    return {"hand": side, "joints": (points * [-1 if side == "left" else 1, 1, 1]).tolist()}


KINDS = {
    "flat": lambda i, x: {"time": i / 60, "joints": x.ravel().tolist()},
    "exact times": lambda i, x: {"time_ns": 10**18 + 1 + i * 10**7, "joints": x.tolist()},
    "not all exact": lambda i, x: {"time_ns": 10**7 * i * (1, 1.0)[i % 2], "joints": x.tolist()},
    "ROS": lambda i, x: {"stamp": {"sec": i // 60, "nanosec": i % 60 * 999}, "joints": x.tolist()},
    "numbers": lambda i, x: {"frame": 3 * i + 7, "joints": x.tolist(), "gesture": i % 3},
    "texts with digits": lambda i, x: {
        "device": "cam-1e3",
        "t": i,
        "left": None,
        "right": named(x),
    },
    "one hand a line": lambda i, x: {"t": i // 2, **sided("right" if i % 2 else "left", x)},
    "gone": lambda i, x: {"t": i, "hands": [] if i % 7 == 3 else [sided("left", x)]},
    "a joint gone": lambda i, x: {
        "t": i,
        "joints": [[None, *x.tolist()][k] for k in PLACES[i % 2]],
    },
    "confidence": lambda i, x: {"t": i, "joints": x.tolist(), "confidence": 0.5 + i / 1000},
    "visibility": lambda i, x: {"t": i, "right": named(x, visibility=(i % 9) / 8)},
    "never sure": lambda i, x: {"t": i, "right": named(x, visibility=0.0)},
    "stepping time": lambda i, x: {"t": 0 if i == 0 else i / 60, "joints": x.tolist()},
}
PLACES = [[0, *range(2, 22)], [*range(1, 21), 0]]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("form", ["lines", "list", "object"])
def test_the_same_as_decoded_one_by_one(kind, form, hand, tmp_path, monkeypatch):
    frames = [json.dumps(KINDS[kind](i, x)) for i, x in enumerate(hand)]
    path = tmp_path / "a.json"
    listed = f"[{','.join(frames)}]"
    about = {"lines": "\n".join(frames), "list": listed}
    path.write_text(about.get(form, f'{{"subject": "S7", "frames": {listed}}}'))
    monkeypatch.setattr(json_file, "_LARGE", 0)
    seen = []
    monkeypatch.setattr(
        json_file, "read_alike", lambda *a: seen.append(alike.read_alike(*a)) or seen[-1]
    )
    quick = load(path)
    assert seen[-1] is not None
    monkeypatch.setattr(json_file, "forms_of", lambda _: None)
    slow = load(path)
    assert len(quick) == len(slow) == (2 if kind == "one hand a line" else 1)
    for a, b in zip(quick, slow, strict=True):
        assert (a.hand, a.name, a.notes, a.subject, a.timed) == (
            b.hand,
            b.name,
            b.notes,
            b.subject,
            b.timed,
        )
        for name in ("joints", "time_ns", "confidence", "frame_index"):
            np.testing.assert_array_equal(getattr(a, name), getattr(b, name))


def test_values_against_the_truth(hand, tmp_path):
    path = tmp_path / "a.jsonl"
    path.write_text(
        "\n".join(
            json.dumps({"time_ns": 10**18 + i, "joints": x.tolist(), "f": 1})
            for i, x in enumerate(hand)
        )
    )
    (found,) = load(path, time_unit="ns")
    np.testing.assert_array_equal(found.joints, hand)


@pytest.mark.parametrize("wrong", ['{"joints": [1.2.3]}', '{"joints": [--1]}', '{"joints": [1, 2'])
def test_a_wrong_line_is_named(wrong, hand, tmp_path):
    lines = [json.dumps({"joints": x.tolist()}) for x in hand]
    lines[137] = wrong
    path = tmp_path / "a.jsonl"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match=r"line 138"):
        load(path)
