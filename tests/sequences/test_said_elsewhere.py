"""What a file says beside its joints: of all frames, its truth's unit, what was not measured."""

from __future__ import annotations

import json
import tracemalloc

import numpy as np
import pytest

import handtrack as ht


@pytest.mark.parametrize("name", ["info", "meta", "metadata", "header"])
def test_an_object_inside_says_what_holds_for_all_frames(tmp_path, right, name):
    frames = [{"joints": x} for x in (right * 1e3).tolist()]
    said = {"fps": 50, "unit": "mm", "hand": "left", "cameras": [1, 2]}
    (tmp_path / "a.json").write_text(json.dumps({name: said, "frames": frames}))
    (found,) = ht.load(tmp_path / "a.json")
    assert (found.hand, found.fps) == ("left", pytest.approx(50))
    np.testing.assert_allclose(found.joints, right, atol=1e-9)
    # what stands outside is nearer to the joints
    document = {name: said, "fps": 25, "frames": frames}
    (tmp_path / "b.json").write_text(json.dumps(document))
    assert ht.load(tmp_path / "b.json")[0].fps == pytest.approx(25)


@pytest.mark.parametrize(("unit", "factor"), [("m", 1.0), ("cm", 1e2), ("mm", 1e3)])
@pytest.mark.parametrize(("of_truth", "times"), [("m", 1.0), ("cm", 1e2), ("mm", 1e3)])
def test_a_truth_in_another_unit(tmp_path, right, unit, factor, of_truth, times):
    truth = right * 1.05 + 0.2
    truth[3] = np.nan
    np.savez(tmp_path / "a.npz", joints=right * factor, truth=truth * times, unit=unit, fps=30)
    (found,) = ht.load(tmp_path / "a.npz")
    np.testing.assert_allclose(found.truth, truth, atol=1e-9)
    said = f"true joints read as {of_truth}, the joints as {unit}, by size"
    assert (said in found.notes) == (unit != of_truth)


@pytest.mark.parametrize("shape", [(), (21,)])
def test_a_confidence_that_was_never_measured(tmp_path, right, shape):
    np.savez(tmp_path / "a.npz", joints_m=right, confidence=np.zeros((len(right), *shape)))
    with pytest.raises(ht.InputError, match=r"a.npz: confidence is 0 for every joint in every"):
        ht.load(tmp_path / "a.npz")


@pytest.mark.parametrize("line", ["{}", "null", "[]"])
def test_millions_of_lines_of_nothing_are_told_at_once(tmp_path, line):
    path = tmp_path / "a.jsonl"
    path.write_text(f"{line}\n" * 1_000_000)
    tracemalloc.start()
    try:
        with pytest.raises(ht.InputError, match=r"a.jsonl: every frame is missing"):
            ht.load(path)
        assert tracemalloc.get_traced_memory()[1] < 10 * path.stat().st_size
    finally:
        tracemalloc.stop()


def test_a_list_of_millions_of_nothing(tmp_path):
    (tmp_path / "a.json").write_text("[" + "[]," * 400_000 + "[]]")
    with pytest.raises(ht.InputError, match=r"a.json: every frame is missing"):
        ht.load(tmp_path / "a.json")
