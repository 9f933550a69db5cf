"""What differs between two tracks is what was made to differ."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import handtrack as ht
from handtrack.evaluation.difference import difference, differences
from handtrack.hand.skeleton import JOINT_NAMES


def test_differences_are_those_that_were_made(sample):
    first = ht.track(sample)
    angles, joints = first.angles.copy(), first.filtered_joints.copy()
    angles[10, 3] += np.radians(2.0)
    joints[20, 8] += [0.003, 0.0, 0.004]
    status = first.status.copy()
    status[5] = "lost"
    second = dataclasses.replace(
        first,
        angles=angles,
        filtered_joints=joints,
        status=status,
        settings={**first.settings, "filter": "kalman"},
    )
    found = difference(first, second)
    assert not found.same
    assert found.worst_deg == pytest.approx(2.0)
    assert found.worst_mm == pytest.approx(5.0)
    assert found.angles_deg["thumb_ip_flexion"].max == pytest.approx(2.0)
    assert found.angles_deg["thumb_ip_flexion"].mean == pytest.approx(
        2.0 / (first.status != "lost").sum()
    )
    changed = [name for name, change in found.joints_mm.items() if change.max > 0]
    assert changed == [JOINT_NAMES[8]]
    assert (found.statuses, found.one_sided) == (1, 0)
    assert found.settings == {"filter": ("none", "kalman")}
    assert found.within(2.01, 5.01)
    assert not found.within(1.99, 5.01)
    assert not found.within(2.01, 4.99)


def test_a_pose_that_only_one_has_is_beyond_all_tolerances(sample):
    first = ht.track(sample)
    angles = first.angles.copy()
    angles[7] = np.nan
    found = difference(first, dataclasses.replace(first, angles=angles))
    assert found.one_sided == 1
    assert not found.within(np.inf, np.inf)


def test_hands_without_a_counterpart_are_refused(sample):
    first = ht.track(sample)
    left = dataclasses.replace(first, hand="left", model=ht.HandModel.default("left"))
    with pytest.raises(ht.InputError, match=r"a right hand, .* a left one"):
        difference(first, left)
    with pytest.raises(ht.InputError, match="in one of the two only"):
        differences([first], [left])
    with pytest.raises(ht.InputError, match="in one of the two only"):
        differences([first], [first, left])
    later = dataclasses.replace(first, frame_index=first.frame_index + 1000)
    with pytest.raises(ht.InputError, match="no frame in common"):
        difference(first, later)
    renamed = dataclasses.replace(first, name="other")
    assert differences([first], [renamed])[0].same


def test_the_worst_is_the_greatest_of_all_that_differ(sample):
    first = ht.track(sample)
    angles, joints = first.angles.copy(), first.filtered_joints.copy()
    angles[10, [3, 7, 12]] += np.radians([1.0, -4.0, 2.0])
    joints[20, [0, 8, 15], 1] += [0.002, 0.001, -0.006]
    found = difference(first, dataclasses.replace(first, angles=angles, filtered_joints=joints))
    assert found.worst_deg == pytest.approx(4.0)
    assert found.worst_mm == pytest.approx(6.0)
    assert found.to_dict()["worst_deg"] == found.worst_deg
    assert found.to_dict()["worst_mm"] == found.worst_mm


def test_turned_hands_differ_by_the_angle_between_them(sample):
    first = ht.track(sample)
    turn = np.array([np.cos(np.radians(5)), 0.0, 0.0, np.sin(np.radians(5))])  # 10 degrees
    w, x, y, z = first.quaternion.T
    a, _, _, d = turn
    turned = np.stack([a * w - d * z, a * x - d * y, a * y + d * x, a * z + d * w], axis=1)
    found = difference(first, dataclasses.replace(first, quaternion=turned))
    assert found.root_deg.max == pytest.approx(10.0, abs=1e-6)
    assert found.root_deg.mean == pytest.approx(10.0, abs=1e-6)
