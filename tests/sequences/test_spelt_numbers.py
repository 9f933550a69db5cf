"""Numbers as people's programs spell them in cells: units, percentages, marks between thousands."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES

FAR = np.array([1.0, 1.0, 1.0])


def write(path, joints, spell, separator=",", title="{n}_{a}"):
    titles = [title.format(n=n, a=a) for n in JOINT_NAMES for a in "xyz"]
    rows = [separator.join(spell(v) for v in frame.ravel()) for frame in joints]
    path.write_text("\n".join([separator.join(titles), *rows]))
    return path


def same(path, joints, atol=1e-6):
    (found,) = ht.load(path, hand="right")
    np.testing.assert_allclose(found.joints, joints, atol=atol)
    return found


@pytest.mark.parametrize("unit", ["mm", "cm", "m", "in"])
@pytest.mark.parametrize("between", ["", " "])
def test_cells_that_state_their_unit(tmp_path, right, unit, between):
    size = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}[unit]
    path = write(tmp_path / "a.csv", right / size, lambda v: f"{v:.7f}{between}{unit}")
    assert same(path, right).notes is not None


def test_cells_in_two_units_are_refused(tmp_path, right):
    path = write(
        tmp_path / "a.csv", right, lambda v: f"{v * 1e3:.3f} mm" if v < 0.3 else f"{v:.6f} m"
    )
    with pytest.raises(InputError, match="cells are in m and in mm"):
        ht.load(path)


def test_cells_in_another_unit_than_their_titles_are_refused(tmp_path, right):
    path = write(tmp_path / "a.csv", right * 100, lambda v: f"{v:.3f} cm", title="{n}_{a}_mm")
    with pytest.raises(InputError, match="titles are in mm, its cells in cm"):
        ht.load(path)


@pytest.mark.parametrize("mark", [",", "'", "\u00a0", "\u202f"])
def test_marks_between_thousands(tmp_path, right, mark):
    joints = (right + FAR) * 1000
    path = tmp_path / "a.csv"
    write(path, joints, lambda v: f"{v:,.3f}".replace(",", mark), ";", "{n}_{a}_mm")
    same(path, right + FAR)
    if mark == ",":
        write(path, joints, lambda v: f'"{v:,.3f}"', ",", "{n}_{a}_mm")
        same(path, right + FAR)


def swapped(text):
    return text.translate(str.maketrans(",.", ".,"))


def test_points_between_thousands_and_decimal_commas(tmp_path, right):
    joints = (right + FAR) * 1000
    path = write(tmp_path / "a.csv", joints, lambda v: swapped(f"{v:,.3f}"), ";", "{n}_{a}_mm")
    same(path, right + FAR)


@pytest.mark.parametrize("spell", [lambda v: f"{v:,.0f}", lambda v: swapped(f"{v:,.0f}")])
def test_whole_numbers_on_both_sides_of_a_thousand(tmp_path, right, spell):
    joints = np.round((right + FAR - right[:, 9:10] + right[0, 9]) * 1000)  # 1 m in its middle
    joints -= np.round(joints[0, 9]) - 1000
    path = write(tmp_path / "a.csv", joints, spell, ";", "{n}_{a}_mm")
    same(path, joints / 1000)


def test_decimal_marks_before_three_digits_stay_decimal_marks(tmp_path, right):
    joints = (right + FAR) * 100
    for spell in (lambda v: f"{v:.3f}", lambda v: swapped(f"{v:.3f}")):
        same(write(tmp_path / "a.csv", joints, spell, ";", "{n}_{a}_cm"), right + FAR, 1e-5)


def test_a_confidence_as_a_percentage(tmp_path, right):
    titles = ["frame", "score", *(f"{n}_{a}" for n in JOINT_NAMES for a in "xyz")]
    rows = [
        f"{t},{50 + t}.5%," + ",".join(f"{v:.7f}" for v in x.ravel()) for t, x in enumerate(right)
    ]
    (tmp_path / "a.csv").write_text("\n".join([",".join(titles), *rows]))
    found = same(tmp_path / "a.csv", right)
    assert found.confidence is not None
    np.testing.assert_allclose(found.confidence[:, 0], 0.505 + 0.01 * np.arange(len(right)))


def test_inches_in_brackets_behind_a_title(tmp_path, right):
    same(write(tmp_path / "a.csv", right / 0.0254, repr_of, title="{n}_{a} (in)"), right)


def repr_of(value):
    return repr(float(value))
