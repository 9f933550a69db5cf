"""What a pose costs: eq. 6 and 8 summed in NumPy, and the weights as the costs' slopes."""

from __future__ import annotations

import numpy as np
import pytest
from kernel_cases import loaded, place
from scipy.spatial.transform import Rotation

from handtrack.hand.model import HandModel
from handtrack.kernels.losses import GEMAN_MCCLURE, HUBER, NO_LOSS

SPREAD2 = 0.02**2


def cost(loss: int, q: np.ndarray) -> np.ndarray:
    """(8) Costs of squared distances."""
    if loss == HUBER:
        far = 2 * np.sqrt(SPREAD2 * q) - SPREAD2
        return np.where(q > SPREAD2, far, q)
    return q * SPREAD2 / (q + SPREAD2) if loss == GEMAN_MCCLURE else q


@pytest.mark.parametrize("loss", [NO_LOSS, HUBER, GEMAN_MCCLURE])
@pytest.mark.parametrize("hand", ["left", "right"])
def test_a_pose_costs_what_its_distances_do(loss, hand):
    rng = np.random.default_rng(0)
    model = HandModel.default(hand)
    angles = model.limits.clamp(rng.uniform(model.limits.lower, model.limits.upper))
    turn, shift = Rotation.random(rng=rng).as_matrix(), rng.normal(size=3)
    posed = model.joints(angles, turn, shift)
    joints = posed + rng.normal(0, 0.02, (21, 3))
    weights = rng.uniform(0, 1, 21)
    joints[[3, 9]], weights[[3, 9]] = np.nan, 0.0
    works = loaded(model, joints, weights, angles, turn, shift)
    works["loss"], works["spread2"] = loss, SPREAD2
    seen = weights > 0
    q = np.where(seen, np.square(posed - joints).sum(-1), 0.0)
    assert (q > SPREAD2).any()
    assert (q[seen] < SPREAD2).any()
    assert place(works) == pytest.approx((weights * cost(loss, q)).sum(), rel=1e-10)
    h = 1e-6 * SPREAD2
    slope = weights * (cost(loss, q + h) - cost(loss, np.maximum(q - h, 0.0))) / (2 * h)
    pull = works[0]["pull"]
    pull = np.append(pull[0, 5], pull[:, :5].T)
    assert np.allclose(pull[seen], slope[seen], rtol=0, atol=1e-6)
    assert (pull[~seen] == 0).all()
