"""handtrack track."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.cameras import Lens, from_cameras
from handtrack.cli.helping import Command
from handtrack.cli.inputs import Reading
from handtrack.cli.job import Made, Work
from handtrack.cli.live_view import check_live, live_options, live_view
from handtrack.cli.models import hand_model_option, model_options, take_models
from handtrack.cli.options import (
    is_default,
    json_option,
    quiet_option,
    reading_options,
    recording_options,
    take_recording,
    take_tracking,
    tracking_options,
)
from handtrack.cli.outputs import jobs, overwrite_option
from handtrack.cli.pictures import check_overlay, picture_options
from handtrack.cli.progress import Times, compiling_said, progress_shown, warm_up
from handtrack.cli.sources import Given, Item, items_of
from handtrack.errors import HandtrackError, SettingsError

if TYPE_CHECKING:
    from handtrack import Track


MOST_SKIPPED = 20
"""So many inputs that were skipped are named."""


@click.command(cls=Command, short_help="Fit a hand to joint sequences and record it.")
@click.argument(
    "inputs", nargs=-1, required=True, metavar="INPUT...", type=click.Path(path_type=Path)
)
@click.option("-o", "--output", type=click.Path(path_type=Path), help="MCAP file, or a folder.")
@overwrite_option
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
    overlay_skin: tuple[int, int, int] | None,
    camera: Path | None,
    board_unit: str | None,
    image_size: tuple[int, int] | None,
    fov: float | None,
    no_picture: bool,
    live: bool,
    connect: str | None,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> int:
    """Fit a hand to every frame of joint sequences or pictures and record the result.

    INPUT is a file, a folder, or several: CMU Panoptic, .npz / .npy / .csv / .json / .jsonl, FPHA,
    Leap Motion, MCAP; videos, images, folders of images. Each gets a recording of its own, which
    without -o is recordings/NAME.mcap, in -o OUT/ by its name; with -o FILE.mcap they share one.
    What cannot be read is named and skipped. Images are unrelated pictures; with --fps, a clip.
    """
    check_live(live, connect)
    (settings, limits), recording = take_tracking(options), take_recording(options)
    settings = settings.but(picture=not no_picture)
    mano = {name: options[name] for name in ("mano", "mano_tips")}
    models = take_models(options, limits)
    if models.file is not None and is_default("calibrate"):
        settings = settings.but(calibrate="none")
    reading, silent = Reading(**options, **mano, image_size=image_size), quiet or as_json
    lens, times = Lens(camera, image_size, fov, board_unit), Times()
    pictured = not lens.given or lens.is_of(inputs, reading)
    if not pictured:
        jobs([Item(inputs[0])], inputs, output, rrd)  # refused before the work, not after it
        with times.during("detecting and following"), compiling_said(silent):
            views = from_cameras(lens, inputs, reading, models, settings, silent)
        given, noise = Given([views[0]]), views[1]
        # what was followed are joint centres of a hand that is known
        settings = settings.but(calibrate="none", detector="auto")
        if settings.fit.noise_mm is None:
            settings = settings.but(noise_mm=noise)
    else:
        with times.during("reading"):
            given = items_of(inputs, reading, silent)
        if lens.given:
            given.items = [item.seen_through(lens) for item in given.items]
    if overlay is not None:
        check_overlay(overlay, _drawn_over(given, inputs))
    elif overlay_skin is not None:
        raise SettingsError("--overlay-skin is the colour of --overlay: give both")
    work = jobs(given.items, inputs, output, rrd)
    sequences = [s for i in given.items if live for s in i.read(reading, silent)]
    show = live_view(live, connect, sequences, mesh=bool(recording.mesh.every))
    made, alone = Made(skipped=given.skipped), len(given.items) == 1
    doing = Work(
        reading, models, settings, recording, show, not no_repair, quiet, silent, alone, times
    )
    frames = sum(item.frames for item in given.items)
    with compiling_said(silent), progress_shown(frames, silent) as progress:
        with times.during("making the fitter ready"):
            warm_up(settings)
        for job in work:
            doing.run(job, progress, made)
        if overlay is not None:
            from handtrack.video.overlay import overlay as draw

            progress.says(f"drawing {overlay}")
            with times.during("drawing"):
                draw(overlay, given.items[0].pictures, made.tracks, skin=overlay_skin)
            made.files.append(overlay)
    with times.during("measuring"):
        made.notes += [f"{t.name}: {text}" for t in made.tracks if (text := _doubt(t))]
    _say(made, given, len(work), doing, as_json)
    show.wait(silent)
    return 1 if any(skip.bad for skip in made.skipped) else 0


def _drawn_over(given: Given, inputs: tuple[Path, ...]) -> list[Path]:
    """The pictures that an overlay is drawn over: those of the only input."""
    from handtrack.files.pictures import pictures_in

    if len(given.items) != 1:
        return []
    (item,) = given.items
    if item.pictures:  # of calibrated cameras
        return [*inputs, *(Path(seen.source) for seen in item.pictures)]
    return [item.source] if pictures_in(item.source) is not None else []


def _say(made: Made, given: Given, count: int, doing: Work, as_json: bool) -> None:
    """Print what came of it.

    Raises:
        HandtrackError: nothing did.
    """
    import handtrack as ht

    skips = [f"{skip.path}: {skip.reason}" for skip in made.skipped]
    if not made.tracks:
        raise HandtrackError(f"nothing could be tracked: {'; '.join([*made.notes, *skips][:3])}")
    for note in made.notes if not doing.quiet else ():
        click.echo(f"warning: {note}", err=True)
    frames = sum(map(len, made.tracks))
    rate = frames / max(doing.times.seconds["fitting"], 1e-9)
    with doing.times.during("measuring"):
        report = ht.stability(made.tracks)
    if as_json:
        read = [s for item in given.items for s in item.read(doing.reading, True)]
        notes = [f"{s.name}: {note}" for s in read for note in s.notes]
        result_dict = report.to_dict() | {
            "outputs": [str(path) for path in made.files],
            "frames_per_second": rate,
            "seconds": doing.times.to_dict(),
            "warnings": notes + made.repairs + made.notes,
            "skipped": [{"input": str(s.path), "reason": s.reason} for s in made.skipped],
            "not_measured": {t.name: list(_not_measured(t)) for t in made.tracks},
        }
        click.echo(json.dumps(result_dict, indent=2, allow_nan=False))
        return
    if doing.quiet:
        return
    with doing.times.during("printing"):
        from handtrack.evaluation.report import print_table

        print_table(report)
        for made_track in made.tracks:
            _say_calibration(made_track)
    for skip in skips[:MOST_SKIPPED]:
        click.echo(f"skipped {skip}", err=True)
    if len(skips) > MOST_SKIPPED:
        click.echo(f"skipped {len(skips) - MOST_SKIPPED} more; --json names them all", err=True)
    where = " and ".join(map(str, made.files))
    if count > 1:
        for path in made.files:
            click.echo(f"wrote {path}")
        folders = dict.fromkeys(str(path.parent) for path in made.files)
        where = f"{len(made.files)} files in {' and '.join(folders)}"
    click.echo(f"took {doing.times.said()}")
    click.echo(f"tracked {frames:,} frames at {rate:,.0f} frames/s -> {where}")


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
    """Whose landmarks it was taken for, and what is not the input's."""
    from handtrack.detectors.chosen import told as detector_told

    if "detector" in track.settings:
        click.echo(f"{track.name}: landmarks as of {detector_told(track.settings)}")
    gone = _not_measured(track)
    if gone:
        click.echo(f"{track.name}: never seen, so neither measured nor exported: {', '.join(gone)}")
    found = track.settings.get("calibration")
    if isinstance(found, dict) and "bound_mean_mm" in found:
        click.echo(
            f"{track.name}: the calibrated hand leaves {found['residual_mean_mm']:.2f} mm of its"
            f" input, any hand of rigid bones {found['bound_mean_mm']:.2f} mm"
        )
