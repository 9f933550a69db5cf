"""Pictures over time: the frames of a video, of one image, or of a folder of images."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, needed
from handtrack.files.pictures import images_in, pictures_in
from handtrack.sequences.clock import check_fps
from handtrack.video.orientation import upright, way_of_frame, way_of_image


def opencv() -> Any:
    """OpenCV.

    Raises:
        SettingsError: it is not installed.
    """
    return needed("cv2", "pictures need OpenCV", "video")


IMAGE_FPS = 30.0
"""Frames per second of a folder of images, which says nothing of time."""


@dataclass(frozen=True, eq=False)
class Picture:
    """One frame.

    Attributes:
        index: its number in the source, from 0.
        time_ns: when, from the source's time stamps [ns].
        rgb: (height, width, 3) uint8, the right way up (see `orientation`).
        path: the file it comes from.
    """

    index: int
    time_ns: int
    rgb: NDArray[np.uint8]
    path: Path


def pictures(path: Path, fps: float | None = None) -> Iterator[Picture]:
    """The frames of a video, an image or a folder of images (in order of name), one by one.

    Args:
        path: what `pictures_in` names.
        fps: frames per second, instead of a video's time stamps; of a folder: 30 by default.

    Raises:
        InputError: not a picture, damaged, or a video whose time stamps do not increase.
        SettingsError: the extra `video` is not installed, or an fps that is none.
    """
    check_fps(fps)
    what = _what(path)
    if what == "video":
        yield from _video(path, fps)
        return
    files = images_in(path) if what == "images" else [path]
    for i, file in enumerate(files):
        yield Picture(i, round(i / (fps or IMAGE_FPS) * 1e9), read_image(file), file)


def _what(path: Path) -> str:
    what = pictures_in(path)
    if what is None:
        missing = "no such file or folder"
        none = "neither a video nor an image nor a folder of images"
        raise InputError(none if path.exists() else missing, path)
    return what


def count(path: Path) -> int:
    """About how many frames there are; 0 where the file does not say.

    Raises:
        InputError: not a picture, or damaged.
        SettingsError: the extra `video` is not installed.
    """
    what = _what(path)
    if what == "images":
        return len(images_in(path))
    if what == "image":
        return 1
    with _open(path) as container:
        stream = container.streams.video[0]
        if stream.frames:
            return int(stream.frames)
        rate, duration = stream.average_rate, container.duration
        return round(float(rate) * duration * 1e-6) if rate and duration else 0


def read_image(path: Path) -> NDArray[np.uint8]:
    """(height, width, 3) RGB of an image file, turned as its EXIF says.

    Raises:
        InputError: it is damaged or no image.
    """
    with _open(path) as container:
        for frame in _decoded(container, path):
            return upright(frame.to_ndarray(format="rgb24"), way_of_image(path))
    raise InputError("the image holds no picture", path)


def _video(path: Path, fps: float | None) -> Iterator[Picture]:
    before, at = None, 0
    with _open(path) as container:
        for i, frame in enumerate(_decoded(container, path)):
            if fps is not None:
                at = round(i / fps * 1e9)
            elif frame.pts is None:
                raise InputError(f"frame {i} has no time stamp: give the rate with --fps", path)
            else:
                # exact, where seconds as a float are not
                at = int(frame.pts * frame.time_base * 10**9)
            if before is not None and at <= before:
                raise InputError(
                    f"frame {i} is at {at * 1e-9:.6f} s, the one before at {before * 1e-9:.6f} s:"
                    " give the rate with --fps",
                    path,
                )
            before = at
            rgb = upright(frame.to_ndarray(format="rgb24"), way_of_frame(frame))
            yield Picture(i, at, rgb, path)


def _open(path: Path) -> Any:
    av = needed("av", f"{path}: reading pictures needs PyAV", "video")
    try:
        container = av.open(str(path))
    except (av.FFmpegError, OSError) as error:
        raise InputError(f"cannot be read: {error.strerror or error}", path) from None
    if not container.streams.video:
        container.close()
        raise InputError("there is no picture in it", path)
    container.streams.video[0].thread_type = "AUTO"
    return container


def _decoded(container: Any, path: Path) -> Iterator[Any]:
    """Frames of the first video stream; a damaged end is an error, said with its frame."""
    import av

    n = 0
    try:
        for frame in container.decode(video=0):
            yield frame
            n += 1
    except av.FFmpegError as error:
        raise InputError(f"frame {n} cannot be decoded: {error.strerror or error}", path) from None
