"""Large tables, which are read by columns: the same as read cell by cell."""

import re
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.readers import (
    columns_at_once,
    landmark_lines,
    table_cells,
    table_places,
)
from handtrack.sequences.readers.columns_at_once import AtOnce, Coded, values_of

N = 12


@pytest.fixture
def joints(right):
    return right[:N]


def long(joints, sides=("Right",), mark=",", lost=()):
    lines = [mark.join(("frame", "time", "hand", "landmark", "x", "y", "z"))]
    for i in range(N):
        for side in sides:
            for name, point in zip(JOINT_NAMES, joints[i], strict=True):
                cells = ["", "NaN", "null"] if (i, name) in lost else [f"{v:.7f}" for v in point]
                lines.append(mark.join((str(i), f"{i / 60:.4f}", side, name, *cells)))
    return "\n".join(lines)


def wide(joints, lost=(), mark=",", said=""):
    lines = [mark.join(["time", *(f"{n}_{a}" for n in JOINT_NAMES for a in "xyz")])]
    for i in range(N):
        cells = [
            said if (i, n) in lost else f"{v:.7f}"
            for n, p in zip(JOINT_NAMES, joints[i], strict=True)
            for v in p
        ]
        lines.append(mark.join([f"{i / 60:.4f}", *cells]))
    return "\n".join(lines)


LOST = {(2, "wrist"), (2, "index_tip"), (7, "thumb_tip")}
TEXTS = {
    "long": lambda x: long(x),
    "long, both hands": lambda x: long(x, ("Left", "Right")),
    "long, holes": lambda x: long(x, lost=LOST),
    "long, tabs": lambda x: long(x, mark="\t"),
    "long, blanks": lambda x: long(x, mark=", "),
    "long, joint twice": lambda x: long(x, ("Right", "Right")),
    "long, unknown joint": lambda x: long(x).replace("ring_tip", "gadget"),
    "long, short line": lambda x: long(x) + "\n3,0.1,Right,wrist,1",
    "long, no number": lambda x: long(x).replace("0.1000,Right,wrist,", "0.1000,Right,wrist,what"),
    "wide": lambda x: wide(x),
    "wide, holes": lambda x: wide(x, LOST),
    "wide, n/a": lambda x: wide(x, LOST, said="N/A"),
    "wide, odd": lambda x: wide(x, LOST, said="-"),
    "wide, plus": lambda x: wide(x).replace(",0.", ",+0."),
    "wide, no number": lambda x: wide(x, LOST, said="0x1"),
    "wide, long line": lambda x: wide(x) + ",1",
    "wide, semicolons": lambda x: wide(x, LOST, mark=";").replace(".", ","),
}

WRONG = {
    *("long, unknown joint", "long, short line", "long, no number", "long, joint twice"),
    *("wide, no number", "wide, long line"),
}


def outcome(path):
    try:
        found = ht.load(path)
    except ht.HandtrackError as error:
        return str(error)
    return [(s.name, s.hand, s.notes, s.joints.tobytes(), s.time_ns.tolist()) for s in found]


@pytest.mark.parametrize("kind", TEXTS)
def test_the_same_as_cell_by_cell(tmp_path, monkeypatch, joints, kind):
    path = tmp_path / "a.csv"
    path.write_text(TEXTS[kind](joints))
    by_cell = outcome(path)
    for module in (columns_at_once, table_cells):
        monkeypatch.setattr(module, "LARGE", 0)
    assert outcome(path) == by_cell
    assert isinstance(by_cell, str) == (kind in WRONG)


def test_holes_are_read_at_once(joints):
    rows = wide(joints, LOST).split("\n")[1:]
    found = AtOnce("\n".join(rows).encode(), ",", 64, N).floats(range(1, 64))
    truth = np.round(joints, 7)
    for frame, name in LOST:
        truth[frame, JOINT_NAMES.index(name)] = np.nan
    np.testing.assert_array_equal(found.reshape(N, 21, 3), truth)


def test_texts_are_in_the_order_of_their_first_rows():
    once = AtOnce(b"5,b,x\n4,a,y\n5,a,x", ",", 3, 3)
    assert once.coded(1).all() == Coded.of(["b", "a", "a"]).all() == ["b", "a", "a"]
    assert once.coded(1).texts == ["b", "a"]
    both = once.coded(0).with_other(once.coded(1))
    assert (both.texts, both.codes.tolist()) == (["5 b", "4 a", "5 a"], [0, 1, 2])
    assert AtOnce(b"5,b,x\n4,a", ",", 3, 2).coded(1) is None
    assert AtOnce(b"5, b\n4,a", ",", 2, 2).coded(1) is None
    assert not AtOnce(b"5,b\n4", ",", 2, 2).is_even()


def test_numbers_of_arrow_without_pandas():
    pa = pytest.importorskip("pyarrow")
    chunks = pa.chunked_array([[1.5, None], [2.5], []], pa.float64())
    np.testing.assert_array_equal(values_of(chunks, np.float64), [1.5, np.nan, 2.5])
    np.testing.assert_array_equal(values_of(chunks.slice(1), np.float64), [np.nan, 2.5])
    assert values_of(pa.chunked_array([], pa.int32()), np.int32).tolist() == []


def lines_of_hands(joints, change=None):
    rng = np.random.default_rng(5)
    out = [] if change is None else [change]
    for i in range(N):
        for side in ("Left", "Right") if i % 4 else ("Right",):
            pose = [f"{v:.6f}" for v in rng.normal(0, 1, 7)]
            fist = f", {side.lower()}Fist: open" if i % 3 == 0 else ""
            if i > 1 and i != 6:
                out.append(f"{side} wrist | f = {i}:, {', '.join(pose)}{fist}")
            about = f" | f = {i} | t = {i * 10**7}" if i != 5 else ""
            numbers = ", ".join(f"{v:.6f}" for v in joints[i].ravel())
            out.append(f"{side} landmarks{about}:, {numbers}")
        out.append("Head pose:, 0, 0, 0, 0, 0, 0, 1\n")
    return "\n".join(out)


ODD_LINES = {
    "usual": None,
    "cells missing": "Right landmarks:, 1, 2, 3",
    "infinite": "Right landmarks:, " + ", ".join(["inf"] * 63),
    "empty cell": "Right wrist:, 1, 2, , 0, 0, 0, 1",
    "no rotation": "Right wrist:, 1, 2, 3, 0, 0, 0, 0",
    "one too many": "Right wrist:, 1, 2, 3, 0, 0, 0, 1, 5",
    "no line": "what is this",
}


@pytest.mark.parametrize("kind", ODD_LINES)
def test_lines_of_hands_the_same_as_line_by_line(monkeypatch, joints, kind):
    data = lines_of_hands(joints, ODD_LINES[kind]).encode()
    outcomes = []
    for large in (10**9, 0):
        monkeypatch.setattr(landmark_lines, "LARGE", large)
        try:
            outcomes.append(landmark_lines.read_landmark_lines(data, Path("a.txt")))
        except ht.HandtrackError as error:
            outcomes.append(str(error))
    assert isinstance(outcomes[0], str) == (kind != "usual")
    if kind != "usual":
        assert outcomes[0] == outcomes[1]
        return
    for slow, quick in zip(*outcomes, strict=True):
        np.testing.assert_allclose(quick.joints, slow.joints, rtol=0, atol=1e-15)
        assert (quick.hand, quick.stamps) == (slow.hand, slow.stamps)


CELLS = {
    "brackets": "({0}, {1}, {2})",
    "lists": "[{0},{1},{2}]",
    "NumPy": "[ {0}  {1} {2}]",
    "names": "{{'x': {0}, 'y': {1}, 'z': {2}}}",
    "MediaPipe": "Landmark(x={0}, y={1}, z={2}, visibility=0.0, presence=0.0)",
    "bare": "{0} {1} {2}",
}
DAMAGE = {
    "whole": lambda text: text,
    "a coordinate less": lambda text: re.sub(r"(?<=[(\[=: ])-?0\.\d+", "", text, count=1),
    "a letter": lambda text: text.replace("7", "q", 1),
    "a number before": lambda text: text.replace('"', '"5', 1),
    "a bracket less": lambda text: (
        text[: text.rindex(")")] + text[text.rindex(")") + 1 :] if ")" in text else text
    ),
}


@pytest.mark.parametrize("damage", DAMAGE)
@pytest.mark.parametrize("kind", CELLS)
def test_cells_of_places_the_same_as_one_by_one(tmp_path, monkeypatch, joints, kind, damage):
    rows = ["time," + ",".join(JOINT_NAMES)]
    for i in range(N):
        cells = [CELLS[kind].format(*(f"{v:.7f}" for v in point)) for point in joints[i]]
        rows.append(f"{i / 60:.4f}," + ",".join(f'"{cell}"' for cell in cells))
    path = tmp_path / "a.csv"
    path.write_text("\n".join([rows[0], DAMAGE[damage]("\n".join(rows[1:]))]))
    quick = outcome(path)
    monkeypatch.setattr(table_places, "_alike", lambda *_: None)
    assert outcome(path) == quick
    assert isinstance(quick, str) or damage in ("whole", "a bracket less", "a number before")


WHOLE = {"rows": "[{}, {}, {}]", "points": "Point(x={}, y={}, z={})", "NumPy": "[{}  {} {}]"}


@pytest.mark.parametrize("form", [*CELLS.values(), *WHOLE.values()])
@pytest.mark.parametrize("mark", [";", "\x1f"])
def test_cells_of_places_are_read_at_once(joints, form, mark):
    hand = form in WHOLE.values()
    if hand:
        form = f"[{' '.join([form] * 21)}]"
    lines = []
    for i, frame in enumerate(joints):
        texts = [f"{v:.7f}" for v in frame.ravel()]
        cells = [texts] if hand else zip(*[iter(texts)] * 3, strict=True)
        lines.append(mark.join([f"{i}", *(form.format(*cell) for cell in cells), "2"]))
    first = lines[0].split(mark)
    widths = dict.fromkeys(range(1, len(first) - 1), 63 if hand else 3)
    rows = table_places._at_once(lines, mark, first, widths)
    assert rows is not None
    found = np.array([row.split("\x1f") for row in rows], float)
    np.testing.assert_array_equal(found[:, 1:-1].reshape(N, 21, 3), np.round(joints, 7))
    np.testing.assert_array_equal(found[:, [0, -1]], [(i, 2) for i in range(N)])


@pytest.mark.parametrize(
    "other",
    [
        "1;[0.1  0.2];[0.3 0.5  0.6 0.7];4",  # as many numbers in the line, not in each cell
        "1;[0.1  0.2 0.3];[0.5  0. 6 0.7];4",
        "1;[0.1  0.20.3];[0.5  0.6 0.7];4",
        "1;[0.1  0.2 0.3];[0.5  0.6 0.7];",
        "1;[0.1  0.2 0.3];[0.5  0.6 x];4",
        "1;[0.1  0.2 0.3];[0.5  0.6 0.7]",
    ],
)
def test_cells_between_blanks_hold_as_many_numbers(other):
    first = "1;[0.1  0.2 0.3];[ 0.5  0.6 -0.7];4"
    ways = (first, first.replace("-0.7]", "0.75 ]"))
    read = lambda lines: table_places._at_once(lines, ";", first.split(";"), {1: 3, 2: 3})  # noqa: E731
    assert read([*ways]) == [
        "1\x1f0.1\x1f0.2\x1f0.3\x1f0.5\x1f0.6\x1f" + z for z in ("-0.7\x1f4", "0.75\x1f4")
    ]
    assert read([*ways, other]) is None
