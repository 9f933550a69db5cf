"""Hands as MediaPipe's results have them, some names deep, and labels with a remark."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht


def points(frame):
    return [dict(zip("xyz", p, strict=True)) for p in frame.tolist()]


@pytest.mark.parametrize("names", [("data", "results"), ("results", "frames"), ("frames",)])
def test_results_some_names_deep(tmp_path, left, right, names):
    value = [
        {
            "timestamp": i / 25,
            "hand_world_landmarks": [points(r), points(a)],
            "handedness": [[{"category_name": "Right"}], [{"category_name": "Left"}]],
        }
        for i, (r, a) in enumerate(zip(right, left, strict=True))
    ]
    for name in reversed(names):
        value = {name: value}
    (tmp_path / "a.json").write_text(json.dumps(value))
    found = {s.hand: s for s in ht.load(tmp_path / "a.json")}
    assert found.keys() == {"left", "right"}
    assert np.allclose(found["left"].joints, left)
    assert np.allclose(found["right"].joints, right)


def test_labels_of_a_mirrored_picture(tmp_path, left):
    rows = ["frame,handedness,landmark,x,y,z"]
    for i, frame in enumerate(left.tolist()):
        rows += [f"{i},Left (mirrored),{j},{x},{y},{z}" for j, (x, y, z) in enumerate(frame)]
    (tmp_path / "a.csv").write_text("\n".join(rows))
    (found,) = ht.load(tmp_path / "a.csv")
    assert found.hand == "left"
    assert np.allclose(found.joints, left)
