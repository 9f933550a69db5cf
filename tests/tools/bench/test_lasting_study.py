"""An unknown detector whose noise lasts: the defaults come nearer to the truth than its joints."""

from __future__ import annotations

import numpy as np
import pytest

from tools.bench.lasting_study import CLIPS, KINDS, METHODS, noisy, ratios
from tools.bench.rendered.layout import read_folder


def test_noise_is_as_large_as_said_and_lasts():
    kind = 0.4, 4.0, 1.0
    noise = noisy(np.zeros((4000, 21, 3)), 30.0, kind, np.random.default_rng(0))
    assert 1e3 * noise.std() == pytest.approx(np.hypot(*kind[1:]), rel=0.05)
    together = float((noise[:-12] * noise[12:]).mean())
    expected = np.exp(-1.0) * (1e-3 * kind[1]) ** 2  # a lasting time later, 12 frames
    assert together == pytest.approx(expected, rel=0.15)


@pytest.mark.parametrize("kind", [KINDS[1], KINDS[4]])
def test_defaults_are_nearer_than_the_joints_and_smoothers_than_any_window(kind):
    clip = read_folder(CLIPS / "tune09.npz")[0]
    found = ratios(clip, kind, 1)
    for name in METHODS:
        assert found[name] < 0.9, name
    for name in ("`rts`", "`fixed-lag`"):
        assert found[name] < 0.95 * found["best window"], name
