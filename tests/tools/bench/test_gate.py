"""tools/bench/gate.py says what got worse, by how much, and nothing else."""

from __future__ import annotations

import copy
import json

import pytest

from tools.bench import gate

NUMBERS = {
    "machine": {"cpu": "made up"},
    "fit": {
        "frames": [
            {"start": s, "solver": n, "median us": us, "x ours": us / 4, "of ours": of}
            for s in ("mean pose", "frame before")
            for n, us, of in (
                ("ours: BCD and Newton, compiled", 4.0, 1.0),
                ("ours: fit() from Python", 60.0, 1.0),
                ("scipy trf, box for ellipses", 4000.0, 1.0),
            )
        ]
        + [{"start": "-", "solver": "mink: not installed"}]
    },
    "motion": {
        "warm": [{"noise mm": 2.0, "median us": 4.0, "p99 us": 6.0, "step() median us": 20.0}],
        "cold": [{"noise mm": 2.0, "median us": 15.0, "p99 us": 40.0, "fit() median us": 70.0}],
    },
    "quality": {"optima": [{"noise mm": 2.0, "optimum %": 100.0}]},
    "tool": {
        "whole": [
            {"what": "track, no filter", "us/frame": 20.0},
            {"what": "write_mcap, no mesh", "us/frame": 40.0, "kB/frame": 3.5},
        ]
    },
}


@pytest.fixture
def held(tmp_path, capsys):
    """Holds changed numbers against NUMBERS: exit status and the lines that say what is worse."""
    baseline, numbers = tmp_path / "baseline.json", tmp_path / "numbers.json"
    numbers.write_text(json.dumps(NUMBERS))
    assert gate.main([str(numbers), "--baseline", str(baseline), "--update"]) == 0

    def hold(change):
        changed = copy.deepcopy(NUMBERS)
        change(changed)
        numbers.write_text(json.dumps(changed))
        capsys.readouterr()
        status = gate.main([str(numbers), "--baseline", str(baseline)])
        out = capsys.readouterr().out
        return status, [line for line in out.splitlines() if "worse by " in line and ":" in line]

    return hold


def test_the_same_numbers_pass(held):
    assert held(lambda numbers: None) == (0, [])


def test_a_slower_machine_is_not_worse(held):
    def slower(numbers):
        for row in numbers["fit"]["frames"] + numbers["tool"]["whole"]:
            for key in ("median us", "us/frame"):
                if key in row:
                    row[key] *= 3

    assert held(slower) == (0, [])


def test_what_got_worse_is_said_with_its_share(held):
    def change(numbers):
        numbers["tool"]["whole"][0]["us/frame"] = 30.0
        numbers["motion"]["warm"][0]["step() median us"] = 22.0  # within the noise

    status, lines = held(change)
    assert status == 1
    (line,) = lines
    assert line.startswith("track, no filter")
    assert "worse by 50 %" in line


def test_a_solver_that_catches_up_is_said(held):
    def change(numbers):
        numbers["fit"]["frames"][2]["x ours"] = 500.0  # was 1000

    status, lines = held(change)
    assert status == 1
    assert [line for line in lines if line.startswith("scipy") and "worse by 100 %" in line]


@pytest.mark.parametrize(
    ("part", "key", "value"),
    [("quality", "optimum %", 99.5), ("tool", "kB/frame", 3.6), ("fit", "of ours", 0.9)],
)
def test_numbers_that_are_no_times_may_not_change(held, part, key, value):
    def change(numbers):
        rows = next(iter(numbers[part].values()))
        next(row for row in reversed(rows) if key in row)[key] = value

    assert held(change)[0] == 1


def test_what_is_not_measured_is_said(held, capsys):
    def change(numbers):
        numbers["tool"]["whole"].pop()

    assert held(change)[0] == 1


def test_a_run_that_is_not_whole_is_refused(tmp_path, capsys):
    path = tmp_path / "part.json"
    path.write_text(json.dumps({"machine": {}, "fit": NUMBERS["fit"]}))
    assert gate.main([str(path)]) == 2
    assert "'motion' is missing" in capsys.readouterr().err
