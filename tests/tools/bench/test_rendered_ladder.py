"""Tables of the accuracy page, on rows and noise that are known."""

from __future__ import annotations

import json

import pytest

from tools.bench.rendered import ladder


def row(pa_mm, moving_mm=1.0):
    return {
        "pa_mm": pa_mm,
        "moving_mm": moving_mm,
        "acceleration": 0.5,
        "jitter": 20.0,
        "jitter_truth": 30.0,
        "angle_deg": 7.0,
        "said": 1.0,
    }


def test_a_row_is_held_against_raw_and_against_the_row_before():
    found, before = [row(3.0), row(5.0)], [row(4.0), row(4.0)]
    base = [row(6.0, 2.0), row(10.0, 2.0)]
    of_raw, of_before, moving, *rest = ladder._cells(found, base, before)
    assert of_raw == "0.500 [0.500, 0.500]"
    assert of_before == "1.000 [0.750, 1.250]"
    assert moving == "0.50"
    assert rest == ["0.50", "20 (30)", "7.0"]


def test_white_noise_is_as_large_as_it_is_said_to_be(monkeypatch):
    monkeypatch.setattr(ladder, "WHITE_CLIPS", 1)
    turned, off = map(float, ladder._white("rts").split(" / "))
    assert 0.8 < turned < 1.3
    assert 0.8 < off < 1.25


def test_tables_are_kept_as_they_are(tmp_path):
    found = {"head": ["", "rts"], "rows": [["acc., m/s²", "0.5"]]}
    ladder.write_table(found, tmp_path / "a.json")
    assert json.loads((tmp_path / "a.json").read_text()) == found
    assert ladder._ratio([(3.0, 1.0), (4.0, 1.0)]) == "3.54 / 1.00"
    with pytest.raises(SystemExit):
        ladder_command("neither")


def ladder_command(which):
    from tools.bench.rendered.__main__ import main

    return main(["tables", which, "-o", "x.json"])
