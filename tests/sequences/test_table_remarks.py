"""What stands around the rows of a table: remarks above it, titles that stand again."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES

TITLES = [f"{name}_{axis}" for name in JOINT_NAMES for axis in "xyz"]


def rows(joints, first=()):
    return [
        ",".join(map(str, [*before, *frame.ravel().tolist()]))
        for before, frame in zip(first or [()] * len(joints), joints, strict=True)
    ]


@pytest.mark.parametrize(
    "remark",
    [
        "# unit: mm",
        "#units=mm",
        "# Units : Millimeters",
        "# positions in mm",
        "# fps: 60, unit: mm",
    ],
)
def test_a_remark_says_the_unit(tmp_path, right, remark):
    path = tmp_path / "a.csv"
    path.write_text("\n".join([remark, "# made by me", ",".join(TITLES), *rows(right * 1000)]))
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-12)
    assert any("a remark in the file says: unit mm" in note for note in sequence.notes)


@pytest.mark.parametrize("remark", ["# fps: 60", "# frame rate = 60", "# 60 fps", "# 60.0 Hz"])
def test_a_remark_says_the_rate_and_the_hand(tmp_path, right, remark):
    path = tmp_path / "a.csv"
    lines = [remark, "# hand: left", ",".join(TITLES), *rows(right * [-1, 1, 1])]
    path.write_text("\n".join(lines))
    (sequence,) = ht.load(path)
    assert (round(sequence.fps), sequence.hand) == (60, "left")


def test_titles_say_more_than_remarks(tmp_path, right):
    path = tmp_path / "a.csv"
    titles = ",".join(f"{t}_m" for t in TITLES)
    path.write_text("\n".join(["# unit: mm", "# hand: wave", titles, *rows(right)]))
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-12)


@pytest.mark.parametrize("first", ["", "frame,"])
def test_joined_files_are_cut_where_the_titles_stand_again(tmp_path, right, first):
    path = tmp_path / "a.csv"
    table = [
        first + ",".join(TITLES),
        *rows(right, first and [(t,) for t in range(len(right))]),
    ]
    path.write_text("\n".join([*table, *table]))
    found = ht.load(path)
    assert len(found) == 2
    for sequence in found:
        np.testing.assert_allclose(sequence.joints, right, atol=1e-12)
    notes = " ".join(found[0].notes)
    assert f"the titles stand again in line {len(table) + 1}" in notes
    assert "cut into 2" in notes


def test_titles_again_do_not_cut_where_time_goes_on(tmp_path, right):
    path = tmp_path / "a.csv"
    stamps = [(t / 30,) for t in range(2 * len(right))]
    body = rows(np.concatenate([right, right]), stamps)
    titles = ",".join(["time_s", *TITLES])
    path.write_text("\n".join([titles, *body[: len(right)], titles, *body[len(right) :]]))
    (sequence,) = ht.load(path)
    assert len(sequence) == 2 * len(right)
