"""Stability of tracks and of (estimate, truth) pairs, its JSON and its table."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import pytest
from rich.console import Console

import handtrack as ht
from handtrack.errors import InputError
from handtrack.evaluation import metrics
from handtrack.evaluation.report import print_table, to_json
from handtrack.evaluation.stability import (
    Spread,
    stability,
    stability_of_pairs,
)
from handtrack.hand.model import HandModel
from handtrack.tracking.track import Track

KEYS = {
    "name",
    "hand",
    "frames",
    "fitted",
    "predicted",
    "lost",
    "against",
    "pa_mpjpe_mm",
    "mpjpe_mm",
    "jitter_m_s3",
    "acceleration_m_s2",
}


def make_track(observed, estimate, truth=None, status=None, fps=30.0, name="walk", hand="right"):
    n = len(observed)
    status = np.full(n, "fitted") if status is None else np.array(status)
    zeros = np.zeros((n, 20))
    turn = np.tile([1.0, 0, 0, 0], (n, 1))
    return Track(
        name=name,
        hand=hand,
        time_ns=np.rint(np.arange(n) * 1e9 / fps).astype(np.int64),
        frame_index=np.arange(n),
        observed=observed,
        confidence=np.ones((n, 21)),
        truth=truth,
        angles_raw=zeros,
        angles=zeros,
        quaternion_raw=turn,
        quaternion=turn,
        translation_raw=np.zeros((n, 3)),
        translation=np.zeros((n, 3)),
        fitted_joints=estimate + 1.0,  # not what is to be judged
        filtered_joints=estimate,
        angle_variance=zeros,
        objective=np.zeros(n),
        iterations=np.zeros(n, dtype=np.int64),
        status=status,
        reason=np.full(n, ""),
        model=HandModel.default(hand),
    )


def denoised(recorded):
    """An estimate half as wrong as the observation, complete but for lost frames."""
    truth = recorded["truth_m"].astype(float)
    noise = np.random.default_rng(0).normal(0, 0.001, truth.shape)
    status = np.full(300, "fitted", dtype="<U9")
    status[200:205], status[205:210] = "predicted", "lost"
    estimate = truth + noise
    estimate[205:210] = np.nan
    return make_track(recorded["joints_m"].astype(float), estimate, truth, status)


def test_spread():
    got = Spread.of([3, np.nan, 1, 2, 4, np.nan])
    assert got == Spread(2.5, np.std([1, 2, 3, 4]), 2.5, np.percentile([1, 2, 3, 4], 95), 4.0)
    assert set(Spread.of([np.nan]).to_dict().values()) == {None}


def test_against_truth(recorded):
    report = ht.stability(denoised(recorded))
    (row,) = report.sequences
    assert (row.frames, row.fitted, row.predicted, row.lost) == (300, 290, 5, 5)
    assert (row.against, row.compared, row.notes) == ("truth", 295, ())
    track = denoised(recorded)
    pa = metrics.pa_mpjpe(track.filtered_joints, track.truth) * 1e3
    assert row.pa_mpjpe_mm.mean == pytest.approx(np.nanmean(pa))
    assert row.pa_mpjpe_mm.std == pytest.approx(np.nanstd(pa))
    assert row.mpjpe_mm.mean == pytest.approx(1.6, abs=0.05)
    assert row.input_mpjpe_mm.mean == pytest.approx(3.2, abs=0.05)
    assert row.input_pa_mpjpe_mm.mean > row.pa_mpjpe_mm.mean
    assert row.truth_jitter_m_s3 < row.jitter_m_s3 < row.input_jitter_m_s3
    assert row.truth_acceleration_m_s2 < row.acceleration_m_s2 < row.input_acceleration_m_s2
    assert row.lag_frames == pytest.approx(0, abs=0.05)
    assert np.isnan(row.frame_values["pa_mpjpe_mm"][205:210]).all()
    # one sequence: overall is the same
    assert report.overall.pa_mpjpe_mm == row.pa_mpjpe_mm
    assert report.overall.jitter_m_s3 == row.jitter_m_s3


@pytest.mark.parametrize("truth", [None, "empty"])
def test_against_observed(recorded, truth):
    observed = recorded["joints_m"].astype(float)
    truth = None if truth is None else np.full(observed.shape, np.nan)
    track = make_track(observed, recorded["truth_m"].astype(float), truth)
    (row,) = ht.stability(track).sequences
    assert row.against == "observed"
    assert row.compared == 290
    assert row.mpjpe_mm.mean == pytest.approx(3.2, abs=0.05)
    assert row.input_mpjpe_mm is None
    assert np.isnan([row.truth_jitter_m_s3, row.lag_frames]).all()


def test_a_late_estimate_is_said_to_be_late(recorded):
    track = denoised(recorded)
    late = replace(track, filtered_joints=np.roll(track.truth, 2, 0))
    assert ht.stability(late).sequences[0].lag_frames == pytest.approx(2, abs=0.1)


def test_overall_pools_frames(recorded):
    a = denoised(recorded)
    b = make_track(a.observed[:30], a.truth[:30] + 0.004, a.truth[:30], name="short", hand="left")
    report = stability([a, b])
    values = [r.frame_values["mpjpe_mm"] for r in report.sequences]
    assert report.overall.mpjpe_mm.mean == pytest.approx(np.nanmean(np.concatenate(values)))
    assert report.overall.frames == 330
    assert report.overall.fitted == 320
    assert (report.overall.name, report.overall.hand) == ("overall", "both")


def test_overall_never_mixes_truth_and_observed(recorded):
    a = denoised(recorded)
    b = replace(a, truth=None, name="wild")
    report = stability([a, b])
    assert [r.against for r in report.sequences] == ["truth", "observed"]
    assert report.overall.against == "observed"
    assert report.overall.input_mpjpe_mm is None
    both = stability([replace(a, truth=None), b]).overall
    assert report.overall.mpjpe_mm == both.mpjpe_mm
    assert "only some" in report.overall.notes[0]


def test_a_wrong_truth_of_a_track_is_noted(recorded):
    track = denoised(recorded)
    row = stability(replace(track, truth=track.truth * 1000)).sequences[0]
    assert "mm read as m" in row.notes[0]


def test_json(recorded):
    a = denoised(recorded)
    lost = make_track(
        a.observed[:5], np.full((5, 21, 3), np.nan), status=["lost"] * 5, name="nothing"
    )
    text = to_json(stability([replace(a, truth=None), lost]))
    data = json.loads(text, parse_constant=lambda name: pytest.fail(f"{name} is not JSON"))
    assert set(data) == {"sequences", "overall"}
    for row in [*data["sequences"], data["overall"]]:
        assert set(row) >= KEYS
        assert list(row["pa_mpjpe_mm"]) == ["mean", "std", "median", "p95", "max"]
        assert "frame_values" not in row
    assert data["sequences"][1]["lost"] == 5
    assert data["sequences"][1]["pa_mpjpe_mm"]["mean"] is None
    assert data["sequences"][1]["jitter_m_s3"] is None
    assert isinstance(data["sequences"][0]["jitter_m_s3"], float)


def printed(report, width=220):
    out = io.StringIO()
    print_table(report, Console(file=out, width=width))
    return out.getvalue()


def test_table_says_against_what(recorded):
    a = denoised(recorded)
    text = printed(stability(a))
    assert "Against the truth" in text
    assert "Input: the error" in text
    assert "overall" not in text
    assert "1.7 %" in text
    text = printed(stability([a, replace(a, truth=None, name="wild [1]")]))
    assert "This is not accuracy" in text
    assert "overall" in text
    assert "wild [1]" in text
    assert "for only some sequences have a truth" in text
    assert "left out" not in text.lower()
    narrow = printed(stability([a, replace(a, name="a name that is longer than a column")]), 60)
    assert not any(len(line) > 60 for line in narrow.splitlines())
    assert "…" not in narrow
    assert "Left out for lack of width" in narrow
    assert "1.50 ± 0.14" in narrow


def test_no_track():
    with pytest.raises(InputError, match="no track"):
        stability([])
    with pytest.raises(InputError, match="no pair"):
        stability_of_pairs([])
