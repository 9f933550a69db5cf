"""The whole way through: sequence, track, recording, replay, numbers."""

from __future__ import annotations

import json
import time
import warnings
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run
from tools.make import panoptic as make_panoptic

ROOT = Path(__file__).resolve().parent.parent


# the real inputs: sequences, frames of each, and what the mean PA-MPJPE to the observed joints
# stays below [mm] with a calibrated hand
REAL = {
    "stereo/joints.npz": (1, 378, 5.0),  # any hand of rigid bones leaves 2.5: a detector's bias is
    "dex/joints.npz": (1, 621, 4.5),  # no bone, and is not taken for one
    "leap/grab.json": (1, 374, 1.2),
    "ego_mcap/hand_keypoints_3d.mcap": (2, 1302, 16.0),
}


def assert_same(a: object, b: object, name: str = "") -> None:
    """Tracks (and what they are made of) equal to the last bit; NaN equals NaN."""
    if hasattr(a, "__dataclass_fields__"):
        assert type(a) is type(b)
        for field in fields(a):
            assert_same(getattr(a, field.name), getattr(b, field.name), f"{name}.{field.name}")
    elif isinstance(a, tuple):
        assert len(a) == len(b), name
        for x, y in zip(a, b, strict=True):
            assert_same(x, y, name)
    elif isinstance(a, np.ndarray):
        assert a.shape == b.shape, name
        assert a.dtype.kind == b.dtype.kind, name
        np.testing.assert_array_equal(a, b, err_msg=name)
    else:
        assert a == b, name


def errors_mm(joints: np.ndarray, truth: np.ndarray) -> float:
    return float(np.nanmean(ht.metrics.pa_mpjpe(joints, truth))) * 1e3


def entities(rrd: Path) -> set[str]:
    from rerun.chunk import RrdReader

    return {chunk.entity_path for chunk in RrdReader(rrd).stream()}


def test_the_sample_end_to_end(sample, tmp_path):
    track = ht.track(sample)
    path = ht.write_mcap([track], tmp_path / "run.mcap")
    (back,) = ht.read_mcap(path)
    assert_same(back, track)

    report = ht.stability(back)
    (row,) = report.sequences
    assert (row.frames, row.fitted, row.predicted, row.lost) == (300, 290, 0, 10)
    assert row.against == "truth"
    # what is fitted is nearer to the truth than what was given, and calmer
    assert row.pa_mpjpe_mm.mean < 0.75 * row.input_pa_mpjpe_mm.mean
    assert row.mpjpe_mm.mean < 0.75 * row.input_mpjpe_mm.mean
    assert row.jitter_m_s3 < 0.75 * row.input_jitter_m_s3
    assert row.pa_mpjpe_mm.mean == pytest.approx(
        errors_mm(track.fitted_joints, sample.truth), rel=1e-9
    )

    scaled = ht.stability(ht.track(sample, calibrate=False)).overall
    assert row.pa_mpjpe_mm.mean < 0.6 * scaled.pa_mpjpe_mm.mean
    steady = ht.stability(ht.track(sample, filter="kalman")).overall
    assert steady.jitter_m_s3 < 0.8 * row.jitter_m_s3
    assert steady.lost < row.lost


def test_the_three_commands(sample_file, tmp_path, capsys):
    mcap, rrd, replayed = (str(tmp_path / n) for n in ("out.mcap", "out.rrd", "replayed.rrd"))
    assert run(["track", str(sample_file), "-o", mcap, "--rrd", rrd, "--filter", "kalman"]) == 0
    assert run(["replay", mcap, "--save", replayed]) == 0
    capsys.readouterr()
    assert run(["stability", mcap, "--json"]) == 0
    overall = json.loads(capsys.readouterr().out)["overall"]
    assert overall["pa_mpjpe_mm"]["mean"] < 2.2
    found = entities(Path(rrd))
    assert found == entities(Path(replayed))
    wanted = {f"/world/right/{n}" for n in ("skin", "observed", "fitted", "filtered", "truth")}
    wanted |= {"/errors/right", "/status/right", "/log/right"}
    wanted |= {f"/angles/right/{f}/angles" for f in ("thumb", "index", "little")}
    assert wanted <= found


def test_calibration_gives_the_subjects_bones(sample):
    """The subject's hand differs from the default one by 6 %, its noise-free bones are known."""
    truth = sample.truth
    lengths = np.linalg.norm(np.diff(truth.reshape(-1, 21, 3)[:, 5:9], axis=1), axis=-1).mean(0)
    model = ht.calibrate(ht.HandModel.default("right"), sample).model
    found = np.linalg.norm(np.diff(model.rest_joints[5:9], axis=0), axis=-1)
    np.testing.assert_allclose(found, lengths, atol=0.5e-3)


def test_panoptic_people_against_their_truth(tmp_path):
    truth, joints = make_panoptic.make(frames=60, noise_mm=2.0, people=2)
    make_panoptic.write(tmp_path / "171204_pose6", joints)
    sequences = ht.load(tmp_path / "171204_pose6", frames=(20705, 20750))
    assert [len(s) for s in sequences] == [46] * 4
    for sequence in sequences:
        person = int(sequence.name.split("person")[1].split()[0])
        clean = truth[person, sequence.hand][4:50] / 100.0
        track = ht.track(sequence)
        assert track.hand == sequence.hand
        assert (track.status == "fitted").all()
        error = errors_mm(track.fitted_joints, clean)
        assert error < 0.75 * errors_mm(sequence.joints, clean)
        assert error < 2.2


def test_two_hands_in_one_recording(sample, tmp_path):
    mirror = np.array([-1.0, 1.0, 1.0])
    left = replace(
        sample,
        joints=sample.joints * mirror,
        truth=sample.truth * mirror,
        hand="left",
        time_ns=sample.time_ns + 5_000_000,
    )
    tracks = [ht.track(s) for s in (left, sample)]
    back = ht.read_mcap(ht.write_mcap(tracks, tmp_path / "two.mcap"))
    for a, b in zip(back, tracks, strict=True):
        assert_same(a, b)
    rows = ht.stability(back).sequences
    assert rows[0].pa_mpjpe_mm.mean == pytest.approx(rows[1].pa_mpjpe_mm.mean, abs=1e-3)
    ht.log_rerun(back, save=tmp_path / "two.rrd")
    assert {"/world/left/skin", "/world/right/skin"} <= entities(tmp_path / "two.rrd")


@pytest.mark.parametrize("name", REAL)
def test_real_input(name, shared_data, tmp_path):
    number, frames, most_mm = REAL[name]
    swap = "swap" if "ego" in name else None  # its labels are the wrong way round
    sequences = ht.load(shared_data / name, hand=swap)
    assert [len(s) for s in sequences] == [frames] * number
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        tracks = [ht.track(s) for s in sequences]
        path = ht.write_mcap(tracks, tmp_path / "run.mcap", mesh=False)
    for back, track in zip(ht.read_mcap(path), tracks, strict=True):
        assert_same(back, track)
    for sequence, track in zip(sequences, tracks, strict=True):
        enough = sequence.present.sum(1) >= 6
        refused = np.char.find(track.reason, "rejected: ") >= 0
        assert refused.mean() < (0.05 if "ego" in name else 0.01)
        np.testing.assert_array_equal(track.status == "fitted", enough & ~refused)
        assert track.model.limits.contains(track.angles[enough & ~refused], 1e-7).all()
        calibrated = errors_mm(track.fitted_joints, sequence.joints)
        scaled = errors_mm(ht.track(sequence, calibrate=False).fitted_joints, sequence.joints)
        assert calibrated < most_mm
        assert calibrated < 0.98 * scaled
    ht.log_rerun(tracks, save=tmp_path / "run.rrd", mesh=False)
    assert {f"/world/{track.hand}/observed" for track in tracks} <= entities(tmp_path / "run.rrd")
    rows = ht.stability(tracks).sequences
    assert all(row.against == "observed" for row in rows)


def test_the_viewer_draws_the_hand_and_the_plots(screen, sample, tmp_path):
    """A real viewer opens the file: skin and curves are there, and no skin in lost frames."""
    rrd = ht.log_rerun(ht.track(sample), save=tmp_path / "sample.rrd")

    def seen() -> tuple[float, float]:
        """Shares of skin in the left half of the picture and of curves in the right one."""
        picture = screen.picture()
        r, g, b = np.moveaxis(picture, -1, 0)
        half = r.shape[1] // 2
        skin = (r > g + 15) & (g > b + 5) & (r > 80)
        coloured = np.max([r, g, b], 0) - np.min([r, g, b], 0) > 80
        return skin[:, :half].mean(), coloured[:, half:].mean()

    screen.client.open(str(rrd))
    for seconds, there in ((0.9, True), (6.85, False)):
        screen.client.set_time("time", duration=seconds, play_state="paused")
        deadline = time.monotonic() + 30
        skin, curves = seen()
        # what is looked at for the first time is loaded then
        while (skin > 0.015) != there and time.monotonic() < deadline:
            time.sleep(0.2)
            skin, curves = seen()
        assert (skin > 0.015) if there else (skin < 0.003)
    assert curves > 0.01


def topics_written(path: Path) -> set[str]:
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        return {c.topic.rpartition("/")[2] for c in summary.channels.values()}
