"""mmpose's pictures in great number say what each says alone."""

from __future__ import annotations

import json

import numpy as np
import pytest

from handtrack.sequences.picture_landmarks import load_picture_landmarks
from handtrack.sequences.readers import json_file, keypoints_2d

PICTURES = 1500


def document(points: np.ndarray, sure: np.ndarray, first: int = 3) -> str:
    def one(i: int) -> dict[str, object]:
        keypoints, scores = points[i].round(4).tolist(), sure[i].round(3).tolist()
        return {"keypoints": keypoints, "keypoint_scores": scores, "bbox_score": i * 0.5}

    frames = [{"frame_id": first + 2 * i, "instances": [one(i)]} for i in range(len(points))]
    return json.dumps({"meta_info": {"dataset_name": "x"}, "instance_info": frames})


@pytest.mark.parametrize("n", [21, 42, 133])
def test_many_are_read_as_few(tmp_path, monkeypatch, n):
    rng = np.random.default_rng(n)
    points = rng.uniform(100, 900, (PICTURES, n, 2))
    sure = rng.uniform(0.1, 1, (PICTURES, n))
    sure[5], sure[9, n - 3] = 0, 0
    path = tmp_path / "a.json"
    path.write_text(document(points, sure))
    used = []
    kept = keypoints_2d.of_forms

    def watched(forms, where):
        used.append(kept(forms, where))
        return used[-1]

    monkeypatch.setattr(keypoints_2d, "of_forms", watched)
    many = load_picture_landmarks(path)
    assert used[0] is not None
    monkeypatch.setattr(json_file, "_LARGE", 10**9)
    few = load_picture_landmarks(path)
    assert len(used) == 1
    assert [(m.hand, m.name, m.notes) for m in many] == [(f.hand, f.name, f.notes) for f in few]
    for a, b in zip(many, few, strict=True):
        np.testing.assert_array_equal(a.points, b.points)
        np.testing.assert_array_equal(a.sure, b.sure)
        np.testing.assert_array_equal(a.frame_index, b.frame_index)
    if n == 21:
        np.testing.assert_array_equal(many[0].points[7], points[7].round(4))
        assert np.isnan(many[0].points[9, n - 3]).all()


def test_several_people_are_told_apart(tmp_path):
    points = np.random.default_rng(1).uniform(100, 900, (PICTURES, 21, 2))
    given = json.loads(document(points, np.ones((PICTURES, 21))))
    given["instance_info"][4]["instances"] *= 2
    path = tmp_path / "a.json"
    path.write_text(json.dumps(given))
    assert len(load_picture_landmarks(path)) == 2
