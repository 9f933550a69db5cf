"""`stability`: tables, JSON, truths, methods side by side."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from cli_cases import ROW, files

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "hand")]

SPREAD = {"mean", "std", "median", "p95", "max"}

pytestmark = pytest.mark.usefixtures("elsewhere")


def test_stability_prints_what_track_printed(call, made):
    _, tracked, _ = call("track", made.short, "-o", "a.mcap")
    status, out, err = call("stability", "a.mcap")
    assert (status, err) == (0, "")
    assert tracked.startswith(out)


def test_stability_json_has_the_agreed_shape(call, made):
    status, out, err = call("stability", made.recording, "--json")
    assert (status, err) == (0, "")
    result = json.loads(out)
    assert list(result) == ["sequences", "overall"]
    for row in (*result["sequences"], result["overall"]):
        assert set(row) >= ROW
        assert set(row["pa_mpjpe_mm"]) == set(row["mpjpe_mm"]) == SPREAD
        numbers = [*row["pa_mpjpe_mm"].values(), *row["mpjpe_mm"].values()]
        numbers += [row["jitter_m_s3"], row["acceleration_m_s2"]]
        assert all(isinstance(n, float) and n > 0 for n in numbers)
        assert row["frames"] == row["fitted"] + row["predicted"] + row["lost"] == 40
    assert result["sequences"][0]["against"] == "truth"


def test_stability_against_the_observed_joints(call, made):
    bare = {k: v for k, v in made.content.items() if "truth" not in k}
    np.savez("bare.npz", **bare)
    call("track", "bare.npz", "-o", "bare.mcap")
    _, out, _ = call("stability", "bare.mcap", "--json")
    assert json.loads(out)["overall"]["against"] == "observed"
    _, out, _ = call("stability", "bare.mcap")
    assert "This is not accuracy" in out


def test_stability_of_estimates_against_a_truth(call, made):
    """A recording's output is measured, not its input; of the truth's file its truth."""
    _, out, _ = call("stability", made.recording, "--truth", made.short, "--json")
    pair = json.loads(out)["overall"]
    _, out, _ = call("stability", made.recording, "--json")
    own = json.loads(out)["overall"]
    assert pair["pa_mpjpe_mm"]["mean"] == pytest.approx(own["pa_mpjpe_mm"]["mean"], abs=1e-6)
    _, out, _ = call("stability", made.short, "--truth", made.short, "--json")
    raw = json.loads(out)["overall"]
    assert raw["pa_mpjpe_mm"]["mean"] == pytest.approx(own["input_pa_mpjpe_mm"]["mean"], abs=1e-6)
    _, out, _ = call(
        "stability", made.recording, "--truth", made.short, "--frames", "10:19", "--json"
    )
    assert json.loads(out)["overall"]["frames"] == 10


def test_stability_pairs_hands_by_name(call, made):
    call("track", made.panoptic, "-o", "p.mcap")
    status, out, _ = call("stability", "p.mcap", "--truth", made.truth, "--json")
    assert status == 0
    rows = json.loads(out)["sequences"]
    assert len(rows) == 4
    assert all(row["against"] == "truth" and row["pa_mpjpe_mm"]["mean"] < 2.5 for row in rows)
    status, out, _ = call(
        "stability", made.panoptic, "--truth", made.truth, "--hand", "left", "--json"
    )
    assert (status, len(json.loads(out)["sequences"])) == (0, 2)
    status, _, err = call("stability", made.short, "--truth", made.truth)
    assert (status, err) == (
        2,
        f"error: {made.truth}: 0 sequences fit sample (right), expected one\n",
    )


def test_stability_of_files_and_folders(call, made):
    os.makedirs("deep/er")
    shutil.copy(made.recording, "deep/er/b.mcap")
    shutil.copy(made.recording, "a.mcap")
    _, out, _ = call("stability", "a.mcap", "deep", "--json")
    result = json.loads(out)
    assert [row["name"] for row in result["sequences"]] == ["a sample", "b sample"]
    assert result["overall"]["frames"] == 80


def test_stability_compares_methods(call, made):
    call("track", made.short, "-o", "fit.mcap", "-q")
    call("track", made.short, "-o", "rough.mcap", "--no-calibrate", "--limits", "li2021", "-q")
    files_of = ("fit=fit.mcap", "rough=rough.mcap", f"raw={made.short}")
    status, out, err = call(
        *("stability", *files_of, "--csv", "o/a.csv", "--latex", "o/a.tex", "--html", "o/a.html")
    )
    assert (status, err) == (0, "")
    sentence = re.search(r"fit is more accurate than rough: .* difference (-\d\.\d+) \[.*\]", out)
    assert files(Path("o")) == {"a.csv", "a.tex", "a.html"}
    assert sentence[0] in Path("o/a.html").read_text()
    status, out, _ = call("stability", *files_of, "--json")
    content = json.loads(out)
    assert list(content["methods"]) == ["fit", "rough", "raw"]
    (found,) = [
        d
        for d in content["differences"]
        if (d["second"], d["measure"], d["statistic"]) == ("rough", "pa_mpjpe_mm", "mean")
    ]
    assert found["difference"]["value"] == pytest.approx(float(sentence[1]), abs=0.01)
    # the same without names; and the raw joints' error is what the recording calls its input's
    status, out, _ = call("stability", "--compare", "fit.mcap", made.short, "--json")
    again = json.loads(out)
    assert list(again["methods"]) == ["fit", "short"]
    raw = again["common"]["short"]["pa_mpjpe_mm"]["mean"]
    assert raw == pytest.approx(again["common"]["fit"]["input_pa_mpjpe_mm"]["mean"], abs=1e-6)


def test_exported_arrays_are_judged_by_what_was_tracked(call, made):
    call("export", made.recording, "out.npz", "-q")
    rows = []
    for path in (made.recording, "out.npz"):
        _, out, _ = call("stability", path, "--json")
        (row,) = json.loads(out)["sequences"]
        rows.append({k: row[k] for k in ("pa_mpjpe_mm", "input_pa_mpjpe_mm", "lost", "against")})
    assert rows[0]["pa_mpjpe_mm"] == pytest.approx(rows[1]["pa_mpjpe_mm"], abs=1e-4)
    assert rows[0]["lost"] == rows[1]["lost"]
    assert rows[1]["input_pa_mpjpe_mm"]["mean"] > rows[1]["pa_mpjpe_mm"]["mean"]
    assert call("stability", "out.npz", "--frames", "5:9", "--truth", made.short)[0] == 0


def test_the_papers_sequence(call, made):
    """The two commands of the README, on a folder made from known motion."""
    frames = ("--frames", "20701:20712", "--hand", "right")
    assert call("track", made.panoptic, *frames, "-o", "pose6.mcap", "-q")[0] == 0
    status, out, _ = call("stability", "pose6.mcap")
    assert status == 0
    assert "5.3302   0.4320" in out
    assert "The paper's frames are 20701:20800, these are 20701:20712" in " ".join(out.split())


def test_a_recording_that_was_cut_is_read_as_far_as_it_goes(call, made):
    data = Path(made.recording).read_bytes()
    Path("cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    status, out, err = call("stability", "cut.mcap", "--json")
    assert status == 0
    assert 0 < json.loads(out)["overall"]["frames"] < 40
    assert re.fullmatch(r"warning: cut.mcap: it ends in the middle .* read \d+ whole .*\n", err)


@pytest.mark.parametrize("columns", [80, 160])
def test_the_table_fits_the_terminal(columns, call, made, monkeypatch):
    call("track", made.panoptic, "-o", "p.mcap")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(columns))
    _, out, _ = call("stability", "p.mcap", made.recording)
    lines = re.sub(r"\x1b\[[\d;]*m", "", out).splitlines()
    assert max(map(len, lines)) <= columns
    rows = [line for line in lines if "person" in line or line.startswith(" overall")]
    assert len(rows) == 5
    assert all(re.search(r"\d\.\d\d ± \d\.\d\d", row) for row in rows)
