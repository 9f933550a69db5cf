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
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import BASES, JOINT_NAMES

N = 240
SEEDS = range(20)


def clean(seed, noise_mm=0.7, hand=None):
    """A hand that moves, turns and flexes, with a little noise."""
    rng = np.random.default_rng(seed)
    hand = hand or ("left", "right")[seed % 2]
    t = np.arange(N)[:, None] / 30
    waves = np.sin(2 * np.pi * t * rng.uniform(0.1, 0.5, 26) + rng.uniform(0, 6, 26))
    angles = np.full((N, 20), 0.0)
    angles[:] = 0.35 + 0.3 * waves[:, :20]
    angles[:, 1::4] *= 0.2  # abduction
    turns = vector_to_matrix(0.5 * waves[:, 20:23] + rng.normal(0, 1, 3))
    joints = HandModel.default(hand).joints(angles, turns, 0.15 * waves[:, 23:])
    joints = joints + rng.normal(0, noise_mm * 1e-3, joints.shape)
    stamps = (np.arange(N) * 1e9 / 30).astype(np.int64)
    return ht.Sequence(stamps, joints, hand=hand, name=f"clip {seed}", source=f"clip{seed}.npz")


def found(sequence, **options):
    (result,) = audit(sequence, fit=False, **options)
    return {f.kind: f for f in result.findings}


def with_joints(s, joints, **changes):
    return replace(s, joints=joints, confidence=None, **changes)


# each: (kind, what is made of a clip, the frames that must be marked)


def bone_jumps(s, rng):
    joints, at = s.joints.copy(), int(rng.integers(20, N - 20))
    joint = int(rng.integers(5, 20))
    joint = joint + 1 if joint in BASES else joint
    joints[at, joint] += 1.4 * (joints[at, joint] - joints[at, joint - 1])
    return with_joints(s, joints), [at]


def breathes(s, rng):
    size = 1 + 0.12 * np.sin(2 * np.pi * np.arange(N) / 150)
    middle = s.joints.mean(1, keepdims=True)
    return with_joints(s, middle + size[:, None, None] * (s.joints - middle)), []


def other_hand(s, rng):
    at = int(rng.integers(30, N - 90))
    joints = s.joints.copy()
    joints[at : at + 50] *= [-1, 1, 1]
    return with_joints(s, joints), list(range(at + 10, at + 40))


def exchanged_joints(s, rng):
    joints = s.joints.copy()
    order = np.r_[0, 5:9, 1:5, 9:21]
    return with_joints(s, joints[:, order]), []


def in_inches(s, rng):
    return with_joints(s, s.joints * 2.54), []


def time_jumps(s, rng):
    at = int(rng.integers(20, N - 20))
    stamps = s.time_ns.copy()
    stamps[at:] += 400_000_000
    return replace(s, time_ns=stamps), [at]


def freezes(s, rng):
    at = int(rng.integers(20, N - 40))
    joints = s.joints.copy()
    joints[at + 1 : at + 8] = joints[at]
    return with_joints(s, joints), list(range(at + 1, at + 8))


def repeats(s, rng):
    joints = s.joints.copy()
    joints[150:170] = joints[30:50]
    return with_joints(s, joints), list(range(150, 170))


def hand_jumps(s, rng):
    at = int(rng.integers(20, N - 20))
    joints = s.joints.copy()
    joints[at] += 0.12 * np.array([0.6, -0.8, 0.0])
    return with_joints(s, joints), [at]


def joint_jumps(s, rng):
    joints, at = s.joints.copy(), int(rng.integers(20, N - 20))
    joints[at, int(rng.integers(6, 21))] += [0.04, 0.03, -0.03]
    return with_joints(s, joints), [at]


def folds(s, rng):
    joints, at, base = s.joints.copy(), int(rng.integers(20, N - 60)), int(rng.choice(BASES[1:]))
    span = slice(at, at + 20)
    bone = joints[span, base + 1] - joints[span, base]
    side = joints[span, base + 2] - joints[span, base + 1]
    length = np.linalg.norm(side, axis=1, keepdims=True)
    back = -bone / np.linalg.norm(bone, axis=1, keepdims=True) + 0.2 * side / length
    back *= length / np.linalg.norm(back, axis=1, keepdims=True)
    rest = joints[span, base + 3] - joints[span, base + 2]
    joints[span, base + 2] = joints[span, base + 1] + back
    joints[span, base + 3] = joints[span, base + 2] + rest
    return with_joints(s, joints), list(range(at, at + 20))


def whole_hand_shakes(s, rng):
    return with_joints(s, s.joints + rng.normal(0, 0.006, (N, 1, 3))), []


def fingers_shake(s, rng):
    joints = s.joints.copy()
    for base in BASES:
        joints[:, base + 2 : base + 4] += rng.normal(0, 0.006, (N, 2, 3))
    return with_joints(s, joints), []


FAULTS = {
    "bone jumps": bone_jumps,
    "bones breathe": breathes,
    "other hand": other_hand,
    "order": exchanged_joints,
    "unit": in_inches,
    "time": time_jumps,
    "frozen": freezes,
    "jump": hand_jumps,
    "joint jumps": joint_jumps,
    "beyond limits": folds,
    "hand shakes": whole_hand_shakes,
    "fingers shake": fingers_shake,
}


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
