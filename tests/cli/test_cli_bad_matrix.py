"""Every command with every file that is wrong: one line that names the file, status 2, no traces.

Status 1 is for jobs that fail; here nothing could begin.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from cli_cases import files
from mcap.writer import Writer

from handtrack.cli.commands import COMMANDS

pytestmark = pytest.mark.usefixtures("elsewhere")

OUTPUTS: dict[str, list[str]] = {
    "track": ["-o", "out/o.mcap", "--rrd", "out/o.rrd"],
    "batch": ["-o", "out/set"],
    "detect": ["-o", "out/o.npz"],
    "calibrate": ["-o", "out/hand.json"],
    "profile": ["--truth", "<short>", "-o", "out/profile.json"],
    "replay": ["--save", "out/o.rrd"],
    "stability": ["--html", "out/o.html"],
    "plot": ["out/o.pdf"],
    "export": ["out/o.csv"],
    "convert": ["out/o.npz"],
    "audit": ["--html", "out/o.html"],
    "info": [],
    "retrack": ["-o", "out/o.mcap"],
    "diff": ["<recording>"],
    "recover": ["-o", "out/o.mcap"],
}
"""What else each command is given; `live` takes no file."""


def _bytes(content: bytes) -> Callable[[Path, SimpleNamespace], object]:
    return lambda path, made: path.write_bytes(content)


def _folder(path: Path, made: SimpleNamespace) -> None:
    path.mkdir()
    (path / "notes.txt").write_text("hello\nworld\n")


def _other_recording(path: Path, made: SimpleNamespace) -> None:
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("robot", "jsonschema", b"{}")
        channel = writer.register_channel("/robot", "json", schema)
        writer.add_message(channel, 0, b'{"speed": 1}', 0)
        writer.finish()


def _no_hand(path: Path, made: SimpleNamespace) -> None:
    np.savez(path, joints_m=np.full((5, 21, 3), np.nan), fps=30.0)


WRONG: dict[str, Callable[[Path, SimpleNamespace], object]] = {
    "missing.mcap": lambda path, made: None,
    "missing.npz": lambda path, made: None,
    "empty_folder": lambda path, made: path.mkdir(),
    "folder_of_text": _folder,
    "folder.mcap": lambda path, made: path.mkdir(),
    "link.npz": lambda path, made: os.symlink("nowhere", path),
    "nothing.json": _bytes(b""),
    "nothing.npz": _bytes(b""),
    "nothing.mcap": _bytes(b""),
    "half.json": _bytes(b'{"joints": [1, }'),
    "latin.csv": _bytes("gr\u00f6\u00dfe,h\u00f6he\n1,2\n".encode("latin-1")),
    "no_hand.npz": _no_hand,
    "noise.mcap": _bytes(b"\x89MCAP0\r\n" + b"x" * 100),
    "start.mcap": lambda path, made: path.write_bytes(Path(made.recording).read_bytes()[:200]),
    "robot.mcap": _other_recording,
    "broken.mp4": _bytes(b"\0\0\0\x18ftypmp42" + b"\0" * 50),
    "broken.png": _bytes(b"\x89PNG\r\n\x1a\n" + b"\0" * 50),
    "broken.h5": _bytes(b"\x89HDF\r\n\x1a\n" + b"\0" * 50),
    "broken.parquet": _bytes(b"PAR1" + b"\0" * 40 + b"PAR1"),
    "broken.zip": _bytes(b"PK\5\6" + b"\0" * 18),
}
JUDGED_BY_WORKERS = {name for name in WRONG if not name.startswith(("missing", "empty", "link"))}
"""`batch` opens these in its workers: tests/batching has clips that fail."""


def test_every_command_is_tried():
    assert set(OUTPUTS) | {"live"} == set(COMMANDS)


@pytest.mark.parametrize("command", OUTPUTS)
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_file_is_one_line_that_names_it(command, name, made, call, elsewhere):
    if command == "batch" and name in JUDGED_BY_WORKERS:
        pytest.skip("judged by the workers")
    if command == "info" and name == "start.mcap":
        pytest.skip("saying that a recording is not complete is its work")
    WRONG[name](elsewhere / name, made)
    before = files(elsewhere)
    stand_for = {"<short>": made.short, "<recording>": made.recording}
    status, out, err = call(command, name, *(stand_for.get(a, a) for a in OUTPUTS[command]))
    assert (status, out) == (2, "")
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert name in err
    assert len(err) < 400
    assert files(elsewhere) == before


WRITTEN = {
    "track": (["<short>", "-o"], "o.mcap"),
    "retrack": (["<recording>", "-o"], "o.mcap"),
    "recover": (["<recording>.part", "-o"], "o.mcap"),
    "calibrate": (["<short>", "-o"], "o.json"),
    "replay": (["<recording>", "--save"], "o.rrd"),
    "stability": (["<recording>", "--html"], "o.html"),
    "plot": (["<recording>"], "o.png"),
    "export": (["<recording>"], "o.csv"),
    "convert": (["<short>"], "o.npz"),
    "audit": (["<short>", "--html"], "o.html"),
}
"""Commands with what they write, the name last."""


@pytest.mark.parametrize("command", WRITTEN)
@pytest.mark.parametrize("place", ["folder", "in a file", "of another kind"])
def test_an_output_that_cannot_be_is_one_line(command, place, made, call, elsewhere):
    arguments, name = WRITTEN[command]
    shutil.copy(made.recording, "cut.mcap.part")
    stand_for = {"<recording>.part": "cut.mcap.part"}
    stand_for |= {"<short>": made.short, "<recording>": made.recording}
    if place == "folder":
        Path(name).mkdir()
        (Path(name) / "kept.txt").write_text("kept")
    elif place == "in a file":
        Path("words").write_text("kept")
        name = f"words/{name}"
    else:
        name = "o.wrong"
    before = files(elsewhere)
    status, _, err = call(command, *(stand_for.get(a, a) for a in arguments), name)
    if command == "track" and place == "folder":  # -o takes a folder of recordings
        assert status == 0
        return
    assert status == 2
    assert err.startswith("error: ")
    assert err.count("\n") == 1
    assert name.partition("/")[0] in err
    assert files(elsewhere) == before


def test_a_batch_of_which_no_file_holds_a_hand_fails(capsys):
    pa = pytest.importorskip("pyarrow")
    from handtrack.batching.run import Outcome
    from handtrack.cli import batch
    from handtrack.errors import HandtrackError

    def of(*states: str) -> Outcome:
        rows = [{"clip": s, "state": s, "error": f"{s}.txt: no joints in it"} for s in states]
        return Outcome(pa.Table.from_pylist(rows), len(rows), 0, 30, 1.0, (), ())

    with pytest.raises(HandtrackError, match=r"nothing could be tracked: passed over\.txt: no jo"):
        batch._say(of("passed over"), "out", False, False)
    batch._say(of("passed over", "done"), "out", False, False)
    assert "1 hold no hand joints, 0 failed -> out" in capsys.readouterr().out
