"""Titles of positions beside rotations, as engines write them, said as plain axes."""

from __future__ import annotations

import pytest

from handtrack.sequences.readers.text_table import plain_axes

ROTATIONS = ["wrist_rx", "wrist_ry", "wrist_rz"]


@pytest.mark.parametrize(
    ("titles", "plain"),
    [
        (["wrist_px", "wrist_py", "wrist_pz"], ["wrist_x", "wrist_y", "wrist_z"]),
        (["Wrist.PX", "Wrist.PY", "Wrist.PZ"], ["Wrist.X", "Wrist.Y", "Wrist.Z"]),
        (["wristPX", "wristPY", "wristPZ"], ["wristX", "wristY", "wristZ"]),
    ],
)
def test_an_engines_positions_have_plain_axes(titles, plain):
    assert plain_axes([*titles, *ROTATIONS]) == [*plain, *ROTATIONS]


@pytest.mark.parametrize(
    "titles",
    [
        ROTATIONS,
        # a word that ends so is no position
        ["clipx", "clipy", "clipz"],
        # not all three, or one more often than the others
        ["wrist_px", "wrist_py"],
        ["wrist_px", "wrist_py", "wrist_pz", "tip_px"],
        # two columns would be called alike
        ["wrist_px", "wrist_py", "wrist_pz", "wrist_x", "wrist_y", "wrist_z"],
    ],
)
def test_other_titles_stay(titles):
    assert plain_axes(titles) == titles
