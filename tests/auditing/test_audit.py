"""Faults that are put into clean motion are found where they are; clean motion is let pass."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import handtrack as ht
from handtrack.auditing.audit import audit
from handtrack.auditing.findings import KINDS, mask_table
from handtrack.auditing.page import to_html
from handtrack.cli import run
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import JOINT_NAMES
from tools.bench.audit_faults import (
    FAULTS,
    SLIGHT,
    N,
    clean,
    fingers_shake,
    joint_jumps,
    repeats,
    whole_hand_shakes,
    with_joints,
)

SEEDS = range(20)


def found(sequence, **options):
    (result,) = audit(sequence, fit=False, **options)
    return {f.kind: f for f in result.findings}


@pytest.mark.parametrize("kind", FAULTS)
def test_each_kind_is_found_where_it_is(kind):
    missed = []
    for seed in SEEDS:
        rng = np.random.default_rng(100 + seed)
        spoilt, frames = FAULTS[kind](clean(seed), rng)
        finding = found(spoilt).get(kind)
        if finding is None or not finding.marks[frames].any(1).all():
            missed.append(seed)
        else:
            assert finding.severity >= 1
            assert any(c.isdigit() for c in finding.text) or kind == "order"
    assert len(missed) <= len(SEEDS) // 20, missed


@pytest.mark.parametrize("name", SLIGHT)
def test_slight_faults_are_found_where_they_are(name):
    kind, fault = SLIGHT[name]
    missed = []
    for seed in SEEDS:
        s = clean(40 + seed, noise_mm=0.3)
        spoilt, frames = fault(s, np.random.default_rng(seed))
        finding = found(spoilt).get(kind)
        if finding is None or not finding.marks[frames].any(1).all():
            missed.append(seed)
        assert kind not in found(s)
    assert len(missed) <= len(SEEDS) // 20, missed


def test_only_the_frames_and_fingers_that_are_exchanged_are_marked():
    s = clean(5)
    joints = s.joints.copy()
    joints[100:108, 5:13] = joints[100:108, np.r_[9:13, 5:9]]
    marks = found(with_joints(s, joints))["order"].marks
    assert np.flatnonzero(marks.any(1)).tolist() == list(range(100, 108))
    assert np.flatnonzero(marks.any(0)).tolist() == list(range(5, 13))


def test_noise_that_is_alike_in_all_joints_is_no_shake_of_the_fingers():
    for seed in range(6):
        assert "fingers shake" not in found(clean(seed, noise_mm=1.5))


def test_a_part_that_comes_again_is_found():
    spoilt, frames = repeats(clean(3), None)
    assert np.flatnonzero(found(spoilt)["frozen"].marks.any(1)).tolist() == frames


def test_clean_motion_is_let_pass():
    """At most one frame in a hundred, over motions that no threshold was set by."""
    marked = []
    for seed in range(200, 240):
        (result,) = audit(clean(seed, noise_mm=(0.0, 1.0, 2.0)[seed % 3]), fit=False)
        marked.append(result.share)
    assert np.mean(marked) <= 0.01


def test_shakes_are_told_apart():
    rng = np.random.default_rng(0)
    whole, _ = whole_hand_shakes(clean(4), rng)
    fingers, _ = fingers_shake(clean(4), rng)
    assert "fingers shake" not in found(whole)
    assert "hand shakes" not in found(fingers)


def test_exchanged_identities_are_named():
    left, right = clean(0, hand="left"), clean(1, hand="right")
    a, b = left.joints.copy(), right.joints + np.array([0.4, 0, 0])
    a[100:106], b[100:106] = b[100:106].copy(), a[100:106].copy()
    pair = [with_joints(left, a, source="x"), with_joints(right, b, source="x")]
    for result in audit(pair, fit=False):
        (swapped,) = [f for f in result.findings if f.kind == "swapped"]
        assert np.flatnonzero(swapped.marks.any(1)).tolist() == list(range(100, 106))


def test_the_worst_comes_first_and_the_fit_tells_its_residual():
    bad, _ = fingers_shake(clean(1), np.random.default_rng(0))
    results = audit([clean(0), bad])
    assert [r.name for r in results] == ["clip 1", "clip 0"]
    for r in results:
        assert 0 < r.numbers["bound_mm"] <= r.numbers["residual_mm"] * 1.01


def test_hardly_anything_is_seen():
    joints = np.full((30, 21, 3), np.nan)
    joints[4, 3] = 0.1
    (result,) = audit(ht.Sequence(np.arange(30) * 10**7, joints))
    assert result.findings == ()
    with pytest.raises(ht.InputError, match="no sequence"):
        audit([])


def test_mask_json_and_page(tmp_path, monkeypatch, capsys):
    import pyarrow.parquet as pq

    monkeypatch.chdir(tmp_path)
    spoilt, (at,) = joint_jumps(clean(7), np.random.default_rng(1))
    np.savez("a.npz", joints_m=spoilt.joints, time_ns=spoilt.time_ns, hand=spoilt.hand)
    call = ["audit", "a.npz", "--mask", "m.parquet", "--html", "a.html", "--json"]
    assert run(call) == 0
    (told,) = json.loads(capsys.readouterr().out)["sequences"]
    assert {f["kind"] for f in told["findings"]} <= set(KINDS)
    assert at in told["worst_frames"]
    table = pq.read_table("m.parquet")
    (result,) = audit(ht.load("a.npz"))
    rows = sum(int(f.marks.sum()) for f in result.findings)
    assert table.num_rows == mask_table([result]).num_rows == rows > 0
    assert set(table["joint"].to_pylist()) <= set(JOINT_NAMES)
    assert at in table["frame"].to_pylist()
    page = (tmp_path / "a.html").read_text()
    assert "<svg" in page
    assert f"frame {at}" in page
    assert page == to_html([result])
    assert run(call) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert run(["audit", "a.npz", "--no-fit"]) == 0
    out = capsys.readouterr().out
    assert "joint jumps" in out


def test_bad_input_is_one_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for arguments, text in (
        (["audit", "no.npz"], "no.npz: no such file"),
        (["audit", "x.npz", "--html", "a.txt"], "ends in .html"),
        (["audit", "x.npz", "--mask", "a.csv"], "ends in .parquet"),
    ):
        assert run(arguments) == 2
        assert text in capsys.readouterr().err


def test_known_faults_of_real_data(shared_data):
    """`ego_mcap` has its hands' labels exchanged, and single exchanges besides."""
    results = audit(ht.load(shared_data / "ego_mcap"), fit=False)
    for result in results:
        kinds = {f.kind: f for f in result.findings}
        assert "throughout" in kinds["other hand"].text
        assert "swapped" in kinds


def test_weak_shakes_are_found_even_for_a_while():
    rng = np.random.default_rng(5)
    for seed in range(4):
        shaken = clean(40 + seed, noise_mm=0.3).joints.copy()
        shaken[80:120] += rng.normal(0, 0.003, (40, 1, 3))
        marks = found(with_joints(clean(40 + seed), shaken))["hand shakes"].marks.any(1)
        assert marks[90:110].all()
        assert marks.sum() < 60
        one = clean(60 + seed, noise_mm=0.3).joints.copy()
        one[:, 6:9] += rng.normal(0, 0.003, (N, 3, 3))
        finding = found(with_joints(clean(60 + seed), one))["fingers shake"]
        assert finding.marks[:, 6:9].any()
        assert not finding.marks[:, 13:].any()


@pytest.mark.parametrize(
    "order",
    [
        np.r_[0, 4, 3, 2, 1, 5:21],
        np.r_[0:13, 17:21, 13:17],
        np.r_[0:5, 8, 7, 6, 5, 9:21],
        np.r_[1:21, 0],
    ],
    ids=["thumb reversed", "little for ring", "index reversed", "wrist last"],
)
def test_other_orders_are_named(order):
    for seed in (2, 11, 17):
        s = clean(seed, noise_mm=1.0)
        finding = found(with_joints(s, s.joints[:, order]))["order"]
        assert "misfit" in finding.text


def test_a_turned_palm_and_a_held_finger_are_found():
    s = clean(9)
    joints = s.joints.copy()
    middle = joints[70].mean(0)
    joints[70] = (joints[70] - middle) @ vector_to_matrix(np.array([0, 0, 1.0])).T + middle
    assert found(with_joints(s, joints))["jump"].marks[70].all()
    joints = s.joints.copy()
    joints[100:110, 9:13] = joints[100, 9:13]
    finding = found(with_joints(s, joints))["frozen"]
    assert np.flatnonzero(finding.marks.any(1)).tolist() == list(range(101, 110))
    assert np.flatnonzero(finding.marks.any(0)).tolist() == [9, 10, 11, 12]


def test_coarse_numbers_of_a_resting_hand_are_no_frozen_frames():
    s = clean(3)
    joints = np.round(s.joints[:1] + np.random.default_rng(1).normal(0, 1e-4, s.joints.shape), 3)
    assert "frozen" not in found(with_joints(s, joints))


@pytest.mark.parametrize("factor", [1000, 0.001])
def test_times_in_another_unit_are_found(factor):
    s = clean(6)
    stamps = (s.time_ns * factor).astype(np.int64)
    finding = found(replace(s, time_ns=stamps))["time"]
    assert "frames/s" in finding.text
    assert finding.marks.any(1).all()


def written(path, s, scale=1.0, order=None, stamps=None):
    joints = s.joints if order is None else s.joints[:, order]
    stamps = s.time_ns if stamps is None else stamps
    np.savez(path, joints_m=scale * joints, time_ns=stamps, hand=s.hand)


def test_a_data_set_with_files_of_other_units_orders_and_clocks(tmp_path, capsys):
    """What the reader cures is told, what it cannot read ends nothing."""
    data = tmp_path / "data"
    data.mkdir()
    written(data / "good.npz", clean(1))
    written(data / "cm.npz", clean(2), scale=100)
    written(data / "order.npz", clean(3), order=np.r_[0:13, 17:21, 13:17])
    written(data / "both.npz", clean(4), scale=100, order=np.r_[0:13, 17:21, 13:17])
    back = clean(5).time_ns.copy()
    back[120:] -= back[120] - back[60]
    written(data / "back.npz", clean(5), stamps=back)
    twice = clean(6).time_ns.copy()
    twice[50] = twice[49]
    written(data / "twice.npz", clean(6), stamps=twice)
    written(data / "us.npz", clean(7), stamps=clean(7).time_ns // 1000)
    (data / "cut.npz").write_bytes((data / "good.npz").read_bytes()[:4000])
    mask = tmp_path / "mask.parquet"
    call = ["audit", str(data), "--json", "--no-fit", "--mask", str(mask)]
    assert run([*call, "--html", str(tmp_path / "a.html")]) == 0
    told = json.loads(capsys.readouterr().out)
    kinds = {s["name"]: {f["kind"]: f for f in s["findings"]} for s in told["sequences"]}
    assert {name: set(k) for name, k in kinds.items()} == {
        "good": set(),
        "cm": {"unit"},
        "order": {"order"},
        "both": {"unit", "order"},
        "back": {"time"},
        "twice": {"time"},
        "us": {"time"},
    }
    assert "cm" in kinds["cm"]["unit"]["text"]
    assert kinds["back"]["time"]["first"] == 120
    assert kinds["us"]["time"]["frames"] == N
    assert kinds["twice"]["time"]["frames"] <= 2
    (unread,) = told["unread"]
    assert unread["source"].endswith("cut.npz")
    assert "cut short" in unread["error"]
    assert "cut.npz" in (tmp_path / "a.html").read_text()
    files = [str(p) for p in sorted(data.iterdir())]
    assert run(["audit", *files, "--no-fit"]) == 0
    assert "not read: " in capsys.readouterr().out


def test_hands_of_two_people_in_a_folder_are_told(tmp_path, capsys):
    for seed in range(6):
        written(tmp_path / f"{seed}.npz", clean(seed), scale=1.0 if seed < 4 else 0.88)
    assert run(["audit", str(tmp_path), "--json", "--no-fit"]) == 0
    told = json.loads(capsys.readouterr().out)
    (of,) = told["people"]
    assert of["people"] == [["0", "1", "2", "3"], ["4", "5"]]
    assert 10 < of["apart_percent"] < 16
    assert not any(s["findings"] for s in told["sequences"])
    assert run(["audit", str(tmp_path), "--no-fit"]) == 0
    assert "hands of 2 people" in capsys.readouterr().out
