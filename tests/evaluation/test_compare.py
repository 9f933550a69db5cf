"""Two methods on their common frames; CSV and LaTeX; the paper's rows."""

from __future__ import annotations

import csv
import io
import json
import re

import numpy as np
import pytest
from rich.console import Console

from handtrack.errors import InputError
from handtrack.evaluation.compare import compare
from handtrack.evaluation.report import print_comparison, print_table, to_json
from handtrack.evaluation.stability import stability, stability_of_pairs
from handtrack.evaluation.tables import panoptic_rows, to_csv, to_latex
from handtrack.hand.model import HandModel
from handtrack.sequences.sequence import Sequence


def truth_of(n=240, hand="right", name="clip", fps=30.0, first=0):
    rng = np.random.default_rng(7)
    t = np.arange(n) / 30.0
    angles = 0.3 + 0.25 * np.sin(t[:, None] * rng.uniform(1, 4, 20) + rng.uniform(0, 6, 20))
    joints = HandModel.default(hand).joints(angles) + np.stack([0.1 * np.sin(t)] * 3, 1)[:, None]
    time_ns = np.rint(np.arange(n) * 1e9 / fps).astype(np.int64)
    return Sequence(time_ns, joints, hand=hand, name=name, frame_index=first + np.arange(n))


def noisy(truth, sigma_mm, seed=1, **changes):
    noise = np.random.default_rng(seed).normal(0, sigma_mm * 1e-3, truth.joints.shape)
    values = {f: getattr(truth, f) for f in ("time_ns", "hand", "name", "frame_index")}
    return Sequence(**values | {"joints": truth.joints + noise} | changes)


def report_of(*pairs):
    return stability_of_pairs(pairs)


def test_the_better_method_is_named_and_the_difference_is_the_frames():
    truth = truth_of()
    # the noise of the worse one grows and shrinks: less steady, too
    swell = 3 + 2 * np.sin(np.arange(240) / 9)[:, None, None]
    wavy = truth.joints + swell * np.random.default_rng(2).normal(0, 1e-3, truth.joints.shape)
    a, b = noisy(truth, 1.0), noisy(truth, 1.0, joints=wavy)
    both = compare({"good": report_of((a, truth)), "bad": report_of((b, truth))})
    found = {(d.measure, d.statistic): d for d in both.differences}
    mean = found["pa_mpjpe_mm", "mean"]
    values = [both.common[m].frame_values["pa_mpjpe_mm"] for m in ("good", "bad")]
    assert mean.of.value == pytest.approx((values[0] - values[1]).mean(), abs=1e-12)
    assert mean.of.clear
    assert mean.sentence.startswith("good is more accurate than bad: PA-MPJPE ")
    std = found["pa_mpjpe_mm", "std"]
    assert std.of.value == pytest.approx(values[0].std() - values[1].std(), abs=1e-12)
    assert std.sentence.startswith("good is steadier than bad: std ")
    said = re.search(r"difference (\S+) \[(\S+), (\S+)\]$", std.sentence)
    numbers = [float(text) for text in said.groups()]
    assert numbers == pytest.approx([std.of.value, std.of.low, std.of.high], abs=0.006)
    # the worse method first: the same sentence, the sign turned
    back = compare({"bad": both.methods["bad"], "good": both.methods["good"]})
    assert back.differences[1].of.value == pytest.approx(-std.of.value)
    assert back.differences[1].sentence == std.sentence


def test_alike_methods_are_not_told_apart():
    truth = truth_of()
    both = compare(
        {
            "one": report_of((noisy(truth, 2.0, seed=1), truth)),
            "two": report_of((noisy(truth, 2.0, seed=2), truth)),
        }
    )
    std = both.differences[1]
    assert not std.of.clear
    assert std.sentence.startswith("No clear difference between ")


def test_only_common_frames_count():
    truth = truth_of()
    a, b = noisy(truth, 1.0), noisy(truth, 2.0, seed=3)
    gone = b.joints.copy()
    gone[50:70] = np.nan
    moved = a.joints.copy()
    moved[50:70, 3] += 0.1  # errors that the other never had to face
    a = noisy(truth, 0, joints=moved)
    b = Sequence(
        b.time_ns[20:], gone[20:], hand="right", name="clip", frame_index=b.frame_index[20:]
    )
    both = compare({"a": report_of((a, truth)), "b": report_of((b, truth))})
    assert both.frames == 240 - 20 - 20
    assert both.common["a"].pa_mpjpe_mm.max < 4 < both.methods["a"].overall.pa_mpjpe_mm.max
    kept = np.r_[20:50, 70:240]
    expected = both.methods["a"].overall.frame_values["pa_mpjpe_mm"][kept]
    np.testing.assert_array_equal(both.common["a"].frame_values["pa_mpjpe_mm"], expected)


def test_sequences_are_paired_by_name_and_hand():
    right, left = truth_of(name="walk right"), truth_of(name="walk left", hand="left")
    other = truth_of(name="run right")
    a = report_of((noisy(right, 1), right), (noisy(left, 1), left), (noisy(other, 1), other))
    b = report_of((noisy(left, 2), left), (noisy(right, 2), right))
    both = compare({"a": a, "b": b})
    assert both.frames == 480
    assert both.notes == ("run right (right) is left out: b has 0 of that name",)
    assert compare({"b": b, "a": a}).notes == ("run right (right) is only in a",)


def test_what_cannot_be_compared_is_said():
    truth = truth_of()
    a = report_of((noisy(truth, 1), truth))
    shifted = noisy(truth, 0, joints=truth.joints + 0.01)
    with pytest.raises(InputError, match="measured against different joints, up to 10 mm apart"):
        compare({"a": a, "b": report_of((noisy(truth, 1), shifted))})
    with pytest.raises(InputError, match="a against truth, b against nothing; give --truth"):
        compare({"a": a, "b": stability(noisy(truth, 1))})
    left = truth_of(hand="left")
    with pytest.raises(InputError, match="a has a right hand, b a left one"):
        compare({"a": a, "b": report_of((noisy(left, 1), left))})
    late = truth_of(first=5000)
    late = Sequence(
        late.time_ns + 10**12, late.joints[:, ::1], name="clip", frame_index=late.frame_index
    )
    assert compare({"a": a, "b": report_of((noisy(late, 1), late))}).frames == 240  # from 0 both
    with pytest.raises(InputError, match="only one method"):
        compare({"a": a})


def test_joints_alone_are_compared_by_how_they_move():
    truth = truth_of()
    both = compare({"raw": stability(noisy(truth, 2)), "still": stability(noisy(truth, 0.1))})
    (difference,) = both.differences
    assert difference.measure == "jitter_m_s3"
    assert difference.sentence.startswith("still jitters less than raw: ")
    row = both.methods["raw"].overall
    assert (row.against, row.compared) == ("nothing", 0)
    assert np.isnan(row.pa_mpjpe_mm.mean)
    json.loads(to_json(both))


@pytest.fixture(scope="module")
def pair():
    truth = truth_of(name="50%_of & more")
    return compare(
        {
            "my_method": report_of((noisy(truth, 1), truth)),
            "theirs": report_of((noisy(truth, 2, seed=4), truth)),
        }
    )


def test_csv_holds_what_json_holds(pair):
    rows = list(csv.DictReader(io.StringIO(to_csv(pair))))
    assert [r["method"] for r in rows] == ["my_method", "theirs"] * 2
    assert [r["scope"] for r in rows] == ["sequence"] * 2 + ["common frames"] * 2
    assert [r["name"] for r in rows] == ["50%_of & more"] * 2 + ["common frames"] * 2
    content = json.loads(to_json(pair))
    common = content["common"]["theirs"]
    assert float(rows[3]["pa_mpjpe_mm.std"]) == common["pa_mpjpe_mm"]["std"]
    assert (
        float(rows[3]["intervals.pa_mpjpe_mm.std.high"])
        == (common["intervals"]["pa_mpjpe_mm"]["std"][1])
    )
    assert float(rows[0]["joint_pa_mm.thumb_tip"]) > 0
    single = list(csv.DictReader(io.StringIO(to_csv(pair.methods["theirs"]))))
    assert len(single) == 1


def test_latex_marks_the_best_and_escapes_names(pair):
    lines = to_latex(pair).splitlines()
    (mine,) = [x for x in lines if x.startswith(r"my\_method & ")]
    common = pair.common["my_method"].pa_mpjpe_mm
    assert rf"\textbf{{{common.mean:.2f} ({common.std:.2f})}}" in mine
    (theirs,) = [x for x in lines if x.startswith("theirs & ")]
    assert theirs.count("textbf") == 1  # as few frames are lost: none
    assert r"50\%\_of \& more & " in to_latex(pair.methods["my_method"])
    assert lines[-1] == r"\end{tabular}"


def test_terminal(pair):
    console = Console(file=io.StringIO(), width=160)
    print_comparison(pair, console)
    text = console.file.getvalue()
    assert pair.differences[0].sentence in text.replace("\n", " ")
    assert "240 frames that all methods have" in text


def test_a_narrow_terminal_keeps_what_matters(pair):
    console = Console(file=io.StringIO(), width=72)
    print_comparison(pair, console)
    lines = console.file.getvalue().splitlines()
    assert max(map(len, lines)) <= 72
    heading = next(line for line in lines if line.split()[:1] == ["method"])
    assert {"PA-MPJPE", "std"} <= set(heading.split())
    assert any("Left out for lack of width: median, AUC" in line for line in lines)
    mean = pair.common["theirs"].pa_mpjpe_mm.mean
    assert any(line.split()[:1] == ["theirs"] and f"{mean:.2f} [" in line for line in lines)


def test_the_papers_rows_stand_beside_its_sequence():
    truth = truth_of(100, name="171204_pose6 right", fps=29.97, first=20701)
    report = report_of((noisy(truth, 2), truth))
    console = Console(file=io.StringIO(), width=120)
    print_table(report, console)
    text = console.file.getvalue()
    assert "5.3302   0.4320" in text
    assert "5.3442   0.5151" in text
    assert "The paper's frames" not in text
    paper = json.loads(to_json(report))["paper"]
    assert paper["published"][1]["std_mm"] == 0.4320
    part = truth_of(100, name="171204_pose6 right", fps=29.97, first=20700)
    found = panoptic_rows(report_of((noisy(part, 2), part)).sequences)
    assert "The paper's frames are 20701:20800, these are 20700:20799" in found.caution
    assert panoptic_rows(report_of((noisy(truth_of(), 1), truth_of())).sequences) is None
