"""The page: what it holds, how small it stays, and that a browser draws it."""

from __future__ import annotations

import html
import json
import os
import re
import shlex
import shutil
import subprocess
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from screens import keep, lacking, pictures_wanted

import handtrack as ht
from handtrack.evaluation.compare import compare
from handtrack.evaluation.html_report import About, _trace, page_data, to_html
from handtrack.evaluation.stability import stability, stability_of_pair, stability_of_pairs
from handtrack.hand.model import HandModel
from handtrack.sequences.sequence import Sequence

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None)
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
)


def sequences(n=120, sigmas_mm=(1.0, 2.0), seed=0):
    """A truth and estimates of it, with a gap."""
    rng = np.random.default_rng(seed)
    t = np.arange(n) / 30.0
    angles = 0.3 + 0.25 * np.sin(t[:, None] * rng.uniform(1, 4, 20) + rng.uniform(0, 6, 20))
    joints = HandModel.default().joints(angles)
    time_ns = np.rint(t * 1e9).astype(np.int64)
    made = [Sequence(time_ns, joints, name="clip")]
    for sigma in sigmas_mm:
        noisy = joints + rng.normal(0, sigma * 1e-3, joints.shape)
        noisy[40:50] = np.nan
        made.append(Sequence(time_ns, noisy, name="clip"))
    return made


@pytest.fixture(scope="module")
def both():
    truth, a, b = sequences()
    return compare(
        {"a</script><b>": stability_of_pairs([(a, truth)]), "b": stability_of_pairs([(b, truth)])}
    )


def data_of(page):
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    return json.loads(found[1])


def test_the_page_needs_nothing_but_itself(both):
    page = to_html(both)
    assert not re.search(r"(src|href)\s*=|@import|url\(|fetch\(|XMLHttp", page)
    addresses = set(re.findall(r"https?://[^\"' ]+", page))
    assert addresses == {"http://www.w3.org/2000/svg"}  # a name, not a place
    assert data_of(page) == json.loads(json.dumps(page_data(both)))


def test_what_is_drawn_is_what_was_measured(both):
    data = data_of(to_html(both))
    row = both.common["b"]
    method = data["methods"][1]
    assert method["mean"][0] == pytest.approx(row.pa_mpjpe_mm.mean, abs=1e-5)
    assert method["std"][1] == pytest.approx(row.intervals["pa_mpjpe_mm"].std.low, abs=1e-5)
    assert method["joint"] == pytest.approx(row.joint_pa_mm.tolist(), abs=0.006)
    assert [s["text"] for s in data["sentences"]] == [d.sentence for d in both.differences]
    (sequence,) = data["sequences"]
    own = both.methods["b"].sequences[0].frame_values["pa_mpjpe_mm"]
    drawn = np.array(sequence["error"][1]["mean"][0], dtype=float)
    np.testing.assert_allclose(drawn, own, atol=0.006)
    assert sequence["error"][1]["low"] is None
    worst = sequence["worst"][1]
    assert worst[0]["error"] == pytest.approx(np.nanmax(own), abs=1e-5)
    times = [w["time"] for w in worst]
    assert min(abs(x - y) for i, x in enumerate(times) for y in times[:i]) >= 0.39
    off = np.subtract(worst[0]["estimate"], worst[0]["reference"])
    assert np.linalg.norm(off, axis=1).mean() == pytest.approx(worst[0]["error"], abs=0.1)
    pck = method["pck"]
    at = data["thresholds"].index(5.0)
    errors = both.methods["b"].sequences[0].material.joint_errors_mm
    assert pck[at] == pytest.approx((errors[~np.isnan(errors)] <= 5).mean(), abs=1e-3)


def test_a_page_says_where_it_comes_from_and_how_its_worst_frames_are_opened(both):
    about = About("2021-02-03", {"a</script><b>": ["my a.mcap"], "b": ["b.npz"]}, "handtrack x")
    data = data_of(to_html(both, about))
    assert (data["date"], data["command"]) == ("2021-02-03", "handtrack x")
    assert data["files"] == [["a</script><b>", ["my a.mcap"]], ["b", ["b.npz"]]]
    first, second = data["sequences"][0]["worst"]
    assert 0 < len(first) <= 6
    assert {w["opens"] for w in second} == {""}  # joints are not replayed
    for frame in first:
        words = shlex.split(frame["opens"])
        assert words[:3] == ["handtrack", "replay", "my a.mcap"]
        start, end = (float(words[words.index(o) + 1]) for o in ("--start", "--end"))
        assert start <= frame["time"] <= end
        assert end - start <= 1.01
        assert max(frame["errors"]) == pytest.approx(frame["joint_error"], abs=0.06)
    undated = data_of(to_html(both))
    assert (undated["date"], undated["files"]) == ("", [])
    row = both.common["b"]
    assert data["pck_end"] in (5.0, 10.0)
    assert data["pck_end"] >= 2 * row.pa_mpjpe_mm.p95


def test_the_inputs_jitter_stands_beside_the_outputs(sample_file):
    report = stability(ht.track(ht.load(sample_file)[0].frames(0, 59)))
    (method,) = page_data(report)["methods"]
    assert method["input_jitter"] == pytest.approx(report.overall.input_jitter_m_s3, abs=1e-4)
    assert method["input_jitter"] > 0


def test_long_series_stay_small_and_keep_what_stands_out():
    truth, estimate = sequences(9_000, (1.0,))
    joints = estimate.joints.copy()
    joints[6_011, 8] += 0.2
    spike = Sequence(truth.time_ns, joints, name="clip")
    report = stability_of_pair(spike, truth)
    data = page_data(stability_of_pairs([(spike, truth)]))
    trace = data["sequences"][0]["error"][0]
    assert len(trace["t"]) == 900
    values = report.frame_values["pa_mpjpe_mm"]
    assert max(v for v in trace["high"][0] if v) == pytest.approx(np.nanmax(values), abs=0.006)
    assert min(v for v in trace["low"][0] if v) == pytest.approx(np.nanmin(values), abs=0.006)
    assert len(json.dumps(data)) < 200_000
    assert data["sequences"][0]["worst"][0][0]["frame"] == 6_011


@pytest.fixture(scope="module")
def browser():
    if BROWSER is None:
        lacking("browser", "no Chromium, the page is not opened")
    return BROWSER


def opened(browser, page: Path, profile: Path) -> str:
    """The page after its script has run."""
    done = subprocess.run(
        [browser, *FLAGS, f"--user-data-dir={profile}", "--dump-dom", page.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "DBUS_SESSION_BUS_ADDRESS": "disabled:"},
        check=False,
    )
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def photographed(browser, page: Path, folder: Path, name: str) -> None:
    """Pictures NAME-light.png and NAME-dark.png of a page, for people to look at."""
    for scheme, number in (("dark", 0), ("light", 1)):
        picture = folder / f"{scheme}.png"
        settings = f"--blink-settings=preferredColorScheme={number}"
        size = ("--window-size=1300,2600", "--hide-scrollbars")
        command = [browser, *FLAGS, settings, *size, f"--user-data-dir={folder / 'profile'}"]
        subprocess.run(
            [*command, f"--screenshot={picture}", page.as_uri()],
            capture_output=True,
            timeout=120,
            check=True,
        )
        keep(f"{name}-{scheme}", picture.read_bytes())


def test_a_browser_draws_it(browser, both, sample_file, tmp_path):
    track = ht.track(ht.load(sample_file)[0].frames(0, 59))
    pages = {"compare": both, "track": stability(track), "alone": stability(sequences()[1])}
    for name, report in pages.items():
        path = tmp_path / f"{name}.html"
        path.write_text(to_html(report), encoding="utf-8")
        dom = opened(browser, path, tmp_path / "profile")
        if pictures_wanted() and name != "alone":
            photographed(browser, path, tmp_path, f"report-{name}")
        assert re.search(r'data-drawn="\d+"', dom), f"{name}: the script stopped"
        body = dom.split("<script")[0]
        text = html.unescape(body)
        if name == "compare":
            assert both.differences[0].sentence in text
            assert body.count("<canvas") == 12
        if name == "track":
            assert text.count("index pip flexion") == 1
        # no error, no PCK and no joints to be drawn
        shown = re.search(r'<div class="two" id="middle"([^>]*)>', body)[1]
        assert ("none" in shown) == (name == "alone")
        assert "NaN" not in body
        assert "undefined" not in body


def test_long_traces_are_least_mean_and_greatest_of_spans():
    """Against loops, with gaps: a span in which nothing is known is null."""
    (truth, a) = sequences(n=120, sigmas_mm=(2.0,))
    row = stability_of_pair(a, truth)
    values = np.random.default_rng(1).normal(size=(120, 3))
    values[:25, 1] = np.nan
    values[30:33] = np.nan
    trace = _trace(row, values, 0, bins=7)
    edges = np.linspace(0, 120, 8).astype(int)
    for k in range(3):
        for i, (start, end) in enumerate(pairwise(edges)):
            known = [v for v in values[start:end, k] if not np.isnan(v)]
            got = [trace[name][k][i] for name in ("low", "mean", "high")]
            if not known:
                assert got == [None] * 3
            else:
                wanted = [min(known), sum(known) / len(known), max(known)]
                assert got == pytest.approx(wanted, abs=0.0051)
    short = _trace(row, values, 0, bins=120)
    assert (short["low"], short["high"]) == (None, None)
    for k in range(3):
        assert short["mean"][k] == [
            None if np.isnan(v) else pytest.approx(v, abs=0.0051) for v in values[:, k]
        ]


def test_how_the_hands_were_tracked_stands_once(track, two_hands):
    both = [
        replace(t, settings={"filter": "rts", "cutoff": 1 / 3, "part": {"a": 1}}) for t in two_hands
    ]
    ways = {"a": stability(both), "b": stability(replace(track, settings={"filter": "none"}))}
    assert page_data(ways["a"])["settings"] == [["", ["filter rts, cutoff 0.3333"]]]
    (row,) = page_data(ways["b"])["settings"]
    assert row == ["", ["filter none"]]
    assert page_data(stability_of_pairs([tuple(sequences(20, (1.0,)))]))["settings"] == [["", []]]
