"""Arrays: .npz and .npy."""

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import ORDER_JOINTS, ORDERS


def test_all_keys_of_the_projects_own_npz(tmp_path, right):
    n = len(right)
    confidence = np.random.default_rng(0).uniform(0.2, 1, (n, 21))
    path = tmp_path / "sample.npz"
    joints = right.copy()
    joints[3, 4] = np.nan
    time = 10**18 + np.arange(n) * 33_333_333
    np.savez(
        path,
        joints_m=joints,
        time_ns=time,
        confidence=confidence,
        truth_m=right,
        hand="right",
        fps=30.0,
        name="open and close",
        subject="A",
    )
    (sequence,) = ht.load(path)
    np.testing.assert_array_equal(sequence.joints, joints)
    np.testing.assert_array_equal(sequence.time_ns, time)
    np.testing.assert_array_equal(sequence.truth, right)
    assert sequence.confidence[3, 4] == 0
    assert sequence.confidence[2, 4] == confidence[2, 4]
    assert (sequence.name, sequence.subject, sequence.hand) == ("open and close", "A", "right")
    assert sequence.source == str(path)
    assert sequence.notes == ()


def test_float32_keys_of_the_shared_data(tmp_path, left):
    path = tmp_path / "joints.npz"
    np.savez(path, joints_m=left.astype(np.float32), fps=25.0, hand=np.array("left"))
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, left, atol=1e-7)
    assert sequence.fps == pytest.approx(25)
    assert sequence.hand == "left"


@pytest.mark.parametrize(("key", "factor"), [("joints_mm", 1e3), ("joints_cm", 1e2)])
def test_unit_in_the_key(tmp_path, right, key, factor):
    np.savez(tmp_path / "a.npz", **{key: right * factor, "truth" + key[6:]: right * factor})
    (sequence,) = ht.load(tmp_path / "a.npz")
    np.testing.assert_allclose(sequence.joints, right)
    np.testing.assert_allclose(sequence.truth, right)


def test_truth_in_another_unit(tmp_path, right):
    np.savez(tmp_path / "a.npz", joints_mm=right * 1e3, truth_m=right)
    np.testing.assert_allclose(ht.load(tmp_path / "a.npz")[0].truth, right)
    np.savez(tmp_path / "b.npz", joints=right, truth_m=right)
    with pytest.raises(ht.InputError, match="truth_m states a unit, joints does not"):
        ht.load(tmp_path / "b.npz")


@pytest.mark.parametrize("order", list(ORDERS))
def test_every_order(tmp_path, right, order):
    theirs = np.full((len(right), ORDER_JOINTS[order], 3), 0.3)
    theirs += np.arange(ORDER_JOINTS[order])[:, None] * 1e-3  # metacarpals: anywhere
    there = np.array(ORDERS[order]) >= 0
    theirs[:, np.array(ORDERS[order])[there]] = right[:, there]
    np.save(tmp_path / "a.npy", theirs)
    (sequence,) = ht.load(tmp_path / "a.npy", order=order, fps=30)
    np.testing.assert_array_equal(sequence.joints[:, there], right[:, there])
    assert not sequence.present[:, ~there].any()


def test_webxr_by_the_number_of_joints(tmp_path, right):
    theirs = np.zeros((len(right), 25, 3))
    theirs[:, list(ORDERS["webxr"])] = right * 1e3
    theirs[:, [5, 10, 15, 20]] = right[:, :1] * 1e3 + 1
    np.savez(tmp_path / "a.npz", xyz_mm=theirs, names=np.array(["fist"] * len(right)))
    (sequence,) = ht.load(tmp_path / "a.npz")
    np.testing.assert_allclose(sequence.joints, right)


@pytest.mark.parametrize("shape", [(12, 21, 3), (12, 63), (1, 21, 3), (21, 3), (63,)])
def test_shapes_of_npy(tmp_path, right, shape):
    data = right[: 12 if shape[0] == 12 else 1].reshape(shape)
    np.save(tmp_path / "a.npy", data)
    (sequence,) = ht.load(tmp_path / "a.npy", fps=50)
    assert len(sequence) == (12 if shape[0] == 12 else 1)
    np.testing.assert_array_equal(sequence.joints, right[: len(sequence)])


def test_fps_argument_replaces_times(tmp_path, right):
    np.savez(tmp_path / "a.npz", joints=right, fps=30)
    (sequence,) = ht.load(tmp_path / "a.npz", fps=120)
    assert sequence.fps == pytest.approx(120, rel=1e-6)


def test_assumed_rate_is_said(tmp_path, right):
    np.save(tmp_path / "a.npy", right)
    (sequence,) = ht.load(tmp_path / "a.npy", hand="right")
    assert sequence.notes == ("no time in the file: 30 frames/s assumed (--fps)",)


@pytest.mark.parametrize("mark", [0.0, -1.0])
def test_marks_of_missing_joints(tmp_path, right, mark):
    joints = right - right[:, :1]  # relative to the wrist: one true zero in every frame
    joints[5] = mark
    joints[6, 3:9] = mark
    np.savez(tmp_path / "a.npz", joints=joints, hand="right", fps=30)
    (sequence,) = ht.load(tmp_path / "a.npz")
    assert sequence.present.sum(1).tolist() == [21] * 5 + [0, 15] + [21] * 5
    assert "were taken as missing" in sequence.notes[0]


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"pose": np.zeros(3)}, "no joints in it: expected joints_m or joints, found pose"),
        ({"joints": np.zeros((4, 19, 3))}, r"joints has shape \(4, 19, 3\), expected \(frames, 21"),
        ({"joints": np.zeros((0, 21, 3))}, "joints holds no frames"),
        ({"joints": np.full((4, 21, 3), np.nan)}, "every joint is missing"),
        ({"joints": np.zeros((4, 21, 3))}, "every joint is missing"),
        ({"joints": np.zeros((4, 21, 3), bool)}, "joints holds bool, expected numbers"),
        ({"joints": np.array([[{}]])}, "pickled Python objects"),
        ({"joints": "R", "joints_m": "R"}, "both joints and joints_m|both joints_m and joints"),
        ({"joints": "R", "hand": "both"}, "hand is 'both', expected left or right"),
        ({"joints": "R", "fps": 0.0}, "fps is 0, expected a number above 0"),
        ({"joints": "R", "fps": np.zeros(2)}, r"fps is \'\[0. 0.\]\', expected a number"),
        ({"joints": "R", "time": np.arange(11.0)}, "time has 11 stamps for 12 frames"),
        ({"joints": "R", "confidence": np.full((12, 21), 2.0)}, "confidence must lie in 0..1"),
        (
            {"joints": "R", "confidence": np.ones((12, 20))},
            r"shape \(12, 20\), expected shape \(12, 21\)",
        ),
        ({"joints": "R", "truth": np.ones((11, 21, 3))}, "truth has shape"),
        ({"joints": "R", "order": "alphabetical"}, "joint order 'alphabetical' is unknown, known"),
        ({"joints": "R", "order": "webxr"}, "a frame has 21 joints, the order webxr has 25"),
        ({"joints": "R", "unit": "yard"}, "unit is 'yard', expected m, cm, mm or in"),
    ],
)
def test_bad_fields(tmp_path, right, fields, message):
    path = tmp_path / "bad.npz"
    values = {k: right if isinstance(v, str) and v == "R" else v for k, v in fields.items()}
    np.savez(path, **values)
    with pytest.raises(ht.InputError, match=message) as caught:
        ht.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_infinite_joint(tmp_path, right):
    right = right.copy()
    right[4, 2, 1] = np.inf
    np.savez(tmp_path / "a.npz", joints=right)
    with pytest.raises(ht.InputError, match="frame 4: a joint is infinite"):
        ht.load(tmp_path / "a.npz")
