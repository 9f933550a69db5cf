"""Two files compared: matched by time or number, and what tells that they do not fit."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from recorded_sample import sequence

from handtrack.errors import InputError
from handtrack.evaluation import metrics
from handtrack.evaluation.report import to_json
from handtrack.evaluation.stability import (
    compare_arrays,
    stability_of_pair,
    stability_of_pairs,
)
from handtrack.hand.skeleton import ORDERS

# ---- pairs ----


def pair(recorded, **more):
    truth = recorded["truth_m"].astype(float)
    noise = np.random.default_rng(1).normal(0, 0.003, truth.shape)
    return sequence(truth + noise, **more), sequence(truth)


def test_pair(recorded):
    estimate, truth = pair(recorded)
    row = stability_of_pair(estimate, truth)
    assert (row.against, row.frames, row.fitted, row.lost, row.notes) == ("truth", 300, 300, 0, ())
    assert row.mpjpe_mm.mean == pytest.approx(
        np.mean(metrics.mpjpe(estimate.joints, truth.joints)) * 1e3
    )
    same = compare_arrays(estimate.joints, truth.joints, fps=30.0)
    assert same.pa_mpjpe_mm == row.pa_mpjpe_mm
    assert same.jitter_m_s3 == pytest.approx(row.jitter_m_s3)
    report = stability_of_pairs([(estimate, truth)] * 2)
    assert report.overall.frames == 600
    assert json.loads(to_json(report))["overall"]["input_jitter_m_s3"] is None


def test_pair_by_frame_number(recorded):
    estimate, truth = pair(recorded)
    part = truth.frames(100, 249)
    row = stability_of_pair(estimate, part, match="frame")
    assert row.compared == 150
    assert row.notes == ("150 of 300 frames have no truth",)
    row = stability_of_pair(part, estimate)
    assert row.notes == ("150 of 300 frames of the truth have no estimate",)
    sparse = replace(
        truth,
        joints=truth.joints[::10],
        confidence=truth.confidence[::10],
        time_ns=truth.time_ns[::10],
        frame_index=truth.frame_index[::10],
    )
    assert stability_of_pair(estimate, sparse).compared == 30


def test_pair_by_time(recorded):
    truth = recorded["truth_m"].astype(float)
    # other frame numbers, same clock
    row = stability_of_pair(sequence(truth, first=20701), sequence(truth))
    assert row.mpjpe_mm.max == 0
    # the truth has every other frame of the estimate, each numbered from 0
    half = sequence(truth[::2], fps=15)
    row = stability_of_pair(sequence(truth), half)
    assert (row.compared, row.mpjpe_mm.max) == (150, 0)
    with pytest.raises(InputError, match="30 frames a second, the truth 15"):
        stability_of_pair(sequence(truth), half, match="frame")
    # no number and no clock in common: both start together
    row = stability_of_pair(sequence(truth, first=5000, start_ns=10**18), sequence(truth))
    assert (row.compared, row.mpjpe_mm.max) == (300, 0)
    # stamps that are beside each other are told
    row = stability_of_pair(
        sequence(truth, first=5000), sequence(truth, fps=30 * 1.002), match="time"
    )
    assert any("ms apart" in note for note in row.notes)
    assert row.notes[-1] == "the output is 0.8 frames late"


def test_pair_that_does_not_fit(recorded):
    estimate, truth = pair(recorded)
    with pytest.raises(InputError, match="right hand against a left"):
        stability_of_pair(estimate, replace(truth, hand="left"))
    later = sequence(truth.joints, first=290, start_ns=int(290e9 / 30))
    with pytest.raises(InputError, match="only 10 frames in common"):
        stability_of_pair(estimate, later)
    with pytest.raises(InputError, match="10 frame numbers in common"):
        stability_of_pair(estimate, later, match="frame")
    with pytest.raises(InputError, match="cannot be matched by 'name'"):
        stability_of_pair(estimate, truth, match="name")
    with pytest.raises(InputError, match=r"\(300, 21, 3\), the truth \(299, 21, 3\)"):
        compare_arrays(estimate.joints, truth.joints[1:])
    with pytest.raises(InputError, match="fps is 0"):
        compare_arrays(estimate.joints, truth.joints, fps=0)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1000, "mm read as m"),
        (100, "cm read as m"),
        (10, "mm read as cm"),
        (3, "3 times as large"),
    ],
)
def test_wrong_unit(recorded, factor, words):
    estimate, truth = pair(recorded)
    for f in (factor, 1 / factor):
        with pytest.raises(InputError) as caught:
            stability_of_pair(estimate, replace(truth, joints=truth.joints * f))
        if f >= 1 or factor != 3:
            assert words in str(caught.value)
    # a hand that is merely smaller is fine
    stability_of_pair(estimate, replace(truth, joints=truth.joints * 0.7))


def test_a_wrong_frame_rate_is_named(recorded):
    """The same frames, stamped at 30 and at 60 per second: by time they are other moments."""
    truth = recorded["truth_m"].astype(float)
    a, b = sequence(truth, 30), sequence(truth, 60)
    with pytest.raises(InputError, match=r"by number the frames fit .* frame rates is wrong"):
        stability_of_pair(a, b)
    assert stability_of_pair(a, b, match="frame").mpjpe_mm.max == 0
    # frames in between are another matter: by time they fit
    twice = np.repeat(truth, 2, axis=0)
    row = stability_of_pair(a, sequence(twice, 60))
    assert row.mpjpe_mm.max == 0


def test_another_size_is_noted(recorded):
    truth = recorded["truth_m"].astype(float)
    row = stability_of_pair(sequence(truth), sequence(1.3 * truth))
    assert row.pa_mpjpe_mm.max < 1e-9
    assert any("truth's hand is 1.30 times as large" in note for note in row.notes)


def test_mirrored(recorded):
    estimate, truth = pair(recorded)
    with pytest.raises(InputError, match="mirrored"):
        stability_of_pair(estimate, replace(truth, joints=truth.joints * [-1, 1, 1]))


@pytest.mark.parametrize("order", ["mano", "interhand", "fpha"])
def test_wrong_joint_order(recorded, order):
    estimate, truth = pair(recorded)
    theirs = np.empty_like(truth.joints)
    theirs[:, list(ORDERS[order])] = truth.joints
    with pytest.raises(InputError, match=f"truth seems to be in joint order '{order}'"):
        stability_of_pair(estimate, replace(truth, joints=theirs))
    theirs = np.empty_like(truth.joints)
    theirs[:, list(ORDERS[order])] = estimate.joints
    with pytest.raises(InputError, match=f"estimate seems to be in joint order '{order}'"):
        stability_of_pair(replace(estimate, joints=theirs), truth)


def test_a_bad_estimate_is_not_called_mirrored(recorded):
    truth = recorded["truth_m"].astype(float)
    still = np.broadcast_to(truth[:1], truth.shape) + np.random.default_rng(0).normal(
        0, 0.015, truth.shape
    )
    assert compare_arrays(still, truth).pa_mpjpe_mm.mean > 10


def test_another_world_frame_is_noted(recorded):
    estimate, truth = pair(recorded)
    elsewhere = truth.joints + np.array([0.0, 1.0, 0.0])
    row = stability_of_pair(estimate, replace(truth, joints=elsewhere))
    assert row.notes == ("the output is 1000 mm from the truth: another world frame?",)


def test_missing_frames_of_an_estimate_are_lost(recorded):
    estimate, truth = pair(recorded)
    joints = estimate.joints.copy()
    joints[40:60] = np.nan
    joints[70, 2:] = np.nan
    row = stability_of_pair(replace(estimate, joints=joints, confidence=None), truth)
    assert (row.fitted, row.lost, row.compared) == (280, 20, 279)
