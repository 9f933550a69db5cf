"""README and site: what they tell people to type runs as it stands, what they say is so."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import landmark_files
import numpy as np
import pytest
from documents_of import DOCUMENTS, ROOT, SITE, Block, blocks

import handtrack as ht
from handtrack.cli import COMMANDS, run
from tools.docs import readme
from tools.make import mano_like as make_mano_like
from tools.make import panoptic as make_panoptic

WORDS = 1200
"""At most so many in the README."""


def commands(block: Block) -> list[str]:
    """The lines that people type, without what explains them."""
    joined = block.text.replace("\\\n", " ")
    return [re.sub(r"\s+# .*", "", line[2:]) for line in joined.splitlines() if line[:2] == "$ "]


def short_clip(sequence: ht.Sequence, first: int, path: Path) -> None:
    """Frames as MediaPipe's JSON has them: named points, a time in seconds, a handedness."""
    frames = []
    for t in range(first, first + 40):
        points = [dict(zip("xyz", map(float, p), strict=True)) for p in sequence.joints[t]]
        missing = [None if np.isnan(p["x"]) else p for p in points]
        time = float(sequence.time_ns[t] / 1e9)
        frames.append({"time_s": time, "handedness": "Right", "world_landmarks": missing})
    path.write_text(json.dumps(frames))


@pytest.fixture(scope="module")
def desk(tmp_path_factory, sample, sample_file) -> Path:
    """A folder with all that the documents' commands and snippets take for granted."""
    folder = tmp_path_factory.mktemp("desk")
    (folder / "recordings").mkdir()
    shutil.copy(sample_file, folder / "recordings")
    short_clip(sample, 20, folder / "clip.json")
    short_clip(sample, 100, folder / "other.json")
    (folder / "clips").mkdir()
    for name in ("clip.json", "other.json"):
        shutil.copy(folder / name, folder / "clips")
    frames, times = slice(20, 120), sample.time_ns[20:120]
    for name, joints in (("true", sample.truth), ("seen", sample.joints)):
        np.savez(folder / f"{name}.npz", joints_m=joints[frames], time_ns=times, hand="right")
    shutil.copy(folder / "clips" / "clip.json", folder / "hands.json")
    mano = folder / "models" / "mano" / "MANO_RIGHT.pkl"
    mano.parent.mkdir(parents=True)
    with mano.open("wb") as file:  # the reader has MANO; we have a free stand-in
        make_mano_like.write_pickle(make_mano_like.make_mano_like("right"), file)
    _, joints = make_panoptic.make(frames=12, noise_mm=2.0, people=1)
    made = make_panoptic.write(folder / "171204_pose6", joints)
    if not (folder / "171204_pose6" / "hdHand3d").is_dir():
        pytest.fail(f"no hdHand3d in {made}")
    pictures(folder)
    cameras(folder, sample)
    results(folder)
    bin_ = folder / "bin"
    bin_.mkdir()
    program(bin_ / "handtrack", f'exec {shlex.quote(sys.executable)} -m handtrack "$@"')
    lines = [
        json.dumps({"hand": "right", "time_ns": int(t), "joints_m": j.tolist()})
        for t, j in zip(times, np.nan_to_num(sample.joints[frames]), strict=True)
    ]
    (bin_ / "lines.jsonl").write_text("\n".join(lines) + "\n")
    program(bin_ / "my_detector", f"cat {shlex.quote(str(bin_ / 'lines.jsonl'))}")
    return folder


def results(folder: Path) -> None:
    """A data set of two clips, and what `handtrack batch` makes of it without and with a filter."""
    if not importlib.util.find_spec("distributed"):
        return
    from handtrack.batching.cluster import engine

    rows = ["path,subject,action", "clips/clip.json,s1,wave", "clips/other.json,s2,count"]
    (folder / "manifest.csv").write_text("\n".join(rows) + "\n")
    with engine(workers=1, processes=False) as made:
        for out, name in (("out", "none"), ("out2", "kalman")):
            settings = ht.BatchSettings(ht.TrackSettings.of({"filter": name}), frames=True)
            ht.batch(
                folder / "manifest.csv", folder / out, made.client, settings, columns=["action"]
            )


def program(path: Path, command: str) -> None:
    path.write_text(f"#!/bin/sh\n{command}\n")
    path.chmod(0o755)


def pictures(folder: Path) -> None:
    """Parts of real videos, where they are; in pictures that we may pass on no hand is found."""
    data = ROOT.parent / "shared" / "data"
    found = {
        "clip.mp4": data / "mediapipe_samples" / "hand_landmarker_test_video.mp4",
        "hands.mp4": data / "mediapipe_samples" / "hand_landmarker_test_video.mp4",
        "cam0.mp4": data / "stereo" / "cam0_test.mp4",
        "cam1.mp4": data / "stereo" / "cam1_test.mp4",
    }
    if not importlib.util.find_spec("av") or not all(path.is_file() for path in found.values()):
        return
    for name, source in found.items():
        beginning(source, folder / name, 20 if "stereo" in source.parts else 12)


def cameras(folder: Path, sample: ht.Sequence) -> None:
    """The calibration of the videos, else a made one, and landmarks that its cameras saw."""
    dats = ROOT.parent / "shared" / "data" / "stereo" / "camera_parameters"
    real = (folder / "cam0.mp4").exists()
    found = ht.load_cameras(dats, unit="42mm") if real else landmark_files.pair()
    seen_by = [replace(camera, name=f"cam{i}", size=(720, 720)) for i, camera in enumerate(found)]
    (folder / "calibration.toml").write_text(landmark_files.calibration(seen_by))
    landmark_files.write_all(folder, sample.truth[20:50], seen_by)


def beginning(source: Path, target: Path, frames: int) -> None:
    """The first frames of a video, as a video."""
    import av

    with av.open(str(source)) as of, av.open(str(target), "w") as to:
        stream = to.add_stream("mpeg4", rate=of.streams.video[0].average_rate)
        picture = next(of.decode(video=0))
        stream.width, stream.height, stream.pix_fmt = picture.width, picture.height, "yuv420p"
        stream.bit_rate = 8_000_000
        of.seek(0)
        for _, picture in zip(range(frames), of.decode(video=0), strict=False):
            plain = av.VideoFrame.from_ndarray(picture.to_ndarray(format="rgb24"), format="rgb24")
            to.mux(stream.encode(plain))
        to.mux(stream.encode())


def lacking(needs: str, desk: Path) -> str:
    """What a block needs and is not here; "" where it can run."""
    for what in filter(None, needs.split(", ")):
        if what == "video":
            if not all(importlib.util.find_spec(m) for m in ("av", "mediapipe")):
                return "the extra video is not installed"
            if not (desk / "clip.mp4").exists():
                return "the real videos are not there"
        elif importlib.util.find_spec(what) is None:
            return f"{what} is not installed"
    return ""


@pytest.fixture
def here(desk: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """An empty table with what lies on the desk; windows open and close at once."""
    shutil.copytree(desk, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("RERUN_CLI_PATH", "/usr/bin/true")
    monkeypatch.setenv("PATH", f"{desk / 'bin'}{os.pathsep}{os.environ['PATH']}")
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))
    return tmp_path


@pytest.mark.parametrize("document", DOCUMENTS, ids=lambda path: path.stem)
def test_what_it_says_to_type_runs(document: Path, here: Path, desk: Path, capsys) -> None:
    names: dict[str, object] = {}
    left = []
    for block in blocks(document):
        if block.not_run:
            continue
        missing = lacking(block.needs, desk)
        if missing:
            left.append(missing)
        elif block.language == "python":
            exec(compile(block.text, str(document), "exec"), names)
        elif block.language == "console":
            for line in commands(block):
                typed(line, capsys)
    if left:
        pytest.skip("run but for what needs more: " + "; ".join(dict.fromkeys(left)))


# one line of the README needs pictures, the others of its block do not
PICTURES = re.compile(r"\S+\.(mp4|jpg|png)")


def typed(line: str, capsys) -> None:
    """Run one line: ours in this process, what is more than one program by the shell."""
    wanted = [m[0] for m in PICTURES.finditer(line)]
    inputs = [name for name in wanted if Path(name).exists()]
    if wanted and (not inputs or lacking("video", Path.cwd())):
        return
    program, *arguments = shlex.split(line)
    capsys.readouterr()
    if program == "handtrack" and not {"|", "&&", ">"} & set(arguments):
        status = run(arguments)
        said = "".join(capsys.readouterr())
    else:
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", line], capture_output=True, text=True
        )
        status, said = done.returncode, done.stdout + done.stderr
    assert status == 0, f"$ {line}\n{said}"


def test_every_option_that_documents_name_is_there(capsys) -> None:
    helped = {}
    for command in COMMANDS:
        run([command, "--help"])
        helped[command] = capsys.readouterr().out
    for document in DOCUMENTS:
        text = document.read_text()
        for block in blocks(document):
            for line in commands(block):
                for ours in re.findall(r"handtrack (\w[\w-]*)([^|]*)", line):
                    for option in re.findall(r"(?<=\s)--?[a-z][a-z-]*", ours[1]):
                        assert re.search(rf"(^|[ ,/]){option}\b", helped[ours[0]]), line
        for option in set(re.findall(r"`(--[a-z][a-z-]*)", text)):
            others = ("--sentences", "--mano", "--json")  # of tools that pages name
            assert option in others or any(option in h for h in helped.values()), option


@pytest.mark.parametrize("document", [*DOCUMENTS, SITE / "index.md"], ids=lambda path: path.stem)
def test_its_links_lead_somewhere(document: Path) -> None:
    for link in re.findall(r"\]\((?!https?:)([^)#]+)(?:#[^)]*)?\)", document.read_text()):
        made = link.startswith(("../reference/", "../commands/", "reference/", "commands/"))
        shown = SITE.parents[1] / link.removeprefix("../")  # the site has recordings/ beside it
        assert made or (document.parent / link).is_file() or shown.is_file(), link


def test_what_contributors_are_told_to_type_is_there() -> None:
    """Its lines install, and test and build all: what they name is looked for, not run."""
    (told,) = blocks(ROOT / ".github" / "CONTRIBUTING.md")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    known = project["optional-dependencies"]
    (extras,) = re.findall(r"\.\[([\w,]+)\]", told.text)
    assert set(extras.split(",")) <= set(known)
    installed = {re.split(r"\W", name)[0] for extra in extras.split(",") for name in known[extra]}
    programs = set(re.findall(r"\.venv/bin/([\w-]+)", told.text))
    assert programs - {"pip", "python"} <= installed
    for folder in re.findall(r"\btests/\w+", told.text):
        assert (ROOT / folder).is_dir(), folder
    for module in re.findall(r"-m (tools[\w.]+)", told.text):
        assert importlib.util.find_spec(module), module


# --- the README


def test_the_readme_is_short() -> None:
    assert len(readme.README.read_text().split()) <= WORDS
