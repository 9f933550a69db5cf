"""The command line as people and scripts use it: outputs, messages, exit status."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import urllib.request
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import progress as cli_progress
from handtrack.cli import run
from tools.make import mano_like as make_mano_like
from tools.make import panoptic as make_panoptic

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "tests" / "hand")]


SPREAD = {"mean", "std", "median", "p95", "max"}
ROW = {
    *("name", "hand", "frames", "fitted", "predicted", "lost", "against"),
    *("pa_mpjpe_mm", "mpjpe_mm", "jitter_m_s3", "acceleration_m_s2"),
}


@pytest.fixture(scope="module")
def made(tmp_path_factory, sample_file) -> SimpleNamespace:
    """Inputs and recordings that many tests read."""
    folder = tmp_path_factory.mktemp("made")
    with np.load(sample_file) as file:
        content = dict(file)
    short = folder / "short.npz"
    part = {k: v[:40] if np.ndim(v) and len(v) == 300 else v for k, v in content.items()}
    np.savez(short, **part)
    truth, joints = make_panoptic.make(frames=12, noise_mm=2.0, people=2)
    make_panoptic.write(folder / "171204_pose6", joints)
    make_panoptic.write_truth(folder / "truth", truth)
    with tarfile.open(folder / "171204_pose6.tar.gz", "w:gz") as archive:
        archive.add(folder / "171204_pose6", "171204_pose6")
    recording = folder / "short.mcap"
    assert run(["track", str(short), "-o", str(recording), "-q"]) == 0
    return SimpleNamespace(
        folder=folder,
        content=part,
        short=str(short),
        recording=str(recording),
        panoptic=str(folder / "171204_pose6"),
        archive=str(folder / "171204_pose6.tar.gz"),
        truth=str(folder / "truth"),
    )


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch) -> Path:
    """Every test starts in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def call(capsys):
    """call(...) -> (exit status, stdout, stderr)"""

    def made(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = run([str(a) for a in arguments])
        return status, *capsys.readouterr()

    return made


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


# --- track


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
    assert call("track", made.short)[0] == 0
    assert files(elsewhere) == {"recordings/short.mcap"}
    assert call("track", made.panoptic, "--no-mesh")[0] == 0
    assert call("track", Path(made.panoptic) / "hdHand3d", "--no-mesh", "--rrd", "x.rrd")[0] == 0
    assert call("track", made.archive, "--no-mesh", "--rrd", "shown")[0] == 0
    expected = {"short.mcap", "171204_pose6.mcap"}
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
    told = {"outputs", "frames_per_second", "warnings", "not_measured"}
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
    status, out, err = call("track", "bare.npz", "-q", "--json")
    assert (status, err) == (0, "")
    assert len(json.loads(out)["warnings"]) == 2
    status, out, err = call("track", "bare.npz")
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
    options = ("--frames", "20703:20710", "--hand", "left", "-o", "left.mcap")
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


# --- stability


def test_stability_prints_what_track_printed(call, made):
    _, tracked, _ = call("track", made.short, "-o", "a.mcap")
    status, out, err = call("stability", "a.mcap")
    assert (status, err) == (0, "")
    assert tracked.startswith(out)


def test_stability_json_has_the_agreed_shape(call, made):
    status, out, err = call("stability", made.recording, "--json")
    assert (status, err) == (0, "")
    result = json.loads(out)
    assert list(result) == ["sequences", "overall"]
    for row in (*result["sequences"], result["overall"]):
        assert set(row) >= ROW
        assert set(row["pa_mpjpe_mm"]) == set(row["mpjpe_mm"]) == SPREAD
        numbers = [*row["pa_mpjpe_mm"].values(), *row["mpjpe_mm"].values()]
        numbers += [row["jitter_m_s3"], row["acceleration_m_s2"]]
        assert all(isinstance(n, float) and n > 0 for n in numbers)
        assert row["frames"] == row["fitted"] + row["predicted"] + row["lost"] == 40
    assert result["sequences"][0]["against"] == "truth"


def test_stability_against_the_observed_joints(call, made):
    bare = {k: v for k, v in made.content.items() if "truth" not in k}
    np.savez("bare.npz", **bare)
    call("track", "bare.npz", "-o", "bare.mcap")
    _, out, _ = call("stability", "bare.mcap", "--json")
    assert json.loads(out)["overall"]["against"] == "observed"
    _, out, _ = call("stability", "bare.mcap")
    assert "This is not accuracy" in out


def test_stability_of_estimates_against_a_truth(call, made):
    """A recording's output is measured, not its input; of the truth's file its truth."""
    _, out, _ = call("stability", made.recording, "--truth", made.short, "--json")
    pair = json.loads(out)["overall"]
    _, out, _ = call("stability", made.recording, "--json")
    own = json.loads(out)["overall"]
    assert pair["pa_mpjpe_mm"]["mean"] == pytest.approx(own["pa_mpjpe_mm"]["mean"], abs=1e-6)
    _, out, _ = call("stability", made.short, "--truth", made.short, "--json")
    raw = json.loads(out)["overall"]
    assert raw["pa_mpjpe_mm"]["mean"] == pytest.approx(own["input_pa_mpjpe_mm"]["mean"], abs=1e-6)
    _, out, _ = call(
        "stability", made.recording, "--truth", made.short, "--frames", "10:19", "--json"
    )
    assert json.loads(out)["overall"]["frames"] == 10


def test_stability_pairs_hands_by_name(call, made):
    call("track", made.panoptic, "-o", "p.mcap")
    status, out, _ = call("stability", "p.mcap", "--truth", made.truth, "--json")
    assert status == 0
    rows = json.loads(out)["sequences"]
    assert len(rows) == 4
    assert all(row["against"] == "truth" and row["pa_mpjpe_mm"]["mean"] < 2.5 for row in rows)
    status, out, _ = call(
        "stability", made.panoptic, "--truth", made.truth, "--hand", "left", "--json"
    )
    assert (status, len(json.loads(out)["sequences"])) == (0, 2)
    status, _, err = call("stability", made.short, "--truth", made.truth)
    assert (status, err) == (
        2,
        f"error: {made.truth}: 0 sequences fit sample (right), expected one\n",
    )


def test_stability_of_files_and_folders(call, made):
    os.makedirs("deep/er")
    shutil.copy(made.recording, "deep/er/b.mcap")
    shutil.copy(made.recording, "a.mcap")
    _, out, _ = call("stability", "a.mcap", "deep", "--json")
    result = json.loads(out)
    assert [row["name"] for row in result["sequences"]] == ["a sample", "b sample"]
    assert result["overall"]["frames"] == 80


def test_stability_compares_methods(call, made):
    call("track", made.short, "-o", "fit.mcap", "-q")
    call("track", made.short, "-o", "rough.mcap", "--no-calibrate", "--limits", "li2021", "-q")
    files_of = ("fit=fit.mcap", "rough=rough.mcap", f"raw={made.short}")
    status, out, err = call(
        *("stability", *files_of, "--csv", "o/a.csv", "--latex", "o/a.tex", "--html", "o/a.html")
    )
    assert (status, err) == (0, "")
    sentence = re.search(r"fit is more accurate than rough: .* difference (-\d\.\d+) \[.*\]", out)
    assert files(Path("o")) == {"a.csv", "a.tex", "a.html"}
    assert sentence[0] in Path("o/a.html").read_text()
    status, out, _ = call("stability", *files_of, "--json")
    content = json.loads(out)
    assert list(content["methods"]) == ["fit", "rough", "raw"]
    (found,) = [
        d
        for d in content["differences"]
        if (d["second"], d["measure"], d["statistic"]) == ("rough", "pa_mpjpe_mm", "mean")
    ]
    assert found["difference"]["value"] == pytest.approx(float(sentence[1]), abs=0.01)
    # the same without names; and the raw joints' error is what the recording calls its input's
    status, out, _ = call("stability", "--compare", "fit.mcap", made.short, "--json")
    again = json.loads(out)
    assert list(again["methods"]) == ["fit", "short"]
    raw = again["common"]["short"]["pa_mpjpe_mm"]["mean"]
    assert raw == pytest.approx(again["common"]["fit"]["input_pa_mpjpe_mm"]["mean"], abs=1e-6)


def test_exported_arrays_are_judged_by_what_was_tracked(call, made):
    call("export", made.recording, "out.npz", "-q")
    rows = []
    for path in (made.recording, "out.npz"):
        _, out, _ = call("stability", path, "--json")
        (row,) = json.loads(out)["sequences"]
        rows.append({k: row[k] for k in ("pa_mpjpe_mm", "input_pa_mpjpe_mm", "lost", "against")})
    assert rows[0]["pa_mpjpe_mm"] == pytest.approx(rows[1]["pa_mpjpe_mm"], abs=1e-4)
    assert rows[0]["lost"] == rows[1]["lost"]
    assert rows[1]["input_pa_mpjpe_mm"]["mean"] > rows[1]["pa_mpjpe_mm"]["mean"]
    assert call("stability", "out.npz", "--frames", "5:9", "--truth", made.short)[0] == 0


def test_the_papers_sequence(call, made):
    """The two commands of the README, on a folder made from known motion."""
    frames = ("--frames", "20701:20712", "--hand", "right")
    assert call("track", made.panoptic, *frames, "-o", "pose6.mcap", "-q")[0] == 0
    status, out, _ = call("stability", "pose6.mcap")
    assert status == 0
    assert "5.3302   0.4320" in out
    assert "The paper's frames are 20701:20800, these are 20701:20712" in " ".join(out.split())


def test_a_recording_that_was_cut_is_read_as_far_as_it_goes(call, made):
    data = Path(made.recording).read_bytes()
    Path("cut.mcap").write_bytes(data[: len(data) * 2 // 3])
    status, out, err = call("stability", "cut.mcap", "--json")
    assert status == 0
    assert 0 < json.loads(out)["overall"]["frames"] < 40
    assert re.fullmatch(r"warning: cut.mcap: it ends in the middle .* read \d+ whole .*\n", err)


@pytest.mark.parametrize("columns", [80, 160])
def test_the_table_fits_the_terminal(columns, call, made, monkeypatch):
    call("track", made.panoptic, "-o", "p.mcap")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", str(columns))
    _, out, _ = call("stability", "p.mcap", made.recording)
    lines = re.sub(r"\x1b\[[\d;]*m", "", out).splitlines()
    assert max(map(len, lines)) <= columns
    rows = [line for line in lines if "person" in line or line.startswith(" overall")]
    assert len(rows) == 5
    assert all(re.search(r"\d\.\d\d ± \d\.\d\d", row) for row in rows)


# --- replay


def test_replay_saves(call, made, elsewhere):
    status, out, err = call("replay", made.recording, "--save", "deep/out.rrd")
    assert (status, out, err) == (0, f"{made.recording} -> deep/out.rrd\n", "")
    assert call("replay", made.recording, "--save", "small.rrd", "--no-mesh", "-q") == (0, "", "")
    assert files(elsewhere) == {"deep/out.rrd", "small.rrd"}
    assert Path("small.rrd").stat().st_size < Path("deep/out.rrd").stat().st_size / 3


def test_replay_of_several_files_and_folders(call, made):
    os.mkdir("runs")
    shutil.copy(made.recording, "runs/a.mcap")
    shutil.copy(made.recording, "runs/b.mcap")
    status, out, _ = call("replay", "runs", made.recording, "--save", "all.rrd")
    assert (status, out) == (0, f"runs/a.mcap, runs/b.mcap, {made.recording} -> all.rrd\n")


def test_replay_without_a_viewer_fails(call, made, monkeypatch):
    monkeypatch.setenv("RERUN_CLI_PATH", "/usr/bin/false")
    status, out, err = call("replay", made.recording)
    assert (status, out) == (1, "")
    assert re.fullmatch(r"error: the viewer ended with status 1; .* --web .* --save .*\n", err)


@pytest.mark.skipif(sys.platform == "win32", reason="sends SIGINT")
def test_replay_serves_a_page_until_it_is_stopped(made):
    code = (
        "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler);"
        "from handtrack.cli import run; sys.exit(run(sys.argv[1:]))"
    )
    command = [sys.executable, "-c", code, "replay", made.recording, "--web", "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:")
        assert process.stdout.readline() == "Ctrl-C stops the server.\n"
        with urllib.request.urlopen(address, timeout=10) as page:
            assert b"<html" in page.read().lower()
        process.send_signal(signal.SIGINT)
        assert process.wait(15) == 0


# --- bad input: one line, status 2, nothing left


@pytest.fixture
def bad(made, elsewhere):
    """Files that are wrong, each in its own way."""
    content = made.content
    joints = content["joints_m"]

    def save(name: str, **changed: object) -> None:
        np.savez(name, **{k: v for k, v in (content | changed).items() if v is not None})

    def cut(source: str, name: str) -> None:
        data = Path(source).read_bytes()
        Path(name).write_bytes(data[: len(data) // 2])

    os.mkdir("empty")
    Path("wrong.json").write_text('{"joints": [1, }')
    Path("other.json").write_text('{"hello": "world"}')
    Path("nothing.json").write_text("")
    Path("words.txt").write_text("hello\nworld\n")
    cut(made.short, "cut.npz")
    cut(made.archive, "cut.tar.gz")
    cut(made.recording, "cut.mcap")
    save("shape.npz", joints_m=joints[:, :20])
    save("flat.npz", joints_m=joints[..., :2])
    save("missing.npz", joints_m=np.full_like(joints, np.nan))
    shutil.copytree(f"{made.panoptic}/hdHand3d", "frames")
    frame = sorted(Path("frames").iterdir())[5]
    broken = json.loads(frame.read_text())
    del broken["people"][0]["right_hand"]["landmarks"][60:]
    frame.write_text(json.dumps(broken))
    return made


SHORT, RECORDING = "<short>", "<recording>"

BAD = {
    "missing file": (["track", "no.npz"], "no.npz: no such file or folder"),
    "empty folder": (["track", "empty"], "empty: no joint sequence found"),
    "wrong JSON": (["track", "wrong.json"], "wrong.json: wrong JSON: "),
    "JSON of something else": (["track", "other.json"], "other.json: no joints in it"),
    "empty file": (["track", "nothing.json"], "nothing.json: the file is empty"),
    "text": (["track", "words.txt"], "words.txt: no joints in it"),
    "cut .npz": (["track", "cut.npz"], "cut.npz: the .npz file is damaged or cut short"),
    "cut archive": (["track", "cut.tar.gz"], "cut.tar.gz: the archive is damaged or cut short"),
    "cut .mcap": (["track", "cut.mcap"], "cut.mcap: the MCAP file is damaged or cut short"),
    "20 joints": (["track", "shape.npz"], "confidence has shape (40, 21), expected shape (40, 20)"),
    "2 coordinates": (["track", "flat.npz"], "flat.npz: joints_m has shape (40, 21, 2), expected"),
    "60 numbers": (
        ["track", "frames"],
        "frames/handRecon3D_hd00020706.json: person 0: right_hand.landmarks has 60 numbers,"
        " expected 63",
    ),
    "nothing seen": (["track", "missing.npz"], "missing.npz: every joint is missing"),
    "hand of 91 mm in mm": (["track", SHORT, "--unit", "mm"], "unit m would fit"),
    "hand of 91 mm in cm": (["track", SHORT, "--unit", "cm"], "unit m would fit"),
    "unknown unit": (["track", SHORT, "--unit", "km"], "'km' is not one of 'm', 'cm', 'mm'"),
    "unknown order": (["track", SHORT, "--order", "x"], "unknown joint order 'x', expected one of"),
    "order of 26": (["track", SHORT, "--order", "openxr"], "21 joints, the order openxr has 26"),
    "unknown hand": (["track", SHORT, "--hand", "both"], "'both' is not one of"),
    "unknown filter": (["track", SHORT, "--filter", "x"], "'x' is not one of 'none', 'kalman'"),
    "unknown limits": (["track", SHORT, "--limits", "x"], "'x' is not one of 'anatomical'"),
    "unknown update": (["track", SHORT, "--update", "x"], "'x' is not one of 'exact', 'li2021'"),
    "fps of 0": (["track", SHORT, "--fps", "0"], "fps is 0, expected a number above 0"),
    "fps of words": (["track", SHORT, "--fps", "x"], "'x' is not a valid float"),
    "no range": (["track", SHORT, "--frames", "5"], "--frames 5 is no range, expected A:B"),
    "range of words": (["track", SHORT, "--frames", "a:b"], "--frames a:b is no range"),
    "range backwards": (["track", SHORT, "--frames", "9:2"], "--frames 9:2 is no range"),
    "no such frames": (["track", SHORT, "--frames", "900:910"], "no joint in frames 900:910"),
    "output of another kind": (["track", SHORT, "-o", "a.rrd"], "expected a name that ends in .mc"),
    "rrd of another kind": (
        ["track", SHORT, "--rrd", "a.mcap"],
        "expected a name that ends in .rr",
    ),
    "output in a file": (["track", SHORT, "-o", "words.txt/a.mcap"], "words.txt is no folder"),
    "rrd in a file": (["track", SHORT, "--rrd", "words.txt/a.rrd"], "words.txt is no folder"),
    "lag of another filter": (
        ["track", SHORT, "--filter", "kalman", "--lag", "3"],
        "--lag belongs to --filter fixed-lag, not to kalman",
    ),
    "no input": (["track"], "Missing argument 'INPUT...'"),
    "two inputs": (["track", SHORT, SHORT], "they need --camera"),
    "unknown command": (["dance"], "No such command 'dance'"),
    "unknown option": (["track", SHORT, "--nice"], "No such option"),
    "no recording": (["stability", "no.mcap"], "no.mcap: no such file or folder"),
    "folder without recordings": (["stability", "empty"], "empty: no joint sequence found"),
    "words for a recording": (["stability", "words.txt"], "words.txt: "),
    "no files": (["stability"], "Missing argument '[NAME=]FILE...'"),
    "no truth": (["stability", RECORDING, "--truth", "no.npz"], "no.npz: no such file"),
    "frames that are not there": (
        ["stability", RECORDING, "--frames", "900:910"],
        "no frame in 900:910, the recording has 0:39",
    ),
    "unit of a recording": (["stability", RECORDING, "--unit", "mm"], "are for joint files"),
    "one method": (["stability", "--compare", RECORDING], "only one"),
    "a name and none": (["stability", "a=x.mcap", RECORDING], "has no name, others have"),
    "html of another kind": (["stability", RECORDING, "--html", "a.htm"], "ends in .html"),
    "truth of another hand": (
        ["stability", RECORDING, "--truth", "other_hand.npz"],
        "a right hand against a left one",
    ),
    "nothing to replay": (["replay", "no.mcap"], "no.mcap: no such file or folder"),
    "folder without replays": (["replay", "empty"], "empty: no .mcap recording in this folder"),
    "joints for a replay": (["replay", SHORT, "--save", "a.rrd"], "not an MCAP file"),
    "replay into another kind": (["replay", RECORDING, "--save", "a.mcap"], "ends in .rrd"),
    "save and web": (["replay", RECORDING, "--save", "a.rrd", "--web"], "choose one"),
    "port of a window": (["replay", RECORDING, "--port", "9000"], "belong to --web"),
    "port 0": (["replay", RECORDING, "--web", "--port", "0"], "0 is not in the range"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_one_line_and_status_2(case, bad, call, elsewhere):
    if "other_hand" in str(BAD[case]):
        mirrored = bad.content["joints_m"] * np.float32([-1, 1, 1])
        content = {k: v for k, v in bad.content.items() if "truth" not in k}
        np.savez("other_hand.npz", **content | {"joints_m": mirrored, "hand": "left"})
    arguments, message = BAD[case]
    stand_for = {SHORT: bad.short, RECORDING: bad.recording}
    arguments = [stand_for.get(a, a) for a in arguments]
    if arguments[:1] == ["track"]:
        for option, name in (("-o", "out/out.mcap"), ("--rrd", "out/out.rrd")):
            arguments += [] if option in arguments else [option, name]
    before = files(elsewhere)
    status, out, err = call(*arguments)
    assert status == 2
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("error: ")
    assert message in err
    assert files(elsewhere) == before


def test_damage_in_a_recording_is_told(call, made):
    data = bytearray(Path(made.recording).read_bytes())
    data[len(data) // 2] ^= 0xFF
    Path("hit.mcap").write_bytes(data)
    for arguments in (["stability"], ["track", "-o", "a.mcap"], ["replay", "--save", "a.rrd"]):
        status, out, err = call(arguments[0], "hit.mcap", *arguments[1:])
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert err.startswith("error: hit.mcap: ")
        assert "damaged" in err
    assert not list(Path().glob("a.*"))


# --- jobs that fail: status 1


@pytest.mark.skipif(sys.platform == "win32", reason="needs resource limits")
def test_a_full_disk_leaves_nothing_half_written(made, elsewhere):
    """The .mcap fits, the .rrd does not; then neither does, and the old .mcap stays."""
    import resource

    fits = int(Path(made.recording).stat().st_size * 1.1)

    outputs = ("-o", "a.mcap", "--rrd", "a.rrd")

    def track(most: int) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [sys.executable, "-m", "handtrack", "track", made.short, *outputs],
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
            capture_output=True,
            text=True,
        )

    done = track(fits)
    assert done.returncode == 1
    assert done.stderr == "error: a.rrd: cannot be written: File too large\n"
    assert files(elsewhere) == {"a.mcap"}
    (whole,) = ht.read_mcap("a.mcap")
    assert len(whole) == 40
    done = track(fits // 3)
    assert done.returncode == 1
    assert done.stderr.startswith("error: a.mcap: cannot be written: File too large; a.mcap.part")
    assert done.stderr.count("\n") == 1
    # the old one stays, and what was written of the new one is not lost
    assert files(elsewhere) == {"a.mcap", "a.mcap.part"}
    assert len(ht.read_mcap("a.mcap")[0]) == 40
    with pytest.warns(UserWarning, match=r"a\.mcap\.part"):
        (part,) = ht.read_mcap("a.mcap.part")
    assert 0 < len(part) < 40


@pytest.mark.skipif(hasattr(os, "geteuid") and os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_may_not_be_written_to(call, made):
    os.mkdir("locked", 0o500)
    status, _, err = call("track", made.short, "-o", "locked/a.mcap")
    assert (status, "no permission" in err) == (2, True)


def test_ctrl_c_is_one_line(call, made, monkeypatch):
    def interrupted(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("handtrack.recording.write.RecordingWriter.add", interrupted)
    status, out, err = call("track", made.short, "-o", "a.mcap")
    assert (status, out) == (1, "")
    assert err.strip() == "stopped"
    assert not list(Path().glob("a.mcap*"))


@pytest.mark.skipif(sys.platform == "win32", reason="pipes differ")
def test_a_reader_that_leaves_is_no_error(made):
    read, write = os.pipe()
    os.close(read)
    done = subprocess.run(
        [sys.executable, "-m", "handtrack", "stability", made.recording, "--json"],
        stdout=write,
        stderr=subprocess.PIPE,
        text=True,
    )
    os.close(write)
    assert (done.returncode, done.stderr) == (1, "")


# --- the program


def test_help(call):
    status, out, _ = call()
    assert status == 0
    for name in ("track", "replay", "stability"):
        assert re.search(rf"^  {name} +\S", out, re.MULTILINE)
        status, text, _ = call(name, "--help")
        assert status == 0
        assert text.startswith(f"Usage: handtrack {name} ")
    assert "..." not in out.partition("Commands:")[2]
    assert call("-h")[1] == call("--help")[1] == out
    assert call("--version")[1] == f"handtrack, version {ht.__version__}\n"


@pytest.mark.parametrize("program", [["handtrack"], [sys.executable, "-m", "handtrack"]])
def test_the_program_itself(program, made, elsewhere):
    if program == ["handtrack"]:
        script = shutil.which("handtrack", path=str(Path(sys.executable).parent))
        if script is None:
            pytest.skip("the console script is not installed beside this Python")
        program = [script]
    done = subprocess.run(
        [*program, "track", made.short, "--json"],
        capture_output=True,
        text=True,
        stdin=subprocess.DEVNULL,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["outputs"] == ["recordings/short.mcap"]
    assert files(elsewhere) == {"recordings/short.mcap"}
    done = subprocess.run([*program, "track", "no.npz"], capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "error: no.npz: no such file or folder\n"


def test_compiling_is_said_once_and_only_when_it_happens(capsys):
    import numba

    with cli_progress.compiling_said(quiet=False):
        pass
    assert capsys.readouterr() == ("", "")
    with cli_progress.compiling_said(quiet=False):
        for _ in range(2):
            assert numba.njit(lambda x: x + 1)(1) == 2
    assert capsys.readouterr() == ("", f"{cli_progress.COMPILING}\n")
    with cli_progress.compiling_said(quiet=True):
        assert numba.njit(lambda x: x + 2)(1) == 3
    assert numba.njit(lambda x: x + 3)(1) == 4
    assert capsys.readouterr() == ("", "")


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
    where = ["track", str(sample_file), "-o", str(out), "--frames", "0:20", "-q"]
    assert run([*where, "--mano", str(tmp_path)]) == 0
    (track,) = ht.read_mcap(out)
    assert track.model.name == "mano"
    assert track.model.licensed
    assert not len(track.model.rest_vertices)
    # the subject's shape is found in MANO's own shape space, and kept
    assert np.count_nonzero(track.model.shape) == 10
    again = ["retrack", str(out), "-o", str(tmp_path / "again.mcap"), "-q", "--mano", str(tmp_path)]
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
    where = ["track", str(sample_file), "-o", str(out), "--frames", "0:20", "-q"]
    assert run([*where, "--gltf", str(tmp_path)]) == 0
    (track,) = ht.read_mcap(out)
    assert track.model.name == "gltf"
    assert run([*where, "--gltf", str(tmp_path), "--mano", str(tmp_path)]) == 2
    assert "name two hands" in capsys.readouterr().err
    assert run([*where, "--gltf", str(sample_file)]) == 2
    assert "no glTF" in capsys.readouterr().err
