"""Reports of a data set: what they say of tables whose numbers are known."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handtrack.batching.data_set import report
from handtrack.batching.page import number, page
from handtrack.batching.rows import COUNTS, KNOWN, NUMBERS, table_of
from handtrack.batching.sums import SUMS, Units, measures, sure
from handtrack.batching.two_runs import compare_runs
from handtrack.cli import run
from handtrack.errors import InputError, SettingsError


def made(folder: Path, subjects: int = 6, clips: int = 8, less: float = 0.0, seed: int = 1) -> Path:
    """Results with an error of 2 mm on average, that differs between people and clips."""
    from pyarrow import parquet

    rng = np.random.default_rng(seed)
    rows: list[dict[str, Any]] = []
    for s in range(subjects):
        own = rng.normal(2.0, 0.5)
        for c in range(clips):
            row: dict[str, Any] = dict.fromkeys(KNOWN, "")
            row |= dict.fromkeys(COUNTS, 100) | dict.fromkeys(NUMBERS, 1.0)
            error = own + rng.normal(0.0, 0.1)
            row |= {"clip": f"s{s}/c{c}", "path": f"in/s{s}/c{c}.npz", "subject": f"s{s}"}
            row |= {"hand": "right", "state": "done", "against": "truth", "lost": 5}
            row |= {"pa_mpjpe_mean_mm": error - less, "pa_mpjpe_std_mm": 0.3}
            row |= {"seconds": 1.0, "finished": 1.0, "action": ("wave", "count")[c % 2]}
            row["recording"] = "" if c else f"recordings/s{s}/c{c}.mcap"
            rows.append(row)
    rows.append(
        rows[0] | {"clip": "bad", "state": "failed", "path": "in/bad", "error": "in/bad: no"}
    )
    folder.mkdir(exist_ok=True)
    parquet.write_table(table_of(rows), folder / "clips.parquet")
    return folder


def test_numbers_have_three_digits_and_no_exponent():
    said = {0.0: "0", 0.66667: "0.667", 4.4: "4.40", -9.996: "-10.0", 310.6: "311", 2129.7: "2,130"}
    assert [number(value) for value in said] == list(said.values())


def test_the_whole_is_all_frames_pooled(tmp_path):
    found = report(str(made(tmp_path / "a")), ["action"])
    numbers = found.results.numbers
    mean, std = numbers["pa_mpjpe_mean_mm"], numbers["pa_mpjpe_std_mm"]
    whole = found.overall.values
    assert whole["pa_mpjpe_mm"].value == pytest.approx(mean.mean())
    spread = np.sqrt((std**2 + mean**2).mean() - mean.mean() ** 2)
    assert whole["pa_mpjpe_std_mm"].value == pytest.approx(spread)
    assert whole["lost_percent"].value == pytest.approx(5)
    assert (found.overall.clips, found.overall.subjects) == (48, 6)
    assert list(found.groups) == ["subject", "action"]
    assert [g.clips for g in found.groups["action"].values()] == [24, 24]
    assert found.results.failed == [("in/bad", "in/bad: no")]
    assert found.worst[0].value == pytest.approx(mean.max())


def test_people_differ_more_than_their_clips_say():
    """95 % intervals hold the true mean in most of many data sets, and by clips alone do not."""
    rng = np.random.default_rng(3)
    held = {"people": 0, "clips": 0}
    tries = 80
    at = SUMS.index("errors"), SUMS.index("error")
    for _ in range(tries):
        error = rng.normal(2.0, 0.5, (8, 1)) + rng.normal(0.0, 0.1, (8, 10))
        sums = np.zeros((80, len(SUMS)))
        sums[:, at[0]], sums[:, at[1]] = 1.0, error.ravel()
        people = Units(sums, np.repeat(np.arange(8), 10), 8, True)
        clips = Units(sums, np.zeros(80, np.int64), 1, False)
        for name, units in (("people", people), ("clips", clips)):
            value = sure(units)[0].values["pa_mpjpe_mm"]
            held[name] += value.low <= 2.0 <= value.high
    assert held["people"] >= 0.88 * tries
    assert held["clips"] < 0.7 * tries


def test_nothing_known_is_said_as_nothing():
    assert np.isnan(measures(np.zeros(len(SUMS)))["pa_mpjpe_mm"])


def test_two_runs_are_compared_clip_by_clip(tmp_path):
    first, second = made(tmp_path / "a"), made(tmp_path / "b", less=0.05)
    found = compare_runs(("a", "b"), (report(str(first)), report(str(second))))
    difference = found.differences["pa_mpjpe_mm"]
    assert difference.value == pytest.approx(-0.05)
    assert difference.clear
    assert found.differences["jitter_m_s3"].value == 0
    assert found.clips == 48
    assert "PA-MPJPE of b is 0.0500 mm less than of a" in page(found)


def test_the_page_names_the_worst_and_what_failed(tmp_path):
    text = page(report(str(made(tmp_path / "a")), ["action"]))
    assert text.count("<svg") == 4
    for part in ("handtrack replay", "in/bad: no", "By action", "s5"):
        assert part in text


def test_the_command_reports_and_compares(tmp_path, capsys):
    first, second = made(tmp_path / "a"), made(tmp_path / "b", less=0.05)
    html = tmp_path / "r.html"
    assert run(["stability", str(first), "--by", "action", "--html", str(html)]) == 0
    out = capsys.readouterr().out
    assert "worst clips" in out
    assert f"handtrack replay {first}/recordings/" in out or "--live" in out
    assert html.read_text().startswith("<!doctype html>")
    assert run(["stability", f"x={first}", f"y={second}", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["differences"]["pa_mpjpe_mm"]["value"] == pytest.approx(-0.05)
    assert run(["stability", str(first), "--by", "nothing"]) == 2
    assert "there is no such column" in capsys.readouterr().err
    assert run(["stability", str(first), "--truth", str(html)]) == 2
    assert run(["stability", f"x={first}", f"y={html}"]) == 2


def test_what_is_no_data_set_is_refused(tmp_path):
    with pytest.raises(InputError, match="no results of handtrack batch"):
        report(str(tmp_path))
    with pytest.raises(SettingsError, match="there is no such column"):
        report(str(made(tmp_path / "a")), ["nothing"])
