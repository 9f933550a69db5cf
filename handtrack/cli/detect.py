"""handtrack detect."""

from __future__ import annotations

import json
from pathlib import Path

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import Reading
from handtrack.cli.options import json_option, quiet_option
from handtrack.cli.outputs import check_target, overwrite_option
from handtrack.cli.progress import progress_shown
from handtrack.errors import SettingsError


@click.command(cls=Command, short_help="Find the hands in a video or in images.")
@click.argument("input", required=False, type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), help=".npz file to write.")
@overwrite_option
@click.option(
    "--model", type=click.Path(path_type=Path), help="A hand_landmarker.task, kept from then on."
)
@click.option("--make-model", is_flag=True, help="Make that file from MediaPipe's own wheel.")
@click.option("--fps", type=float, help="Frame rate, instead of the video's times.")
@click.option("--frames", metavar="A:B", help="Only frames A to B, both included.")
@json_option
@quiet_option
def detect(
    input: Path | None,
    output: Path | None,
    model: Path | None,
    make_model: bool,
    fps: float | None,
    frames: str | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Find the hands of one person in INPUT: a video, an image, or a folder of images.

    Writes joints in metres around each hand's middle, joints in the picture, and scores; `handtrack
    track` reads the file, and takes videos and images directly, too. Needs `pip install
    'handtrack[video]'` and MediaPipe's hand model: --make-model or --model, once.
    """
    from handtrack.video import model_file

    if make_model:
        if model is not None:
            raise SettingsError("--make-model makes a model and --model gives one: choose one")
        path = model_file.make()
        if not quiet:
            click.echo(f"made {path}\n{model_file.LICENCE}", err=as_json)
    if input is None:
        if not make_model:
            raise SettingsError("nothing to look at: expected a video, an image or a folder")
        return
    from handtrack.video.detections import detect as find
    from handtrack.video.media import count

    total = count(input)
    output = output or Path(f"{input.resolve().stem}.npz")
    check_target(output, ".npz", "-o", [input])
    span = Reading(frames=frames).frame_range
    if span is not None:
        total = max(min(total, span[1] + 1) - span[0], 1)
    with progress_shown(total, quiet or as_json, "detecting") as progress:
        found = find(input, model=model, fps=fps, frames=span, progress=progress.frames)
    output.parent.mkdir(parents=True, exist_ok=True)
    found.save(output)
    seen = {hand: int((found.score[hand] > 0).sum()) for hand in found.hands}
    if as_json:
        click.echo(json.dumps({"output": str(output), "frames": len(found), "seen": seen}))
    elif not quiet:
        counts = ", ".join(f"{hand} hand in {n:,}" for hand, n in seen.items())
        click.echo(f"{counts} of {len(found):,} frames -> {output}")
