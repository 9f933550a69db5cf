"""handtrack convert."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.config import used_config
from handtrack.cli.helping import Command
from handtrack.cli.inputs import Reading
from handtrack.cli.models import hand_model_option, model_options, take_models
from handtrack.cli.options import json_option, quiet_option, reading_options
from handtrack.cli.outputs import check_place, overwrite_option, refuse_existing
from handtrack.cli.progress import compiling_said
from handtrack.errors import InputError, SettingsError
from handtrack.hand.units import METRES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from handtrack.converting.convert import Converted


@click.command(cls=Command, short_help="Write hands in another format, and say what that loses.")
@click.argument("input", type=click.Path(path_type=Path))
@click.argument("output", type=click.Path(path_type=Path))
@click.option(
    "--to",
    metavar="FORMAT",
    help="npz, csv, parquet, lerobot, mcap, openxr, umetrack, mano, egodex, trc, bvh or glb; by"
    " OUTPUT's ending if left out.",
)
@click.option(
    "--up",
    type=click.Choice(["x", "y", "z", "-x", "-y", "-z"]),
    default="y",
    show_default=True,
    help="bvh, glb: the input's axis that points up; it becomes y.",
)
@click.option(
    "--length",
    type=click.Choice([*METRES]),
    default="cm",
    show_default=True,
    help="bvh: the unit of length in OUTPUT.",
)
@overwrite_option
@model_options
@hand_model_option
@json_option
@quiet_option
@reading_options
def convert(
    input: Path,
    output: Path,
    to: str | None,
    up: str,
    length: str,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Write joint sequences, recordings or pictures in another format.

    INPUT is all that `track` reads, or a recording of handtrack; a folder is converted file by
    file where OUTPUT is a folder. Joints stay as they are where the format has places for them;
    those that it wants and INPUT lacks come from the hand fitted to it, with their standard
    deviation. What is written is read back and compared: what was lost is said in millimetres and
    degrees. Of several hands each gets a file, OUTPUT_right and OUTPUT_left, where a file of the
    format holds but one.
    """
    from handtrack.converting.convert import files_of
    from handtrack.converting.targets import TARGETS, target_of

    mano = {name: options[name] for name in ("mano", "mano_tips")}
    models = take_models(options, "anatomical")
    reading = Reading(**options, **mano)
    folder = output.is_dir() or not output.suffix
    if folder and to is None:
        raise SettingsError(f"{output} is a folder: say the format with --to")
    name = target_of(output / f"x{TARGETS[to].ending}" if folder and to in TARGETS else output, to)
    check_place(output / "x" if folder else output)
    made: list[Converted] = []
    with compiling_said(quiet or as_json):
        for source, found in _found(input, reading, quiet or as_json, folder, name):
            target = output / f"{source.stem}{TARGETS[name].ending}" if folder else output
            refuse_existing(files_of(found, target, name), "another name keeps what is there")
            target.parent.mkdir(parents=True, exist_ok=True)
            made += _convert(found, target, name, models, reading, up, length)
            if not (quiet or as_json):
                for hand in made[-len(found) :]:
                    _say(source, hand)
    if as_json:
        click.echo(json.dumps({"files": [_plain(hand) for hand in made]}, indent=2))


def _convert(
    found: Sequence[Any],
    target: Path,
    name: str,
    models: Any,
    reading: Reading,
    up: str,
    length: str,
) -> list[Converted]:
    from handtrack.converting.convert import convert as write

    def subject(sequence: Any) -> tuple[Any, Any]:
        model, how = models.subject(sequence, "none" if models.file is not None else "auto")
        return model, how

    return write(
        found,
        target,
        name,
        models=subject,
        mano=reading.mano,
        mano_tips=reading.mano_tips,
        profile=reading.profile,
        up=up,
        unit=length,
        told={"config": config} if (config := used_config()) else {},
    )


def _found(
    input: Path, reading: Reading, quiet: bool, folder: bool, to: str
) -> list[tuple[Path, Sequence[Any]]]:
    """What is to be converted, by file.

    Raises:
        InputError: several files go into one.
    """
    import handtrack as ht
    from handtrack.mcap.hands import is_recording

    if input.is_file() and input.suffix in (".mcap", ".part") and is_recording(input):
        tracks = ht.read_mcap(input)
        if reading.hand in ("left", "right"):
            tracks = [t for t in tracks if t.hand == reading.hand]
        return [(input, tracks)]
    by_file: dict[str, list[Any]] = {}
    for sequence in _loaded(input, reading, quiet, to):
        by_file.setdefault(sequence.source, []).append(sequence)
    if len(by_file) > 1 and not folder:
        raise InputError(f"holds {len(by_file)} files: they need a folder to go to", input)
    return [(Path(source), found) for source, found in by_file.items()]


def _loaded(input: Path, reading: Reading, quiet: bool, to: str) -> list[Any]:
    """The sequences; a profile may be of what is written alone."""
    from handtrack.files.pictures import pictures_in
    from handtrack.sequences.readers.companions import NotTakenError

    without = reading._replace(profile=None)
    if to != "umetrack" or reading.profile is None:
        return reading.load(input, quiet)
    if pictures_in(input) is not None:
        return without.load(input, quiet)
    try:
        return reading.load(input, quiet)
    except NotTakenError as error:
        if error.companion != "profile":
            raise
        return without.load(input, quiet)


def _say(source: Path, hand: Converted) -> None:
    what = [hand.hand, f"{hand.frames:,} frames", *hand.notes]
    never = [f"{name} ± {made.sd_mm:.1f} mm" for name, made in hand.made.items() if made.never]
    if never:
        what.append(f"from the fitted hand: {', '.join(never)}")
    if times := [made for made in hand.made.values() if not made.never]:
        count = sum(made.frames for made in times)
        most = max(made.sd_mm for made in times)
        what.append(f"{count:,} joints of single frames from it, ± {most:.1f} mm or less")
    click.echo(f"{source} -> {hand.path}: {'; '.join([*what, str(hand.loss)])}")


def _plain(hand: Converted) -> dict[str, Any]:
    made = {joint: of._asdict() for joint, of in hand.made.items()}
    loss = {k: None if v != v else v for k, v in hand.loss._asdict().items()}
    return {**hand._asdict(), "path": str(hand.path), "made": made, "loss": loss}
