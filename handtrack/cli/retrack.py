"""handtrack retrack."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import click
from click.core import ParameterSource

from handtrack.cli.config import used_config
from handtrack.cli.helping import Command
from handtrack.cli.models import model_options, take_models
from handtrack.cli.options import (
    TRACKING,
    json_option,
    quiet_option,
    recording_options,
    take_recording,
    take_tracking,
    tracking_options,
)
from handtrack.cli.outputs import check_target, overwrite_option
from handtrack.cli.progress import compiling_said

_GIVEN = (ParameterSource.COMMANDLINE, ParameterSource.DEFAULT_MAP)


@click.command(cls=Command, short_help="Track the input of a recording again.")
@click.argument("file", type=click.Path(path_type=Path))
@click.option("-o", "--output", type=click.Path(path_type=Path), required=True, help="MCAP file.")
@overwrite_option
@tracking_options
@model_options
@recording_options
@json_option
@quiet_option
def retrack(file: Path, output: Path, as_json: bool, quiet: bool, **options: Any) -> None:
    """Track the joints that FILE was made of again, with its own hand and settings.

    What is given here replaces the stored settings. Without any the result is the stored one, to
    the bit, as long as the version is the same: `handtrack diff` shows what changed. The hand is
    the stored one, as it was calibrated; --calibrate or --no-calibrate take it from the joints
    again. A recording of MANO holds no model: give --mano again.
    """
    import handtrack as ht
    from handtrack.recording.retrack import as_stored, input_of
    from handtrack.recording.retrack import retrack as run

    source = click.get_current_context().get_parameter_source
    given = {name for name in options if source(name) in _GIVEN}
    recording = take_recording(options)
    tracking, limits = take_tracking(options)
    models = take_models(options, limits)
    settings = {name: value for name, value in tracking.flat().items() if name in given}
    check_target(output, ".mcap", "-o", [file])
    tracks = []
    with compiling_said(quiet or as_json):
        for stored in ht.read_mcap(file):
            model = None if stored.model.licensed else stored.model
            own = dict(settings)
            if given & {"mano", "gltf"}:
                model = models.of(stored.hand, stored.model.shape)
                if stored.model.licensed and "calibrate" not in own:
                    model = as_stored(model, stored.model)
                else:
                    how = own.get("calibrate", stored.settings.get("calibrate", True))
                    if how is True:
                        model, how = models.subject(input_of(stored), how)
                    own["calibrate"] = how
            elif "calibrate" in own:
                model = models.of(stored.hand)
            if model is not None and "limits" in given:
                model = model.with_limits(limits)
            tracks.append(run(stored, model, own))
    told = {"config": config} if (config := used_config()) else {}
    tracks = [replace(track, settings={**track.settings, **told}) for track in tracks]
    output.parent.mkdir(parents=True, exist_ok=True)
    ht.write_mcap(tracks, output, recording=recording)
    report = ht.stability(tracks)
    if as_json:
        from handtrack.evaluation.report import to_json

        click.echo(to_json(report))
    elif not quiet:
        from handtrack.evaluation.report import print_table

        print_table(report)
        click.echo(f"tracked {sum(map(len, tracks)):,} frames of {file} again -> {output}")


for _option in retrack.params:
    # what is not given is the recording's own
    if isinstance(_option, click.Option) and _option.name in {*TRACKING, "limits"}:
        _option.show_default = "as stored"
