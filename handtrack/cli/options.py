"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from handtrack.errors import SettingsError
from handtrack.hand.units import METRES
from handtrack.settings import Known
from handtrack.tracking.settings import TrackSettings

if TYPE_CHECKING:
    from handtrack.recording.settings import RecordingSettings

_Command = TypeVar("_Command", bound=Callable[..., Any])

json_option = click.option("--json", "as_json", is_flag=True, help="Print numbers for machines.")
quiet_option = click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")


def _mesh(default: str) -> Callable[[_Command], _Command]:
    return click.option(
        "--mesh",
        metavar="full|quantised|every:N|none",
        default=default,
        show_default=True,
        help="The skin in the recording: float32, steps of 0.12 mm, every Nth frame (also"
        " quantised,every:N), or left out.",
    )


_RECORDING = (
    click.option("--no-mesh", is_flag=True, help="The same as --mesh none."),
    click.option(
        "--compression",
        type=click.Choice(["lz4", "zstd", "none"]),
        default="lz4",
        show_default=True,
        help="Of the recording: zstd is smaller and slower.",
    ),
    click.option("--foxglove-mesh", is_flag=True, help="Smooth skin for Foxglove in every frame."),
)


def recording_options(command: _Command, mesh: str = "full") -> _Command:
    """Give a command the options that say what a recording holds; `take_recording` takes them.

    Args:
        command: it.
        mesh: the skin that is recorded unless the user says otherwise.
    """
    for option in reversed((_mesh(mesh), *_RECORDING)):
        command = option(command)
    return command


def take_recording(options: dict[str, Any]) -> RecordingSettings:
    """Take the values of `recording_options`.

    Raises:
        SettingsError: they contradict each other.
    """
    from handtrack.recording.settings import RecordingSettings

    taken = {name: options.pop(name) for name in ("mesh", "compression", "foxglove_mesh")}
    if options.pop("no_mesh"):
        if taken["mesh"] != "none" and not is_default("mesh"):
            raise SettingsError(f"--no-mesh and --mesh {taken['mesh']}: choose one")
        taken["mesh"] = "none"
    return RecordingSettings.of(**taken)


class _Number(click.ParamType[Any]):
    """One of some words, or a number."""

    name = "number"

    def __init__(self, words: tuple[str, ...]) -> None:
        self._words = words

    def convert(self, value: Any, param: Any, context: Any) -> Any:
        return value if value in self._words else click.FLOAT.convert(value, param, context)


def setting_option(name: str, known: Known) -> Callable[[_Command], _Command]:
    """The option that a setting is on the command line."""
    about, default = known.about, known.default
    dashed = name.replace("_", "-")
    if isinstance(default, bool):
        return click.option(f"--{dashed}/--no-{dashed}", default=default, help=about.help)
    kind: click.ParamType[Any]
    if about.choices:
        kind = click.Choice(about.choices)
    elif about.words:
        kind = _Number(about.words)
    elif isinstance(default, str):
        kind = click.STRING
    else:
        ranges = click.IntRange if isinstance(default, int) else click.FloatRange
        low = about.least if about.above is None else about.above
        kind = ranges(low, about.most, min_open=about.above is not None)  # type: ignore[arg-type]
    return click.option(
        f"--{dashed}",
        type=kind,
        default=default,
        show_default=default is not None,
        metavar=about.metavar,
        help=about.help,
    )


_LIMITS = click.option(
    "--limits",
    type=click.Choice(["anatomical", "li2021"]),
    default="anatomical",
    show_default=True,
    help="Joint limits: a wide anatomical set, or Table 1 of Li et al. 2021.",
)
TRACKING = {
    name: setting_option(name, known)
    for name, known in TrackSettings.known().items()
    if known.about.option
}
"""How to track: an option for each setting of `handtrack.track` that is for the command line.
`track`, `retrack` and `live` share them, and `--limits`, which are the model's."""

_KALMAN = ("kalman", "fixed-lag", "rts")
_BELONGS = {
    "lag": ("filter", ("fixed-lag",)),
    "process_noise": ("filter", _KALMAN),
    "noise_colour": ("filter", _KALMAN),
    "couple": ("filter", _KALMAN),
    "spread_mm": ("robust", ("huber", "geman-mcclure")),
}
"""Options that say something only of some choices of another."""


def is_default(name: str) -> bool:
    """Whether the user left an option of the running command out."""
    source = click.get_current_context().get_parameter_source(name)
    return source is click.core.ParameterSource.DEFAULT


def tracking_options(command: _Command) -> _Command:
    """Give a command the options that say how to track; their values are taken
    by `take_tracking`."""
    for option in reversed((_LIMITS, *TRACKING.values())):
        command = option(command)
    return command


def take_tracking(options: dict[str, Any]) -> tuple[TrackSettings, str]:
    """Take the values of `tracking_options` out of a command's options: settings and limits.

    Raises:
        SettingsError: a value cannot be used, or the filter has no use for an option.
    """
    settings = TrackSettings.of(None, {name: options.pop(name) for name in TRACKING})
    chosen = {"filter": settings.filter.name, "robust": settings.fit.robust}
    stored = click.get_current_context().info_name == "retrack"
    for option, (of, using) in _BELONGS.items():
        # retrack has what is not given from the recording
        known = not (stored and is_default(of))
        if known and chosen[of] not in using and not is_default(option):
            no = "no-" if settings.flat()[option] is False else ""
            *most, last = using
            words = " or ".join([", ".join(most), last] if most else [last])
            raise SettingsError(
                f"--{no}{option.replace('_', '-')} belongs to --{of} {words}, not to {chosen[of]}"
            )
    return settings, options.pop("limits")


def part_options(command: _Command) -> _Command:
    """Give a command the options that choose a part of a recording: hand, start and end."""
    for option in (
        click.option("--end", type=float, metavar="SECONDS", help="Last time, from the start."),
        click.option("--start", type=float, metavar="SECONDS", help="First time, from the start."),
        click.option("--hand", type=click.Choice(["left", "right"]), help="Only this hand."),
    ):
        command = option(command)
    return command


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
        click.option("--unit", type=click.Choice([*METRES]), help="Unit of the joints."),
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
