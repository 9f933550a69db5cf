"""CSV tables and FPHA's skeleton.txt."""

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES, ORDERS


def header(names=JOINT_NAMES, suffix=""):
    return [f"{name}_{axis}{suffix}" for name in names for axis in "xyz"]


def rows(joints):
    return [[repr(float(v)) for v in frame.ravel()] for frame in joints]


@pytest.fixture
def write(tmp_path):
    def to(lines, name="a.csv", delimiter=","):
        path = tmp_path / name
        path.write_text("\n".join(delimiter.join(line) for line in lines) + "\n")
        return path

    return to


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
def test_bare_numbers(write, right, delimiter):
    (sequence,) = ht.load(write(rows(right), delimiter=delimiter))
    np.testing.assert_array_equal(sequence.joints, right)


def test_names_in_any_order_with_time_and_frame(write, right):
    names = JOINT_NAMES[::-1]
    lines = [["Time", "frame", *header(names)]]
    for i, frame in enumerate(rows(right[:, ::-1])):
        lines.append([str(i / 50), str(7 + 2 * i), *frame])
    (sequence,) = ht.load(write(lines))
    np.testing.assert_array_equal(sequence.joints, right)
    assert sequence.fps == pytest.approx(50)
    assert sequence.frame_index.tolist() == list(range(7, 31, 2))


def test_frame_numbers_make_the_time(write, right):
    lines = [["frame", *header()]]
    lines += [[str(i), *frame] for i, frame in zip([0, 1, *range(5, 15)], rows(right), strict=True)]
    (sequence,) = ht.load(write(lines), fps=10)
    assert sequence.time_ns[2] == 500_000_000


def test_units_in_names_numbers_for_joints_and_missing_columns(write, right):
    present = JOINT_NAMES[1:]
    (sequence,) = ht.load(write([header(present, "_mm"), *rows(right[:, 1:] * 1e3)]))
    assert not sequence.present[:, 0].any()
    np.testing.assert_allclose(sequence.joints[:, 1:], right[:, 1:])
    (numbered,) = ht.load(write([header(range(21)), *rows(right)]))
    np.testing.assert_array_equal(numbered.joints, right)
    (other,) = ht.load(write([[f"{a}{j}" for j in range(21) for a in "xyz"], *rows(right)]))
    np.testing.assert_array_equal(other.joints, right)


def test_empty_cells_unknown_columns_and_hands(write, left, right):
    lines = [["hand", "time_ns", "mood", *header()]]
    start = 1_782_897_167_604_809_001
    for i, pair in enumerate(zip(rows(left), rows(right), strict=True)):
        for hand, frame in zip(("left", "right"), pair, strict=True):
            lines.append([hand, str(start + i * 10**7), "good", *frame])
    lines[5][6:9] = ["", "nan", ""]  # frame 2 of the left hand, thumb_cmc
    a, b = ht.load(write(lines))
    assert (a.hand, b.hand) == ("left", "right")
    assert (~a.present).sum() == 1
    assert not a.present[2, 1]
    assert a.time_ns[0] == start
    np.testing.assert_array_equal(b.joints, right)
    assert "columns not used: mood" in a.notes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda t: [*t[:4], [*t[4][:-1], "abc"]],
            "line 5: little_tip_z is 'abc', expected a number",
        ),
        (lambda t: [*t[:4], t[4][:-1]], "line 5 has 62 columns, line 1 has 63"),
        (lambda t: t[:1], "a header, but no frames"),
        (lambda t: [line[:-1] for line in t], "no column for little_tip z"),
        (lambda t: [["a", "b"], ["1", "2"]], "expected columns such as wrist_x, found a, b"),
        (lambda t: [["1", "2"]], "a table of 2 columns without a header, expected 63"),
        (
            lambda t: [[*t[0], "frame"], *[[*r, "1.5"] for r in t[1:]]],
            "frame is not a whole number",
        ),
        (
            lambda t: [[*t[0], "time"], *[[*r, "noon"] for r in t[1:]]],
            "line 2: time is 'noon', expected a time",
        ),
        (lambda t: [[*t[0], "wrist_x"], *[[*r, "1"] for r in t[1:]]], "two columns for wrist x"),
        (lambda t: [[""]], "no lines in it"),
    ],
)
def test_bad_tables(write, right, change, message):
    path = write(change([header(), *rows(right)]))
    with pytest.raises(ht.InputError, match=message) as caught:
        ht.load(path)
    assert str(caught.value).startswith(f"{path}: ")


def fpha(right, start=0):
    theirs = np.empty_like(right)
    theirs[:, :] = np.nan
    for ours, their in enumerate(ORDERS["fpha"]):
        theirs[:, their] = right[:, ours] * 1e3
    return [[f"{start + i:04d}", *frame] for i, frame in enumerate(rows(theirs))]


def test_fpha(tmp_path, write, right):
    folder = tmp_path / "Subject_3" / "put_salt" / "2"
    folder.mkdir(parents=True)
    path = write(fpha(right, 5), "Subject_3/put_salt/2/skeleton.txt", " ")
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, right)
    assert sequence.frame_index.tolist() == list(range(5, 17))
    assert sequence.fps == pytest.approx(30)
    assert (sequence.name, sequence.subject) == ("put_salt 2", "Subject_3")
    assert sequence.hand == "right"
    assert sequence.notes == ()
    (part,) = ht.load(tmp_path, frames=(6, 8))
    assert part.frame_index.tolist() == [6, 7, 8]


def test_fpha_frames_are_numbers(write, right):
    lines = fpha(right)
    lines[3][0] = "2.5"
    with pytest.raises(ht.InputError, match=r"frame index \(column 1\) is not a whole number"):
        ht.load(write(lines, "skeleton.txt", " "))


def test_quotes_behind_a_blank(tmp_path, right):
    titles = ", ".join(f'"{n}_{a}"' for n in JOINT_NAMES for a in "xyz")
    lines = [", ".join(f'"{x:.9f}"' for x in row.ravel()) for row in right]
    path = tmp_path / "a.csv"
    path.write_text("\n".join([titles, *lines]) + "\n")
    (sequence,) = ht.load(path, hand="right")
    np.testing.assert_allclose(sequence.joints, right, atol=1e-8)
