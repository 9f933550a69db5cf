"""handtrack recover."""

from __future__ import annotations

from pathlib import Path

import click

from handtrack.cli.helping import Command
from handtrack.cli.options import quiet_option
from handtrack.cli.outputs import check_target, overwrite_option
from handtrack.errors import SettingsError


@click.command(cls=Command, short_help="Make a clean recording of a broken one.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    help="The new file; NAME.mcap of NAME.mcap.part.",
)
@overwrite_option
@quiet_option
def recover(file: Path, output: Path | None, quiet: bool) -> None:
    """Make a clean recording of FILE, the part that a stopped run left, or a damaged file.

    All up to where it broke is copied, message for message.
    """
    from handtrack.recording.recover import recover as run

    if output is None:
        name = file.name.partition(".mcap")[0] + ".mcap"
        output = file.with_name(name)
        if file.suffix != ".part":
            raise SettingsError(f"where {file} is to be recovered to is not said: give -o OUT.mcap")
    check_target(output, ".mcap", "-o", [file])
    output.parent.mkdir(parents=True, exist_ok=True)
    found = run(file, output)
    if quiet:
        return
    what = f"recovered {found.frames:,} frames, {found.seconds:.2f} s -> {output}"
    if not found.note:
        click.echo(f"nothing was wrong with {file}; {what}")
    else:
        click.echo(f"{what}\n{file}: {found.note}; {found.lost_bytes:,} bytes are lost")
