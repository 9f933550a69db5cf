"""The pictures of a source, small enough for the viewer, with the joints seen and fitted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import N_JOINTS
from handtrack.mcap.hand import hand_topics
from handtrack.tracking.track import Track
from handtrack.video.media import opencv, pictures
from handtrack.video.placing import Seen
from handtrack.viewer import style
from handtrack.viewer.picture_log import PictureView

Array = NDArray[np.float64]

WIDEST = 640
"""Pictures wider than this are made smaller [px]."""
_QUALITY = 80


def scale_of(width: int) -> float:
    """By how much a picture so wide [px] is made smaller."""
    return min(1.0, WIDEST / width)


def jpeg_of(rgb: NDArray[np.uint8]) -> bytes:
    """A picture (height, width, 3) as a JPEG file, at most `WIDEST` wide.

    Raises:
        HandtrackError: it cannot be encoded.
    """
    cv2 = opencv()
    height, width = rgb.shape[:2]
    if (scale := scale_of(width)) < 1:
        size = (round(scale * width), round(scale * height))
        rgb = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(".jpg", rgb[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    if not done:
        raise HandtrackError(f"a picture of {width} x {height} cannot be encoded")
    return bytes(data.tobytes())


def picture_view(camera: Seen, tracks: list[Track]) -> PictureView:
    """A camera's pictures for the viewer, with the joints of the hands tracked in them."""
    found, source = camera.found, camera.source
    scale = scale_of(found.size[0])
    joints = {}
    for track, topic in zip(tracks, hand_topics((t.name, t.hand) for t in tracks), strict=True):
        angles, rotation, translation, image = camera.place(track)
        fitted = camera.camera.project(track.model.joints(angles, rotation, translation))
        rows = camera.rows(track)
        seen, shown = (np.full((len(found), N_JOINTS, 2), np.nan) for _ in range(2))
        seen[rows], shown[rows] = scale * image, scale * fitted
        # what is drawn is the filtered pose where there is one
        kind = style.FILTERED if track.filtered else style.FITTED
        joints[topic] = {style.OBSERVED: seen, kind: shown}
    wanted = set(found.frame_index.tolist())

    def jpegs() -> Iterator[bytes]:
        for picture in pictures(source, found.fps):
            if picture.index in wanted:
                yield jpeg_of(picture.rgb)

    return PictureView(camera.name, found.time_ns, found.frame_index, jpegs, joints)
