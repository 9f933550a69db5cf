"""What the documents say that the code knows better: formats, limits, options, names, numbers."""

from __future__ import annotations

import inspect
import json
import os
import pty
import re
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from typing import Any

import click
import numpy as np

import handtrack as ht
from handtrack.cli import COMMANDS, cli
from handtrack.hand.limits import PRESETS
from handtrack.hand.skeleton import ANGLE_NAMES, FINGERS, ORDER_JOINTS, ORDERS
from handtrack.sequences.readers.catalogue import formats as all_formats
from handtrack.settings import Settings

SAMPLE = str(Path(__file__).resolve().parents[2] / "recordings" / "sample.npz")
NUMBERS = Path(__file__).resolve().parent / "numbers"
"""Measured by the tools that each page names, and kept with what they were measured on."""


def pages() -> dict[str, str]:
    """All generated pages and parts of pages: name -> text."""
    from tools.docs import measured

    reference = {f"reference/{slug(g)}": _group_page(g, n) for g, n in groups().items()}
    return {
        "generated/formats": formats(),
        "generated/orders": orders(),
        "generated/limits": limits(),
        "generated/settings": settings(),
        "generated/first_output": first_output(),
        "commands/index": commands(),
        "reference/index": _reference_index(),
        **reference,
        **{f"generated/{name}": text for name, text in measured.tables().items()},
    }


def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table; bars inside cells are escaped."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("|" + "|".join(c.replace("|", "\\|") for c in line) + "|\n" for line in lines)


# --- what is read


def formats() -> str:
    """Every format, with all that is to be known of it."""
    head = ["source", "what is read", "joint order; unit; hands", "recognised by"]
    rows = []
    for f in all_formats():
        needs = f"; needs {f.needs}" if f.needs else ""
        rows.append(
            [f"**{f.name}**", f.reads + needs, f"{f.order}; {f.unit}; {f.hands}", f.known_by]
        )
    return table(head, rows)


def formats_short() -> str:
    """Every format in a few words, for the README."""
    rows = [[f.name, f.order, f.unit, f.needs.partition(" (")[0]] for f in all_formats()]
    return table(["source", "joint order", "unit", "needs"], rows)


def orders() -> str:
    """The joint orders by name: where each of our joints stands in a frame."""
    rows = []
    for name, places in ORDERS.items():
        shown = " ".join("–" if place < 0 else str(place) for place in places)
        rows.append([f"`{name}`", str(ORDER_JOINTS[name]), shown])
    return table(["`--order`", "joints", "where our 21 joints stand in it (–: it has none)"], rows)


# --- the hand


def limits() -> str:
    """The limits of all presets, degrees."""
    head = ["finger", "angle", *PRESETS]
    rows = []
    for i, name in enumerate(ANGLE_NAMES):
        finger = FINGERS[i // 4]
        ranges = [f"{lo:.0f}..{hi:.0f}" for lo, hi in (_degrees(p, i) for p in PRESETS.values())]
        rows.append([finger if i % 4 == 0 else "", f"`{name}`", *ranges])
    return table(head, rows)


def _degrees(preset: Any, i: int) -> tuple[float, float]:
    return float(np.rad2deg(preset.lower[i])), float(np.rad2deg(preset.upper[i]))


# --- settings and commands


def settings() -> str:
    """The settings of track(), with what each may be."""
    from handtrack.tracking.settings import TrackSettings

    return _settings_table(TrackSettings)


def _settings_table(of: type[Settings]) -> str:
    rows = []
    for name, known in of.known().items():
        help_text, unit, may_be = known.about.help, known.about.unit, known.about.range
        if unit and unit not in may_be:
            help_text = f"{help_text.removesuffix('.')} [{unit}]."
        may_be = "yes or no" if isinstance(known.default, bool) and not may_be else may_be
        rows.append([f"`{name}`", f"`{known.default}`", may_be, _options_as_code(help_text)])
    return table(["setting", "default", "may be", "what it does"], rows)


def _options_as_code(text: str) -> str:
    return re.sub(r"(?<![\w`-])(--[a-z][a-z-]*)", r"`\1`", text)


def first_output() -> str:
    """What `track` prints of the sample on a terminal of 80 columns, but for how long it took."""
    ours, terminal = pty.openpty()
    with tempfile.TemporaryDirectory() as folder, os.fdopen(ours, "rb", buffering=0) as shown:
        made = f"{folder}/sample.mcap"
        running = subprocess.Popen(
            [sys.executable, "-m", "handtrack", "track", SAMPLE, "-o", made],
            env={**os.environ, "TERM": "dumb"},
            stdout=terminal,
            stderr=subprocess.DEVNULL,
        )
        os.close(terminal)
        text = b""
        with suppress(OSError):  # Linux ends a terminal so
            while more := shown.read(4096):
                text += more
        if running.wait():
            raise RuntimeError(f"track ended with {running.returncode}")
    lines = [line.rstrip() for line in text.decode().splitlines()]
    kept = [line for line in lines if line and not line.startswith(("took ", "tracked "))]
    return "```text\n" + "\n".join(kept) + "\n```\n"


def commands() -> str:
    """Every command's help, as the command line prints it."""
    parts = [
        "# Commands",
        "What `handtrack COMMAND --help` prints. Exit status: 0 done, 1 the job failed, 2 the"
        " input or the arguments are wrong; what is wrong stands on one line.",
    ]
    for name in COMMANDS:
        top = click.Context(cli, info_name="handtrack", max_content_width=96, terminal_width=96)
        command = cli.get_command(top, name)
        if command is None:
            raise LookupError(f"no command {name}")
        inner = click.Context(command, top, name, max_content_width=96, terminal_width=96)
        parts += [f"## {name}", f"```text\n{command.get_help(inner)}\n```"]
    return "\n\n".join(parts) + "\n"


# --- the reference


def slug(title: str) -> str:
    """A file's name for a title."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")


def groups() -> dict[str, list[str]]:
    """The public names by what they are for, as the package's docstring lists them."""
    found: dict[str, list[str]] = {}
    text = inspect.getdoc(ht) or ""
    for bullet in re.findall(r"^- (.*?)(?=^- |^\S|\Z)", text, re.MULTILINE | re.DOTALL):
        title, _, names = bullet.partition(":")
        public = [name for name in re.findall(r"`(\w+)`", names) if name in ht.__all__]
        found[title.strip()] = list(dict.fromkeys(public))
    return found


def _reference_index() -> str:
    lines = ["# Reference", "Everything that `import handtrack as ht` gives, by what it is for."]
    for title, names in groups().items():
        links = ", ".join(f"{{py:obj}}`~handtrack.{name}`" for name in names)
        lines.append(f"- [{title}]({slug(title)}.md): {links}")
    contents = "\n".join(slug(title) for title in groups())
    return "\n\n".join(lines) + f"\n\n```{{toctree}}\n:hidden:\n\n{contents}\n```\n"


def _group_page(title: str, names: list[str]) -> str:
    blocks = []
    for name in names:
        value = getattr(ht, name)
        if inspect.ismodule(value):
            blocks.append(f".. automodule:: {value.__name__}\n   :members:")
        elif inspect.isclass(value):
            shown = "" if issubclass(value, Exception) else "\n   :members:"
            blocks.append(f".. autoclass:: handtrack.{name}{shown}")
        else:
            blocks.append(f".. autofunction:: handtrack.{name}")
    return f"# {title}\n\n```{{eval-rst}}\n" + "\n\n".join(blocks) + "\n```\n"


def numbers(name: str) -> Any:
    """What a tool measured, as kept."""
    return json.loads((NUMBERS / f"{name}.json").read_text())
