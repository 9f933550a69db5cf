"""Stability of tracks and of (estimate, truth) pairs, its JSON and its table."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

import handtrack as ht
from handtrack.errors import InputError
from handtrack.evaluation import metrics
from handtrack.evaluation.report import print_table, to_json
from handtrack.evaluation.stability import (
    Spread,
    compare_arrays,
    stability,
    stability_of_pair,
    stability_of_pairs,
)
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ORDERS
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.track import Track

SAMPLE = Path(__file__).resolve().parents[2] / "recordings" / "sample.npz"
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


@pytest.fixture(scope="module")
def sample():
    with np.load(SAMPLE) as data:
        return {name: data[name] for name in data.files}


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


def sequence(joints, fps=30.0, first=0, start_ns=0, **more):
    time_ns = start_ns + np.rint(np.arange(len(joints)) * 1e9 / fps).astype(np.int64)
    return Sequence(time_ns, joints, frame_index=first + np.arange(len(joints)), **more)


def denoised(sample):
    """An estimate half as wrong as the observation, complete but for lost frames."""
    truth = sample["truth_m"].astype(float)
    noise = np.random.default_rng(0).normal(0, 0.001, truth.shape)
    status = np.full(300, "fitted", dtype="<U9")
    status[200:205], status[205:210] = "predicted", "lost"
    estimate = truth + noise
    estimate[205:210] = np.nan
    return make_track(sample["joints_m"].astype(float), estimate, truth, status)


def test_spread():
    got = Spread.of([3, np.nan, 1, 2, 4, np.nan])
    assert got == Spread(2.5, np.std([1, 2, 3, 4]), 2.5, np.percentile([1, 2, 3, 4], 95), 4.0)
    assert set(Spread.of([np.nan]).to_dict().values()) == {None}


def test_against_truth(sample):
    report = ht.stability(denoised(sample))
    (row,) = report.sequences
    assert (row.frames, row.fitted, row.predicted, row.lost) == (300, 290, 5, 5)
    assert (row.against, row.compared, row.notes) == ("truth", 295, ())
    track = denoised(sample)
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
def test_against_observed(sample, truth):
    observed = sample["joints_m"].astype(float)
    truth = None if truth is None else np.full(observed.shape, np.nan)
    track = make_track(observed, sample["truth_m"].astype(float), truth)
    (row,) = ht.stability(track).sequences
    assert row.against == "observed"
    assert row.compared == 290
    assert row.mpjpe_mm.mean == pytest.approx(3.2, abs=0.05)
    assert row.input_mpjpe_mm is None
    assert np.isnan([row.truth_jitter_m_s3, row.lag_frames]).all()


def test_a_late_estimate_is_said_to_be_late(sample):
    track = denoised(sample)
    late = replace(track, filtered_joints=np.roll(track.truth, 2, 0))
    assert ht.stability(late).sequences[0].lag_frames == pytest.approx(2, abs=0.1)


def test_overall_pools_frames(sample):
    a = denoised(sample)
    b = make_track(a.observed[:30], a.truth[:30] + 0.004, a.truth[:30], name="short", hand="left")
    report = stability([a, b])
    values = [r.frame_values["mpjpe_mm"] for r in report.sequences]
    assert report.overall.mpjpe_mm.mean == pytest.approx(np.nanmean(np.concatenate(values)))
    assert report.overall.frames == 330
    assert report.overall.fitted == 320
    assert (report.overall.name, report.overall.hand) == ("overall", "both")


def test_overall_never_mixes_truth_and_observed(sample):
    a = denoised(sample)
    b = replace(a, truth=None, name="wild")
    report = stability([a, b])
    assert [r.against for r in report.sequences] == ["truth", "observed"]
    assert report.overall.against == "observed"
    assert report.overall.input_mpjpe_mm is None
    both = stability([replace(a, truth=None), b]).overall
    assert report.overall.mpjpe_mm == both.mpjpe_mm
    assert "only some" in report.overall.notes[0]


def test_a_wrong_truth_of_a_track_is_noted(sample):
    track = denoised(sample)
    row = stability(replace(track, truth=track.truth * 1000)).sequences[0]
    assert "mm read as m" in row.notes[0]


def test_json(sample):
    a = denoised(sample)
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


def test_table_says_against_what(sample):
    a = denoised(sample)
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


# ---- pairs ----


def pair(sample, **more):
    truth = sample["truth_m"].astype(float)
    noise = np.random.default_rng(1).normal(0, 0.003, truth.shape)
    return sequence(truth + noise, **more), sequence(truth)


def test_pair(sample):
    estimate, truth = pair(sample)
    row = stability_of_pair(estimate, truth)
    assert (row.against, row.frames, row.fitted, row.lost, row.notes) == ("truth", 300, 300, 0, ())
    assert row.mpjpe_mm.mean == pytest.approx(
        np.mean(metrics.mpjpe(estimate.joints, truth.joints)) * 1e3
    )
    same = compare_arrays(estimate.joints, truth.joints, fps=30.0)
    assert same.pa_mpjpe_mm == row.pa_mpjpe_mm
    assert same.jitter_m_s3 == pytest.approx(row.jitter_m_s3)
    report = stability_of_pairs([(estimate, truth)] * 2)
    assert report.overall.frames == 600
    assert json.loads(to_json(report))["overall"]["input_jitter_m_s3"] is None


def test_pair_by_frame_number(sample):
    estimate, truth = pair(sample)
    part = truth.frames(100, 249)
    row = stability_of_pair(estimate, part, match="frame")
    assert row.compared == 150
    assert row.notes == ("150 of 300 frames have no truth",)
    row = stability_of_pair(part, estimate)
    assert row.notes == ("150 of 300 frames of the truth have no estimate",)
    sparse = replace(
        truth,
        joints=truth.joints[::10],
        confidence=truth.confidence[::10],
        time_ns=truth.time_ns[::10],
        frame_index=truth.frame_index[::10],
    )
    assert stability_of_pair(estimate, sparse).compared == 30


def test_pair_by_time(sample):
    truth = sample["truth_m"].astype(float)
    # other frame numbers, same clock
    row = stability_of_pair(sequence(truth, first=20701), sequence(truth))
    assert row.mpjpe_mm.max == 0
    # the truth has every other frame of the estimate, each numbered from 0
    half = sequence(truth[::2], fps=15)
    row = stability_of_pair(sequence(truth), half)
    assert (row.compared, row.mpjpe_mm.max) == (150, 0)
    with pytest.raises(InputError, match="30 frames a second, the truth 15"):
        stability_of_pair(sequence(truth), half, match="frame")
    # no number and no clock in common: both start together
    row = stability_of_pair(sequence(truth, first=5000, start_ns=10**18), sequence(truth))
    assert (row.compared, row.mpjpe_mm.max) == (300, 0)
    # stamps that are beside each other are told
    row = stability_of_pair(
        sequence(truth, first=5000), sequence(truth, fps=30 * 1.002), match="time"
    )
    assert any("ms apart" in note for note in row.notes)
    assert row.notes[-1] == "the output is 0.8 frames late"


def test_pair_that_does_not_fit(sample):
    estimate, truth = pair(sample)
    with pytest.raises(InputError, match="right hand against a left"):
        stability_of_pair(estimate, replace(truth, hand="left"))
    later = sequence(truth.joints, first=290, start_ns=int(290e9 / 30))
    with pytest.raises(InputError, match="only 10 frames in common"):
        stability_of_pair(estimate, later)
    with pytest.raises(InputError, match="10 frame numbers in common"):
        stability_of_pair(estimate, later, match="frame")
    with pytest.raises(InputError, match="cannot be matched by 'name'"):
        stability_of_pair(estimate, truth, match="name")
    with pytest.raises(InputError, match=r"\(300, 21, 3\), the truth \(299, 21, 3\)"):
        compare_arrays(estimate.joints, truth.joints[1:])
    with pytest.raises(InputError, match="fps is 0"):
        compare_arrays(estimate.joints, truth.joints, fps=0)


@pytest.mark.parametrize(
    ("factor", "words"),
    [
        (1000, "mm read as m"),
        (100, "cm read as m"),
        (10, "mm read as cm"),
        (3, "3 times as large"),
    ],
)
def test_wrong_unit(sample, factor, words):
    estimate, truth = pair(sample)
    for f in (factor, 1 / factor):
        with pytest.raises(InputError) as caught:
            stability_of_pair(estimate, replace(truth, joints=truth.joints * f))
        if f >= 1 or factor != 3:
            assert words in str(caught.value)
    # a hand that is merely smaller is fine
    stability_of_pair(estimate, replace(truth, joints=truth.joints * 0.7))


def test_a_wrong_frame_rate_is_named(sample):
    """The same frames, stamped at 30 and at 60 per second: by time they are other moments."""
    truth = sample["truth_m"].astype(float)
    a, b = sequence(truth, 30), sequence(truth, 60)
    with pytest.raises(InputError, match=r"by number the frames fit .* frame rates is wrong"):
        stability_of_pair(a, b)
    assert stability_of_pair(a, b, match="frame").mpjpe_mm.max == 0
    # frames in between are another matter: by time they fit
    twice = np.repeat(truth, 2, axis=0)
    row = stability_of_pair(a, sequence(twice, 60))
    assert row.mpjpe_mm.max == 0


def test_another_size_is_noted(sample):
    truth = sample["truth_m"].astype(float)
    row = stability_of_pair(sequence(truth), sequence(1.3 * truth))
    assert row.pa_mpjpe_mm.max < 1e-9
    assert any("truth's hand is 1.30 times as large" in note for note in row.notes)


def test_mirrored(sample):
    estimate, truth = pair(sample)
    with pytest.raises(InputError, match="mirrored"):
        stability_of_pair(estimate, replace(truth, joints=truth.joints * [-1, 1, 1]))


@pytest.mark.parametrize("order", ["mano", "interhand", "fpha"])
def test_wrong_joint_order(sample, order):
    estimate, truth = pair(sample)
    theirs = np.empty_like(truth.joints)
    theirs[:, list(ORDERS[order])] = truth.joints
    with pytest.raises(InputError, match=f"truth seems to be in joint order '{order}'"):
        stability_of_pair(estimate, replace(truth, joints=theirs))
    theirs = np.empty_like(truth.joints)
    theirs[:, list(ORDERS[order])] = estimate.joints
    with pytest.raises(InputError, match=f"estimate seems to be in joint order '{order}'"):
        stability_of_pair(replace(estimate, joints=theirs), truth)


def test_a_bad_estimate_is_not_called_mirrored(sample):
    truth = sample["truth_m"].astype(float)
    still = np.broadcast_to(truth[:1], truth.shape) + np.random.default_rng(0).normal(
        0, 0.015, truth.shape
    )
    assert compare_arrays(still, truth).pa_mpjpe_mm.mean > 10


def test_another_world_frame_is_noted(sample):
    estimate, truth = pair(sample)
    elsewhere = truth.joints + np.array([0.0, 1.0, 0.0])
    row = stability_of_pair(estimate, replace(truth, joints=elsewhere))
    assert row.notes == ("the output is 1000 mm from the truth: another world frame?",)


def test_missing_frames_of_an_estimate_are_lost(sample):
    estimate, truth = pair(sample)
    joints = estimate.joints.copy()
    joints[40:60] = np.nan
    joints[70, 2:] = np.nan
    row = stability_of_pair(replace(estimate, joints=joints, confidence=None), truth)
    assert (row.fitted, row.lost, row.compared) == (280, 20, 279)
