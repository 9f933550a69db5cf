"""Files in inches, and BVH of our own, which names the hand that it is of."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import handtrack as ht

TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def moving(hand: str) -> ht.Sequence:
    """Two seconds of a hand that bends, mirrored in part by nothing but its model."""
    model = ht.HandModel.default(hand)
    bend = 0.5 + 0.5 * np.sin(np.linspace(0, 6, 60))[:, None]
    angles = model.limits.clamp(bend * np.tile([0.8, 0.05, 0.9, 0.6], 5))
    joints = model.joints(angles, TURN, [0.3, 1.1, 0.2])
    return ht.Sequence(np.arange(60) * 33_333_333, joints, hand=hand)


@pytest.mark.parametrize("hand", ["left", "right"])
@pytest.mark.parametrize("unit", ["m", "cm", "mm", "in"])
def test_bvh_names_its_hand_and_is_read_in_the_unit_it_was_written_in(
    tmp_path: Path, hand: str, unit: str
) -> None:
    sequence = moving(hand)
    (made,) = ht.convert([sequence], tmp_path / "a.bvh", unit=unit)
    (found,) = ht.load(made.path)
    assert found.hand == hand
    assert not any("no hand named" in note for note in found.notes)
    assert any(f"read as {unit}" in note for note in found.notes)
    # the file has six digits: of metres that is 1 um and 1e-6 degrees
    np.testing.assert_allclose(found.joints, sequence.joints, atol=1e-3)


def test_inches_that_are_said(tmp_path: Path) -> None:
    joints = moving("right").joints
    np.savez(tmp_path / "said.npz", joints=joints / 0.0254, unit="inches", hand="right", fps=30)
    np.savez(tmp_path / "bare.npz", joints=joints / 0.0254, hand="right", fps=30)
    (said,) = ht.load(tmp_path / "said.npz")
    (given,) = ht.load(tmp_path / "bare.npz", unit="in")
    np.testing.assert_allclose(said.joints, joints, atol=1e-12)
    np.testing.assert_allclose(given.joints, joints, atol=1e-12)
