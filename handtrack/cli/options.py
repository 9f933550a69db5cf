"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import click

_Command = TypeVar("_Command", bound=Callable[..., Any])

json_option = click.option("--json", "as_json", is_flag=True, help="Print numbers for machines.")
no_mesh_option = click.option("--no-mesh", is_flag=True, help="Leave the skin out.")
quiet_option = click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")

_TRACKING = {
    "limits": click.option(
        "--limits",
        type=click.Choice(["anatomical", "li2021"]),
        default="anatomical",
        show_default=True,
        help="Joint limits: a wide anatomical set, or Table 1 of Li et al. 2021.",
    ),
    "update": click.option(
        "--update",
        type=click.Choice(["exact", "li2021"]),
        default="exact",
        show_default=True,
        help="Block updates: the constrained minimiser, or the paper's.",
    ),
    "calibrate": click.option(
        "--calibrate/--no-calibrate",
        default=True,
        help="Take the hand's proportions from the sequence (default), or only its size.",
    ),
    "filter": click.option(
        "--filter",
        type=click.Choice(["none", "kalman"]),
        default="none",
        show_default=True,
        help="Steady the angles over time.",
    ),
}
"""How to track, by the argument of `handtrack.track` that it sets; `limits` are the model's.
`track` and `retrack` share them."""


def tracking_options(command: _Command) -> _Command:
    """Give a command the options that say how to track; their values are taken
    by `take_tracking`."""
    for option in reversed(_TRACKING.values()):
        command = option(command)
    return command


def take_tracking(options: dict[str, Any]) -> dict[str, Any]:
    """Take the values of `tracking_options` out of a command's options."""
    return {name: options.pop(name) for name in _TRACKING}


def part_options(command: _Command) -> _Command:
    """Give a command the options that choose a part of a recording: hand, start and end."""
    for option in (
        click.option("--end", type=float, metavar="SECONDS", help="Last time, from the start."),
        click.option("--start", type=float, metavar="SECONDS", help="First time, from the start."),
        click.option("--hand", type=click.Choice(["left", "right"]), help="Only this hand."),
    ):
        command = option(command)
    return command
