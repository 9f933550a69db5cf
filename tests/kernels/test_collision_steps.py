"""Steps of joints and contacts together against dense systems."""

from __future__ import annotations

import numpy as np
import pytest
from dense_systems import dense, directions
from kernel_cases import by_finger
from plain import plain, workspace
from scipy.spatial.transform import Rotation

from handtrack.hand.capsules import contacts
from handtrack.hand.model import HandModel
from handtrack.kernels import collisions
from handtrack.kernels.joint_objective import place

N = 26


def fist(hand: str, seed: int):
    """Fingers that cross, hinges and saddles at limits that their joints pull them over."""
    rng = np.random.default_rng(seed)
    model = HandModel.default(hand)
    limits = model.limits
    angles = limits.clamp(0.75 * limits.upper + rng.normal(0, 0.2, 20))
    angles[2::4] = limits.upper[2::4]
    rotation, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    over = angles.copy()
    over[2::4] += rng.normal(0, 0.4, 5)
    joints = model.joints(over, rotation, shift) + rng.normal(0, 2e-3, (21, 3))
    w = workspace(model, joints, rng.uniform(0.3, 1.0, 21), angles, rotation, shift)
    pairs = contacts(model)
    w.contacts = len(pairs)
    w.contact[: len(pairs)] = pairs
    return w


@pytest.mark.parametrize(("hand", "seed"), [("left", 0), ("right", 1)])
def test_a_step_minimises_joints_and_contacts_on_the_faces(hand, seed):
    w = fist(hand, seed)
    plain(place)(w)
    g, x, h, u = np.zeros(N), np.zeros(N), np.zeros((N, N)), np.zeros((N, N))
    promise = plain(collisions.step_apart)(w, g, h, x, u)
    step, root_step = by_finger(w.step), w.root_step.copy()
    columns, bend = directions(w)
    assert columns.shape[1] < N
    g, h = dense(w, 0.0)
    assert plain(collisions.weigh_contacts)(w, g, h, True) > 0
    system = columns.T @ (h + bend + collisions._RIDGE * np.eye(N)) @ columns
    expected = -columns @ np.linalg.solve(system, columns.T @ g)
    np.testing.assert_allclose(step, expected[:20], rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(root_step, expected[20:], rtol=1e-7, atol=1e-10)
    assert promise == pytest.approx(-g @ expected, rel=1e-7)


@pytest.mark.parametrize(("hand", "seed"), [("left", 0), ("right", 1)])
def test_what_ends_is_no_worse_and_told(hand, seed):
    """Joints and contacts together; `objective` has the joints alone; inside the limits."""
    w, model = fist(hand, seed), HandModel.default(hand)

    def both() -> tuple[float, float]:
        joints = plain(place)(w)
        g, h = np.zeros(N), np.zeros((N, N))
        return joints, plain(collisions.weigh_contacts)(w, g, h, False)

    before = both()
    plain(collisions.move_apart)(w)
    told, after = w.objective, both()
    assert told == pytest.approx(after[0], rel=1e-12)
    assert sum(after) < sum(before)
    assert w.steps > 0
    assert model.limits.contains(by_finger(w.angle), 1e-9).all()
    # where a further step promises nothing
    g, x, h, u = np.zeros(N), np.zeros(N), np.zeros((N, N)), np.zeros((N, N))
    promise = plain(collisions.step_apart)(w, g, h, x, u)
    assert promise < 1e-2 * sum(after)
