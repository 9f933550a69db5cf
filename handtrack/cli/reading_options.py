"""The options that say how joint sequences are read; `inputs.Reading` takes them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

_Command = TypeVar("_Command", bound=Callable[..., Any])

_FRAMES = click.option("--frames", metavar="A:B", help="Only source frames A to B, both included.")


def reading_options(command: _Command, frames: bool = True) -> _Command:
    """Give a command the options that make a `Reading`; `frames`: also the one of that name."""
    for option in (
        click.option("--fps", type=float, help="Frame rate, instead of the file's times."),
        click.option(
            "--time-unit",
            type=click.Choice(["s", "ms", "us", "ns"]),
            help="Unit of the file's times, where it does not say or is wrong.",
        ),
        click.option(
            "--mirror",
            type=click.Choice(["x", "y", "z"]),
            help="Axis to turn round, where the file's world is left-handed (Unity, Unreal).",
        ),
        click.option(
            "--order",
            metavar="NAME",
            help="Joint order, where the file does not say: a name, or 21 places (0,1,2,...).",
        ),
        click.option(
            "--markers",
            type=click.Path(path_type=Path),
            metavar="FILE",
            help="Of motion capture: which marker is which joint, JSON or CSV of pairs.",
        ),
        click.option(
            "--trajectory",
            type=click.Path(path_type=Path),
            metavar="FILE",
            help="Of Project Aria: closed_loop_trajectory.csv, to bring hands into the world.",
        ),
        click.option(
            "--profile",
            type=click.Path(path_type=Path),
            metavar="FILE",
            help="Of UmeTrack's angles (HOT3D, emg2pose): the hand's profile, if not beside them.",
        ),
        click.option(
            "--key",
            metavar="NAME",
            help="What is the joints: an array of an .npz, a dataset of an HDF5, a key of a JSON.",
        ),
        click.option(
            "--columns",
            metavar="A:B|LIST",
            help="Of a table: the 63 columns of the joints, x y z of each in its turn: the first"
            " and the last, or all with commas between; titles, or numbers from 0.",
        ),
        click.option("--unit", type=click.Choice(["m", "cm", "mm"]), help="Unit of the joints."),
        click.option(
            "--hand",
            type=click.Choice(["auto", "left", "right", "swap"]),
            default="auto",
            help="Which hand it is, or which to take of two; swap exchanges the labels.",
        ),
        click.option(
            "--format", metavar="NAME", help="Format of the file, where it could be another's."
        ),
        click.option(
            "--max-size",
            metavar="SIZE",
            help="Read, and unpack, files up to that size, such as 16GB.  [default: 4GB]",
        ),
        *([_FRAMES] if frames else []),
    ):
        command = option(command)
    return command
