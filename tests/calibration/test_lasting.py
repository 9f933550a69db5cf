"""What lasts in the errors of poses, against poses fitted with hands and landmarks that err."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from handtrack.calibration.lasting import lasting_errors
from handtrack.detectors.profile import Noise
from handtrack.fitting.fit import fit_batch
from handtrack.hand.model import HandModel

MODEL = HandModel.default("right")
DRAWS = 300


def poses() -> np.ndarray:
    """Two bent hands, well inside the limits."""
    limits = MODEL.limits
    middle = 0.5 * (limits.lower + limits.upper)
    return np.stack([middle, middle + 0.15 * (limits.upper - middle)])


def noise(lasting_m: float) -> Noise:
    return Noise(np.full(21, lasting_m), np.zeros(21), np.zeros(21), 0.1)


def spread_of(fits, angles, centres) -> tuple[np.ndarray, np.ndarray]:
    """Root mean squares over draws and poses: of angles, and of joints per coordinate."""
    off = np.square(fits.angles.reshape(DRAWS, *angles.shape) - angles)
    joints = fits.joints.reshape(DRAWS, *centres.shape[1:]) - centres
    return np.sqrt(off.mean((0, 1))), np.sqrt(np.square(joints).mean((0, 1, 3)))


def near(found, drawn, share):
    ratio = found / drawn
    assert np.exp(np.abs(np.log(ratio)).mean()) < 1 + share, ratio


def test_a_hand_whose_bones_are_wrong():
    """Errors of rest joints that go together, so that their covariance is not diagonal."""
    rng = np.random.default_rng(1)
    angles = poses()
    mix = rng.normal(size=(63, 3)) * np.repeat(rng.uniform(1e-4, 6e-4, 21), 3)[:, None]
    mix[:3] = 0.0
    draws = (rng.normal(size=(DRAWS, 3)) @ mix.T).reshape(DRAWS, 21, 3)
    # the true hand differs from the one that is fitted
    joints = np.stack(
        [replace(MODEL, rest_joints=MODEL.rest_joints + d).joints(angles) for d in draws]
    )
    fits = fit_batch(MODEL, joints.reshape(-1, 21, 3))
    found = lasting_errors(MODEL, noise(0.0), mix @ mix.T, angles)
    drawn_angles, drawn_joints = spread_of(fits, angles, joints)
    near(found.angles, drawn_angles, 0.12)
    near(found.joints, drawn_joints, 0.12)


@pytest.mark.parametrize("least_mm", [0.4])
def test_landmarks_that_stand_aside(least_mm):
    rng = np.random.default_rng(2)
    angles, sigma = poses(), 1e-3 * least_mm
    true = MODEL.joints(angles)
    seen = true + rng.normal(0, sigma, (DRAWS, 1, 21, 3))
    fits = fit_batch(MODEL, seen.reshape(-1, 21, 3))
    found = lasting_errors(MODEL, noise(sigma), np.zeros((63, 63)), angles)
    drawn_angles, drawn_joints = spread_of(fits, angles, np.broadcast_to(true, seen.shape))
    near(found.angles, drawn_angles, 0.12)
    near(found.joints, drawn_joints, 0.12)
