"""Bad input is one line and status 2; what was written is not lost."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cli_cases import files

import handtrack as ht

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "hand")]

pytestmark = pytest.mark.usefixtures("elsewhere")


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
    Path("-dash.txt").write_text("hello\n")
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
    "empty output": (["track", SHORT, "-o", ""], "what follows -o is empty: is a variable of"),
    "empty input": (["track", "", "-o", "a.mcap"], "what follows the command is empty"),
    "a dash": (["track", "-", "-o", "a.mcap"], "`handtrack live --stdin` reads joints from"),
    "a dash to write to": (["track", SHORT, "-o", "-"], "- is no file here"),
    "a name with a dash": (["track", "-dash.txt", "-o", "a.mcap"], "./-dash.txt means the file"),
    "no value": (["track", SHORT, "--filter"], "`handtrack track --help` tells more"),
    "a long name": (["track", SHORT, "-o", f"{'x' * 300}.mcap"], "File name too long"),
    "a long input": (["info", "x" * 300], "File name too long"),
    "skin and none": (
        ["track", SHORT, "-o", "a.mcap", "--mesh", "full", "--no-mesh"],
        "--no-mesh and --mesh full: choose one",
    ),
    "tips of no MANO": (
        ["track", SHORT, "-o", "a.mcap", "--mano-tips", "manopth"],
        "--mano-tips are of --mano: give both",
    ),
    "no hand to batch": (
        ["batch", SHORT, "-o", "out", "--hand-model", "no.json"],
        "no.json: no such file or folder",
    ),
    "shown and not": (
        ["live", "--stdin", "--no-view", "--connect", "127.0.0.1:9876"],
        "--no-view opens no viewer and --connect sends to one: choose one",
    ),
    "a companion of nothing": (
        ["track", SHORT, "-o", "a.mcap", "--markers", "words.txt"],
        "nothing in it takes --markers",
    ),
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
    "2 coordinates": (
        ["track", "flat.npz"],
        "flat.npz: only x and y of each joint: positions in a picture",
    ),
    "60 numbers": (
        ["track", "frames"],
        "frames/handRecon3D_hd00020706.json: person 0: right_hand.landmarks has 60 numbers,"
        " expected 63",
    ),
    "nothing seen": (["track", "missing.npz"], "missing.npz: every joint is missing"),
    "hand of 91 mm in mm": (["track", SHORT, "--unit", "mm"], "unit m would fit"),
    "hand of 91 mm in cm": (["track", SHORT, "--unit", "cm"], "unit m would fit"),
    "no configuration": (
        ["track", SHORT, "--config", "nothing.json"],
        "nothing.json: there is no option in it, expected a table for each command",
    ),
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
    "spread of no robust loss": (
        ["track", SHORT, "--spread-mm", "5"],
        "--spread-mm belongs to --robust huber or geman-mcclure, not to none",
    ),
    "coupling of no filter": (
        ["track", SHORT, "--filter", "one-euro", "--no-couple"],
        "--no-couple belongs to --filter kalman, fixed-lag or rts, not to one-euro",
    ),
    "process noise of no filter": (
        ["batch", SHORT, "-o", "out", "--process-noise", "2"],
        "--process-noise belongs to --filter kalman, fixed-lag or rts, not to none",
    ),
    "one of two truths": (
        ["stability", RECORDING, "--truth", SHORT, "--truth", SHORT],
        "--truth is given 2 times and takes one value: give it once",
    ),
    "one of two outputs": (
        ["track", SHORT, "-o", "a.mcap", "--output", "b.mcap"],
        "--output is given 2 times and takes one value: give it once",
    ),
    "a column of no manifest": (
        ["batch", SHORT, "-o", "out", "--column", "action"],
        "--column action: columns are a manifest's, and",
    ),
    "columns of arrays": (
        ["track", SHORT, "--columns", "1:63"],
        "--columns is for text tables; .npz, HDF5 and JSON have --key",
    ),
    "columns of JSON": (["track", "other.json", "--columns", "1:63"], "--columns is for text tab"),
    "no input": (["track"], "Missing argument 'INPUT...'"),
    "two inputs": (["track", "cut.npz", "words.txt"], "nothing to track in 2 inputs: cut.npz: "),
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
    "results in a file": (
        ["batch", SHORT, "-o", "words.txt"],
        "words.txt is a file, expected a fo",
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


@pytest.mark.skipif(sys.platform == "win32", reason="needs resource limits")
def test_a_full_disk_leaves_nothing_half_written(made, elsewhere):
    """The .mcap fits, the .rrd does not; then neither does, and the old .mcap stays."""
    import resource

    fits = int(Path(made.recording).stat().st_size * 1.1)

    outputs = ("-o", "a.mcap", "--rrd", "a.rrd", "--overwrite")

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


PHASES = {
    "read": "handtrack.sequences.load.read_file",
    "calibrate": "handtrack.calibration.bundle._step",
    "fit": "handtrack.tracking.sequence_track._blocks",
    "write": "handtrack.recording.write.RecordingWriter.add",
    "write the end": "handtrack.recording.write.RecordingWriter.finish",
    "write .rrd": "handtrack.viewer.rerun_log.save_hands",
    "print": "handtrack.evaluation.report.print_table",
}
"""Where `track` is when Ctrl-C comes."""


@pytest.mark.filterwarnings("ignore:a.mcap.part")
@pytest.mark.parametrize("phase", PHASES)
def test_ctrl_c_is_one_line(phase, call, made, monkeypatch):
    """And leaves recordings that can be read, or none."""
    came = []

    def interrupted(*_: object, **__: object) -> None:
        came.append(phase)
        raise KeyboardInterrupt

    monkeypatch.setattr(PHASES[phase], interrupted)
    status, out, err = call("track", made.short, "-o", "a.mcap", "--rrd", "a.rrd")
    assert (status, out, came) == (130, "", [phase])
    *_, last = err.splitlines()
    assert last == "stopped"
    assert "Traceback" not in err
    left = {path.name for path in Path().glob("a.*")}
    assert left <= {"a.mcap", "a.mcap.part"} | ({"a.rrd"} if phase == "print" else set())
    for name in left - {"a.rrd"}:
        assert len(ht.read_mcap(name)[0]) == 40


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
    assert (done.returncode, done.stderr) == (141, "")
