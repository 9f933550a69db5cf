"""tools/bench/mutants.py seeds real faults, and sees whether tests notice them."""

from __future__ import annotations

import ast
import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from tools.bench import mutants
from tools.bench.distance import FAR, distances
from tools.bench.mutants import ROOT, Finder
from tools.bench.seeding import again

SOURCE = '''\
"""A docstring with 3 numbers."""

SIDE = "left"


def area(width: float, height: float, *, scale: float = 2.0) -> float:
    """Of 1 box."""
    if width < 0 and height < 0:
        raise ValueError(f"{width} is below 0")
    log(width, height)
    return max(width - height, pick(width, scale=scale, other=1).T @ height)
'''


def seeded(source=SOURCE):
    found = Finder("made/up.py", source).found
    data = source.encode()
    return {
        (m.kind, m.text): (data[: m.start] + m.text.encode() + data[m.end :]).decode()
        for m in found
    }


def test_every_fault_is_python_and_differs():
    for text in seeded().values():
        ast.parse(text)
        assert ast.dump(ast.parse(text)) != ast.dump(ast.parse(SOURCE))


@pytest.mark.parametrize(
    ("kind", "text"),
    [
        ("another comparison", "(width <= 0)"),
        ("and for or", "((width < 0) or (height < 0))"),
        ("the condition reversed", "not (width < 0 and height < 0)"),
        ("an error is not raised", "pass"),
        ("a call is left out", "pass"),
        ("arguments exchanged", "log(height, width)"),
        ("an argument is left out", "pick(width, other=1)"),
        ("another operation", "(width + height)"),
        ("operands exchanged", "(height - width)"),
        ("not transposed", "pick(width, scale=scale, other=1)"),
        ("its twin", "min"),
        ("the other side", "'right'"),
        ("another constant", "3.0"),
    ],
)
def test_kinds(kind, text):
    assert (kind, text) in seeded()


def test_what_cannot_be_wrong_is_left_alone():
    assert not any(
        "docstring" in m.before or "is below" in m.before
        for m in Finder("a.py", SOURCE).found
        if m.kind != "an error is not raised"
    )


def test_places_in_text_that_is_not_ascii():
    source = 'NAME = "Hände"; SIDE = "left"\n'
    assert seeded(source)["the other side", "'right'"] == "NAME = \"Hände\"; SIDE = 'right'\n"


def test_a_fault_that_tests_see_and_one_that_none_sees(tmp_path, monkeypatch, capsys):
    (tmp_path / "handtrack" / "made").mkdir(parents=True)
    (tmp_path / "tests" / "made").mkdir(parents=True)
    (tmp_path / "handtrack" / "made" / "__init__.py").touch()
    (tmp_path / "handtrack" / "__init__.py").touch()
    (tmp_path / "handtrack" / "made" / "sides.py").write_text("def one():\n    return 1\n")
    test = tmp_path / "tests" / "made" / "test_sides.py"
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    monkeypatch.setattr(mutants, "COPIED", ("handtrack", "tests"))
    test.write_text(
        "from handtrack.made.sides import one\n\n\ndef test_one():\n    assert one() == 1\n"
    )
    assert mutants.main(["handtrack/made"]) == 0
    assert "0 of 1 faults survived" in capsys.readouterr().out
    test.write_text("from handtrack.made.sides import one\n\n\ndef test_one():\n    assert one()\n")
    assert mutants.main(["handtrack/made"]) == 1
    assert "SURVIVED: '1' -> '2'" in capsys.readouterr().out


def test_operands_keep_their_parentheses():
    source = "x = a * (b + c)\ny = (a if b else c) or d\nz = a - (b - c)\n"
    found = seeded(source)
    assert ("another operation", "(a / (b + c))") in found
    assert ("and for or", "((a if b else c) and d)") in found
    assert ("operands exchanged", "((b - c) - a)") in found


def test_tests_are_as_far_as_imports_lie_between(tmp_path):
    files = {
        "handtrack/__init__.py": "from handtrack.far import far",
        "handtrack/near.py": "X = 1",
        "handtrack/between.py": "from handtrack.near import X",
        "handtrack/far.py": "def far():\n    from handtrack import between",
        "handtrack/other.py": "",
        "tests/helper.py": "import handtrack.near",
        "tests/a/test_near.py": "",
        "tests/a/test_helped.py": "import helper",
        "tests/a/test_between.py": "from handtrack import between",
        "tests/a/test_far.py": "from handtrack.far import far",
        "tests/a/test_whole.py": "import handtrack as ht",
        "tests/a/test_other.py": "from handtrack.other import nothing",
        "tests/a/test_none.py": "import numpy",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    tests = [name for name in files if "/test_" in name]
    found = distances(tmp_path, "handtrack/near.py", tests)
    named = {name[len("tests/a/test_") : -len(".py")]: n for name, n in found.items()}
    assert named == {"near": 0, "helped": 1, "between": 2, "far": 3, "whole": FAR, "other": FAR}


_TRACK = """
import sys
{first}
import handtrack as ht
(s,) = ht.load(sys.argv[1])
tracker = ht.Tracker(ht.HandModel.default(s.hand), filter="kalman", noise_colour=0.2)
frames = [tracker.step(s.joints[t], int(s.time_ns[t])) for t in range(3)]
print([[*map(float, [*f.angles, *f.angle_variance])] for f in frames])
"""


def test_plain_kernels_say_what_compiled_ones_do(sample_file):
    found = []
    for first in ("import tools.bench.interpreted", ""):
        code = [sys.executable, "-c", _TRACK.format(first=first), str(sample_file)]
        run = subprocess.run(code, cwd=ROOT, capture_output=True, text=True, check=True)
        found.append(np.array(ast.literal_eval(run.stdout)))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-6, atol=1e-9)


def test_a_fault_is_found_again_where_lines_were_added(tmp_path):
    (tmp_path / "made.py").write_text(SOURCE)
    (old,) = (m for m in Finder("made.py", SOURCE).found if m.text == "min")
    (tmp_path / "made.py").write_text(f"A = max(1, 2)\n{SOURCE}")
    (found,) = again(tmp_path, [dataclasses.asdict(old)])
    assert found == dataclasses.replace(old, line=old.line + 1, start=found.start, end=found.end)
    assert again(tmp_path, [{**dataclasses.asdict(old), "text": "gone"}]) == []
