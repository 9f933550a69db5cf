"""handtrack track."""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.inputs import Reading, reading_options
from handtrack.cli.live_view import live_options, live_view
from handtrack.cli.models import hand_model_option, model_options, take_models
from handtrack.cli.options import (
    is_default,
    json_option,
    quiet_option,
    recording_options,
    take_recording,
    take_tracking,
    tracking_options,
)
from handtrack.cli.outputs import Stretches, jobs, recorder
from handtrack.cli.pictures import (
    check_overlay,
    detected,
    for_viewer,
    from_cameras,
    picture_options,
)
from handtrack.cli.progress import compiling_said, progress_shown, warm_up
from handtrack.errors import HandtrackError, SettingsError

if TYPE_CHECKING:
    from handtrack import Track


@click.command(short_help="Fit a hand to joint sequences and record it.")
@click.argument(
    "inputs", nargs=-1, required=True, metavar="INPUT...", type=click.Path(path_type=Path)
)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="MCAP file, or a folder.")
@click.option("--rrd", type=click.Path(path_type=Path), help="Rerun file, or a folder, as well.")
@model_options
@hand_model_option
@tracking_options
@click.option(
    "--no-repair", is_flag=True, help="Leave hands exchanged that were exchanged for a moment."
)
@picture_options
@recording_options
@live_options
@json_option
@quiet_option
@reading_options
def track(
    inputs: tuple[Path, ...],
    output: Path | None,
    rrd: Path | None,
    no_repair: bool,
    overlay: Path | None,
    camera: Path | None,
    live: bool,
    connect: str | None,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Fit a hand to every frame of a joint sequence and record the result.

    INPUT is a file or a folder: CMU Panoptic, .npz / .npy / .csv / .json / .jsonl, FPHA, Leap
    Motion, MCAP; a video, an image or a folder of images. Without -o the recording is
    recordings/NAME.mcap; of a folder with several unrelated files each gets its own,
    recordings/FOLDER/NAME.mcap. With -o FILE.mcap they share one.
    """
    import handtrack as ht
    from handtrack.files.pictures import pictures_in

    (settings, limits), recording = take_tracking(options), take_recording(options)
    mano = {name: options[name] for name in ("mano", "mano_tips")}
    models = take_models(options, limits)
    if models.file is not None and is_default("calibrate"):
        settings = settings.but(calibrate="none")
    reading = Reading(**options, **mano)
    input = inputs[0]
    if camera is not None:
        with compiling_said(quiet or as_json):
            sequences, pictures, noise = from_cameras(
                camera, inputs, reading, models, settings.calibration.method, quiet or as_json
            )
        settings = settings.but(calibrate="none")
        if settings.fit.noise_mm is None:
            settings = settings.but(noise_mm=noise)
    elif len(inputs) > 1:
        raise SettingsError("several inputs are views of one scene: they need --camera")
    elif pictures_in(input) is not None:
        found, pictures = detected(input, reading, output, recording, quiet or as_json)
        sequences = reading.load(input, quiet, found)
    else:
        pictures, sequences = [], reading.load(input, quiet)
    if overlay is not None:
        check_overlay(overlay, pictures, input)
    repairs: list[str] = []
    if not no_repair:
        sequences = ht.repair_identity(sequences)
        repairs = [f"{s.name}: {remark.text}" for s in sequences for remark in s.remarks]
    for repair in repairs if not quiet else ():
        click.echo(f"repaired: {repair}", err=True)
    work = jobs(sequences, input, output, rrd)
    show = live_view(live, connect, sequences, mesh=bool(recording.mesh.every))
    tracks: list[Track] = []
    left_out: list[str] = []
    seconds = 0.0
    written: list[Path] = []
    silent = quiet or as_json
    with (
        compiling_said(silent),
        progress_shown(sum(map(len, sequences)), silent) as progress,
    ):
        warm_up(settings)
        for job in work:
            made = []
            with recorder(job, recording) as record:
                for i, sequence in enumerate(job.sequences):
                    start, stretches = time.perf_counter(), Stretches(record, i)
                    try:
                        model, how = models.subject(sequence, settings.calibration.method)
                        parts = show.parts(sequence, stretches)
                        result = ht.track(
                            sequence,
                            model,
                            settings=settings.but(calibrate=how),
                            progress=progress.frames,
                            on_part=parts,
                        )
                        _check_fitted(result)
                    except HandtrackError as error:
                        # a hand that is hardly seen must not take the others with it
                        left_out.append(f"{sequence.name}: left out: {error}")
                        if len(left_out) == len(sequences) or record.closed:
                            raise
                    else:
                        made.append(result)
                    seconds += time.perf_counter() - start - stretches.seconds
                    progress.next(len(sequence))
                if not made:
                    record.stop()
            if made:
                if job.rrd is not None:
                    progress.says(f"writing {job.rrd}")
                    job.rrd.parent.mkdir(parents=True, exist_ok=True)
                    shown = for_viewer(made, pictures)
                    mesh = bool(recording.mesh.every)
                    ht.log_rerun(made, save=job.rrd, mesh=mesh, pictures=shown)
                    progress.says("tracking")
                tracks += made
                written += job.files
        if overlay is not None:
            from handtrack.video.overlay import overlay as draw

            progress.says(f"drawing {overlay}")
            draw(overlay, pictures, tracks)
            written.append(overlay)
    doubts = [f"{t.name}: {text}" for t in tracks if (text := _doubt(t))]
    for note in [*left_out, *doubts] if not quiet else ():
        click.echo(f"warning: {note}", err=True)

    frames = sum(map(len, tracks))
    rate = frames / (seconds - show.seconds)
    report = ht.stability(tracks)
    if as_json:
        notes = [f"{s.name}: {note}" for s in sequences for note in s.notes]
        result_dict = report.to_dict() | {
            "outputs": [str(path) for path in written],
            "frames_per_second": rate,
            "warnings": notes + repairs + left_out + doubts,
            "not_measured": {t.name: list(_not_measured(t)) for t in tracks},
        }
        click.echo(json.dumps(result_dict, indent=2, allow_nan=False))
    elif not quiet:
        from handtrack.evaluation.report import print_table

        print_table(report)
        for made_track in tracks:
            _say_calibration(made_track)
        where = " and ".join(map(str, written))
        if len(work) > 1:
            folders = dict.fromkeys(str(path.parent) for path in written)
            where = f"{len(written)} files in {' and '.join(folders)}"
        click.echo(f"tracked {frames:,} frames at {rate:,.0f} frames/s -> {where}")
    show.wait(silent)


def _doubt(track: Track) -> str | None:
    """What is doubtful of how its calibrated hand explains the input."""
    from handtrack.calibration.explain import doubt

    found = track.settings.get("calibration")
    return doubt(found) if isinstance(found, dict) else None


def _not_measured(track: Track) -> tuple[str, ...]:
    """Joints that no frame tells of."""
    from handtrack.hand.skeleton import JOINT_NAMES

    known = track.measured_joints
    return tuple(name for name, is_known in zip(JOINT_NAMES, known, strict=True) if not is_known)


def _say_calibration(track: Track) -> None:
    """How well the calibrated hand explains its input, and what is not the input's."""
    gone = _not_measured(track)
    if gone:
        click.echo(f"{track.name}: never seen, so neither measured nor exported: {', '.join(gone)}")
    found = track.settings.get("calibration")
    if isinstance(found, dict) and "bound_mean_mm" in found:
        click.echo(
            f"{track.name}: the calibrated hand leaves {found['residual_mean_mm']:.2f} mm of its"
            f" input, any hand of rigid bones {found['bound_mean_mm']:.2f} mm"
        )


def _check_fitted(track: Track) -> None:
    """Refuse a track of which nothing is there.

    Raises:
        HandtrackError: every frame is lost.
    """
    if (track.status == "lost").all():
        raise HandtrackError(f"{track.source}: no frame could be fitted: {track.reason[0]}")
