"""handtrack calibrate."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import Reading
from handtrack.cli.models import model_options, take_models
from handtrack.cli.options import json_option, quiet_option, reading_options
from handtrack.cli.outputs import check_target, overwrite_option
from handtrack.cli.progress import compiling_said
from handtrack.errors import InputError, SettingsError

if TYPE_CHECKING:
    from handtrack import HandModel, Sequence
    from handtrack.cli.models import Models
    from handtrack.detectors.profile import Profile


@click.command(
    cls=Command, short_help="Find a subject's own hand in sequences and keep it in a file."
)
@click.argument("inputs", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "-o",
    "--output",
    type=click.Path(path_type=Path),
    default=Path("hand.json"),
    show_default=True,
    help="The hand's file.",
)
@overwrite_option
@click.option(
    "--method",
    type=click.Choice(["full", "lengths", "proportions", "scale"]),
    default="full",
    show_default=True,
    help="Lengths, palm and axes; lengths and palm; medians of those; or the size alone.",
)
@click.option(
    "--detector",
    metavar="auto|none|NAME|PROFILE.json",
    default="auto",
    show_default=True,
    help="Whose landmarks the joints are, as `track` takes it.",
)
@click.option(
    "--limits",
    type=click.Choice(["anatomical", "li2021"]),
    default="anatomical",
    show_default=True,
    help="Joint limits that the hand is to be used with.",
)
@model_options
@json_option
@quiet_option
@reading_options
def calibrate(
    inputs: tuple[Path, ...],
    output: Path,
    method: str,
    detector: str,
    limits: str,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Find the hand of one subject: bone lengths, palm and joint axes.

    INPUTS are files or folders as `track` takes them, all of the same hand of the same person:
    the axes are shared, and lengths may drift a little from one sequence to the next. Use the
    result with `handtrack track --hand-model hand.json`.
    """
    check_target(output, ".json", "-o", inputs)
    given = dict(options)
    models = take_models(options, limits)
    mano = {name: given[name] for name in ("mano", "mano_tips")}
    reading = Reading(**options, **mano)
    sequences = [s for path in inputs for s in reading.load(path, quiet or as_json)]
    # those of a folder
    check_target(output, ".json", "-o", [Path(s.source) for s in sequences if s.source])
    _check_one_subject(sequences)
    with compiling_said(quiet or as_json):
        from handtrack.detectors.chosen import chosen_profile
        from handtrack.fitting.fit import warm_up

        warm_up()
        profile = (
            None
            if models.mano(sequences[0].hand)
            else chosen_profile(detector, sequences[0].detector)
        )
        fitted = [sequence.corrected(profile) for sequence in sequences]
        hand, found, notes = _calibrated(models, fitted, method, profile)
        from handtrack.calibration.explain import doubt, explain

        found |= explain(hand, fitted).summary()
        doubtful = doubt(found)
        several, drift = len(sequences) > 1, found.get("drift_mm")
        if doubtful is not None:
            notes = [
                *notes,
                doubtful + ("; or are the clips of different people?" if several else ""),
            ]
        elif several and isinstance(drift, list) and min(drift, default=0.0) > _DRIFT_MM:
            notes = [*notes, _OTHERS]
        bound = found["bound_mean_mm"]
        if isinstance(bound, float) and bound < _RIGID_MM:
            notes = [*notes, _OF_A_FIT]
    from handtrack import __version__
    from handtrack.hand.hand_file import save_hand

    sources = [s.source or s.name for s in sequences]
    base, base_file = models.base
    save_hand(hand, output, found | {"sources": sources, "by": __version__}, base, base_file)
    if as_json:
        result = found | {
            "hand": hand.hand,
            "sources": sources,
            "output": str(output),
            "warnings": [f"{s.name}: {note}" for s in sequences for note in s.notes] + notes,
        }
        click.echo(json.dumps(result, indent=2, allow_nan=False))
    elif not quiet:
        for note in notes:
            click.echo(f"warning: {note}", err=True)
        _say(hand, found, sequences)
        click.echo(f"-> {output}")


# clips of one person: at most 2.1 mm of the clip that drifts least, of eight pools of real ones
_DRIFT_MM = 3.0
_OTHERS = (
    "bones of every clip have other lengths than the hand that all share: are the clips of"
    " different people?"
)
_RIGID_MM = 0.01
_OF_A_FIT = (
    "the joints are those of a rigid hand without noise, as where a hand was fitted to pictures"
    " before: the result is that hand, and the residual says nothing about a detector"
)


def _check_one_subject(sequences: list[Sequence]) -> None:
    """Refuse sequences that cannot be of one hand.

    Raises:
        InputError: they are of both hands, of several people, or one file holds several.
    """
    hands = {s.hand for s in sequences}
    if len(hands) > 1:
        raise InputError("left and right hands are in the input: choose one with --hand")
    subjects = sorted({s.subject for s in sequences if s.subject})
    if len(subjects) > 1:
        raise InputError(f"several subjects are in the input: {', '.join(subjects)}")
    seen: set[str] = set()
    for sequence in sequences:
        if sequence.source and sequence.source in seen:
            raise InputError(
                f"holds several {sequence.hand} hands, a calibration is of one", sequence.source
            )
        seen.add(sequence.source)


def _calibrated(
    models: Models, sequences: list[Sequence], method: str, profile: Profile | None
) -> tuple[HandModel, dict[str, object], list[str]]:
    """The hand, what was found as JSON values, and what the user should know."""
    import handtrack as ht

    hand = sequences[0].hand
    mano = models.mano(hand)
    if mano is None:
        model = models.of(hand) if profile is None else profile.on(models.of(hand))
        noise = None if profile is None else profile.noise
        result = ht.calibrate(model, sequences, method, noise=noise)
        return result.model, result.summary(), list(result.notes)
    from handtrack.fitting.mano_shape import mano_shape

    if len(sequences) > 1:
        raise SettingsError("MANO's shape is found in one sequence: give one input")
    if method != "full":
        raise SettingsError(f"--method {method} is not for MANO, whose shape is its own")
    shape = mano_shape(mano, sequences[0], models.limits)
    found: dict[str, object] = {
        "method": "mano",
        "frames": shape.frames,
        "betas": shape.betas.tolist(),
        "betas_deviation": shape.deviation.tolist(),
    }
    return shape.model, found, []


def _say(hand: HandModel, found: dict[str, Any], sequences: list[Sequence]) -> None:
    clips = f"{len(sequences)} sequences" if len(sequences) > 1 else sequences[0].name
    from handtrack.calibration.split import told

    line = f"{hand.hand} hand from {found['frames']} frames of {clips}"
    if "scale" in found:
        line += f": {found['scale']:.3f} times the model's size, input noise"
        line += f" {found['noise_mm']:.2f} mm"
    click.echo(line)
    click.echo(
        f"residual {_length(found, 'residual')}, without limits {_length(found, 'unlimited')};"
        f" any hand of rigid bones leaves {_length(found, 'bound')}"
    )
    if text := told(found):
        click.echo(text)
    for what, key in (("joints", "kept_joints"), ("axes", "kept_axes")):
        if found.get(key):
            click.echo(f"{what} that the frames do not show stay the model's: " + _list(found[key]))
    drift = found.get("drift_mm", [])
    if len(drift) > 1:
        lengths = ", ".join(f"{s.name} {d:.1f} mm" for s, d in zip(sequences, drift, strict=False))
        click.echo(f"largest drift of a bone's length: {lengths}")


def _length(found: dict[str, Any], what: str) -> str:
    """ "2.36 mm (rms 2.63 mm)"."""
    return f"{found[f'{what}_mean_mm']:.2f} mm (rms {found[f'{what}_rms_mm']:.2f} mm)"


def _list(names: list[str]) -> str:
    return "all" if len(names) == 20 else ", ".join(names)
