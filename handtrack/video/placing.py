"""Where tracked hands are in front of a camera, and in its pictures."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.detectors.chosen import in_pictures
from handtrack.fitting.images import NOISE_PX, SPREAD_PX, ViewResults, shift_before_camera
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import N_JOINTS, Hand
from handtrack.tracking.track import Track
from handtrack.video.detections import Detections
from handtrack.video.views import Views

Array = NDArray[np.float64]

ASSUMED = "assumed"
"""Name of a camera of which at most the field of view is known."""
STIFF_DEG = 3.0
"""How far the picture may bend the tracked angles [degrees]."""


def assumed_camera(size: tuple[int, int]) -> Camera:
    """A camera as phones and webcams have them, where none is given: no lens distortion, and a
    focal length as long as the picture's longer side (a field of view of 53 degrees).
    """
    width, height = size
    focal = float(max(width, height))
    matrix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(ASSUMED, matrix, np.zeros(0), np.eye(3), np.zeros(3), size)


def place_in_view(track: Track, image: Array, camera: Camera) -> tuple[Array, Array, Array]:
    """Poses of a track in front of the camera that saw it.

    The root is fitted to the picture, by the landmarks that the detector has there; the angles
    stay within about `STIFF_DEG` of the track's.

    Args:
        track: fitted to world joints with the camera's axes (see `Detection.world`).
        image: (T, 21, 2) joints in the picture [px], NaN where not seen.
        camera: it; its own frame is the world.

    Returns:
        angles (T, 20), rotations (T, 3, 3), translations (T, 3) [m]; NaN where nothing is seen
        or the track is lost.
    """
    n = len(track)
    angles, roots = np.full((n, 20), np.nan), np.full((n, 12), np.nan)
    seen = np.asarray(np.isfinite(image).all(-1))
    use = np.flatnonzero((seen.sum(1) >= 6) & np.isfinite(track.angles[:, 0]))
    if not len(use):
        return angles, np.full((n, 3, 3), np.nan), np.full((n, 3), np.nan)
    rotation = camera.rotation.T @ quaternion_to_matrix(track.quaternion[use])
    joints = track.model.joints(track.angles[use], quaternion_to_matrix(track.quaternion[use]))
    starts = np.empty((len(use), 12))
    starts[:, :9] = rotation.reshape(-1, 9)
    for i, t in enumerate(use):
        rays = camera.undistorted(image[t, seen[t]])
        shift = shift_before_camera(joints[i], seen[t], rays, track.model.size)
        starts[i, 9:] = camera.rotation.T @ (shift - camera.translation)
    results = ViewResults(len(use))
    results.run(
        in_pictures(track.model, track.settings),
        [camera],
        np.nan_to_num(image[use])[:, None],
        seen[use].astype(np.float64)[:, None],
        track.model.limits.clamp(track.angles[use]),
        starts,
        SPREAD_PX,
        (NOISE_PX / np.deg2rad(STIFF_DEG)) ** 2,
    )
    angles[use], roots[use] = results.angles, results.roots
    return angles, roots[:, :9].reshape(-1, 3, 3), roots[:, 9:]


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
    def alone(found: Detections, camera: Camera | None = None) -> Seen:
        """The pictures of one camera; an assumed one where nothing is known of it."""
        return Seen(Path(found.source), found, camera or assumed_camera(found.size))

    @property
    def name(self) -> str:
        """Of the camera, or of its pictures where it has none of its own."""
        return self.source.stem if self.camera.name == ASSUMED else self.camera.name

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
        if "cameras" in track.settings:
            return self._in_world(track, rows)
        # whatever the hand was called when it was detected
        image = np.full((len(track), N_JOINTS, 2), np.nan)
        for hand in self.found.hands:
            same = (self.found.world[hand][rows] == track.observed).all((1, 2))
            image[same] = self.found.image[hand][rows][same]
        return Placed(*place_in_view(track, image, self.camera), image)

    def _in_world(self, track: Track, rows: NDArray[np.int64]) -> Placed:
        """Of a hand in the camera's world; it is seen where the nearest of those found is."""
        rotation = quaternion_to_matrix(track.quaternion)
        shown = self.camera.project(track.model.joints(track.angles, rotation, track.translation))
        images = np.stack([self.found.image[hand][rows] for hand in self.found.hands])
        off = np.linalg.norm(images - shown, axis=-1).mean(-1)
        nearest = np.argmin(np.where(np.isfinite(off), off, np.inf), axis=0)
        image = images[nearest, np.arange(len(rows))]
        return Placed(track.angles, rotation, track.translation, image)

    def rows(self, track: Track) -> NDArray[np.int64]:
        """(T,) the detections' rows of a track's frames."""
        row = {int(frame): t for t, frame in enumerate(self.found.frame_index)}
        return np.array([row[int(frame)] for frame in track.frame_index], dtype=np.int64)
