"""What is wrong with a truth as a whole is said in words."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.evaluation.matching import truth_problem

MODEL = ht.HandModel.default("right")


@pytest.fixture
def joints():
    """(30, 21, 3) a hand that moves and bends."""
    rng = np.random.default_rng(0)
    angles = MODEL.limits.clamp(rng.normal(0, 0.5, (30, 20)))
    return MODEL.joints(angles, np.eye(3), rng.normal(0, 0.2, (30, 3)))


@pytest.mark.parametrize("collapsed", ["estimate", "truth", "both"])
def test_a_hand_in_one_point_has_no_size(joints, collapsed):
    point = np.repeat(joints[:, :1], 21, axis=1)
    estimate = joints if collapsed == "truth" else point
    truth = joints if collapsed == "estimate" else point
    assert truth_problem(estimate, truth) == "all joints of a frame are at one point"


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (1.0, ""),
        (2.0, ""),
        (0.5, ""),
        (1000.0, "the truth's hand is 1000 times the estimate's: mm read as m?"),
        (0.01, "the estimate's hand is 100 times the truth's: cm read as m?"),
        (10.0, "the truth's hand is 10 times the estimate's: mm read as cm?"),
        (3.0, "the truth's hand is 3 times as large as the estimate's"),
        (0.3, "the truth's hand is 0.3 times as large as the estimate's"),
    ],
)
def test_another_unit_is_told_from_another_size(joints, factor, said):
    assert truth_problem(joints, factor * joints) == said


def test_nothing_is_said_of_frames_with_few_common_joints(joints):
    truth = 1000 * joints
    truth[:, 3:] = np.nan
    assert truth_problem(joints, truth) == ""
    truth[7, 3] = 1000 * joints[7, 3]  # four in one frame do
    assert "1000 times" in truth_problem(joints, truth)
