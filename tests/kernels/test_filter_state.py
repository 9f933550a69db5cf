"""What a filter remembers: its pose moves as a pose does."""

from __future__ import annotations

import numpy as np
from plain import plain, record
from scipy.spatial.transform import Rotation

from handtrack.kernels import filter_state
from handtrack.kernels.filter_state import FILTER


def test_a_pose_is_moved_by_a_turn_of_the_world():
    rng = np.random.default_rng(5)
    state, d = record(FILTER), rng.normal(size=26)
    before = Rotation.random(rng=rng)
    state.rotation[:], state.angles[:], state.translation[:] = before.as_matrix(), 0.3, 0.2
    plain(filter_state.move_pose)(state, d)
    expected = (Rotation.from_rotvec(d[20:23]) * before).as_matrix()
    assert np.allclose(state.rotation, expected, atol=1e-13)
    assert np.allclose(state.angles, 0.3 + d[:20])
    assert np.allclose(state.translation, 0.2 + d[23:])
