"""Every setting of the tracker changes what comes out, and is no other setting."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.tracking.tracker import Tracker

# setting: another value, and what else must be set for it to matter
CHANGED = {
    "filter": ("one-euro", {}),
    "update": ("li2021", {}),
    "min_joints": (21, {}),
    "coast_s": (0.02, {"filter": "kalman"}),
    "process_noise": (5.0, {"filter": "kalman"}),
    "couple": (False, {"filter": "kalman"}),
    "lag": (5, {"filter": "fixed-lag"}),
    "noise_colour": ("white", {"filter": "rts"}),
    "noise_mm": (30.0, {"filter": "kalman"}),
    "engine": ("filterpy", {"filter": "kalman"}),
    "gate": (False, {}),
    "robust": ("huber", {}),
    "spread_mm": (0.5, {"robust": "geman-mcclure"}),
    "collisions": (True, {}),
}
FIELDS = ("angles", "filtered_joints", "angle_variance", "status", "rejected")


@pytest.fixture(scope="module")
def clip(sample: ht.Sequence) -> ht.Sequence:
    """Frames with noise, a stray, missing joints, a short gap, and fingers in one another."""
    joints = sample.joints[100:140].copy()
    joints[12, 8] += 0.08
    joints[20:24] = np.nan
    joints[30:34, 5:9] = joints[30:34, 9:13] + 0.002
    return ht.Sequence(sample.time_ns[100:140], joints, hand=sample.hand)


def told(clip: ht.Sequence, **settings: object) -> dict[str, np.ndarray]:
    tracker = Tracker(ht.HandModel.default(clip.hand), **settings)
    given = [f for x, t in zip(clip.joints, clip.time_ns, strict=True) for f in tracker.push(x, t)]
    given += tracker.finish()
    return {name: np.array([getattr(f, name) for f in given]) for name in FIELDS}


def same(a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> bool:
    return all(np.array_equal(a[n], b[n], equal_nan=a[n].dtype.kind == "f") for n in FIELDS)


def test_all_settings_are_in_the_table():
    assert set(CHANGED) == set(Tracker(ht.HandModel.default()).settings)


@pytest.mark.parametrize("name", CHANGED)
def test_a_setting_changes_what_comes_out(name, clip):
    value, others = CHANGED[name]
    before, after = told(clip, **others), told(clip, **others, **{name: value})
    assert not same(before, after)
    tracker = Tracker(ht.HandModel.default(clip.hand), **others, **{name: value})
    assert tracker.settings == {
        **Tracker(ht.HandModel.default(clip.hand)).settings,
        **others,
        name: value,
    }
