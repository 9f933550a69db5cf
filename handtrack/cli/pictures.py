"""What `track` reads from calibrated cameras, and what it shows and draws of pictures."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.outputs import check_target
from handtrack.errors import SettingsError

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


class _Size(click.ParamType[Any]):
    """Width and height of a picture."""

    name = "size"

    def convert(self, value: Any, param: Any, ctx: Any) -> tuple[int, int]:
        """Both [px]."""
        if isinstance(value, tuple):
            return value
        match = re.fullmatch(r"(\d{1,5})[xX*,](\d{1,5})", str(value).strip())
        size = (0, 0) if match is None else (int(match[1]), int(match[2]))
        if min(size) < 1:
            self.fail(f"{value}: expected width and height, as in 1280x720", param, ctx)
        return size


no_picture_option = click.option(
    "--no-picture",
    is_flag=True,
    help="Where joints were found in one camera's pictures: fit them alone, not these too.",
)


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
            " TOML, OpenCV's YAML or XML, ROS's camera_info, JSON (Panoptic's too), .npz, .dat; a"
            " file or a folder of them. Of files of landmarks in pictures (MediaPipe's, OpenPose's"
            " ...) as well.",
        ),
        click.option(
            "--board-unit",
            metavar="UNIT",
            help="Unit of the calibration's translations: m, cm, mm, or the length of a board's"
            " square as in 42mm.  [default: cm for Panoptic, else m]",
        ),
        click.option(
            "--image-size",
            type=_Size(),
            metavar="WxH",
            help="Of landmarks in a picture, alone or beside MediaPipe's world landmarks: the"
            " picture's size in pixels.",
        ),
        click.option(
            "--fov",
            type=click.FloatRange(1, 170),
            metavar="DEGREES",
            help="Without --camera: how wide the camera sees, from left to right.  [default: a"
            " focal length as long as the picture's longer side]",
        ),
        no_picture_option,
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


def for_viewer(tracks: list[Track], pictures: list[Seen]) -> list[PictureView]:
    """What the viewer shows of the pictures beside the hands."""
    if not pictures:
        return []
    from handtrack.video.viewer_pictures import picture_view

    return [picture_view(camera, tracks) for camera in pictures]
