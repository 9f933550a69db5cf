"""tools/bench/noise_study.py runs, and shows what the study is about."""

from __future__ import annotations

import json
import sys

import numpy as np
import pytest

from handtrack.hand.model import HandModel
from tools.bench import noise_study


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    noise_study.main(["--quick", "--json", str(folder / "rows.json")])
    return json.loads((folder / "rows.json").read_text())


def error(study, on, sigma, method, key="truth_mean_mm"):
    (row,) = (
        row
        for row in study["rows"]
        if (row["on"], row["sigma_mm"], row["method"]) == (on, sigma, method)
    )
    return row[key]


@pytest.mark.parametrize("on", ["random poses", "sample motion"])
def test_the_exact_update_beats_the_papers_and_the_input(study, on):
    for sigma in (2.0, 5.0):
        exact = error(study, on, sigma, "exact")
        assert exact < error(study, on, sigma, "li2021") < error(study, on, sigma, "input")
    noise = error(study, on, 5.0, "input")
    assert noise == pytest.approx(5.0 * np.sqrt(8 / np.pi), rel=0.05)


@pytest.mark.parametrize("on", ["random poses", "sample motion"])
def test_robust_losses_hold_against_outliers(study, on):
    plain = error(study, on, 2.0, "exact", "outliers_mean_mm")
    for robust in ("huber", "geman-mcclure"):
        assert error(study, on, 2.0, robust, "outliers_mean_mm") < 0.7 * plain


def test_outliers_are_10_cm_off():
    joints = noise_study.random_poses(HandModel.default(), 200, np.random.default_rng(0))
    moved = noise_study.with_outliers(joints, np.random.default_rng(1)) - joints
    distance = np.linalg.norm(moved, axis=-1)
    assert distance[distance > 0] == pytest.approx(0.1)
    assert (distance > 0).mean() == pytest.approx(0.05, abs=0.01)


def test_random_angles_are_valid():
    model = HandModel.default(limits="li2021")
    angles = noise_study.random_angles(model, 500, np.random.default_rng(0))
    assert model.limits.contains(angles).all()
    assert np.ptp(angles, axis=0) == pytest.approx(
        model.limits.upper - model.limits.lower, rel=0.15
    )


def test_the_plot(study, tmp_path):
    pytest.importorskip("matplotlib")
    path = tmp_path / "study.png"
    assert noise_study.plot(study["rows"], path)
    assert path.read_bytes().startswith(b"\x89PNG")


def test_a_missing_matplotlib_is_said(study, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    assert not noise_study.plot(study["rows"], tmp_path / "study.png")
