"""Options that several commands share."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeVar

import click

from handtrack.errors import SettingsError

if TYPE_CHECKING:
    from handtrack.recording.settings import RecordingSettings

_Command = TypeVar("_Command", bound=Callable[..., Any])

json_option = click.option("--json", "as_json", is_flag=True, help="Print numbers for machines.")
quiet_option = click.option("-q", "--quiet", is_flag=True, help="Print nothing but errors.")

_RECORDING = (
    click.option(
        "--mesh",
        metavar="full|quantised|every:N|none",
        default="full",
        show_default=True,
        help="The skin in the recording: float32, steps of 0.12 mm, every Nth frame (also"
        " quantised,every:N), or left out.",
    ),
    click.option("--no-mesh", is_flag=True, help="The same as --mesh none."),
    click.option(
        "--compression",
        type=click.Choice(["lz4", "zstd", "none"]),
        default="lz4",
        show_default=True,
        help="Of the recording: zstd is smaller and slower.",
    ),
    click.option(
        "--foxglove-mesh", is_flag=True, help="The skin as a foxglove.SceneUpdate as well."
    ),
)


def recording_options(command: _Command) -> _Command:
    """Give a command the options that say what a recording holds; `take_recording` takes them."""
    for option in reversed(_RECORDING):
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
        if taken["mesh"] not in ("full", "none"):
            raise SettingsError(f"--no-mesh and --mesh {taken['mesh']}: choose one")
        taken["mesh"] = "none"
    return RecordingSettings.of(**taken)


class _Factor(click.ParamType[Any]):
    """auto, or a number."""

    name = "factor"

    def convert(self, value: Any, param: Any, context: Any) -> Any:
        return value if value == "auto" else click.FLOAT.convert(value, param, context)


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
        help="Find the subject's hand in the sequence: lengths, palm and axes (default; with"
        " --hand-model it is fitted as it is); or only its size.",
    ),
    "gate": click.option(
        "--gate/--no-gate",
        default=True,
        help="Leave out joints and frames that cannot be true (default), or use all.",
    ),
    "filter": click.option(
        "--filter",
        type=click.Choice(["none", "kalman", "one-euro", "fixed-lag", "rts"]),
        default="none",
        show_default=True,
        help="Steady the poses: frame by frame (kalman, one-euro), by the next frames too"
        " (fixed-lag), or by the whole sequence (rts).",
    ),
    "lag": click.option(
        "--lag",
        type=click.IntRange(0, 1000),
        default=2,
        show_default=True,
        metavar="FRAMES",
        help="How many frames fixed-lag waits.",
    ),
    "process_noise": click.option(
        "--process-noise",
        type=_Factor(),
        default="auto",
        show_default=True,
        metavar="auto|FACTOR",
        help="How wildly the hand moves: learnt, or a factor on usual accelerations.",
    ),
    "couple": click.option(
        "--couple/--no-couple",
        default=True,
        help="Let the filter's prediction enter the fit (default), or filter the fits.",
    ),
    "robust": click.option(
        "--robust",
        type=click.Choice(["none", "huber", "geman-mcclure"]),
        default="none",
        show_default=True,
        help="Give joints that are far off little weight (huber), or next to none.",
    ),
    "spread_mm": click.option(
        "--spread-mm",
        type=click.FloatRange(0, min_open=True),
        default=10.0,
        show_default=True,
        metavar="MM",
        help="How far off --robust begins to doubt a joint.",
    ),
    "noise_mm": click.option(
        "--noise-mm",
        type=click.FloatRange(0, min_open=True),
        metavar="MM",
        help="Noise of the joints, per coordinate, for variances and filters; by default it is"
        " estimated.",
    ),
    "collisions": click.option(
        "--collisions/--no-collisions",
        default=False,
        help="Move bones apart that sink into each other; off by default.",
    ),
}
"""How to track, by the argument of `handtrack.track` that it sets; `limits` are the model's.
`track` and `retrack` share them."""


def is_default(name: str) -> bool:
    """Whether the user left an option of the running command out."""
    source = click.get_current_context().get_parameter_source(name)
    return source is click.core.ParameterSource.DEFAULT


def tracking_options(command: _Command) -> _Command:
    """Give a command the options that say how to track; their values are taken
    by `take_tracking`."""
    for option in reversed(_TRACKING.values()):
        command = option(command)
    return command


def take_tracking(options: dict[str, Any]) -> dict[str, Any]:
    """Take the values of `tracking_options` out of a command's options.

    Raises:
        SettingsError: an option that the filter has no use for.
    """
    taken = {name: options.pop(name) for name in _TRACKING}
    # retrack has the filter from the recording where it is not given
    known = click.get_current_context().info_name != "retrack" or not is_default("filter")
    if known and taken["filter"] != "fixed-lag" and not is_default("lag"):
        raise SettingsError(f"--lag belongs to --filter fixed-lag, not to {taken['filter']}")
    return taken


def part_options(command: _Command) -> _Command:
    """Give a command the options that choose a part of a recording: hand, start and end."""
    for option in (
        click.option("--end", type=float, metavar="SECONDS", help="Last time, from the start."),
        click.option("--start", type=float, metavar="SECONDS", help="First time, from the start."),
        click.option("--hand", type=click.Choice(["left", "right"]), help="Only this hand."),
    ):
        command = option(command)
    return command
