"""`track` as people and scripts use it: outputs, names, settings, messages."""

from __future__ import annotations

import json
import os
import re
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from cli_cases import ROW, files

import handtrack as ht
from handtrack.cli import progress as cli_progress
from handtrack.cli import run
from tools.make import mano_like as make_mano_like

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "hand")]

pytestmark = pytest.mark.usefixtures("elsewhere")


def test_track_writes_what_it_says(call, made, elsewhere):
    status, out, err = call("track", made.short, "-o", "new/out.mcap", "--rrd", "new/out.rrd")
    assert (status, err) == (0, "")
    assert files(elsewhere) == {"new/out.mcap", "new/out.rrd"}
    last = out.splitlines()[-1]
    assert re.fullmatch(
        r"tracked 40 frames at [\d,]+ frames/s -> new/out.mcap and new/out.rrd", last
    )
    assert "PA-MPJPE" in out
    assert "Against the truth" in out
    (track,) = ht.read_mcap("new/out.mcap")
    assert (track.name, len(track), track.hand) == ("sample", 40, "right")
    assert track.settings["filter"] == "none"
    assert track.model.limits.name == "anatomical"


def test_without_a_name_it_writes_to_recordings(call, made, elsewhere):
    there = Path(made.short).parent.name
    assert call("track", made.short)[0] == 0
    assert files(elsewhere) == {f"recordings/{there}-short.mcap"}
    assert call("track", made.panoptic, "--no-mesh")[0] == 0
    frames = Path(made.panoptic) / "hdHand3d"
    assert call("track", frames, "--no-mesh", "--rrd", "x.rrd", "--overwrite")[0] == 0
    assert call("track", made.archive, "--no-mesh", "--rrd", "shown", "--overwrite")[0] == 0
    expected = {f"{there}-short.mcap", f"{there}-171204_pose6.mcap"}
    assert files(elsewhere) == {f"recordings/{n}" for n in expected} | {
        "x.rrd",
        "shown/171204_pose6.rrd",
    }


def test_the_settings_reach_the_track(call, made):
    fit = ("--limits", "li2021", "--update", "li2021", "--no-calibrate")
    status, _, _ = call(
        "track", made.short, "-o", "a.mcap", *fit, "--filter", "kalman", "--no-mesh"
    )
    assert status == 0
    (track,) = ht.read_mcap("a.mcap")
    assert track.settings["limits"] == track.model.limits.name == "li2021"
    assert (track.settings["update"], track.settings["filter"]) == ("li2021", "kalman")
    assert track.settings["calibrate"] is False
    assert track.filtered
    assert Path("a.mcap").stat().st_size < Path(made.recording).stat().st_size / 3


def test_track_json(call, made):
    status, out, err = call("track", made.short, "-o", "a.mcap", "--rrd", "a.rrd", "--json")
    assert (status, err) == (0, "")
    result = json.loads(out)
    told = {"outputs", "frames_per_second", "seconds", "warnings", "skipped", "not_measured"}
    assert set(result) == {"sequences", "overall", *told}
    assert result["outputs"] == ["a.mcap", "a.rrd"]
    assert result["frames_per_second"] > 0
    assert result["warnings"] == []
    (row,) = result["sequences"]
    assert set(row) >= ROW
    assert (row["frames"], row["fitted"], row["against"]) == (40, 40, "truth")


def test_quiet_prints_nothing(call, made):
    np.savez("bare.npz", joints_m=made.content["joints_m"])  # no hand, no fps: worth two warnings
    assert call("track", "bare.npz", "-q") == (0, "", "")
    status, out, err = call("track", "bare.npz", "-q", "--json", "--overwrite")
    assert (status, err) == (0, "")
    assert len(json.loads(out)["warnings"]) == 2
    status, out, err = call("track", "bare.npz", "--overwrite")
    assert (status, err.count("warning: bare: ")) == (0, 2)


def test_a_recording_can_be_tracked_again(call, made):
    assert call("track", made.recording, "-o", "again.mcap", "--filter", "kalman")[0] == 0
    (a,), (b,) = ht.read_mcap(made.recording), ht.read_mcap("again.mcap")
    np.testing.assert_array_equal(a.angles_raw, b.angles_raw)
    status, _, err = call("track", "again.mcap", "-o", "./again.mcap")
    assert (status, err) == (
        2,
        "error: again.mcap is the input: give the new file another name with -o\n",
    )


def test_panoptic_frames_and_hands(call, made):
    options = ("--frames", "20703:20710", "--hand", "left", "-o", "left.mcap", "--overwrite")
    for source in (made.panoptic, made.archive):
        assert call("track", source, *options)[0] == 0
        tracks = ht.read_mcap("left.mcap")
        assert [(t.name, t.hand) for t in tracks] == [
            ("171204_pose6 person0 left", "left"),
            ("171204_pose6 person1 left", "left"),
        ]
        assert all(list(t.frame_index) == list(range(20703, 20711)) for t in tracks)


def test_a_folder_of_unrelated_files(call, made, elsewhere):
    os.makedirs("clips/deep")
    for name in ("one.npz", "deep/two.npz", "deep/one.npz"):
        shutil.copy(made.short, f"clips/{name}")
    status, out, _ = call("track", "clips")
    assert status == 0
    names = {"clips-one.mcap", "two.mcap", "deep-one.mcap"}
    assert files(Path("recordings/clips")) == names
    assert out.splitlines()[-1].endswith("-> 3 files in recordings/clips")
    assert "overall" in out
    assert call("track", "clips", "-o", "out", "--rrd", "shown")[0] == 0
    assert files(Path("out")) == names
    assert {n.replace(".rrd", ".mcap") for n in files(Path("shown"))} == names
    assert call("track", "clips", "-o", "all.mcap")[0] == 0
    assert len(ht.read_mcap("all.mcap")) == 3
    # the table of a folder, rows told apart
    status, out, _ = call("stability", "recordings", "--json")
    assert len({row["name"] for row in json.loads(out)["sequences"]}) == 3


def test_a_hand_that_is_hardly_seen_does_not_stop_the_others(call, made):
    hidden = made.content["joints_m"].copy()
    hidden[:, 4:] = np.nan
    os.mkdir("clips")
    np.savez("clips/hidden.npz", **made.content | {"joints_m": hidden, "name": "hidden"})
    shutil.copy(made.short, "clips")
    status, out, err = call("track", "clips", "-o", "out")
    assert status == 0
    assert "sample" in out
    assert re.fullmatch(r"warning: hidden: left out: .* no frame could be fitted: .*\n", err)
    assert files(Path("out")) == {"short.mcap"}
    status, out, err = call("track", "clips/hidden.npz", "-o", "out.mcap")
    assert (status, out) == (1, "")
    assert err == (
        "error: clips/hidden.npz: no frame could be fitted: 4 of 21 joints observed, 6 needed\n"
    )
    assert not Path("out.mcap").exists()


def test_a_bar_on_a_terminal(call, made, monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    seen = []
    update = cli_progress._Bar.frames
    monkeypatch.setattr(
        cli_progress._Bar, "frames", lambda bar, n: (seen.append(bar._before + n), update(bar, n))
    )
    status, _, err = call("track", made.panoptic, "-o", "a.mcap")
    assert status == 0
    assert "tracking" in err
    assert seen == sorted(seen)
    assert seen[-1] == 4 * 12


def test_track_fits_the_users_mano(sample_file, tmp_path, capsys):
    """Free stand-ins for MANO's files; what is licensed does not land in the recording."""
    with (tmp_path / "MANO_RIGHT.pkl").open("wb") as file:
        make_mano_like.write_pickle(make_mano_like.make_mano_like("right"), file)
    out = tmp_path / "out.mcap"
    where = ["track", str(sample_file), "-o", str(out), "--frames", "0:20", "-q", "--overwrite"]
    assert run([*where, "--mano", str(tmp_path)]) == 0
    (track,) = ht.read_mcap(out)
    assert track.model.name == "mano"
    assert track.model.licensed
    assert not len(track.model.rest_vertices)
    # the subject's shape is found in MANO's own shape space, and kept
    assert np.count_nonzero(track.model.shape) == 10
    again = ["retrack", str(out), "-o", str(tmp_path / "again.mcap"), "-q", "--mano", str(tmp_path)]
    again.append("--overwrite")
    for calibrate in ([], ["--calibrate"]):
        assert run([*again, *calibrate]) == 0
        (tracked,) = ht.read_mcap(tmp_path / "again.mcap")
        assert np.abs(tracked.model.shape - track.model.shape).max() < 1e-9
        assert np.nanmax(np.abs(tracked.angles - track.angles)) < 1e-6
    assert run([*where, "--mano", str(tmp_path), "--no-calibrate"]) == 0
    assert not len(ht.read_mcap(out)[0].model.shape)
    assert run([*where, "--mano", str(tmp_path), "--hand", "left"]) == 2
    assert "MANO_LEFT.pkl" in capsys.readouterr().err
    (tmp_path / "MANO_RIGHT.pkl").write_bytes(b"cos\nsystem\n(S'true'\ntR.")
    assert run([*where, "--mano", str(tmp_path)]) == 2
    assert "asks for os.system" in capsys.readouterr().err


def test_track_fits_a_hand_of_gltf(sample_file, tmp_path, capsys):
    from glb_files import write_glb

    write_glb(tmp_path / "right.glb", ht.HandModel.default("right"))
    out = tmp_path / "out.mcap"
    where = ["track", str(sample_file), "-o", str(out), "--frames", "0:20", "-q", "--overwrite"]
    assert run([*where, "--gltf", str(tmp_path)]) == 0
    (track,) = ht.read_mcap(out)
    assert track.model.name == "gltf"
    assert run([*where, "--gltf", str(tmp_path), "--mano", str(tmp_path)]) == 2
    assert "name two hands" in capsys.readouterr().err
    assert run([*where, "--gltf", str(sample_file)]) == 2
    assert "no glTF" in capsys.readouterr().err


def test_landmarks_in_a_picture_are_fitted_there(call, tmp_path):
    model = ht.HandModel.default("right")
    x = np.add(model.joints(model.mean_angles), [0.0, 0.0, 0.5])
    seen = np.tile(x[:, :2] / x[:, 2:] * 500 + [320, 240], (3, 1, 1))
    np.save(tmp_path / "a.npy", seen)
    status, _, err = call("track", tmp_path / "a.npy", "-o", "a.mcap")
    assert status == 2
    assert "--image-size WxH" in err
    view = ("--image-size", "640x480", "--fov", "65.2")
    status, _, err = call("track", tmp_path / "a.npy", *view, "--hand", "right", "-o", "a.mcap")
    assert status == 0, err
    assert "does not determine depth (median 0.5" in err
    (track,) = ht.read_mcap("a.mcap")
    assert track.settings["cameras"]["from"] == "landmarks in pictures"
    assert track.settings["cameras"]["lens"] == "65.2 degrees"
    assert track.settings["cameras"]["reprojection_px"]["median"] < 1
    # what is there is refused before the work, not after it
    again = call("track", tmp_path / "a.npy", *view, "--hand", "right", "-o", "a.mcap")
    said = (
        "error: a.mcap is there already: --overwrite replaces it, -o and --rrd give other names\n"
    )
    assert again == (2, "", said)
