"""A workspace that has been used for another frame, hand and face gives what a new one gives."""

from __future__ import annotations

import numpy as np
import pytest
from plain import plain, record
from scipy.spatial.transform import Rotation

from handtrack.hand.capsules import contacts
from handtrack.hand.model import HandModel
from handtrack.kernels import bends, collisions, descent, exchange, li2021, newton, pose_information
from handtrack.kernels.workspace import WORK

SOLVERS = {
    "newton": newton.newton,
    "descent": descent.bcd_exact,
    "li2021": li2021.bcd_li2021,
    "bends": bends.other_bends,
    "apart": collisions.move_apart,
    "information": pose_information.information,
    "covariance": pose_information.unit_covariance,
}
RESULTS = ("angle", "rotation", "translation", "objective", "state", "sweeps", "steps")
TOLD = {
    "bends": ("trial", "rise"),
    "apart": ("angle", "rotation", "translation", "objective", "steps"),
    "information": ("objective", "gradient", "information"),
    "covariance": ("variance", "covariance"),
}


def load(w, hand: str, seed: int, unseen: tuple[int, ...]) -> None:
    """A frame some way off a pose with fingers at their limits, and all settings."""
    rng = np.random.default_rng(seed)
    model = HandModel.default(hand)
    limits = model.limits
    angles = limits.clamp(rng.uniform(limits.lower, limits.upper) * 1.3)
    rotation, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    joints = model.joints(angles, rotation, shift) + rng.normal(0, 5e-3, (21, 3))
    weights = rng.uniform(0.3, 1.0, 21)
    weights[list(unseen)] = 0.0
    numbers = model.rest_joints, model.axes, limits.lower, limits.upper, 0.2 * seed
    plain(exchange.load_model)(w, (*numbers, model.landmark_offsets))
    plain(exchange.load_frame)(w, joints, weights, 1.0)
    begun = limits.clamp(angles + rng.normal(0, 0.1, 20))
    plain(exchange.load_pose)(w, begun, np.append(rotation, shift))
    pairs = contacts(model)
    w.contacts = len(pairs)
    w.contact[: len(pairs)] = pairs
    w.max_sweeps, w.max_steps, w.tolerance, w.full = 2.0, 4.0, 1e-9, 1
    w.loss, w.spread2, w.sweeps, w.steps = seed % 3, 4e-6, 0.0, 0.0


@pytest.mark.parametrize("name", SOLVERS)
def test_what_another_frame_has_left_makes_no_difference(name):
    solve = plain(SOLVERS[name])
    new, used = record(WORK), record(WORK)
    load(used, "left", 2, (3, 4, 17))
    solve(used)
    for w in (new, used):
        load(w, "right", 4, (12,))
        solve(w)
    for field in TOLD.get(name, RESULTS):
        np.testing.assert_array_equal(getattr(used, field), getattr(new, field), err_msg=field)
