"""Help, suggestions, completion, and options from a file."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli.commands import COMMANDS
from handtrack.cli.helping import EXAMPLES


@pytest.fixture(autouse=True)
def _elsewhere(elsewhere):
    """Every test starts in an empty folder."""


@pytest.fixture
def clip(sample, elsewhere) -> str:
    np.savez("take.npz", joints_m=sample.joints[:20], fps=30.0, hand="right")
    return "take.npz"


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_examples_and_says_its_options_once(command, call):
    status, out, err = call(command, "--help")
    assert (status, err) == (0, "")
    assert f"\nExamples:\n  handtrack {command} " in out
    assert "--config FILE" in out
    listed = out[out.index("\nOptions") :]
    options = re.findall(r"^  (?:-\w, )?(--[\w-]+)", listed, re.MULTILINE)
    assert sorted(options) == sorted(set(options))
    assert call("help", command)[1] == out


def test_the_examples_use_options_that_exist(call):
    for command, lines in EXAMPLES.items():
        if command in COMMANDS:
            text = call(command, "--help")[1]
            for line in lines:
                assert set(re.findall(r" (--[\w-]+)", line)) <= set(re.findall(r"--[\w-]+", text))


def test_what_people_need_first_comes_first(call):
    out = call("track", "--help")[1]
    titles = re.findall(r"^(\S.*):$", out, re.MULTILINE)
    assert titles[0] == "Options that people need first"
    assert titles[-2:] == ["Configuration", "Examples"]
    first = out.partition("Options that people need first:")[2].partition("\n\n")[0]
    assert len(re.findall(r"^  -", first, re.MULTILINE)) == 10
    assert first.rstrip().splitlines()[-1].startswith("  -h, --help")
    assert "-o, --output" in first
    assert "--process-noise" not in first


def test_retrack_says_that_its_defaults_are_stored_ones(call):
    out = " ".join(call("retrack", "--help")[1].split())
    assert "(as stored)" in out
    assert "[default: (none)]" not in out
    assert "[default: none]" not in out.partition("--filter")[2].partition("--lag")[0]


def test_what_is_misspelt_is_guessed(call):
    for arguments, text in (
        (["trak"], "No such command 'trak'. Did you mean 'track'? (`handtrack --help` tells"),
        (["track", "x", "--filtr", "rts"], "--filter"),
        (["stability"], "(`handtrack stability --help` tells more)"),
    ):
        status, out, err = call(*arguments)
        assert (status, out, err.count("\n")) == (2, "", 1)
        assert text in err


@pytest.mark.parametrize("command", [c for c in COMMANDS if c != "help"])
def test_every_command_can_be_quiet(command, call):
    assert "-q, --quiet" in call(command, "--help")[1]


def test_the_shell_completes(tmp_path):
    words = {"COMP_WORDS": "handtrack tra", "COMP_CWORD": "1"}
    done = subprocess.run(
        [sys.executable, "-c", "from handtrack.cli import main; main()"],
        env=os.environ | words | {"_HANDTRACK_COMPLETE": "bash_complete"},
        capture_output=True,
        text=True,
    )
    assert "plain,track" in done.stdout


def test_options_come_from_a_file_and_are_recorded(call, clip):
    Path("run.toml").write_text('[track]\nfilter = "kalman"\nnoise-mm = 2\ncalibrate = false\n')
    assert call("track", clip, "-o", "a.mcap", "--config", "run.toml", "-q") == (0, "", "")
    (track,) = ht.read_mcap("a.mcap")
    assert (track.settings["filter"], track.settings["noise_mm"]) == ("kalman", 2)
    assert track.settings["config"]["file"] == "run.toml"
    assert track.settings["config"]["options"]["filter"] == "kalman"
    # what is given counts more
    arguments = ("--config", "run.toml", "--filter", "rts", "-q")
    assert call("track", clip, "-o", "b.mcap", *arguments)[0] == 0
    assert ht.read_mcap("b.mcap")[0].settings["filter"] == "rts"
    # such a recording is tracked again as any other
    assert call("retrack", "a.mcap", "-o", "c.mcap", "-q")[0] == 0
    assert ht.read_mcap("c.mcap")[0].settings["filter"] == "kalman"


def test_saved_options_give_the_same_again(call, clip):
    robust = ("--robust", "huber", "--spread-mm", "7.5")
    options = ("--filter", "one-euro", "--no-gate", *robust, "--hand", "right")
    assert call("track", clip, "-o", "a.mcap", *options, "--save-config", "run.toml", "-q")[0] == 0
    assert 'filter = "one-euro"' in Path("run.toml").read_text()
    assert call("track", clip, "-o", "b.mcap", "--config", "run.toml", "--overwrite", "-q")[0] == 0
    first, again = ht.read_mcap("a.mcap")[0], ht.read_mcap("b.mcap")[0]
    np.testing.assert_array_equal(first.angles, again.angles)
    assert again.settings["gate"] is False
    # what is there is not written over
    status, _, err = call("track", clip, "-o", "c.mcap", "--save-config", "run.toml")
    assert status == 2
    assert "run.toml is there already" in err


def test_a_file_says_options_as_people_type_them(call, clip):
    """Some values have other names inside: both are taken, so are files that were saved before."""
    for name in ("json", "as-json"):
        Path("run.toml").write_text(f"[track]\n{name} = true\n")
        status, out, _ = call("track", clip, "-o", f"{name}.mcap", "--config", "run.toml")
        assert (status, "sequences" in json.loads(out)) == (0, True)
    assert call("track", clip, "-o", "c.mcap", "--json", "--save-config", "saved.toml")[0] == 0
    assert Path("saved.toml").read_text() == '[track]\noutput = "c.mcap"\njson = true\n'
    Path("run.toml").write_text('[batch]\nexport = "csv"\n')
    status, _, err = call("batch", clip, "-o", "out", "--config", "run.toml")
    assert (status, 'run.toml: export: "csv": expected a list' in err) == (2, True)


def test_pyproject_is_read(call, clip):
    Path("pyproject.toml").write_text('[tool.handtrack]\nfilter = "kalman"\n')
    assert call("track", clip, "-o", "a.mcap", "-q")[0] == 0
    assert ht.read_mcap("a.mcap")[0].settings["filter"] == "kalman"
    assert call("info", "a.mcap", "-q") == (0, "", "")  # has no such option
    Path("pyproject.toml").write_text('[project]\nname = "other"\n')
    assert call("track", clip, "-o", "b.mcap", "-q")[0] == 0
    assert ht.read_mcap("b.mcap")[0].settings["filter"] == "none"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[track]\nfiltr = 'rts'", "run.toml: [track] filtr: no such option of track, did you"),
        ("[trak]\nfilter = 'rts'", "run.toml: [trak] is no command, did you mean track?"),
        ("colour = 'red'", "run.toml: colour is an option of no command"),
        ("[track]\nfilter = 'wiener'", "run.toml: filter: 'wiener' is not one of"),
        ("[track]\nlag = 'two'", "run.toml: lag: 'two' is not a valid integer"),
        ("[track]\nfps = [1, 2]", "run.toml: fps: [1, 2]: expected one value"),
        ("[track]\nfps = {a = 1}", 'run.toml: fps: {"a": 1}: expected one value'),
        ("[track]\nquiet = 'perhaps'", "run.toml: quiet: 'perhaps' is not a valid boolean"),
        ("[track]\noverwrite = true", "no such option of track"),
        ("[track", "run.toml: not valid TOML"),
        (None, "run.toml: No such file"),
    ],
)
def test_a_file_that_is_wrong(text, says, call, clip):
    if text is not None:
        Path("run.toml").write_text(text)
    status, out, err = call("track", clip, "-o", "a.mcap", "--config", "run.toml")
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert not Path("a.mcap").exists()
