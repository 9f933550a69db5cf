"""handtrack export."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import recordings
from handtrack.cli.models import model_options, take_models
from handtrack.cli.options import json_option, part_options, quiet_option, setting_option
from handtrack.cli.outputs import check_place, overwrite_option, refuse_existing
from handtrack.errors import SettingsError
from handtrack.exporting.settings import ExportSettings


def _options(command: Any) -> Any:
    """An option for each setting of an export."""
    for name, known in reversed(ExportSettings.known().items()):
        command = setting_option(name, known)(command)
    return command


@click.command(cls=Command, short_help="Write recordings for other programs.")
@click.argument("input", type=click.Path(path_type=Path))
@click.argument("output", type=click.Path(path_type=Path))
@click.option(
    "--to",
    type=click.Choice(["csv", "parquet", "npz", "bvh", "glb", "urdf", "mjcf"]),
    help="The format, where OUTPUT is a folder.",
)
@_options
@click.option(
    "--base",
    default="wrist",
    show_default=True,
    metavar="FRAME",
    help="urdf, mjcf: fix the wrist, or let it float in the input's frame of that name.",
)
@overwrite_option
@part_options
@model_options
@json_option
@quiet_option
def export(
    input: Path,
    output: Path,
    to: str | None,
    hand: str | None,
    start: float | None,
    end: float | None,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Write recordings for other programs: .csv, .parquet, .npz, .bvh, .glb, .urdf, .xml.

    INPUT is a recording written by `handtrack track`, or a folder of them. The ending of
    OUTPUT says the format; a folder needs --to. Of several hands each gets its own file,
    OUTPUT_right and OUTPUT_left, but a .glb holds all. Where the hand is lost .csv cells are
    empty, .parquet holds null, .npz NaN, and .bvh and .glb hold the last pose.

    .urdf, and .xml or .mjcf for MuJoCo, are the hand as a robot: links, hinges with limits,
    capsules and masses, with NAME_meshes/ and NAME_joints.csv, the angles [rad] by time; of
    NAME.xml these are NAME_xml_meshes/ and NAME_xml_joints.csv.

    Recordings do not hold licensed skins: --mano or --gltf brings that of the model that was
    tracked into a .glb; without it bones are drawn.
    """
    import handtrack as ht
    from handtrack.exporting.files import targets
    from handtrack.recording.read import read_part

    found = recordings((input,))
    folder = output.is_dir() or not output.suffix
    if folder == (to is None):
        raise SettingsError(
            f"{output} is a folder: say the format with --to"
            if folder
            else f"--to is for folders, {output} says its format by itself"
        )
    if len(found) > 1 and not folder:
        raise SettingsError(f"{len(found)} recordings need a folder to go to, not {output}")
    check_place(output / "x" if folder else output)
    given = take_models(options, "anatomical")
    written = []
    for path in found:
        target = output / f"{path.stem}.{to}" if folder else output
        if folder and input.is_dir():
            target = output / path.relative_to(input).with_suffix(f".{to}")
        tracks = [given.dressed(track) for track in read_part(path, hand, start, end)]
        refuse_existing(targets(tracks, target), "another name keeps what is there")
        target.parent.mkdir(parents=True, exist_ok=True)
        made = ht.export(tracks, target, **options)
        written += made
        for file in made if not (quiet or as_json) else ():
            what = [f"{', '.join(file.hands)}", f"{file.frames:,} frames", *file.notes]
            click.echo(f"{path} -> {file.path}: {'; '.join(what)}")
    if as_json:
        click.echo(json.dumps({"files": [_plain(file) for file in written]}, indent=2))


def _plain(file: Any) -> dict[str, Any]:
    return {**file._asdict(), "path": str(file.path), "bytes": file.path.stat().st_size}
