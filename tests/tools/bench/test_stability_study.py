"""tools/bench/stability_study.py, its faults and its oracles."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

from tools.bench import faults, oracles, stability_study

ROOT = Path(__file__).resolve().parents[3]


RNG = np.random.default_rng


def smooth_joints(frames=80):
    t = np.arange(frames)[:, None, None] / 30.0
    phase = RNG(0).uniform(0, 6, (1, 21, 3))
    return 0.1 * np.sin(3.0 * t + phase)


@pytest.mark.parametrize(("window", "order"), [(7, 2), (11, 0), (15, 4)])
def test_savgol_is_scipys_in_complete_windows(window, order):
    signal = pytest.importorskip("scipy.signal")
    x = RNG(1).normal(size=(60, 21, 3))
    ours = oracles.savgol(x, window, order)
    theirs = signal.savgol_filter(x, window, order, axis=0)
    half = window // 2
    np.testing.assert_allclose(ours[half:-half], theirs[half:-half], atol=1e-9)
    assert np.isfinite(ours).all()


def test_savgol_passes_over_missing_samples_and_ends():
    t = np.linspace(-1, 1, 50)[:, None, None]
    parabola = np.broadcast_to(1 + 2 * t - 3 * t**2, (50, 21, 3)).copy()
    holed = parabola.copy()
    holed[RNG(2).random((50, 21)) < 0.3] = np.nan
    smooth = oracles.savgol(holed, 11, 2)
    inside = np.isfinite(smooth)
    np.testing.assert_allclose(smooth[inside], parabola[inside], atol=1e-8)
    assert inside[5:-5].mean() > 0.95
    holed[:] = np.nan
    assert np.isnan(oracles.savgol(holed, 11, 2)).all()


def test_one_euro_without_gain_by_speed_is_exponential_smoothing():
    steps = np.zeros((40, 1, 3))
    steps[1:] = 1.0
    time_ns = (np.arange(40) * 1e9 / 50).astype(np.int64)
    tau = 1 / (2 * np.pi * 2.0)
    (smooth,) = oracles.one_euro(steps, time_ns, np.array([2.0]), np.array([0.0]))
    left = (1 - 1 / (1 + tau * 50)) ** np.arange(40)
    np.testing.assert_allclose(smooth[:, 0, 1], 1 - left, atol=1e-9)
    (fast,) = oracles.one_euro(steps, time_ns, np.array([2.0]), np.array([5.0]))
    assert (fast[1:30, 0, 0] > smooth[1:30, 0, 0]).all()


def test_one_euro_leaves_out_what_is_missing():
    x = RNG(3).normal(size=(30, 21, 3))
    time_ns = np.arange(30) * 10_000_000
    some = np.delete(np.arange(30), [4, 5, 17])
    holed = x.copy()
    holed[[4, 5, 17]] = np.nan
    parameters = np.array([1.0, 5.0]), np.array([0.1, 0.0])
    smooth = oracles.one_euro(holed, time_ns, *parameters)
    assert np.isnan(smooth[:, [4, 5, 17]]).all()
    # the same as a sequence that never had those frames
    alone = oracles.one_euro(x[some], time_ns[some], *parameters)
    np.testing.assert_allclose(smooth[:, some], alone, atol=1e-12)


def test_oracles_pick_what_is_nearest_to_the_truth():
    clean = smooth_joints()
    noisy = clean + RNG(4).normal(0, 0.005, clean.shape)
    time_ns = (np.arange(80) * 1e9 / 30).astype(np.int64)
    best = oracles.best_savgol(noisy, clean)
    window, order = (int(word) for word in best.parameters.replace(",", "").split()[1::2])
    mine = np.linalg.norm(best.joints - clean, axis=-1).mean()
    for w in (window - 4, window + 10):
        other = oracles.savgol(noisy, w, order)
        assert mine < np.linalg.norm(other - clean, axis=-1).mean()
    causal = oracles.best_one_euro(noisy, clean, time_ns).joints
    raw = np.linalg.norm(noisy - clean, axis=-1).mean()
    assert mine < np.linalg.norm(causal - clean, axis=-1).mean() < raw


def test_faults_are_as_many_and_as_large_as_said():
    clean = np.zeros((2000, 21, 3))
    noise = faults.disturbed(clean, faults.Faults(noise_mm=4.0), RNG(5))
    assert noise.std() == pytest.approx(4e-3, rel=0.02)
    every = faults.KINDS["all"]
    joints = faults.disturbed(clean, every, RNG(5))
    gone = np.isnan(joints[..., 0])
    starts = faults.gap_starts(2000, every)
    in_gap = np.zeros(2000, dtype=bool)
    for start in starts:
        in_gap[start : start + 5] = True
    assert len(starts) == 3
    assert gone[in_gap].all()
    assert gone[~in_gap].mean() == pytest.approx(0.10, abs=0.01)
    assert not gone[~in_gap].all(1).any()
    distance = np.linalg.norm(joints[~gone], axis=-1)
    assert (distance > 0).mean() == pytest.approx(0.02, abs=0.004)
    assert distance[distance > 0] == pytest.approx(0.2)
    # kinds can be compared: they share their noise
    both = faults.disturbed(clean, faults.Faults(noise_mm=4.0, dropped=0.1), RNG(5))
    kept = ~np.isnan(both)
    np.testing.assert_array_equal(both[kept], noise[kept])


@pytest.fixture(scope="module")
def rows(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    clean = smooth_joints() * 0.1
    sample = np.load(ROOT / "recordings" / "sample.npz")
    hand = sample["truth_m"][100:160] + clean[:60, :1]
    path = folder / "hand.npz"
    np.savez(path, joints_m=hand, fps=np.array(30.0), hand=np.array("right"))
    arguments = [str(path), "--noise-mm", "0", "5", "--json", str(folder / "rows.json")]
    stability_study.main([*arguments, "--filters", "none", "kalman"])
    return json.loads((folder / "rows.json").read_text())


def found(rows, noise, faults, method):
    (row,) = (
        r
        for r in rows["overall"]
        if (r["noise_mm"], r["faults"], r["method"]) == (noise, faults, method)
    )
    return row


def test_raw_joints_show_the_noise_that_was_added(rows):
    clean = found(rows, 0.0, "none", "raw joints")
    assert clean["error_mm"] == 0.0
    assert clean["jitter_ratio"] == pytest.approx(1.0)
    assert clean["lag_frames"] == pytest.approx(0.0, abs=0.01)
    noisy = found(rows, 5.0, "none", "raw joints")
    assert noisy["error_mm"] == pytest.approx(5.0 * np.sqrt(8 / np.pi), rel=0.05)
    assert noisy["said"] == 1.0
    assert noisy["jitter_ratio"] > 5


def test_ratios_are_to_the_oracles(rows):
    fit = found(rows, 5.0, "none", "fit")
    savgol = found(rows, 5.0, "none", "savitzky-golay oracle")
    assert fit["vs_savgol"] == pytest.approx(fit["error_mm"] / savgol["error_mm"])
    assert savgol["vs_savgol"] == 1.0
    assert savgol["error_mm"] < found(rows, 5.0, "none", "raw joints")["error_mm"]


def test_every_method_is_there_with_faults(rows):
    methods = {r["method"] for r in rows["overall"]}
    assert methods >= {"raw joints", "one-euro oracle", "fit", "fit + kalman"}
    raw = found(rows, 5.0, "all", "raw joints")
    # 15 of 60 frames are gaps, a tenth of the other joints is dropped
    assert raw["said"] == pytest.approx(0.75 * 0.9, abs=0.03)
    assert found(rows, 5.0, "all", "fit + kalman")["said"] > raw["said"]


def test_the_plot(rows, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    path = tmp_path / "study.png"
    assert stability_study.plot(rows["overall"], path)
    assert path.read_bytes().startswith(b"\x89PNG")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert not stability_study.plot(rows["overall"], path)


@pytest.mark.parametrize(
    "arguments", [["nowhere.npz"], ["--noise-mm", "-1"], ["--processes", "0"], ["--frames", "3"]]
)
def test_bad_arguments(arguments, capsys):
    with pytest.raises(SystemExit) as stop:
        stability_study.main(arguments)
    assert stop.value.code == 2
    assert "error: " in capsys.readouterr().err
