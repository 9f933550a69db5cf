"""Large tables, which are read by columns: the same as read cell by cell."""

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.readers import columns_at_once, table_cells
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
