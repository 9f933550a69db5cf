"""Where tracked hands are in the pictures of a camera."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.tracking.track import Track
from handtrack.video.detections import Detections
from handtrack.video.placing import assumed_camera, place_in_view
from handtrack.video.views import Views

Array = NDArray[np.float64]


class Placed(NamedTuple):
    """A track's hand as a camera saw it, over the track's T frames.

    Attributes:
        angles: (T, 20); rotation: (T, 3, 3); translation: (T, 3) [m]: of the filtered pose in
            the camera's world, NaN where it is not known.
        image: (T, 21, 2) joints that the detector saw [px], NaN where it saw none.
    """

    angles: Array
    rotation: Array
    translation: Array
    image: Array


@dataclass(frozen=True, eq=False)
class Seen:
    """One camera's pictures and what was detected in them.

    Attributes:
        source: the video, image or folder of images.
        found: what the detector said.
        camera: that took them.
        images: (T, 21, 2) of each hand, by the name that all cameras agreed on. None where the
            tracks are around the hand's own middle, not in the camera's world.
    """

    source: Path
    found: Detections
    camera: Camera
    images: dict[Hand, Array] | None = None

    @staticmethod
    def alone(found: Detections) -> Seen:
        """The pictures of a camera of which nothing is known."""
        return Seen(Path(found.source), found, assumed_camera(found.size))

    @staticmethod
    def together(detections: Items[Detections], views: Items[Views]) -> list[Seen]:
        """The pictures of calibrated cameras, by the views made of them."""
        return [
            Seen(Path(d.source), d, camera, {v.hand: v.image[:, c] for v in views})
            for c, (d, camera) in enumerate(zip(detections, views[0].cameras, strict=True))
        ]

    def place(self, track: Track) -> Placed:
        """Where a track's hand is in the pictures."""
        rows = self.rows(track)
        if self.images is not None:
            unseen = np.full((len(self.found), N_JOINTS, 2), np.nan)
            image = self.images.get(track.hand, unseen)[rows]
            rotation = quaternion_to_matrix(track.quaternion)
            return Placed(track.angles, rotation, track.translation, image)
        # whatever the hand was called when it was detected
        image = np.full((len(track), N_JOINTS, 2), np.nan)
        for hand in self.found.hands:
            same = (self.found.world[hand][rows] == track.observed).all((1, 2))
            image[same] = self.found.image[hand][rows][same]
        return Placed(*place_in_view(track, image, self.camera), image)

    def rows(self, track: Track) -> NDArray[np.int64]:
        """(T,) the detections' rows of a track's frames."""
        row = {int(frame): t for t, frame in enumerate(self.found.frame_index)}
        return np.array([row[int(frame)] for frame in track.frame_index], dtype=np.int64)
