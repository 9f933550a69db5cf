"""README and site: what they tell people to type runs as it stands, what they say is so."""

from __future__ import annotations

import importlib.util
import inspect
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.cli import COMMANDS, run
from tools.docs import generated, numbers, readme
from tools.docs.docstrings import restructured, short_types
from tools.make import mano_like as make_mano_like
from tools.make import panoptic as make_panoptic

ROOT = Path(__file__).resolve().parents[3]
SITE = ROOT / "tools" / "docs"
DOCUMENTS = [ROOT / "README.md", *sorted((SITE / "pages").glob("*.md"))]
WORDS = 1200
"""At most so many in the README."""


@dataclass(frozen=True)
class Block:
    """What stands between fences: language and text; what it needs, or why it is not run."""

    language: str
    text: str
    needs: str = ""
    not_run: str = ""


def blocks(document: Path) -> list[Block]:
    found = []
    pattern = r"(?:<!-- (needs|not run): (.*?) -->\n)?^```(\w+)\n(.*?)^```$"
    for mark, said, language, text in re.findall(
        pattern, document.read_text(), re.MULTILINE | re.DOTALL
    ):
        marks = {"needs": said} if mark == "needs" else {"not_run": said} if mark else {}
        found.append(Block(language, text, **marks))
    return found


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
    truth, times = sample.truth[20:60], sample.time_ns[20:60]
    np.savez(folder / "true.npz", joints_m=truth, time_ns=times, hand="right")
    mano = folder / "models" / "mano" / "MANO_RIGHT.pkl"
    mano.parent.mkdir(parents=True)
    with mano.open("wb") as file:  # the reader has MANO; we have a free stand-in
        make_mano_like.write_pickle(make_mano_like.make_mano_like("right"), file)
    _, joints = make_panoptic.make(frames=12, noise_mm=2.0, people=1)
    made = make_panoptic.write(folder / "171204_pose6", joints)
    if not (folder / "171204_pose6" / "hdHand3d").is_dir():
        pytest.fail(f"no hdHand3d in {made}")
    pictures(folder)
    results(folder)
    bin_ = folder / "bin"
    bin_.mkdir()
    program(bin_ / "handtrack", f'exec {shlex.quote(sys.executable)} -m handtrack "$@"')
    lines = [
        json.dumps({"hand": "right", "time_ns": int(t), "joints_m": j.tolist()})
        for t, j in zip(times, np.nan_to_num(sample.joints[20:60]), strict=True)
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
    tables = []
    for i in (0, 1):
        lens = rows_of_numbers(data / "stereo" / "camera_parameters" / f"c{i}.dat")
        way = rows_of_numbers(data / "stereo" / "camera_parameters" / f"rot_trans_c{i}.dat")
        turn = Rotation.from_matrix(way[:3]).as_rotvec().tolist()
        shift = [0.042 * float(row[0]) for row in way[3:6]]  # squares of 42 mm
        tables.append(
            f'[cam_{i}]\nname = "cam{i}"\nsize = [720, 720]\nmatrix = {lens[:3]}\n'
            f"distortions = {lens[3]}\nrotation = {turn}\ntranslation = {shift}\n"
        )
    (folder / "calibration.toml").write_text("\n".join(tables))


def rows_of_numbers(path: Path) -> list[list[float]]:
    lines = [line.split() for line in path.read_text().splitlines()]
    return [
        [float(x) for x in line] for line in lines if line and not re.match("[#A-Za-z]", line[0])
    ]


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


# --- the README


def test_the_readme_is_short() -> None:
    assert len(readme.README.read_text().split()) <= WORDS


def test_the_readmes_tables_are_as_generated() -> None:
    """`python -m tools.docs.readme` writes them."""
    text = readme.README.read_text()
    assert readme.filled(text) == text
    for name in readme.TABLES:
        assert f"<!-- generated: {name} -->" in text


def test_the_readmes_first_two_blocks_are_those_that_ci_runs() -> None:
    first, second = (b.text for b in blocks(readme.README) if b.language == "bash")
    assert "pip install '.[test]'" in first
    assert second.split() == [".venv/bin/pytest"]


def test_the_readmes_python_is_twelve_lines() -> None:
    (example,) = (b.text for b in blocks(readme.README) if b.language == "python")
    assert len([line for line in example.splitlines() if line.strip()]) <= 12


def test_the_samples_numbers_are_those_of_today() -> None:
    """`python -m tools.docs.numbers` measures them; another processor rounds otherwise."""
    kept = generated.numbers("sample")["rows"]
    for row, now in zip(kept, numbers.measure()["rows"], strict=True):
        assert row["what"] == now["what"]
        for name in ("pa_mpjpe_mm", "std_mm", "jitter_m_s3"):
            assert row[name] == pytest.approx(now[name], rel=0.02), (row["what"], name)
        assert row["lost"] == now["lost"]


# --- the site


def test_every_page_stands_in_the_table_of_contents() -> None:
    entries = re.findall(r"^(pages/\w+|theory)$", (SITE / "index.md").read_text(), re.MULTILINE)
    listed = set(entries)
    assert len(listed) == len(entries)
    assert listed == {f"pages/{p.stem}" for p in (SITE / "pages").glob("*.md")} | {"theory"}
    notebooks = {p.stem for p in (SITE / "notebooks").glob("*.ipynb")}
    index = (SITE / "notebooks" / "index.md").read_text()
    assert len(notebooks) >= 3
    assert all(re.search(rf"^{name}$", index, re.MULTILINE) for name in notebooks)


def test_every_public_name_stands_in_the_reference_once() -> None:
    listed = [name for names in generated.groups().values() for name in names]
    assert sorted(listed) == sorted(set(ht.__all__) - {"__version__"})


@pytest.mark.parametrize("name", sorted(set(ht.__all__) - {"__version__"}))
def test_a_public_name_says_what_it_is(name: str) -> None:
    """Functions their arguments, results and errors, classes their attributes."""
    value = getattr(ht, name)
    text = inspect.getdoc(value) or ""
    assert len(text.split()) >= 5, name
    if inspect.isfunction(value):
        given = [p for p in inspect.signature(value).parameters if p not in ("self", "cls")]
        said = text.partition("Args:")[2]
        for argument in given:
            assert re.search(rf"^\s+.*\b{argument}\b.*:", said, re.MULTILINE), f"{name}({argument})"
        gives = inspect.signature(value).return_annotation
        assert gives in ("None", None) or re.search(
            r"Returns:|Yields:|: |^The |^What |^How |^Whe", text
        ), name


def test_pages_hold_no_table_of_numbers_of_their_own() -> None:
    """Numbers in tables are generated; a pasted one would be true for a while."""
    for document in DOCUMENTS[1:]:
        for line in document.read_text().splitlines():
            if line.startswith("|"):
                assert not re.search(r"\d\.\d", line), f"{document.name}: {line}"


def test_notebooks_are_kept_without_what_they_printed() -> None:
    for path in (SITE / "notebooks").glob("*.ipynb"):
        for cell in json.loads(path.read_text())["cells"]:
            assert not cell.get("outputs"), path
            assert cell.get("execution_count") is None, path


def test_docstrings_become_restructured_text() -> None:
    text = """The norm |x| of
- one
  more
- two

Formula
    y = |x|
after

Args:
    a, b: both."""
    assert restructured(text.splitlines()) == [
        *("The norm \\|x\\| of", "", "- one", "  more", "- two", "", "Formula", "", "::", ""),
        *("    y = |x|", "", "after", "", "Args:", "    a: both.", "    b: both."),
    ]
    arrays = "~numpy.ndarray[tuple[~typing.Any, ...], ~numpy.dtype[~numpy.float64]]"
    assert short_types(f"(x: {arrays}, y: ~typing.Literal['a'])") == (
        "(x: NDArray[float64], y: Literal['a'])"
    )
    like = "~numpy._typing._array_like._"
    some = f"{like}SupportsArray[~numpy.dtype[~typing.Any]]"
    text = f"~numpy.typing._Buffer | {some} | ~numpy._NestedSequence[{some}]"
    text += " | complex | bytes | str | ~numpy._NestedSequence[complex | bytes | str] | None"
    assert short_types(f"(x: {text})") == "(x: ArrayLike | None)"
    assert short_types(None) is None


def test_citation_and_metadata() -> None:
    text = (ROOT / ".github" / "CITATION.cff").read_text()
    for author in ("Li", "Wu", "Liu", "Zhang", "Nie", "Mao"):
        assert f"family-names: {author}" in text
    assert f"version: {ht.__version__}" in text
    change = (ROOT / "CHANGELOG.md").read_text()
    assert re.search(r"^## \[?Unreleased", change, re.MULTILINE)
