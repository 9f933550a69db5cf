"""Random combinations of what people's files are like: right, or refused or doubted with a cure."""

from __future__ import annotations

import numpy as np
import pytest
from test_joint_order import as_source, moving_hand

import handtrack as ht
from handtrack.hand.skeleton import ORDERS

UNITS = {"m": 1.0, "cm": 100.0, "mm": 1000.0}
EXPECTED = ("taken as missing", "no hand named")


@pytest.mark.parametrize("seed", range(60))
def test_nothing_is_silent(tmp_path, seed):
    random = np.random.default_rng(seed)
    side = str(random.choice(["left", "right"]))
    frames, noise = int(random.integers(12, 60)), float(random.choice([0, 5e-4, 2e-3]))
    joints = moving_hand(frames, seed, noise) * [1 if side == "right" else -1, 1, 1]
    order, unit = str(random.choice(list(ORDERS))), str(random.choice(list(UNITS)))
    source = as_source(joints, order)
    if random.random() < 0.5:
        source = source - source[:, :1]
    source = source * UNITS[unit]
    source[random.random(source.shape[:2]) < 0.03] = random.choice([0, -1, -999, np.nan])
    stated = {"order": order, "unit": unit, "hand": side}
    fields = {name: value for name, value in stated.items() if random.random() < 0.6}
    if random.random() < 0.2:
        fields["hand"] = "left" if side == "right" else "right"
    np.savez(tmp_path / "a.npz", joints=source, fps=30.0, **fields)
    said, right = _outcome(str(tmp_path / "a.npz"), joints, side)
    assert right or any("--order" in text or "unit" in text or "--" in text for text in said)


def _outcome(path: str, joints: np.ndarray, side: str) -> tuple[list[str], bool]:
    """What was said of a file, and whether its joints and hand are right."""
    try:
        (found,) = ht.load(path)
    except ht.InputError as error:
        return [str(error)], False
    apart = found.joints - joints
    apart -= np.nanmedian(apart, axis=1, keepdims=True)
    right = found.hand == side and bool(np.nanmax(np.abs(apart)) < 1e-3)
    return [n for n in found.notes if not any(text in n for text in EXPECTED)], right
