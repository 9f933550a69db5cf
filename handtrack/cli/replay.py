"""handtrack replay."""

from __future__ import annotations

from pathlib import Path

import click

from handtrack.cli.inputs import recordings
from handtrack.cli.options import no_mesh_option, quiet_option
from handtrack.cli.outputs import check_target
from handtrack.errors import SettingsError


@click.command(short_help="Show recordings in Rerun.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--save", type=click.Path(path_type=Path), help="Write a Rerun file instead.")
@click.option("--web", is_flag=True, help="Serve the browser viewer on 127.0.0.1.")
@click.option(
    "--port", type=click.IntRange(1, 65535), metavar="PORT", help="Port of the browser viewer."
)
@click.option("--no-open", is_flag=True, help="With --web, only print the address.")
@no_mesh_option
@quiet_option
def replay(
    files: tuple[Path, ...],
    save: Path | None,
    web: bool,
    port: int | None,
    no_open: bool,
    no_mesh: bool,
    quiet: bool,
) -> None:
    """Show recordings in Rerun: the hand, the observed joints, the angles and the errors.

    FILES are recordings written by `handtrack track`, or folders of them; several are shown in
    one world.
    """
    if save is not None:
        if web:
            raise SettingsError("--save writes a file and --web serves a page: choose one")
        check_target(save, ".rrd", "--save")
    if not web and (port is not None or no_open):
        raise SettingsError("--port and --no-open belong to --web")
    from handtrack.recording.replay import replay as show

    paths = recordings(files)
    if save is not None:
        save.parent.mkdir(parents=True, exist_ok=True)

    def say(address: str) -> None:
        click.echo(address if quiet else f"{address}\nCtrl-C stops the server.")

    show(paths, save=save, web=web, port=port, open_viewer=not no_open, mesh=not no_mesh, say=say)
    if save is not None and not quiet:
        click.echo(f"{', '.join(map(str, paths[:3]))}{' ...' * (len(paths) > 3)} -> {save}")
