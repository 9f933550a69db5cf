"""What a filter remembers: its pose moves as a pose does."""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy.spatial.transform import Rotation

from handtrack.kernels import filter_state
from handtrack.kernels.filter_state import FILTER


@njit
def move_pose(states, d):
    filter_state.move_pose(states[0], d)


def test_a_pose_is_moved_by_a_turn_of_the_world():
    rng = np.random.default_rng(5)
    states, d = np.zeros(1, FILTER), rng.normal(size=26)
    before = Rotation.random(rng=rng)
    states["rotation"], states["angles"], states["translation"] = before.as_matrix(), 0.3, 0.2
    move_pose(states, d)
    expected = (Rotation.from_rotvec(d[20:23]) * before).as_matrix()
    assert np.allclose(states[0]["rotation"], expected, atol=1e-13)
    assert np.allclose(states[0]["angles"], 0.3 + d[:20])
    assert np.allclose(states[0]["translation"], 0.2 + d[23:])
