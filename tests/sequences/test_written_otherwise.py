"""The same hand written otherwise: separators, hands' numbers, tables and objects in JSON."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES


def same(path, right):
    (sequence,) = ht.load(path, hand="right")
    np.testing.assert_allclose(sequence.joints, right, atol=1e-12)


def rows(right):
    return [
        {"frame": t, "joint": name, **dict(zip("xyz", x, strict=True))}
        for t, frame in enumerate(right.tolist())
        for name, x in zip(JOINT_NAMES, frame, strict=True)
    ]


def wide(right, title="{n}_{a}"):
    names = [title.format(n=n, a=a) for n in JOINT_NAMES for a in "xyz"]
    return [
        {"frame": t, **dict(zip(names, frame.ravel().tolist(), strict=True))}
        for t, frame in enumerate(right)
    ]


def test_bars_separate_cells(tmp_path, right):
    for table in (wide(right), rows(right)):
        lines = ["|".join(table[0]), *("|".join(map(str, r.values())) for r in table)]
        (tmp_path / "a.csv").write_text("\n".join(lines))
        same(tmp_path / "a.csv", right)


@pytest.mark.parametrize("title", ["h{h}_{a}{j}", "hand{h}_lm{j}_{a}", "Hand_{h}_{n}_{a}"])
def test_titles_that_begin_with_a_hands_number(tmp_path, right, title):
    left = right * [-1, 1, 1]
    head, both = ["frame"], np.stack([left, right], axis=1)
    for h in (0, 1):
        for j, n in enumerate(JOINT_NAMES):
            head += [title.format(h=h, a=a, j=j, n=n) for a in "xyz"]
    lines = [f"{t}," + ",".join(map(str, x.ravel())) for t, x in enumerate(both)]
    (tmp_path / "a.csv").write_text("\n".join([",".join(head), *lines]))
    found = {s.hand: s for s in ht.load(tmp_path / "a.csv")}
    np.testing.assert_array_equal(found["left"].joints, left)
    np.testing.assert_array_equal(found["right"].joints, right)
    (tmp_path / "b.csv").write_text(
        "\n".join(
            ",".join(line.split(",")[:1] + line.split(",")[64:])
            for line in [",".join(head), *lines]
        )
    )
    same(tmp_path / "b.csv", right)


def test_tables_in_json(tmp_path, right):
    path = tmp_path / "a.json"
    for table in (wide(right), rows(right)):
        path.write_text(json.dumps(table))
        same(path, right)
        lines = "\n".join(map(json.dumps, table))
        (tmp_path / "a.jsonl").write_text(lines)
        same(tmp_path / "a.jsonl", right)
        data = [list(row.values()) for row in table]
        path.write_text(json.dumps({"columns": list(table[0]), "index": [], "data": data}))
        same(path, right)


def test_objects_under_numbers_and_one_after_the_other(tmp_path, right):
    path = tmp_path / "a.json"
    frames = [{"landmarks": [dict(zip("xyz", p, strict=True)) for p in x]} for x in right.tolist()]
    path.write_text(json.dumps({f"frame_{t}": f for t, f in enumerate(frames)}))
    same(path, right)
    for join in ("", "\n"):
        path.write_text(join.join(json.dumps(f, indent=1) for f in frames))
        same(path, right)
    columns = [dict(zip("xyz", x.T.tolist(), strict=True)) for x in right]
    path.write_text(json.dumps(columns))
    same(path, right)
