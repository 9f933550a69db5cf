"""The study on made clips whose errors are known."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import ModelError, SettingsError
from tools.bench.rendered import layout, methods, motion
from tools.bench.rendered.bones import bone_frames, hand_size, learnt_offsets, moved_by
from tools.bench.rendered.cases import GIVEN, ONE_CAMERA, cases
from tools.bench.rendered.measures import measure
from tools.bench.rendered.study import study, summaries, write_json

OFFSETS = np.zeros((21, 3))
OFFSETS[1:] = np.random.default_rng(9).normal(0.0, 0.08, (20, 3))


def truth_of(number, hand="right"):
    movement = motion.generated(np.random.default_rng([8, number]), 60)
    if hand == "left":
        movement = motion.mirrored(movement)
    model = ht.HandModel.default(movement.hand, shape=[number - 1.0, 0.5])
    return model, movement, model.joints(movement.angles, movement.rotation, movement.translation)


def clip(number, noise_mm=3.0, biased=True):
    """A detector whose landmarks are off by constant offsets, and noisy."""
    hand = "left" if number % 2 else "right"
    model, movement, truth = truth_of(number, hand)
    rng = np.random.default_rng(number)
    seen = moved_by(truth, OFFSETS, hand) if biased else truth
    seen = seen + rng.normal(0, 1e-3 * noise_mm, truth.shape)
    return layout.Clip(
        f"made{number}",
        hand,
        np.rint(np.arange(60) * 1e9 / 30).astype(np.int64),
        truth,
        subject=f"someone{number}",
        joints=seen,
        world=(seen - seen.mean(1, keepdims=True))[None],
        truth_angles=movement.angles,
        truth_rest_joints=model.rest_joints,
        truth_axes=model.axes,
    )


def test_offsets_in_the_bones_frames_are_learnt_again():
    pairs = []
    for number in range(4):
        hand = "left" if number % 2 else "right"
        truth = truth_of(number, hand)[2]
        pairs.append((moved_by(truth, -0.2 * OFFSETS, hand), truth, hand))
    learnt = learnt_offsets(pairs)
    # to first order: alignment takes up a common part, and frames are of the moved joints
    assert np.corrcoef(learnt[1:].ravel(), OFFSETS[1:].ravel())[0, 1] > 0.9
    frames = bone_frames(pairs[1][1], "left")
    assert np.linalg.det(frames) == pytest.approx(-1.0)
    assert hand_size(pairs[0][1]) == pytest.approx(ht.HandModel.default("right").size, rel=0.1)


def test_a_bias_is_no_moving_error_and_noise_is_one():
    for given in cases(clip(0, noise_mm=0.0)):
        numbers = measure(given.joints, None, given)
        assert numbers["pa_mm"] > 4
        assert numbers["moving_mm"] < 0.25 * numbers["pa_mm"]
        assert numbers["said"] == 1
    (given,) = (c for c in cases(clip(0, 4.0, biased=False)) if c.input == GIVEN)
    numbers = measure(given.joints, None, given)
    # white noise of 4 mm a coordinate less 7 of 63 coordinates that the alignment takes up
    expected = 4 * np.sqrt(8 / np.pi) * np.sqrt(56 / 63)
    assert numbers["pa_mm"] == pytest.approx(expected, rel=0.05)
    assert numbers["moving_mm"] == pytest.approx(expected, rel=0.06)
    assert numbers["jitter"] > 5 * numbers["jitter_truth"]
    exact = measure(given.clip.truth_joints, given.angles, given)
    assert exact["pa_mm"] < 1e-6
    assert exact["angle_deg"] == 0
    assert exact["acceleration"] == pytest.approx(0.0, abs=1e-9)


def few(given):
    def breaks(case):
        raise ModelError("no hand")

    rows = methods.standard(given)
    kept = ("raw", "savitzky-golay, oracle", "fit, template", "constant offsets, no fit")
    return {name: rows[name] for name in kept} | {"broken": breaks}


def test_the_study_orders_methods_as_they_deserve(tmp_path):
    rows = study([clip(0), clip(1), clip(2)], few)
    assert len(rows) == 3 * 2 * 5
    overall = {(r["input"], r["method"]): r for r in summaries(rows)}
    for given in (ONE_CAMERA, GIVEN):
        raw, smooth, fitted, moved, broken = (overall[given, name] for name in few([]))
        assert raw["pa_mm_ratio"].value == 1
        assert smooth["pa_mm"].value < raw["pa_mm"].value
        assert smooth["nearer"] == 1
        assert moved["pa_mm"].value < smooth["pa_mm"].value
        assert moved["pa_mm_ratio"].low <= moved["pa_mm_ratio"].value <= moved["pa_mm_ratio"].high
        assert 0 < fitted["angle_deg"].value < 40
        assert (broken["clips"], broken["failed"]) == (0, 3)
    write_json(rows, tmp_path / "out.json")
    assert len(json.loads((tmp_path / "out.json").read_text())["rows"]) == len(rows)


def test_the_true_hand_is_given_only_to_the_oracle():
    (given, _) = cases(clip(1))
    assert given.sequence.truth is None
    assert np.allclose(given.model.rest_joints, given.clip.truth_rest_joints)
    assert given.remark == ""


def test_angles_of_another_days_axes_are_fitted_anew():
    made = clip(2)
    other = np.roll(made.truth_axes, 1, axis=1)
    (given, _) = cases(replace(made, default_axes=other))
    assert "axes have changed (0.00 mm left)" in given.remark
    # the axes are today's after all: the same angles come out
    assert np.rad2deg(np.abs(given.angles - made.truth_angles)).max() < 0.01


def test_a_camera_that_is_not_there_is_said():
    with pytest.raises(SettingsError, match="has 1 cameras, there is no 2"):
        cases(clip(0), camera=2)


def test_rows_are_chosen_and_added():
    rows = methods.chosen([], ["template"], [("mine", '{"calibrate": false}')])
    templates = ["fit, template", "rts, template", "fit, template, profile"]
    assert list(rows) == ["raw", *templates, "mine"]
    (given, _) = cases(clip(1))
    mine, template = rows["mine"](given), rows["fit, template"](given)
    assert np.array_equal(mine.joints, template.joints)
    for text in ("{", "[1]"):
        with pytest.raises(SettingsError, match="mine: "):
            methods.chosen([], also=[("mine", text)])
