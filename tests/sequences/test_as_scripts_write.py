"""Hands as people's scripts write them: labels beside bare numbers, what Python prints, pandas'
JSON, landmarks in the picture beside those in the world; and what is refused with its cure."""

from __future__ import annotations

import datetime
import json
import pickle
from types import SimpleNamespace

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES

NUMBERED = [f"{axis}{j}" for j in range(21) for axis in "xyz"]


def same(path, right):
    found = {s.hand: s for s in ht.load(path)}
    np.testing.assert_allclose(found["right"].joints, right, atol=1e-9)
    return found


def numbers(right):
    return [frame.ravel().tolist() for frame in right]


def table(path, rows, titles=None):
    lines = ([titles] if titles else []) + rows
    path.write_text("\n".join(",".join(map(str, line)) for line in lines))


@pytest.mark.parametrize(
    ("before", "behind"),
    [((), ("fist",)), (("fist",), ()), (("img_1.jpg",), (3,)), ((), (4,)), (("Right",), ("A",))],
)
def test_labels_beside_bare_numbers_are_left_out(tmp_path, right, before, behind):
    table(tmp_path / "a.csv", [[*before, *row, *behind] for row in numbers(right)])
    same(tmp_path / "a.csv", right)


def test_a_label_behind_the_numbers_of_an_array(tmp_path, right):
    flat = np.concatenate([right.reshape(len(right), 63), np.full((len(right), 1), 2.0)], 1)
    np.save(tmp_path / "a.npy", flat)
    same(tmp_path / "a.npy", right)
    np.save(tmp_path / "b.npy", np.zeros((9, 64)))
    with pytest.raises(InputError, match="shape"):
        ht.load(tmp_path / "b.npy")


def test_lines_of_x_y_z_under_their_titles(tmp_path, right):
    table(tmp_path / "a.csv", right.reshape(-1, 3).tolist(), ["x", "y", "z"])
    same(tmp_path / "a.csv", right)


@pytest.mark.parametrize("title", ["{w}_{n}_{a}", "{n}_{w}_{a}"])
def test_the_picture_beside_the_world_is_left_out(tmp_path, right, title):
    def titles(where):
        return [title.format(w=where, n=n, a=a) for n in JOINT_NAMES for a in "xyz"]

    picture = right * [0.5, 0.5, 1.0] + [0.5, 0.5, 0.0] - right[:, :1] * [0, 0, 1]
    rows = [[*p, *w] for p, w in zip(numbers(picture), numbers(right), strict=True)]
    table(tmp_path / "a.csv", rows, [*titles("image"), *titles("world")])
    same(tmp_path / "a.csv", right)
    bare = [t.replace("image_", "") for t in titles("image")]
    table(tmp_path / "b.csv", rows, [*bare, *titles("world")])
    same(tmp_path / "b.csv", right)


PANDAS = {
    "records": lambda rows: [dict(zip(NUMBERED, row, strict=True)) for row in rows],
    "split": lambda rows: {"columns": NUMBERED, "index": [*range(len(rows))], "data": rows},
    "columns": lambda rows: {
        k: {str(i): row[c] for i, row in enumerate(rows)} for c, k in enumerate(NUMBERED)
    },
    "index": lambda rows: {
        str(i): dict(zip(NUMBERED, row, strict=True)) for i, row in enumerate(rows)
    },
    "table": lambda rows: {
        "schema": {"fields": []},
        "data": [{"index": i, **dict(zip(NUMBERED, r, strict=True))} for i, r in enumerate(rows)],
    },
}


@pytest.mark.parametrize("orient", PANDAS)
def test_what_pandas_writes_as_json(tmp_path, right, orient):
    (tmp_path / "a.json").write_text(json.dumps(PANDAS[orient](numbers(right))))
    same(tmp_path / "a.json", right)


def landmarks(frame):
    return "".join("landmark {{\n  x: {}\n  y: {}\n  z: {}\n}}\n".format(*x) for x in frame)


PRINTED = {
    "objects": lambda right: "\n".join(
        str({"frame": t, "hand": "Right", "seen": True, "more": None, "landmarks": frame})
        for t, frame in enumerate(right.tolist())
    ),
    "list": lambda right: str([[tuple(x) for x in frame] for frame in right.tolist()]),
    "lines of tuples": lambda right: "\n".join(
        str([tuple(x) for x in frame]) for frame in right.tolist()
    ),
    "numpy": lambda right: "\n".join(
        "[" + ", ".join(f"np.float64({v})" for v in frame.ravel()) + "]" for frame in right
    ),
    "landmarks": lambda right: "".join(map(landmarks, right)),
    "list of landmarks": lambda right: "".join(f"[{landmarks(frame)}]" for frame in right),
}


@pytest.mark.parametrize("kind", PRINTED)
def test_what_python_prints(tmp_path, right, kind):
    (tmp_path / "a.txt").write_text(PRINTED[kind](right))
    same(tmp_path / "a.txt", right)


@pytest.mark.parametrize("key", ["world", "World", "right_world"])
def test_joints_under_world_alone(tmp_path, right, key):
    lines = [
        {"ts": 1.7e9 + t / 30, "image": (frame[:, :2] * 100).tolist(), key: frame.tolist()}
        for t, frame in enumerate(right)
    ]
    (tmp_path / "a.jsonl").write_text("\n".join(map(json.dumps, lines)))
    same(tmp_path / "a.jsonl", right)


@pytest.mark.parametrize(
    ("name", "data", "says"),
    [
        ("a.pkl", [SimpleNamespace(x=1.0)] * 21, "SimpleNamespace.*np.savez, json.dump"),
        ("a.pkl", [{"t": datetime.datetime(2026, 1, 1)}], "datetime.*np.savez, json.dump"),
        ("a.npy", np.array([{"x": 1}], dtype=object), "no joints in it: .*found x"),
    ],
)
def test_pickles_of_more_than_numbers_say_how_to_save_them(tmp_path, name, data, says):
    if name.endswith(".npy"):
        np.save(tmp_path / name, data, allow_pickle=True)
    else:
        (tmp_path / name).write_bytes(pickle.dumps(data))
    with pytest.raises(InputError, match=says):
        ht.load(tmp_path / name)


def test_what_is_cut_short_says_what_to_do(tmp_path, right):
    table(tmp_path / "a.csv", [*numbers(right), [0.1, 0.2]], NUMBERED)
    with pytest.raises(InputError, match=r"line 14 has 2 columns.*cut short, leave it out"):
        ht.load(tmp_path / "a.csv")
    lines = [json.dumps({"joints": frame}) for frame in right.tolist()]
    (tmp_path / "a.jsonl").write_text("\n".join([*lines, lines[0][:90]]))
    with pytest.raises(InputError, match=r"line 13\): leave that line out"):
        ht.load(tmp_path / "a.jsonl")
    (tmp_path / "a.json").write_text("[" + ",\n".join(lines) + ",\n]")
    with pytest.raises(InputError, match="leave that comma out"):
        ht.load(tmp_path / "a.json")


def picture(right):
    """MediaPipe's landmarks in a picture: shares of it, depths from the wrist."""
    flat = 0.3 + 1.5 * right
    flat[..., 2] = 1.5 * (right[..., 2] - right[:, :1, 2])
    flat[:, 0, 2] = 1e-7 * np.arange(len(right))
    return flat


IN_A_PICTURE = {
    "a.npy": lambda path, x: np.save(path, x),
    "b.npy": lambda path, x: np.save(path, x.reshape(len(x), 63)),
    "c.npy": lambda path, x: np.save(
        path, np.concatenate([x.reshape(len(x), 63), 0 * x[:, :1, 0] + 3], 1)
    ),
    "a.npz": lambda path, x: np.savez(path, landmarks=x),
    "b.npz": lambda path, x: np.savez(path, mine=x),
    "a.json": lambda path, x: path.write_text(json.dumps(x.tolist())),
    "b.json": lambda path, x: path.write_text(json.dumps({"data": x.reshape(len(x), 63).tolist()})),
    "c.json": lambda path, x: path.write_text(json.dumps({"hand": "left", "samples": x.tolist()})),
    "a.txt": lambda path, x: np.savetxt(path, x.reshape(len(x), 63)),
    "b.txt": lambda path, x: path.write_text(PRINTED["landmarks"](x)),
    "a.csv": lambda path, x: table(path, [[*row, 4] for row in numbers(x)]),
    "b.csv": lambda path, x: table(path, [[t, *row] for t, row in enumerate(numbers(x))]),
    "c.csv": lambda path, x: table(path, x.reshape(-1, 3).tolist(), ["x", "y", "z"]),
    "a.pkl": lambda path, x: path.write_bytes(pickle.dumps([*x])),
}


@pytest.mark.parametrize("name", IN_A_PICTURE)
def test_landmarks_in_a_picture_are_not_read_as_metres(tmp_path, right, name):
    IN_A_PICTURE[name](tmp_path / name, picture(right))
    with pytest.raises(InputError, match=r"world landmarks.*--camera LENS.*--fov"):
        ht.load(tmp_path / name)
