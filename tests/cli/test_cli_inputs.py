"""What `track` takes, file by file, and what it does not write over."""

from __future__ import annotations

import json
import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run

sys.path.append(str(Path(__file__).resolve().parents[1] / "video"))


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch) -> Path:
    """Every test starts in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="session")
def clip(sample, tmp_path_factory) -> Path:
    """Twenty frames of the sample."""
    path = tmp_path_factory.mktemp("clip") / "take.npz"
    np.savez(path, joints_m=sample.joints[:20], fps=30.0, hand="right")
    return path


def recordings(folder: str | Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in Path(folder).rglob("*.mcap")}


def test_inputs_of_the_same_name_get_recordings_of_their_own(call, clip):
    for folder in ("a", "b", "b/deep"):
        os.makedirs(folder)
        shutil.copy(clip, folder)
        assert call("track", f"{folder}/take.npz", "-q") == (0, "", "")
    assert recordings("recordings") == {"a-take.mcap", "b-take.mcap", "b-deep-take.mcap"}


WRITES = {
    "track": (["track", "{clip}", "-o", "out.mcap"], "out.mcap"),
    "track by default": (["track", "take.npz"], "recordings/take.mcap"),
    "rrd": (["track", "{clip}", "-o", "new.mcap", "--rrd", "out.rrd"], "out.rrd"),
    "folder": (["track", "{clip}", "-o", "out"], "out/take.mcap"),
    "retrack": (["retrack", "{mcap}", "-o", "out.mcap"], "out.mcap"),
    "recover": (["recover", "{mcap}", "-o", "out.mcap"], "out.mcap"),
    "calibrate": (["calibrate", "{clip}"], "hand.json"),
    "export": (["export", "{mcap}", "out.csv"], "out.csv"),
    "export to a folder": (["export", "{mcap}", "out", "--to", "npz"], "out/made.npz"),
    "replay": (["replay", "{mcap}", "--save", "out.rrd"], "out.rrd"),
    "csv": (["stability", "{mcap}", "--csv", "out.csv"], "out.csv"),
    "html": (["stability", "{mcap}", "--html", "out.html"], "out.html"),
    "latex": (["stability", "{mcap}", "--latex", "out.tex"], "out.tex"),
    "live": (["live", "--udp", "0", "-o", "out.mcap"], "out.mcap"),
    "detect": (["detect", "seen.png", "-o", "out.npz"], "out.npz"),
}


@pytest.fixture(scope="session")
def mcap(clip, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("mcap") / "made.mcap"
    assert run(["track", str(clip), "-o", str(path), "-q"]) == 0
    return path


@pytest.mark.parametrize("case", WRITES)
def test_what_is_there_stays_unless_told(case, call, clip, mcap):
    arguments, name = WRITES[case]
    shutil.copy(clip, "take.npz")
    Path("seen.png").write_bytes(b"\x89PNG\r\n\x1a\n")  # not looked into before the target
    Path(name).parent.mkdir(exist_ok=True)
    Path(name).write_text("mine")
    arguments = [a.format(clip=clip, mcap=mcap) for a in arguments]
    status, out, err = call(*arguments)
    assert (status, out, Path(name).read_text()) == (2, "", "mine")
    assert err.startswith(f"error: {name} is there already: --overwrite replaces it, ")
    assert err.count("\n") == 1
    if arguments[0] not in ("live", "detect"):
        assert call(*arguments, "--overwrite")[0] == 0
        assert Path(name).read_bytes()[:4] != b"mine"


def test_a_second_live_session_keeps_the_first(call, monkeypatch):
    from handtrack.cli import live

    names = []
    for _ in range(3):
        path = live._free_name()
        names.append(str(path))
        path.parent.mkdir(exist_ok=True)
        path.touch()
    assert names == [f"recordings/{n}.mcap" for n in ("live", "live-2", "live-3")]


def test_several_inputs_and_patterns(call, clip):
    for name in ("a", "b"):
        os.mkdir(name)
        shutil.copy(clip, name)
    status, out, err = call("track", "a/take.npz", "b/take.npz", "-o", "out")
    assert (status, err) == (0, "")
    assert recordings("out") == {"a-take.mcap", "b-take.mcap"}
    assert "wrote out/a-take.mcap\nwrote out/b-take.mcap\n" in out
    # a pattern that no shell expanded; the same file named twice is one
    assert call("track", "?/*.npz", "a/take.npz", "-o", "all.mcap", "-q") == (0, "", "")
    assert len(ht.read_mcap("all.mcap")) == 2


def test_a_mixed_folder_is_told_file_by_file(call, clip):
    os.mkdir("mix")
    shutil.copy(clip, "mix/one.npz")
    Path("mix/cut.npz").write_bytes(clip.read_bytes()[:900])
    Path("mix/words.txt").write_text("hello\n")
    Path("mix/paper.pdf").write_bytes(b"%PDF")
    Path("mix/README.md").write_text("passed over")
    status, _, err = call("track", "mix", "-o", "out")
    # a damaged file is a failure, what never was joints is none
    assert status == 1
    assert recordings("out") == {"one.mcap"}
    told = [line.split(": ")[0] for line in err.splitlines()]
    assert told == [f"skipped mix/{name}" for name in ("paper.pdf", "cut.npz", "words.txt")]
    os.remove("mix/cut.npz")
    status, out, _ = call("track", "mix", "-o", "out", "--overwrite", "--json")
    assert status == 0
    skipped = json.loads(out)["skipped"]
    assert [skip["input"] for skip in skipped] == ["mix/paper.pdf", "mix/words.txt"]
    assert skipped[1]["reason"].startswith("no joints in it")
    # of named inputs the one that cannot be read does not stop the other
    status, _, err = call("track", "mix/words.txt", "mix/one.npz", "-o", "two")
    assert (status, recordings("two")) == (1, {"one.mcap"})
    assert err.startswith("skipped mix/words.txt: no joints in it")


class TestPictures:
    """Videos and images, with a stand-in for MediaPipe."""

    @pytest.fixture(autouse=True)
    def detector(self, monkeypatch):
        pytest.importorskip("av", reason="the extra video is not installed")
        from clips import Told, seen

        # each picture shows both hands, far from where they were in the one before
        both = [[seen("left", 100 + 40 * i), seen("right", 400 - 40 * i)] for i in range(6)]
        told = lambda *_, **__: Told(*both[:4])  # noqa: E731
        monkeypatch.setattr("handtrack.video.detections.MediaPipeDetector", told)

    def test_folders_of_videos_beside_joints(self, call, clip):
        from clips import write_video

        os.mkdir("mix")
        shutil.copy(clip, "mix/one.npz")
        for name in ("mix/a.mp4", "mix/b.mp4"):
            write_video(Path(name), [0, 33, 67, 100])
        assert call("track", "mix", "-q") == (0, "", "")
        names = {"a.mcap", "b.mcap", "one.mcap"}
        assert recordings("recordings") == {f"mix/{name}" for name in names}
        assert [t.hand for t in ht.read_mcap("recordings/mix/a.mcap")] == ["left", "right"]

    def test_images_are_unrelated_pictures(self, call):
        """Nothing is put back or left out for its motion from one picture to the next."""
        from clips import write_image

        os.mkdir("images")
        for i in range(4):
            write_image(Path(f"images/{i}.png"), 100)
        status, _, err = call("track", "images", "-o", "out.mcap")
        assert status == 0
        for line in err.splitlines():
            assert "fitted to its joints and its picture" in line or "the lens is assumed" in line
        tracks = ht.read_mcap("out.mcap")
        assert [t.hand for t in tracks] == ["left", "right"]
        assert all((t.status == "fitted").all() for t in tracks)
        assert tracks[0].settings["gate"] is False
        # with a rate they are a clip's
        assert call("track", "images", "-o", "clip.mcap", "--fps", "30", "-q")[0] == 0
        assert ht.read_mcap("clip.mcap")[0].settings["gate"] is True

    def test_many_images_beside_other_files_are_not_looked_at(self, call, clip):
        from clips import write_image

        os.mkdir("mix")
        shutil.copy(clip, "mix/one.npz")
        for i in range(21):
            write_image(Path(f"mix/{i}.png"), 100)
        status, _, err = call("track", "mix", "-o", "out")
        assert (status, recordings("out")) == (0, {"one.mcap"})
        assert "one of many images beside other files" in err
        assert "skipped 1 more" in err
