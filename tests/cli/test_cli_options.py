"""What holds of the options of every command: names, groups, settings, where they are recorded."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path

import click
import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import cli
from handtrack.cli.commands import COMMANDS
from handtrack.cli.helping import _GROUPS, FEW
from handtrack.tracking.settings import TrackSettings


@pytest.fixture(autouse=True)
def _elsewhere(elsewhere):
    """Every test starts in an empty folder."""


def _commands() -> list[tuple[str, click.Command]]:
    """Every command of the tree, those of groups in groups too."""

    def below(path: str, command: click.Command) -> list[tuple[str, click.Command]]:
        found = [(path, command)]
        if isinstance(command, click.Group):
            with click.Context(command) as context:
                for name in command.list_commands(context):
                    child = command.get_command(context, name)
                    assert child is not None
                    found += below(f"{path} {name}", child)
        return found

    return below("handtrack", cli)


def _params(path: str, command: click.Command) -> list[click.Parameter]:
    """Those of a command and its help, named as on the command line."""
    with click.Context(command, info_name=path, **cli.context_settings) as context:
        return command.get_params(context)


TREE = _commands()
IDS = [path for path, _ in TREE]


def test_the_tree_is_whole():
    assert {path.split()[-1] for path in IDS} == {"handtrack", *COMMANDS}


@pytest.mark.parametrize(("path", "command"), TREE, ids=IDS)
def test_no_two_options_share_a_name(path, command):
    params = _params(path, command)
    words = Counter(word for p in params for word in (*p.opts, *p.secondary_opts))
    assert [word for word, times in words.items() if times > 1] == []
    values = Counter(p.name for p in params)
    assert [name for name, times in values.items() if times > 1] == []


@pytest.mark.parametrize(("path", "command"), TREE[1:], ids=IDS[1:])
def test_every_option_has_help_and_a_group(path, command):
    options = [p for p in _params(path, command) if isinstance(p, click.Option)]
    assert [p.opts for p in options if not p.help] == []
    if len(options) <= FEW:
        return
    grouped = {name for names in _GROUPS.values() for name in names}
    # the rest is of the fit and the filter: what `settings` make options of
    own = set(TrackSettings.known())
    assert [p.name for p in options if p.name not in grouped | own] == []


def test_no_group_names_an_option_that_no_command_has():
    names = {p.name for _, command in TREE for p in command.params}
    grouped = {name for names in _GROUPS.values() for name in names}
    assert grouped - names <= {"help", "_click_default_help"}


@pytest.mark.parametrize("name", ["track", "batch", "live", "retrack"])
def test_every_setting_has_its_option(name):
    command = {path.split()[-1]: c for path, c in TREE}[name]
    options = {p.name for p in command.params}
    hidden = {n for n, known in TrackSettings.known().items() if not known.about.option}
    missing = set(TrackSettings.known()) - options - hidden
    assert missing == set()


CONFIG = '[COMMAND]\nhand = "right"\n'


def _config(command: str) -> tuple[str, str]:
    Path("run.toml").write_text(CONFIG.replace("COMMAND", command))
    return "--config", "run.toml"


@pytest.fixture
def clip(sample) -> str:
    np.savez("take.npz", joints_m=sample.joints[:20], fps=30.0, hand="right")
    return "take.npz"


TOLD = {"file": "run.toml", "options": {"hand": "right"}}


def test_a_data_set_says_where_its_options_came_from(call, clip):
    pytest.importorskip("distributed")
    status, _, err = call("batch", clip, "-o", "out", "--workers", "1", *_config("batch"), "-q")
    assert (status, err) == (0, "")
    told = json.loads(Path("out/settings.json").read_text())
    assert told["config"] == TOLD
    assert told["tracking"]["filter"] == "none"
    (track,) = ht.read_mcap("out/recordings/take.mcap")
    assert track.settings["config"] == TOLD


def test_what_is_converted_or_tracked_again_says_it_too(call, clip):
    assert call("convert", clip, "a.mcap", *_config("convert"), "-q")[0] == 0
    assert ht.read_mcap("a.mcap")[0].settings["config"] == TOLD
    Path("run.toml").write_text('[retrack]\nfilter = "kalman"\n')
    assert call("retrack", "a.mcap", "-o", "b.mcap", "--config", "run.toml", "-q")[0] == 0
    (again,) = ht.read_mcap("b.mcap")
    assert again.settings["config"] == {"file": "run.toml", "options": {"filter": "kalman"}}
    assert again.settings["filter"] == "kalman"
