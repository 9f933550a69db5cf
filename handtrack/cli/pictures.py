"""What `track` reads from calibrated cameras, and what it shows and draws of pictures."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.inputs import Reading
from handtrack.cli.models import Models
from handtrack.cli.outputs import check_target
from handtrack.cli.sources import Item
from handtrack.errors import InputError, SettingsError

if TYPE_CHECKING:
    from handtrack import Track
    from handtrack.video.placing import Seen
    from handtrack.viewer.picture_log import PictureView


class _Colour(click.ParamType[Any]):
    """A colour with a name, or #rrggbb."""

    name = "colour"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[int, int, int]:
        """Red, green and blue."""
        from handtrack.video.overlay import SKINS

        if value in SKINS:
            return SKINS[value]
        if not re.fullmatch("#[0-9a-fA-F]{6}", str(value)):
            self.fail(f"{value}: expected {', '.join(SKINS)} or #rrggbb", param, ctx)
        red, green, blue = bytes.fromhex(value[1:])
        return red, green, blue


def picture_options(command: Any) -> Any:
    """Give a command the options on pictures."""
    for option in (
        click.option(
            "--overlay",
            type=click.Path(path_type=Path),
            help="Of pictures: the hand drawn over them, .mp4, or .png (the first picture).",
        ),
        click.option(
            "--overlay-skin",
            type=_Colour(),
            help="Of the hand drawn over them: blue, green, violet, grey, skin, or #rrggbb.",
        ),
        click.option(
            "--camera",
            type=click.Path(path_type=Path),
            metavar="FILE",
            help="Calibration of the cameras that took the videos, in their order: aniposelib's"
            " TOML, OpenCV's YAML (a folder of files), Panoptic's JSON.",
        ),
    ):
        command = option(command)
    return command


def check_overlay(path: Path, read: list[Path]) -> None:
    """Refuse a picture of the result that cannot be made, before the work begins.

    Args:
        path: of the overlay.
        read: files that are read; none of pictures.

    Raises:
        SettingsError: there are no pictures, or the file cannot be written.
    """
    if not read:
        raise SettingsError(f"--overlay {path}: the input is neither a video nor an image")
    if path.suffix not in (".mp4", ".png"):
        raise SettingsError(f"--overlay {path}: expected a name that ends in .mp4 or .png")
    check_target(path, path.suffix, "--overlay", read)


def from_cameras(
    calibration: Path,
    videos: tuple[Path, ...],
    reading: Reading,
    models: Models,
    calibrate: bool | str,
    quiet: bool,
    detector: str,
) -> tuple[Item, float]:
    """Hands followed in the pictures of calibrated cameras.

    Returns:
        The hands' joints in the cameras' world with the pictures, and how far they are from
        those; and the joints' noise [mm] that the reprojection errors show.

    Raises:
        InputError: the files do not belong together.
    """
    import numpy as np

    import handtrack as ht
    from handtrack.detectors.chosen import seen_by
    from handtrack.files.pictures import pictures_in
    from handtrack.hand.reshape import without_landmarks
    from handtrack.video.placing import Seen
    from handtrack.video.views import follow, views_of

    cameras = ht.load_cameras(calibration, reading.unit)
    if len(cameras) != len(videos):
        names = ", ".join(c.name for c in cameras)
        raise InputError(
            f"{len(cameras)} cameras ({names}) for {len(videos)} videos: give them in the"
            " order of the calibration",
            calibration,
        )
    detections = []
    for video in videos:
        if pictures_in(video) is None:
            raise InputError("neither a video nor images, as --camera expects", video)
        detections.append(reading._replace(unit=None).detect(video, quiet))
    hands, noise = views_of(detections, cameras), []
    sequences = []
    told: dict[tuple[str, str], dict[str, Any]] = {}
    for views in hands:
        if reading.hand not in ("auto", views.hand):
            continue
        points = views.sequence()
        model, method = models.subject(points, calibrate)
        if method != "none":
            methods: dict[Any, str] = {True: "auto", False: "scale"}
            model, profile = seen_by(model, detector, points.detector)
            noise_of = None if profile is None else profile.noise
            way = methods.get(method, method)
            model = ht.calibrate(model, points, way, noise=noise_of).model
        else:
            model, _ = seen_by(model, detector, points.detector)
        followed = follow(views, model)
        # what follows are joint centres
        models.keep(without_landmarks(model))
        sequences.append(followed.sequence)
        noise.append(followed.noise_mm)
        pixels = followed.reprojection[np.isfinite(followed.reprojection)]
        values = (pixels.mean(), *np.percentile(pixels, [50, 95]), pixels.max())
        kinds = ("mean", "median", "p95", "max")
        error = {kind: round(float(x), 3) for kind, x in zip(kinds, values, strict=True)}
        about = {"views": len(cameras), "reprojection_px": error}
        told[views.name, views.hand] = {"cameras": about}
        if not quiet:
            for note in followed.sequence.notes:
                click.echo(f"warning: {views.name}: {note}", err=True)
            click.echo(
                f"{views.name}: {views.hand} hand in {len(cameras)} views, reprojection error"
                f" {error['median']:.2f} px (median)",
                err=True,
            )
    if not sequences:
        raise InputError(f"there is no {reading.hand} hand", videos[0])
    item = Item.of(sequences, videos[0], Seen.together(detections, hands))
    item.told = told
    return item, max(noise)


def for_viewer(tracks: list[Track], pictures: list[Seen]) -> list[PictureView]:
    """What the viewer shows of the pictures beside the hands."""
    if not pictures:
        return []
    from handtrack.video.viewer_pictures import picture_view

    return [picture_view(camera, tracks) for camera in pictures]
