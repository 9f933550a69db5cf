"""handtrack profile."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import Reading, Truths
from handtrack.cli.options import json_option, quiet_option, reading_options
from handtrack.cli.outputs import check_target
from handtrack.errors import InputError

if TYPE_CHECKING:
    from handtrack import Sequence
    from handtrack.detectors.profile import Profile
    from handtrack.evaluation.landmarks import Seen


@click.command(
    cls=Command,
    short_help="Find how a detector's landmarks lie about the joints, from the truth.",
)
@click.argument("detections", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    help="True joint centres of the same frames; by default those that the files hold.",
)
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("profile.json"),
    show_default=True,
    help="The profile's file.",
)
@click.option("--name", help="Of the profile; by default the file's.")
@click.option(
    "--one-camera",
    is_flag=True,
    help="The detections are one camera's: about the hand's middle, of a size of their own in each"
    " frame, z the viewing direction.",
)
@json_option
@quiet_option
@reading_options
def profile(
    detections: tuple[Path, ...],
    truth: Path | None,
    output: Path,
    name: str | None,
    one_camera: bool,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Find a detector's profile: its landmarks about the joint centres, and its noise.

    DETECTIONS are files or folders as `track` takes them, of frames of which the true joints are
    known too. `handtrack track --detector profile.json` then brings the landmarks of the fitted
    hand onto what the detector gives. Take several people, or the profile is one person's.
    """
    check_target(output, ".json", "-o", detections)
    reading = Reading(**options)
    truths = None if truth is None else Truths.load(truth, reading)
    sequences = [s for path in detections for s in reading.load(path, quiet or as_json)]
    from handtrack.detectors.profile import INPUTS, save_profile
    from handtrack.evaluation.landmarks import estimate_profile

    kind = INPUTS[0] if one_camera else INPUTS[1]
    clips = [_seen(s, truths, one_camera) for s in sequences]
    found = estimate_profile(clips, name or output.stem, name or "", kind)
    save_profile(found, output)
    if as_json:
        click.echo(json.dumps(_summary(found) | {"output": str(output)}))
    elif not quiet:
        _say(found)
        click.echo(f"-> {output}")


def _seen(sequence: Sequence, truths: Truths | None, one_camera: bool) -> Seen:
    """A sequence beside its truth, frame by frame.

    Raises:
        InputError: no truth, or none that belongs to it.
    """
    import numpy as np

    from handtrack.evaluation.frame_match import match_frames
    from handtrack.evaluation.landmarks import Seen

    view = np.array([0.0, 0.0, 1.0]) if one_camera else None
    if truths is None:
        if sequence.truth is None:
            raise InputError("no true joints: give them with --truth", sequence.source or None)
        return Seen.of(sequence, sequence.truth, view=view)
    true = truths.of(sequence)
    if true.hand != sequence.hand:
        raise InputError(
            f"the truth is of a {true.hand} hand, the detections are of a {sequence.hand} one"
            " (--hand says which)",
            sequence.source or None,
        )
    found = match_frames(sequence, true)
    joints = np.full_like(sequence.joints, np.nan)
    joints[found.estimate] = true.joints[found.truth]
    return Seen.of(sequence, joints, view=view)


def _summary(found: Profile) -> dict[str, Any]:
    noise = found.noise
    return {
        "name": found.name,
        "input": found.input,
        **found.evidence,
        "noise_mm": {
            part: round(1e3 * float((getattr(noise, part) ** 2).mean() ** 0.5), 2)
            for part in ("constant", "fading", "white")
        },
        "fades_s": noise.fades_s,
    }


def _say(found: Profile) -> None:
    said = _summary(found)
    click.echo(
        f"{said['clips']} clips, {said['frames']:,} frames: landmarks were"
        f" {said['without_mm']:.1f} mm off the joints, {said['with_mm']:.1f} mm with their offsets"
    )
    noise = said["noise_mm"]
    click.echo(
        f"left per coordinate: {noise['constant']:.1f} mm of the subject's own,"
        f" {noise['fading']:.1f} mm that fades in {said['fades_s']:.2f} s, {noise['white']:.1f} mm"
        " new in every frame"
    )
