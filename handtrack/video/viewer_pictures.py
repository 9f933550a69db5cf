"""The pictures of a source, small enough for the viewer, with the joints seen and fitted."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.errors import HandtrackError
from handtrack.recording import viewer_style as style
from handtrack.recording.picture_log import PictureView
from handtrack.recording.topics import hand_topics
from handtrack.tracking.track import Track
from handtrack.video.detections import Detections
from handtrack.video.media import pictures
from handtrack.video.optional import opencv
from handtrack.video.placing import assumed_camera, place_in_view, seen_of

Array = NDArray[np.float64]

WIDEST = 640
"""Pictures wider than this are made smaller [px]."""
_QUALITY = 80


def picture_view(
    source: Path, tracks: list[Track], found: Detections, camera: Camera | None = None
) -> PictureView:
    """A source's pictures for the viewer.

    Args:
        source: the video, image or folder of images.
        tracks: made of what was found in it.
        found: that.
        camera: that took them; by default as `placing.assumed_camera`.
    """
    camera = camera or assumed_camera(found.size)
    scale = min(1.0, WIDEST / found.size[0])
    joints = {}
    rows = {int(frame): t for t, frame in enumerate(found.frame_index)}
    for track, topic in zip(tracks, hand_topics((t.name, t.hand) for t in tracks), strict=True):
        image = seen_of(track, found)
        fitted = camera.project(track.model.joints(*place_in_view(track, image, camera)))
        at = [rows[int(frame)] for frame in track.frame_index]
        seen, shown = (np.full((len(found), 21, 2), np.nan) for _ in range(2))
        seen[at], shown[at] = scale * image, scale * fitted
        # what is drawn is the filtered pose where there is one
        kind = style.FILTERED if track.filtered else style.FITTED
        joints[topic] = {style.OBSERVED: seen, kind: shown}
    wanted = set(rows)

    def jpegs() -> Iterator[bytes]:
        cv2 = opencv()
        for picture in pictures(source):
            if picture.index in wanted:
                rgb = picture.rgb
                if scale < 1:
                    size = (round(scale * rgb.shape[1]), round(scale * rgb.shape[0]))
                    rgb = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
                options = [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
                done, data = cv2.imencode(".jpg", rgb[..., ::-1], options)
                if not done:
                    raise HandtrackError(f"{source}: picture {picture.index} cannot be encoded")
                yield data.tobytes()

    return PictureView(source.stem, found.time_ns, found.frame_index, jpegs, joints)
