"""Input that cannot be fitted is refused by name; what can be never gives a NaN."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from handtrack.errors import InputError, ModelError, SettingsError
from handtrack.fitting.fit import fit
from handtrack.fitting.result import Fit
from handtrack.hand.model import HandModel

MODEL = HandModel.default("right")
JOINTS = MODEL.joints(MODEL.mean_angles) + 0.1
POSE = ("angles", "rotation", "translation", "joints")


def with_value(shape, index, value) -> np.ndarray:
    out = np.ones(shape)
    out[index] = value
    return out


def joints_with(index, value) -> np.ndarray:
    out = JOINTS.copy()
    out[index] = value
    return out


@pytest.mark.parametrize(
    ("joints", "says"),
    [
        (JOINTS[:20], r"\(20, 3\), expected \(21, 3\)"),
        (JOINTS[None], r"\(1, 21, 3\)"),
        (JOINTS[:, :2], r"\(21, 2\)"),
        ([], "shape"),
        (joints_with((4, 1), np.inf), "infinite"),
        (joints_with((4, 1), -np.inf), "infinite"),
        (np.full((21, 3), np.nan), "missing"),
    ],
)
def test_joints_that_cannot_be_used(joints, says):
    with pytest.raises(InputError, match=says):
        fit(MODEL, joints)


@pytest.mark.parametrize(
    ("weights", "says"),
    [
        (np.ones(20), r"\(20,\), expected \(21,\)"),
        (np.ones((21, 1)), r"\(21, 1\)"),
        (1.0, "shape"),
        (with_value(21, 3, np.nan), "finite"),
        (with_value(21, 3, np.inf), "finite"),
        (with_value(21, 3, -1e-9), "negative"),
        (np.zeros(21), "no weight"),
    ],
)
def test_weights_that_cannot_be_used(weights, says):
    with pytest.raises(InputError, match=says):
        fit(MODEL, JOINTS, weights=weights)


def test_weight_only_on_missing_joints():
    joints = JOINTS.copy()
    joints[5] = np.nan
    with pytest.raises(InputError, match="missing or has no weight"):
        fit(MODEL, joints, weights=np.eye(21)[5])


@pytest.mark.parametrize(
    "start", [np.zeros(19), np.zeros((20, 1)), with_value(20, 2, np.nan), with_value(20, 2, np.inf)]
)
def test_starts_that_cannot_be_used(start):
    with pytest.raises(InputError, match="start"):
        fit(MODEL, JOINTS, start=start)


@pytest.mark.parametrize(
    ("setting", "says"),
    [
        ({"update": "paper"}, "'paper'"),
        ({"method": "adam"}, "'adam'"),
        ({"max_sweeps": 0}, "max_sweeps"),
        ({"tolerance": -1e-6}, "tolerance"),
        ({"tolerance": np.nan}, "tolerance"),
    ],
)
def test_settings_that_make_no_sense(setting, says):
    with pytest.raises(SettingsError, match=says):
        fit(MODEL, JOINTS, **setting)


def test_a_bone_without_length_is_refused_by_the_model():
    rest = np.array(MODEL.rest_joints)
    rest[10] = rest[9]
    with pytest.raises(ModelError, match="joint 10"):
        replace(MODEL, rest_joints=rest)


# ---- never NaN out ----


def check(found: Fit, model: HandModel = MODEL) -> None:
    for name in POSE:
        assert np.isfinite(getattr(found, name)).all(), name
    assert np.isfinite(found.objective)
    assert not np.isnan(found.covariance).any()
    assert (found.variance >= 0).all()
    assert model.limits.contains(found.angles, tolerance=1e-12)
    assert np.allclose(found.rotation @ found.rotation.T, np.eye(3), rtol=0, atol=1e-9)


METRES = st.floats(-1e3, 1e3, allow_subnormal=True)
ODD = st.sampled_from([0.0, -0.0, 5e-324, 1e-300, 1e-30, 1e-9, 0.01, 0.1, -0.1, 1.0, 1e3, -1e3])


@settings(max_examples=150, deadline=None)
@given(
    joints=npst.arrays(np.float64, (21, 3), elements=st.one_of(METRES, ODD, st.just(np.nan))),
    weights=npst.arrays(
        np.float64,
        21,
        elements=st.one_of(st.floats(1e-12, 10), st.sampled_from([0.0, 1e-100, 1e6, 1e100])),
    ),
    update=st.sampled_from(["exact", "li2021"]),
    method=st.sampled_from(["newton", "bcd"]),
    robust=st.sampled_from(["none", "huber", "geman-mcclure"]),
    collisions=st.booleans(),
)
def test_any_numbers(joints, weights, robust, collisions, update, method):
    how = {"update": update, "method": method, "robust": robust, "collisions": collisions}
    try:
        found = fit(MODEL, joints, weights=weights, max_sweeps=50, **how)
    except InputError:
        assert not (np.isfinite(joints).all(1) & (weights > 0)).any()
        return
    check(found)


def all_at_one_point() -> np.ndarray:
    return np.full((21, 3), 0.25)


def fingers_at_one_point() -> np.ndarray:
    out = np.full((21, 3), 0.25)
    out[:5] = JOINTS[:5]
    return out


def two_points() -> np.ndarray:
    return np.where(np.arange(21)[:, None] % 2, 0.1, 0.3) * np.ones(3)


SHAPES = {
    "all at one point": all_at_one_point(),
    "all at the origin": np.zeros((21, 3)),
    "fingers at one point": fingers_at_one_point(),
    "two points": two_points(),
    "tiny": 1e-6 * JOINTS,
    "nothing of a hand": 1e-200 * JOINTS,
    "kilometres large": 1e3 * JOINTS,
    "far away": JOINTS + 1e3,
    "very far away": JOINTS + 1e8,
    "flat": JOINTS * [1, 1, 0],
    "mirrored": JOINTS * [1, 1, -1],
    "inside out": -JOINTS,
    "fingers swapped": JOINTS[[0, *range(17, 21), *range(13, 17), *range(9, 13), *range(1, 9)]],
    "a line": np.linspace(0, 0.2, 21)[:, None] * [1, 2, 3],
    "nearly a line": np.linspace(0, 0.2, 21)[:, None] * [1, 2, 3] + 1e-9 * JOINTS,
    "one joint 1 km off": joints_with(12, 1000.0),
    "millimetres taken for metres": 1000 * JOINTS,
}


@pytest.mark.parametrize("method", ["newton", "bcd"])
@pytest.mark.parametrize("kind", SHAPES)
def test_shapes_that_are_no_hand(kind, method):
    found = fit(MODEL, SHAPES[kind], method=method)
    check(found)
    if kind in ("far away", "very far away"):
        # only rounding is left: metres of 1e8 have steps of 1.5e-8
        assert found.objective < 21 * (1e-15 if kind == "far away" else 1e-12)
    if kind in ("all at one point", "all at the origin", "two points", "a line"):
        assert found.status == "underdetermined"


@pytest.mark.parametrize("factor", [1e-4, 1e-2, 1e2, 1e4])
def test_hands_of_any_size(factor):
    model = MODEL.scaled(factor)
    angles = model.limits.clamp(model.mean_angles + 0.2)
    truth = model.joints(angles) + factor
    found = fit(model, truth)
    check(found, model)
    assert np.abs(found.joints - truth).max() < 1e-3 * factor


@pytest.mark.parametrize("kind", ["long", "short", "fixed"])
def test_odd_models(kind):
    model = MODEL
    if kind == "fixed":
        limits = model.limits
        lower, upper = limits.lower.copy(), limits.upper.copy()
        lower[[2, 6]] = upper[[2, 6]] = 0.3
        model = model.with_limits(replace(limits, lower=lower, upper=upper))
    else:
        rest = np.array(model.rest_joints)
        rest[8] = rest[7] + (rest[8] - rest[7]) * (1e-4 if kind == "short" else 1e3)
        model = replace(model, rest_joints=rest)
    truth = model.joints(model.limits.clamp(model.mean_angles + 0.1)) + 0.2
    found = fit(model, truth)
    check(found, model)
    # a bone of twenty metres leaves millimetres
    assert np.abs(found.joints - truth).max() < (0.01 if kind == "long" else 1e-5)
    if kind == "fixed":
        assert found.angles[[2, 6]].tolist() == [0.3, 0.3]
        assert found.variance[[2, 6]].tolist() == [0, 0]
