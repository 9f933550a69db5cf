"""Hands of which little is there, through every command: no warning of a library, no number of
what nobody saw."""

from __future__ import annotations

import csv
import re

import made_files
import numpy as np
import pytest
from made_hands import Brought, brought, finger_missing, joined

from tools.bench.brought import command

LIBRARY = re.compile(r"RuntimeWarning|Traceback|model default|numpy|site-packages")
right = brought().but(label="right", extra={"fps": 30.0})


def never(joints: list[int]) -> Brought:
    made = right.joints.copy()
    made[:, joints] = np.nan
    return right.but(joints=made, expected=made)


def still() -> Brought:
    made = np.repeat(right.joints[:1], len(right.joints), 0)
    return right.but(joints=made, expected=made, angles=np.repeat(right.angles[:1], 45, 0))


HANDS = {
    "one frame": brought(frames=1).but(label="right", extra={"fps": 30.0}),
    "two frames": brought(frames=2).but(label="right", extra={"fps": 30.0}),
    "never moves": still(),
    "thumb bone of no length": joined(right, 2, 1),
    "tip on its joint": joined(right, 12, 11),
    "base on the wrist": joined(right, 17, 0),
    "a tip never seen": never([8]),
    "no wrist": never([0]),
    "a finger never seen": finger_missing(right, 3),
    "two fingers only": never([j for j in range(1, 21) if (j - 1) // 4 not in (1, 2)]),
    "tips and wrist only": never([j for j in range(1, 21) if j % 4]),
    "four joints": never([j for j in range(21) if j not in (0, 5, 9, 17)]),
    "three joints": never([j for j in range(21) if j not in (0, 5, 17)]),
}


@pytest.mark.parametrize("word", HANDS)
def test_every_command(word, tmp_path):
    path = made_files.npz(tmp_path / "a.npz", HANDS[word])
    out = str(tmp_path / "a.mcap")
    status, said, _ = command("track", str(path), "-o", out, "--filter", "rts", "--mesh", "none")
    assert not LIBRARY.search(said), said
    if status:
        assert status in (1, 2), said
        assert str(path) in said
        assert len(said.strip().splitlines()) <= 3
        return
    for ending in ("csv", "npz", "bvh", "glb"):
        done, more, _ = command("export", out, str(tmp_path / f"out.{ending}"))
        assert done == 0, more
        assert not LIBRARY.search(more), more
    for arguments in (("stability", out), ("info", out), ("stability", str(path))):
        done, more, _ = command(*arguments)
        assert not LIBRARY.search(more), more
        assert done in (0, 2), more


def cells(path) -> list[dict[str, str]]:
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


@pytest.mark.parametrize("mark", [None, 0.0, -1.0])
def test_a_finger_that_no_frame_saw_has_no_numbers(mark, tmp_path):
    path = made_files.npz(tmp_path / "a.npz", finger_missing(right, 3, mark))
    out = str(tmp_path / "a.mcap")
    status, _, printed = command("track", str(path), "-o", out, "--mesh", "none")
    assert status == 0
    assert "never seen" in printed
    assert "ring_mcp" in printed
    command("export", out, str(tmp_path / "a.csv"))
    rows = cells(tmp_path / "a.csv")
    for name in rows[0].keys() - {"reason"}:
        seen = [row[name] for row in rows if row[name]]
        assert bool(seen) != ("ring" in name), name
