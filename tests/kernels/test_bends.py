"""Fingers that are bent the wrong way: what is tried, and that the better bend is found."""

from __future__ import annotations

import numpy as np
from kernel_cases import by_finger, loaded
from numba import njit

from fit_cases import moved_joints, some_poses  # isort: skip

from handtrack.fitting import fit, solver
from handtrack.hand.model import HandModel
from handtrack.kernels import bends

MODEL = HandModel.default("right")
_bend = njit(bends.other_bends.function)


@njit
def other_bends(works):
    _bend(works[0])


def placed(poses, i: int, angles: np.ndarray) -> np.ndarray:
    no_step = np.zeros((1, 26))
    return moved_joints(MODEL, angles, poses.rotation[i], poses.translation[i], no_step)[0]


def test_a_trial_bends_one_finger_and_says_what_it_adds():
    poses = some_poses(MODEL, 60, 0.015, seed=3)
    tried = 0
    for i, joints in enumerate(poses.joints):
        pose = (poses.angles[i], poses.rotation[i], poses.translation[i])
        s = loaded(MODEL, joints, np.ones(21), *pose)
        other_bends(s)
        np.testing.assert_array_equal(by_finger(s[0]["angle"]), poses.angles[i])
        trial, rise = by_finger(s[0]["trial"]), s[0]["rise"][:5]
        before = np.square(placed(poses, i, poses.angles[i]) - joints).sum()
        for f in np.flatnonzero(np.isfinite(rise)):
            angles = poses.angles[i].copy()
            angles[4 * f : 4 * f + 4] = trial[4 * f : 4 * f + 4]
            assert MODEL.limits.contains(angles, 1e-12)
            after = np.square(placed(poses, i, angles) - joints).sum()
            np.testing.assert_allclose(rise[f], after - before, rtol=1e-9, atol=1e-15)
            tried += 1
    assert tried > 10


def test_a_bend_that_nothing_shows_is_not_tried():
    poses = some_poses(MODEL, 20, 0.02, seed=4)
    for i, joints in enumerate(poses.joints):
        pose = (poses.angles[i], poses.rotation[i], poses.translation[i])
        joints[[4, 7, 12]] = np.nan  # tips of thumb and middle finger, last joint of the index
        s = loaded(MODEL, joints, np.ones(21), *pose)
        other_bends(s)
        assert np.isinf(s[0]["rise"][:3]).all()


def test_the_better_bend_is_found():
    joints = some_poses(MODEL, 600, 0.010, seed=24).joints
    found = []
    for trials in (True, False):
        program = solver.Program()
        if not trials:
            program.solvers = program.solvers._replace(bends=0)
        results, keep = solver.Results(len(joints)), solver.start_at(MODEL)
        weights, start = np.ones((len(joints), 21)), MODEL.mean_angles
        results.run(program, MODEL, joints.copy(), weights, keep, start, alone=True)
        found.append(results)
    better, worse = (results.objective for results in found)
    assert (better <= worse * (1 + 1e-12)).all()
    assert (better < 0.99 * worse).sum() >= 2
    # from the frame before, only for a gain that noise does not make
    (far,) = np.flatnonzero(better < 0.9 * worse)
    again = fit.fit(MODEL, joints[far], start=found[1].fit(int(far)))
    assert abs(again.objective / better[far] - 1) < 1e-5
    for i in np.flatnonzero((better < 0.999 * worse) & (better > 0.95 * worse)):
        again = fit.fit(MODEL, joints[i], start=found[1].fit(int(i)))
        assert abs(again.objective / worse[i] - 1) < 1e-5
