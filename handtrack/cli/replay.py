"""handtrack replay."""

from __future__ import annotations

from pathlib import Path

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import recordings
from handtrack.cli.live_view import connect_option
from handtrack.cli.options import part_options, quiet_option
from handtrack.cli.outputs import check_target, overwrite_option
from handtrack.errors import SettingsError


@click.command(cls=Command, short_help="Show recordings in Rerun.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--save", type=click.Path(path_type=Path), help="Write a Rerun file instead.")
@overwrite_option
@click.option("--web", is_flag=True, help="Serve the browser viewer on 127.0.0.1.")
@click.option(
    "--port", type=click.IntRange(1, 65535), metavar="PORT", help="Port of the browser viewer."
)
@click.option("--no-open", is_flag=True, help="With --web, only print the address.")
@connect_option
@click.option("--speed", type=float, metavar="X", help="Send in recorded time, X times as fast.")
@part_options
@click.option(
    "--side-by-side/--together",
    default=None,
    help="3D views for each file, or all in one world; by default side by side, up to 3 files.",
)
@click.option(
    "--offset",
    type=float,
    default=0.0,
    metavar="METRES",
    help="Move each file's hands so far to the right of the last one's.",
)
@click.option("--light", is_flag=True, help="Draw on a light ground.")
@click.option("--still", is_flag=True, help="Leave the eye where it is, even if a hand goes far.")
@click.option(
    "--limits",
    type=click.Choice(["anatomical", "li2021"]),
    help="Limits to draw and to mark violations of, instead of those of the fit.",
)
@click.option(
    "--mesh/--no-mesh",
    default=None,
    help="Draw the skin or not; by default up to 20,000 frames.",
)
@quiet_option
def replay(
    files: tuple[Path, ...],
    save: Path | None,
    web: bool,
    port: int | None,
    no_open: bool,
    connect: str | None,
    speed: float | None,
    hand: str | None,
    start: float | None,
    end: float | None,
    side_by_side: bool | None,
    offset: float,
    light: bool,
    still: bool,
    limits: str | None,
    mesh: bool | None,
    quiet: bool,
) -> None:
    """Show recordings in Rerun: the hand, the observed joints, the angles and the errors.

    FILES are recordings written by `handtrack track`, or folders of them. Several are compared:
    each has its own colour and 3D views (or all one world: --together), angles share plots, and
    the distance between their joints is plotted.
    """
    if save is not None:
        if web:
            raise SettingsError("--save writes a file and --web serves a page: choose one")
        check_target(save, ".rrd", "--save")
    if not web and (port is not None or no_open):
        raise SettingsError("--port and --no-open belong to --web")
    from handtrack.viewer.replay import replay as show

    paths = recordings(files)
    if save is not None:
        save.parent.mkdir(parents=True, exist_ok=True)

    def say(text: str) -> None:
        if text.startswith("http"):
            click.echo(text if quiet else f"{text}\nCtrl-C stops the server.")
        elif not quiet:
            click.echo(text, err=True)

    show(
        paths,
        save=save,
        web=web,
        connect=connect,
        speed=speed,
        port=port,
        open_viewer=not no_open,
        hand=hand,
        start_s=start,
        end_s=end,
        mesh=mesh,
        limits=limits,
        side_by_side=side_by_side,
        offset_m=offset,
        light=light,
        still=still,
        say=say,
    )
    if save is not None and not quiet:
        click.echo(f"{', '.join(map(str, paths[:3]))}{' ...' * (len(paths) > 3)} -> {save}")
