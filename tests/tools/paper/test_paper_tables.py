"""The paper's experiments and the comparison of methods, small."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from tools.bench import compare_methods
from tools.make import mano_like as make_mano_like
from tools.paper import tables as paper

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def mano_file(tmp_path_factory):
    """A stand-in for MANO_RIGHT.pkl, stored as MANO's is."""
    path = tmp_path_factory.mktemp("mano") / "MANO_RIGHT.pkl"
    with path.open("wb") as file:
        make_mano_like.write_pickle(make_mano_like.make_mano_like("right"), file)
    return path


def test_tables_2_and_3_on_the_free_hand(capsys):
    rows = {row.method: row for row in paper.main(["mano", "--poses", "12"])}
    exact, li2021 = (rows[m].values for m in ("exact", "li2021"))
    for measure in ("MPJPE", "PA-MPJPE", "MPVPE", "PA-MPVPE"):
        assert 0.5 < exact[measure][0] < li2021[measure][0] < 8
    assert rows["exact"].ms < rows["gdc"].ms
    out = capsys.readouterr().out
    assert "paper: BCD" in out
    assert "5.35 (1.91)" in out


def test_tables_2_and_3_on_a_mano_file(mano_file, capsys):
    """The poses are the file's own: mean pose and components times hands_coeffs, decoded."""
    poses = paper.mano_hands(mano_file, 5, "anatomical")
    assert poses.joints.shape == (5, 21, 3)
    assert poses.vertices.shape == (5, 778, 3)
    mean, components = poses.components
    assert components.shape == (45, 45)
    # rows are orthonormal as in the file, whatever the order of parts
    np.testing.assert_allclose(components @ components.T, np.eye(45), atol=1e-6)
    assert mean.shape == (45,)
    rows = paper.main(["mano", "--poses", "4", "--mano", str(mano_file)])
    assert all(np.isfinite(v).all() for row in rows for v in row.values.values())
    assert "MANO's 4 registrations" in capsys.readouterr().out


def test_figures_6_and_7(capsys):
    found = paper.main(["noise", "--poses", "8", "--limits", "anatomical"])
    exact = [found[s][-1].values["MPJPE"][0] for s in paper.SIGMAS_MM]
    assert exact == sorted(exact)
    assert "20 mm" in capsys.readouterr().out


def test_table_4(tmp_path, capsys):
    """FreiHAND's file and a detector's, by the field's numbers."""
    truth, seen = paper._detector(30)
    (tmp_path / "evaluation_xyz.json").write_text(json.dumps(truth.tolist()))
    np.savez(tmp_path / "detected.npz", joints_mm=seen * 1e3, hand="right", fps=30.0)
    paths = [str(tmp_path / name) for name in ("evaluation_xyz.json", "detected.npz")]
    found = paper.main(["freihand", *paths])
    aligned = ht.metrics.align(seen, truth)
    assert found["detector"]["auc"] == pytest.approx(ht.metrics.auc(aligned, truth), abs=1e-6)
    assert found["exact"]["error_cm"] < found["detector"]["error_cm"]
    assert "0.799" in capsys.readouterr().out
    np.savez(tmp_path / "detected.npz", joints_mm=seen[:20] * 1e3, hand="right", fps=30.0)
    with pytest.raises(SystemExit, match=r"20 frames, .*evaluation_xyz.json has 30"):
        paper.main(["freihand", *paths])


def test_panoptic(capsys):
    comparison = paper.main(["panoptic"])
    assert list(comparison.methods) == ["exact", "li2021", "rts"]
    assert comparison.frames == 100
    assert "5.3302   0.4320" in capsys.readouterr().out


def test_methods_beside_each_other(tmp_path, sample_file, capsys):
    out = tmp_path / "table.md"
    arguments = [str(sample_file), "--frames", "60", "--sentences", "--markdown", str(out)]
    (reports,) = compare_methods.main(arguments)
    assert set(reports) == {*compare_methods.TRACKED, *compare_methods.BASELINES}
    assert "exact is more accurate than GDC: PA-MPJPE" in " ".join(capsys.readouterr().out.split())
    lines = out.read_text().splitlines()
    assert lines[2].startswith("| recordings: sample | 60 | truth | ")
    spread = reports["exact"].overall.pa_mpjpe_mm
    assert f"{spread.mean:.2f} ± {spread.std:.2f}" in lines[2]


def test_only_short_gaps_are_filled():
    joints = np.cumsum(np.random.default_rng(0).normal(0, 0.01, (40, 21, 3)), 0)
    holes = joints.copy()
    holes[5:8, 4] = np.nan  # short: on a line
    holes[20:30, 6] = np.nan  # long: left
    holes[35] = np.nan  # nothing seen
    out = compare_methods.filled(holes)
    line = joints[4, 4] + (joints[8, 4] - joints[4, 4]) * np.array([0.25, 0.5, 0.75])[:, None]
    np.testing.assert_allclose(out[5:8, 4], line)
    assert np.isnan(out[20:30, 6]).all()
    assert np.isnan(out[35]).all()
    seen = ~np.isnan(holes)
    np.testing.assert_array_equal(out[seen], holes[seen])
