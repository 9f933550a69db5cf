"""tools/bench/mutants.py seeds real faults, and sees whether tests notice them."""

from __future__ import annotations

import ast

import pytest

from tools.bench import mutants
from tools.bench.mutants import Finder

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
