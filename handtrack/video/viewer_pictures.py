"""The pictures of a source, small enough for the viewer, with the joints seen and fitted."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import N_JOINTS
from handtrack.mcap.hand import hand_topics
from handtrack.tracking.track import Track
from handtrack.video.media import pictures
from handtrack.video.optional import opencv
from handtrack.video.placing import Seen
from handtrack.viewer import style
from handtrack.viewer.picture_log import PictureView

Array = NDArray[np.float64]

WIDEST = 640
"""Pictures wider than this are made smaller [px]."""
_QUALITY = 80


def picture_view(camera: Seen, tracks: list[Track]) -> PictureView:
    """A camera's pictures for the viewer, with the joints of the hands tracked in them."""
    found, source = camera.found, camera.source
    scale = min(1.0, WIDEST / found.size[0])
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
        cv2 = opencv()
        for picture in pictures(source, found.fps):
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

    name = source.stem if camera.images is None else camera.camera.name
    return PictureView(name, found.time_ns, found.frame_index, jpegs, joints)
