"""MANO poses as joints and vertices, beside MANO's published equations."""

from __future__ import annotations

import numpy as np
import pytest
from mano_equations import mano as equations

from handtrack.errors import InputError
from handtrack.hand.mano import MANO, TIP_VERTICES
from handtrack.hand.mano_pose import decode
from handtrack.hand.skeleton import ORDERS


@pytest.mark.parametrize("hand", ["right", "left"])
def test_as_the_equations_say(contents, mano_folder, hand):
    mano = MANO.load(mano_folder, hand, tips="freihand")
    rng = np.random.default_rng(2)
    poses, betas = rng.normal(0, 0.5, (5, 48)), rng.normal(0, 1, (5, 10))
    betas[3] = betas[1]
    transl = rng.normal(0, 0.3, (5, 3))
    joints, vertices = decode(mano, poses, betas, transl)
    tips = list(TIP_VERTICES["freihand"][hand == "left"])
    for t in range(5):
        skin, sixteen = equations(contents[hand], betas[t], poses[t], transl[t])
        np.testing.assert_allclose(vertices[t], skin, atol=1e-12)
        every = np.concatenate([sixteen, skin[tips]])
        np.testing.assert_allclose(joints[t], every[list(ORDERS["mano"])], atol=1e-12)
    one, _ = decode(mano, poses[:1], betas[0, :4])
    short, _ = equations(contents[hand], betas[0, :4], poses[0], np.zeros(3))
    np.testing.assert_allclose(one[0, 4], short[tips[0]], atol=1e-12)


def test_shapes_are_checked(mano_folder):
    mano = MANO.load(mano_folder, "right")
    with pytest.raises(InputError, match=r"shape \(2, 45\), expected \(frames, 48\)"):
        decode(mano, np.zeros((2, 45)))
    with pytest.raises(InputError, match="betas have shape"):
        decode(mano, np.zeros((2, 48)), np.zeros((3, 10)))
