"""The examples in every command's help: all can be parsed, and those of files run as they stand."""

from __future__ import annotations

import shlex
import shutil
from pathlib import Path

import click
import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import cli
from handtrack.cli.helping import EXAMPLES
from handtrack.hand.skeleton import JOINT_NAMES

ALL = [line for lines in EXAMPLES.values() for line in lines]
RUN = (
    "track clip.json",
    "track a.npz b.json -o OUT/",
    "track noisy.csv --filter rts --unit mm",
    "calibrate a.json b.json -o hand.json",
    "replay out.mcap --save out.rrd",
    "stability out.mcap",
    "stability out.mcap --truth true.npz",
    "stability ours=a.mcap theirs=b.npz --truth true.npz --html report.html",
    "export out.mcap hand.glb",
    "export recordings/ tables/ --to csv",
    "convert hands.csv out.npz",
    "audit recordings/sample.npz",
    "info out.mcap",
    "info recordings/ --json",
    "retrack out.mcap -o again.mcap --filter kalman",
    "diff out.mcap again.mcap",
    "recover recordings/live.mcap.part",
)
FAILS = {"diff out.mcap again.mcap"}
"""By its documented status of 1: the two differ."""


@pytest.mark.parametrize("line", ALL)
def test_an_example_is_parsed(line, elsewhere):
    name, *arguments = shlex.split(line)
    with click.Context(cli) as context:
        command = cli.get_command(context, name)
    assert command is not None
    # raises for options, values and numbers of arguments that the command does not take
    command.make_context(name, arguments)


def test_examples_of_files_run_as_they_stand(call, sample, elsewhere):
    assert set(RUN) <= set(ALL)
    _files(sample.joints[:24], sample.truth[:24])
    statuses = {}
    for line in RUN:
        status, out, err = call(*shlex.split(line))
        statuses[line] = (status, err.splitlines()[-1:] if status else [])
        assert out
    assert {line: s for line, s in statuses.items() if s[0] and line not in FAILS} == {}
    assert {line for line in FAILS if statuses[line][0] == 1} == FAILS
    for made in ("OUT/a.mcap", "OUT/b.mcap", "hand.glb", "hand.json", "report.html", "out.npz"):
        assert Path(made).stat().st_size > 100
    assert list(Path("tables").glob("*.csv"))


def _files(joints, truth) -> None:
    Path("recordings").mkdir()
    np.savez("a.npz", joints_m=joints, fps=30.0, hand="right")
    for name in ("true.npz", "b.npz", "recordings/sample.npz"):
        np.savez(name, joints_m=truth, fps=30.0, hand="right")
    (sequence,) = ht.load("a.npz")
    track = ht.track(sequence, calibrate=False)
    for name in ("out.mcap", "a.mcap"):
        ht.write_mcap([track], name)
    whole = Path("out.mcap").read_bytes()
    Path("recordings/live.mcap.part").write_bytes(whole[: len(whole) // 2])
    for name in ("a.json", "b.json", "clip.json"):
        rows = ",".join(_row(frame) for frame in joints)
        Path(name).write_text(f'{{"fps": 30, "hand": "right", "joints": [{rows}]}}')
    columns = [f"{joint}_{c}_mm" for joint in JOINT_NAMES for c in "xyz"]
    table = [",".join(["time_s", *columns])]
    for t, frame in enumerate(joints):
        cells = ["" if np.isnan(x) else f"{1e3 * x:.3f}" for x in frame.ravel()]
        table.append(",".join([f"{t / 30:.4f}", *cells]))
    Path("hands.csv").write_text("\n".join(table) + "\n")
    shutil.copy("hands.csv", "noisy.csv")


def _row(frame) -> str:
    points = [
        "[null,null,null]" if np.isnan(p).any() else str([float(x) for x in p]) for p in frame
    ]
    return f"[{','.join(points)}]"
