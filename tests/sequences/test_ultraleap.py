"""Frames of Ultraleap's newer service, made after LeapC's structures."""

from __future__ import annotations

import json
from itertools import pairwise

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError

BONES = ("metacarpal", "proximal", "intermediate", "distal")
DIGITS = ("thumb", "index", "middle", "ring", "pinky")


def place(x):
    return dict(zip("xyz", map(float, x), strict=True))


def hand(joints, kind):
    digits = []
    for f in range(5):
        own = joints[1 + 4 * f : 5 + 4 * f]
        ends = [own[0] if f == 0 else 0.7 * joints[0] + 0.3 * own[0], *own]
        digits.append(
            {"bones": [{"prev_joint": place(a), "next_joint": place(b), "width": 15.0}
             for a, b in pairwise(ends)]}
        )  # fmt: skip
    arm = {"prev_joint": place(joints[0] - 200), "next_joint": place(joints[0])}
    return {"id": 5, "type": kind, "confidence": 1.0, "digits": digits, "arm": arm,
            "palm": {"position": place(joints[9]), "width": 80.0}}  # fmt: skip


@pytest.mark.parametrize("form", ["frames", "lines", "names"])
def test_all_forms(tmp_path, left, right, form):
    frames = [
        {
            "tracking_frame_id": t,
            "timestamp": 11_000 * t,
            "hands": [hand(1e3 * left[t], "Left"), hand(1e3 * right[t], "Right")],
        }
        for t in range(len(right))
    ]
    frames[0]["hands"] = []
    frames[4]["hands"].pop(0)
    path = tmp_path / "a.json"
    if form == "names":
        for frame in frames:
            for one in frame["hands"]:
                digits = one.pop("digits")
                one |= {
                    d: dict(zip(BONES, digit["bones"], strict=True))
                    for d, digit in zip(DIGITS, digits, strict=True)
                }
    text = json.dumps({"frames": frames})
    if form == "lines":
        path = tmp_path / "a.jsonl"
        text = "\n".join(map(json.dumps, frames))
    path.write_text(text)
    mine, other = ht.load(path)
    left[[0, 4]] = right[0] = np.nan
    np.testing.assert_allclose(mine.joints, left, atol=1e-9)
    np.testing.assert_allclose(other.joints, right, atol=1e-9)
    assert (mine.hand, other.hand) == ("left", "right")
    assert other.fps == pytest.approx(1e6 / 11_000, rel=1e-3)


def test_a_bone_that_is_none(tmp_path, right):
    frames = [{"timestamp": 11_000 * t, "hands": [hand(right[t], "Right")]} for t in range(5)]
    frames[3]["hands"][0]["digits"][2]["bones"][1]["prev_joint"] = {"x": 1, "y": "a"}
    path = tmp_path / "a.json"
    path.write_text(json.dumps(frames))
    with pytest.raises(HandtrackError, match="frame 3: a hand: the end of a bone is no place"):
        ht.load(path)
