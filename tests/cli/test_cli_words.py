"""One word, one meaning: what residuals say, what cameras measure."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import handtrack as ht


@pytest.fixture
def two(sample, elsewhere):
    """A good track and a worse one, without a truth."""
    bare = replace(sample.frames(0, 149), truth=None)
    ht.write_mcap([ht.track(bare)], "fit.mcap")
    ht.write_mcap([ht.track(bare, calibrate=False, update="li2021")], "rough.mcap")


def test_a_residual_that_varies_less_is_no_steadiness(call, two):
    status, out, _ = call("stability", "fit.mcap", "rough.mcap", "--compare", "--html", "a.html")
    assert status == 0
    assert "steadier" not in out
    assert "leaves a residual that varies less than" in " ".join(out.split())
    data = json.loads(call("stability", "fit.mcap", "rough.mcap", "--compare", "--json")[1])
    (std,) = [
        d for d in data["differences"] if (d["measure"], d["statistic"]) == ("pa_mpjpe_mm", "std")
    ]
    assert std["clear"]  # it differs for sure, and is still no verdict
    with open("a.html", encoding="utf-8") as page:
        text = page.read()
    (at,) = [i for i in range(len(text)) if text.startswith("leaves a residual", i)]
    assert '"clear":false' in text[at : text.index("}", at) + 1]


def test_cameras_measure_in_pixels(call, sample, elsewhere):
    """The joints of such a recording are fitted ones: their error says nothing."""
    track = ht.track(sample.frames(0, 19))
    track = replace(track, truth=None)
    seen = {"views": 2, "reprojection_px": {"mean": 2.5, "median": 2.25, "p95": 6.0, "max": 9.0}}
    ht.write_mcap([replace(track, settings={**track.settings, "cameras": seen})], "a.mcap")
    ht.write_mcap([track], "plain.mcap")
    for command, text in (
        ("stability", "reprojection, px"),
        ("info", "reprojection error in 2 cameras, px: mean 2.5, median 2.25"),
    ):
        status, out, _ = call(command, "a.mcap")
        assert status == 0
        assert text in " ".join(out.split())
        assert "reprojection" not in call(command, "plain.mcap")[1]
    row = ht.stability(ht.read_mcap("a.mcap")).overall
    assert row.against == "nothing"
    assert row.compared == 0
    assert (row.reprojection_px.median, row.reprojection_px.max) == (2.25, 9.0)
    assert ht.stability(track).overall.against == "observed"
    assert np.isfinite(track.angles).any()
