"""Where a hand that was tracked around its own middle is in front of the camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.fitting.images import NOISE_PX, SPREAD_PX, ViewResults, shift_to_rays
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.tracking.track import Track

Array = NDArray[np.float64]

STIFF_DEG = 3.0
"""How far the picture may bend the tracked angles [degrees]."""


def assumed_camera(size: tuple[int, int]) -> Camera:
    """A camera as phones and webcams have them, where none is given: no lens distortion, and a
    focal length as long as the picture's longer side (a field of view of 53 degrees).
    """
    width, height = size
    focal = float(max(width, height))
    matrix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera("assumed", matrix, np.zeros(0), np.eye(3), np.zeros(3), size)


def place_in_view(track: Track, image: Array, camera: Camera) -> tuple[Array, Array, Array]:
    """Poses of a track in front of the camera that saw it.

    The root is fitted to the picture; the angles stay within about `STIFF_DEG` of the track's.

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
        ok = seen[t]
        shift = shift_to_rays(joints[i, ok], camera.undistorted(image[t, ok]))
        shift[2] = max(shift[2], 0.5 * track.model.size - joints[i, :, 2].min())
        starts[i, 9:] = camera.rotation.T @ (shift - camera.translation)
    results = ViewResults(len(use))
    results.run(
        track.model,
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
