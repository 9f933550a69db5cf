"""handtrack plot."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import recordings
from handtrack.cli.options import part_options, quiet_option, setting_option
from handtrack.cli.outputs import check_target, overwrite_option
from handtrack.errors import SettingsError
from handtrack.plotting.settings import PlotSettings

if TYPE_CHECKING:
    from handtrack import Track

_SUFFIXES = (".pdf", ".svg", ".png")


def _options(command: Any) -> Any:
    """An option for each setting of a figure."""
    for name, known in reversed(PlotSettings.known().items()):
        command = setting_option(name, known)(command)
    return command


@click.command(cls=Command, short_help="Draw angles, errors and events for a paper.")
@click.argument(
    "files", nargs=-1, required=True, metavar="FILE... FIGURE", type=click.Path(path_type=Path)
)
@click.option(
    "--finger",
    metavar="thumb|index|middle|ring|little",
    multiple=True,
    help="Only this one; more by repeating.",
)
@click.option(
    "--joint",
    metavar="NAME",
    multiple=True,
    help="Only its angles: a joint as in index_pip, a kind as in pip, an angle as in"
    " thumb_cmc_abduction; more by repeating.",
)
@part_options
@_options
@overwrite_option
@quiet_option
def plot(
    files: tuple[Path, ...],
    finger: tuple[str, ...],
    joint: tuple[str, ...],
    hand: str | None,
    start: float | None,
    end: float | None,
    quiet: bool,
    **options: Any,
) -> None:
    """Draw angles, errors, statuses and events over time, as papers want them.

    FILE is a recording written by `handtrack track`; several are compared, by the names of their
    files or as NAME=FILE. FIGURE is a .pdf or .svg, which are vectors, or a .png. Angles are in
    degrees with what is outside the limits shaded; bands are standard deviations of the fit.
    """
    import handtrack as ht

    *given, target = files
    if not given:
        raise SettingsError(f"{target}: expected recordings and then the figure, a .pdf or .svg")
    if target.suffix not in _SUFFIXES:
        raise SettingsError(f"{target}: expected a figure that ends in {', '.join(_SUFFIXES)}")
    tracks = _tracks(given, hand)
    check_target(target, target.suffix, "FIGURE", [Path(path) for path in given])
    ht.plot(tracks, target, fingers=finger, joints=joint, start_s=start, end_s=end, **options)
    if not quiet:
        frames = sum(len(track) for track in tracks.values())
        click.echo(f"{len(tracks)} {'hand' if len(tracks) == 1 else 'hands'}, {frames:,} frames"
                   f" -> {target}")  # fmt: skip


def _tracks(given: list[Path], hand: str | None) -> dict[str, Track]:
    """The hands of recordings by the names of their files, or those given, where there are
    several."""
    import handtrack as ht
    from handtrack.recording.parts import pick

    found: list[tuple[str, Path, Track]] = []
    for argument in given:
        name, equals, rest = str(argument).partition("=")
        named = bool(equals) and not argument.exists()
        for path in recordings((Path(rest) if named else argument,)):
            tracks = pick(ht.read_mcap(path), hand)
            for track in tracks:
                side = f" {track.hand}" if len(tracks) > 1 else ""
                found.append((f"{name if named else path.stem}{side}", path, track))
    count = Counter(name for name, _, _ in found)
    called = [
        f"{path.resolve().parent.name}/{name}" if count[name] > 1 else name
        for name, path, _ in found
    ]
    twice = [name for name, n in Counter(called).items() if n > 1]
    if twice:
        raise SettingsError(f"two are called {twice[0]}: give names as NAME=FILE")
    return {name: track for name, (_, _, track) in zip(called, found, strict=True)}
