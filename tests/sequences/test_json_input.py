"""Plain JSON and JSON lines."""

import json

import numpy as np
import pytest

import handtrack as ht


def lists(joints):
    """Nested lists with null for missing joints."""
    return [[None if np.isnan(j).any() else j.tolist() for j in frame] for frame in joints]


@pytest.fixture
def write(tmp_path):
    def to(value, name="a.json"):
        path = tmp_path / name
        path.write_text(value if isinstance(value, str) else json.dumps(value))
        return path

    return to


def test_list_of_frames(write, right):
    (sequence,) = ht.load(write(right.tolist()))
    np.testing.assert_array_equal(sequence.joints, right)
    (flat,) = ht.load(write(right.reshape(-1, 63).tolist()))
    np.testing.assert_array_equal(flat.joints, right)


def test_one_frame(write, right):
    for value in (right[0].tolist(), right[0].ravel().tolist(), right[:1].tolist()):
        (sequence,) = ht.load(write(value))
        np.testing.assert_array_equal(sequence.joints, right[:1])


def test_nulls_and_nans(write, right):
    right[2, 3] = np.nan
    right[4] = np.nan
    value = lists(right)
    value[4] = None
    for text in (json.dumps(value), json.dumps(right.tolist())):  # the second one has NaN
        (sequence,) = ht.load(write(text))
        np.testing.assert_array_equal(sequence.joints, right)


def test_object(write, right):
    time = [0.1 * i + 5 for i in range(len(right))]
    value = {
        "joints_mm": (right * 1e3).tolist(),
        "hand": "Right",
        "time": time,
        "frame": list(range(100, 112)),
        "subject": "B",
        "confidence": [0.5] * len(right),
        "truth_mm": (right * 1e3).tolist(),
        "unknown": {"a": 1},
    }
    (sequence,) = ht.load(write(value))
    np.testing.assert_allclose(sequence.joints, right)
    np.testing.assert_allclose(sequence.truth, right)
    np.testing.assert_array_equal(sequence.time_ns, np.round(np.array(time) * 1e9))
    assert sequence.frame_index[0] == 100
    assert (sequence.confidence == 0.5).all()
    assert (sequence.hand, sequence.subject) == ("right", "B")


def test_unit_and_order_in_an_object(write, right):
    mano = np.empty_like(right)
    mano[:, list(ht_orders()["mano"])] = right * 100
    value = {"joints": mano.tolist(), "unit": "cm", "order": "mano", "fps": 60}
    (sequence,) = ht.load(write(value))
    np.testing.assert_allclose(sequence.joints, right)
    assert sequence.fps == pytest.approx(60)


def ht_orders():
    from handtrack.hand.skeleton import ORDERS

    return ORDERS


def test_exact_nanoseconds(write, right):
    stamps = [1_782_897_167_604_809_001 + 33_333_333 * i for i in range(len(right))]
    (sequence,) = ht.load(write({"joints": right.tolist(), "time_ns": stamps}))
    assert sequence.time_ns.tolist() == stamps


def test_lines_of_arrays(write, right):
    text = "\n".join(json.dumps(f.tolist()) for f in right) + "\n\n"
    (sequence,) = ht.load(write(text, "a.jsonl"))
    np.testing.assert_array_equal(sequence.joints, right)


def test_lines_of_both_hands_in_turn(write, left, right):
    lines = []
    for i, (a, b) in enumerate(zip(left, right, strict=True)):
        lines.append({"time": i / 60, "joints": lists([a])[0], "hand": "left", "confidence": 0.7})
        if i != 4:
            scores = [0.9] * 20 + [None]
            lines.append({"time": i / 60, "joints": b.tolist(), "hand": "right"})
            lines[-1]["confidence"] = [*scores[:20], 0.1]
        else:
            lines.append({"time": i / 60, "joints": None, "hand": "right"})
    a, b = ht.load(write("\n".join(map(json.dumps, lines)), "pair.json"))  # by content
    assert (a.hand, b.hand) == ("left", "right")
    np.testing.assert_array_equal(a.joints, left)
    assert not b.present[4].any()
    assert b.confidence[3, 20] == 0.1
    assert a.fps == pytest.approx(60)
    # frame objects in one list are the same
    same, _ = ht.load(write(lines, "pair2.json"))
    np.testing.assert_array_equal(same.joints, left)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[1,2,", r"the JSON is cut short: it ends after 6 bytes \(line 1\)"),
        ('{"joints": [\n[1,2,x]]}', r"wrong JSON: invalid character at byte 18 \(line 2\)"),
        ("[]", "the list of frames is empty"),
        ("{}", "no joints in it: expected joints_m or joints, found nothing"),
        ('{"a": 1}', "found a"),
        ('["a"]', "the list holds no frames"),
        ('{"joints": 5}', "joints is a number, expected a list"),
        ('{"joints": "abc"}', "joints is text, expected a list"),
        ('{"joints": [[1, 2], [3]]}', r"joints\[1\] has shape \(1,\), joints\[0\] has \(2,\)"),
        ('{"joints": [[1, "a"]]}', r"joints\[0\]\[1\] is text, expected a number"),
        ('{"joints": [[1, {}]]}', r"joints\[0\]\[1\] is an object"),
        ('{"joints": [[1, 2]]}', r"joints has shape \(1, 2\), expected \(frames, 21, 3\)"),
        ('{"joints": []}', r"joints has shape \(0,\)"),
        ("[" * 3000, "nested too deeply|cut short"),
        ('["\udcff"]', "not UTF-8"),
        ("[1e999]", "out of range|shape"),
        ('[[1,2,3]]\n{"a":1}\n', "line 1 is not an object, others are"),
    ],
)
def test_wrong_json(tmp_path, text, message):
    path = tmp_path / "bad.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(ht.InputError, match=message) as caught:
        ht.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_wrong_lines_name_the_line(write, right):
    good = {"joints": right[0].tolist(), "time": 0.0}
    for bad, message in [
        ('{"joints": [1, 2', r"the JSON is cut short.*\(line 3\)"),
        ('{"joints": [1, 2], "time": 1}', r"line 3: joints has shape \(2,\)"),
        (json.dumps(good | {"time": "now"}), "line 3: time is 'now', expected a number"),
        (json.dumps(good | {"hand": "up"}), "line 3: hand is 'up'"),
        (json.dumps(good | {"confidence": [1, 2]}), r"line 3: confidence has shape \(2,\)"),
        ("[1, 2]", "line 3 is not an object"),
    ]:
        lines = [json.dumps(good), json.dumps(good | {"time": 0.2}), bad]
        with pytest.raises(ht.InputError, match=message):
            ht.load(write("\n".join(lines), "b.jsonl"))
