"""Figures of tracks: what is drawn is what was tracked, and what cannot be drawn is said."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run
from handtrack.hand.skeleton import ANGLE_NAMES
from handtrack.plotting.runs import chosen_angles, runs_of

matplotlib = pytest.importorskip("matplotlib", reason="plots need matplotlib (extra `plot`)")
matplotlib.use("Agg")


@pytest.fixture(scope="module")
def tracked() -> ht.Track:
    """60 frames of a hand that bends its index finger, with noise, a gap and a truth."""
    model, rng = ht.HandModel.default(), np.random.default_rng(3)
    angles = np.zeros((60, 20))
    angles[:, ANGLE_NAMES.index("index_pip_flexion")] = np.linspace(0, 1.4, 60)
    truth = np.stack([model.joints(a, np.eye(3), np.zeros(3)) for a in angles])
    joints = truth + 0.002 * rng.normal(size=truth.shape)
    joints[30:36] = np.nan
    time_ns = np.round(np.arange(60) / 30 * 1e9).astype(np.int64)
    sequence = ht.Sequence(time_ns, joints, truth=truth, name="bend")
    return ht.track(sequence, model, filter="kalman", calibrate="none")


def panel(figure, title):
    """The panel of that title, or of that label of its vertical axis."""
    return next(a for a in figure.axes if title in (a.get_title(), a.get_ylabel()))


def lines(axes):
    """Numbers of its lines, without gaps."""
    return [np.asarray(line.get_ydata(), dtype=float) for line in axes.get_lines()]


def test_an_angle_is_drawn_in_degrees_within_its_limits(tracked):
    figure = ht.plot(tracked)
    axes = panel(figure, "Index PIP flexion")
    i = ANGLE_NAMES.index("index_pip_flexion")
    raw, steady = lines(axes)
    np.testing.assert_allclose(steady, np.rad2deg(tracked.angles[:, i]))
    np.testing.assert_allclose(raw, np.rad2deg(tracked.angles_raw[:, i]))
    below, above = [patch.get_extents() for patch in axes.patches]
    ends = axes.transData.inverted().transform([[0, below.y1], [0, above.y0]])[:, 1]
    limits = tracked.model.limits
    np.testing.assert_allclose(ends, np.rad2deg([limits.lower[i], limits.upper[i]]), atol=1e-6)
    band = axes.collections[0].get_paths()[0].vertices
    spread = 2 * np.rad2deg(np.sqrt(tracked.angle_variance[0, i]))
    at_start = band[np.isclose(band[:, 0], 0.0), 1]
    assert np.ptp(at_start) == pytest.approx(2 * spread)
    assert len(figure.axes) == 22


def test_errors_are_those_that_stability_measures(tracked):
    row = ht.stability(tracked).sequences[0]
    errors = panel(ht.plot(tracked), "PA-MPJPE (mm)")
    seen, output = lines(errors)
    np.testing.assert_allclose(output, row.frame_values["pa_mpjpe_mm"])
    np.testing.assert_allclose(seen, row.frame_values["input_pa_mpjpe_mm"])
    assert np.isnan(seen[30:36]).all()
    assert [t.get_text() for t in errors.get_legend().get_texts()] == ["input", "output"]


def test_without_a_truth_the_distance_from_the_input_is_drawn(tracked):
    blind = dataclasses.replace(tracked, truth=None)
    fit, _ = lines(panel(ht.plot(blind), "from input (mm)"))
    np.testing.assert_allclose(fit[:30], 1e3 * tracked.error[:30].mean(1))


def test_statuses_lie_where_they_were(tracked):
    at = np.flatnonzero(tracked.status == "predicted")
    bars = ht.plot(tracked, joints=["index_pip"]).axes[-1].collections
    (box,) = [b for b in bars if len(b.get_paths()) == 1]
    x = box.get_paths()[0].vertices[:, 0]
    assert (x.min(), x.max()) == pytest.approx(((at[0] - 0.5) / 30, (at[-1] + 0.5) / 30), abs=1e-6)


def test_frames_that_are_missing_break_the_lines(tracked):
    keep = np.r_[0:20, 40:60]
    arrays = {n: None if a is None else a[keep] for n, a in tracked.arrays().items()}
    (only,) = runs_of(dataclasses.replace(tracked, **arrays))
    seconds, values = only.broken(only.seconds)
    assert np.flatnonzero(np.isnan(values)).tolist() == [20]
    np.testing.assert_array_equal(np.isnan(seconds), np.isnan(values))


@pytest.mark.parametrize(
    ("fingers", "joints", "names"),
    [
        (["index"], [], [n for n in ANGLE_NAMES if n.startswith("index")]),
        ([], ["pip"], [f"{f}_pip_flexion" for f in ("index", "middle", "ring", "little")]),
        ([], ["thumb_cmc_abduction"], ["thumb_cmc_abduction"]),
        (["ring"], ["mcp"], ["ring_mcp_flexion", "ring_mcp_abduction"]),
    ],
)
def test_fingers_and_joints_are_chosen(fingers, joints, names):
    assert [ANGLE_NAMES[i] for i in chosen_angles(fingers, joints)] == names


def test_several_tracks_and_a_span_of_time(tracked):
    figure = ht.plot({"a": tracked, "b": tracked}, joints=["index_pip"], start_s=0.5, end_s=1.0)
    first, second = lines(panel(figure, "Index PIP flexion"))
    index = ANGLE_NAMES.index("index_pip_flexion")
    np.testing.assert_allclose(first, np.rad2deg(tracked.angles[15:31, index]))
    np.testing.assert_allclose(second, first)
    legend = figure.legends[0]
    colours = np.array([patch.get_facecolor() for patch in legend.get_patches()])
    seen = 1 + colours[:, 3:] * (colours[:, :3] - 1)  # on white
    assert len(np.unique(seen.round(1), axis=0)) == len(seen)  # no colour has two meanings
    names = [t.get_text() for t in legend.get_texts()]
    assert names[:2] == ["a", "b"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"joints": ["knee"]}, "joint 'knee' has no angle"),
        ({"fingers": ["thumb"], "joints": ["pip"]}, "thumb has no pip"),
        ({"fingers": ["pinky"]}, "finger 'pinky' is unknown"),
        ({"start_s": 5.0}, "no frames in that part"),
        ({"start_s": 1.0, "end_s": 1.0}, "is empty"),
        ({"width_mm": 3}, "width_mm"),
        ({"save": "figure.docx"}, "expected a name that ends in .pdf"),
    ],
)
def test_what_cannot_be_drawn_is_said(tracked, options, says):
    with pytest.raises(ht.SettingsError, match=says):
        ht.plot(tracked, **options)


def test_a_figure_that_cannot_be_written_keeps_the_one_before(tracked, tmp_path, monkeypatch):
    path = tmp_path / "a.png"
    path.write_bytes(b"before")

    def full(figure, part, **_):
        Path(part).write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", full)
    with pytest.raises(ht.HandtrackError, match=r"a\.png: cannot be written: No space left"):
        ht.plot(tracked, path)
    assert [p.read_bytes() for p in tmp_path.iterdir()] == [b"before"]


def test_a_figure_is_written_as_vectors_with_its_text(tracked, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ht.write_mcap([tracked], "out.mcap")
    assert run(["plot", "out.mcap", "angles.pdf", "--finger", "index"]) == 0
    assert capsys.readouterr().out == "1 hand, 60 frames -> angles.pdf\n"
    made = Path("angles.pdf").read_bytes()
    assert made.startswith(b"%PDF")
    assert b"/Subtype /Image" not in made
    assert b"/Type42" in made or b"/CIDFontType2" in made
    assert run(["plot", "out.mcap", "angles.pdf"]) == 2
    assert "there already" in capsys.readouterr().err
    assert run(["plot", "one=out.mcap", "two=out.mcap", "both.svg", "-q"]) == 0
    assert Path("both.svg").read_text().count("<svg") == 1
    assert run(["plot", "out.mcap"]) == 2
    assert "expected recordings and then the figure" in capsys.readouterr().err
    assert run(["plot", "out.mcap", "out.mcap", "x.pdf"]) == 2
    assert "give names as NAME=" in capsys.readouterr().err
