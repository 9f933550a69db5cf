"""Units that make no hand, and settings that are not known."""

import numpy as np
import pytest

import handtrack as ht
from handtrack.sequences.size import palm_length


@pytest.mark.parametrize(
    ("factor", "unit", "fits"),
    [
        (1e3, None, "mm"),
        (1e2, None, "cm"),
        (1e3, "cm", "mm"),
        (1.0, "mm", "m"),
        (1.0, "cm", "m"),
        (1e2, "mm", "cm"),
    ],
)
@pytest.mark.parametrize("wrist", [True, False])
def test_the_unit_that_fits_is_named(tmp_path, right, factor, unit, fits, wrist):
    joints = right * factor
    if not wrist:
        joints[:, 0] = np.nan
    np.savez(tmp_path / "a.npz", joints=joints)
    with pytest.raises(
        ht.InputError, match=f"from wrist to knuckles with unit {unit or 'm'}; --unit {fits} would"
    ):
        ht.load(tmp_path / "a.npz", unit=unit)
    assert len(ht.load(tmp_path / "a.npz", unit=fits)) == 1


def test_how_large_it_would_be(tmp_path, right):
    scale = 0.0982 / palm_length(right)
    np.save(tmp_path / "a.npy", right * scale * 1e3)
    with pytest.raises(ht.InputError, match=r"the hand would be 98\.2 m from wrist to knuckles"):
        ht.load(tmp_path / "a.npy")


def test_no_unit_fits(tmp_path, right):
    np.save(tmp_path / "a.npy", right * 4)
    with pytest.raises(ht.InputError, match="none of m, cm, mm would fit"):
        ht.load(tmp_path / "a.npy")


def test_unit_in_the_file_is_checked_too(tmp_path, right):
    np.savez(tmp_path / "a.npz", joints_mm=right)
    with pytest.raises(ht.InputError, match="--unit m would fit"):
        ht.load(tmp_path / "a.npz")


def test_odd_scale_is_only_noted(tmp_path, right):
    np.savez(tmp_path / "a.npz", joints=right * 1.8, hand="right", fps=30)
    (sequence,) = ht.load(tmp_path / "a.npz")
    assert "is the scale right?" in sequence.notes[0]


def test_palm_without_a_wrist_is_near_the_palm_with_it(right):
    bare = right.copy()
    bare[:, 0] = np.nan
    assert palm_length(bare) == pytest.approx(palm_length(right), rel=0.15)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"unit": "yard"}, "unknown unit 'yard', expected one of m, cm, mm"),
        (
            {"order": "alphabetical"},
            "unknown joint order 'alphabetical', expected one of handtrack,",
        ),
        ({"hand": "both"}, "unknown hand 'both', expected one of auto, left, right, swap"),
        ({"fps": 0}, "fps is 0, expected a number above 0"),
        ({"fps": float("nan")}, "fps is nan"),
        ({"frames": (5, 4)}, r"frames are \(5, 4\), expected \(first, last\)"),
    ],
)
def test_settings(tmp_path, right, setting, message):
    np.save(tmp_path / "a.npy", right)
    with pytest.raises(ht.SettingsError, match=message):
        ht.load(tmp_path / "a.npy", **setting)
