"""The skins that a recording holds frame by frame, read when they are asked for."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.recording.mcap_walk import Walk
from handtrack.recording.schema import message_class


class StoredSkin:
    """The /HAND/mesh topic of a file, as `handtrack.tracking.track.Skin`.

    Args:
        path: the file.
        topic: the mesh's.
        frames: of the hand.
        n_vertices: of the skin.
        faces: (F, 3) triangles.
    """

    def __init__(
        self, path: Path, topic: str, frames: int, n_vertices: int, faces: NDArray[np.int32]
    ) -> None:
        self._path, self._topic, self._frames = path, topic, frames
        self.n_vertices, self.faces = n_vertices, faces

    def vertices(self, frames: slice | NDArray[np.int64]) -> NDArray[np.float64]:
        """(n, V, 3) in the world [m], NaN where none was recorded.

        Raises:
            InputError: the file is not there any more, or is damaged.
        """
        return self._all[frames].astype(np.float64)

    @cached_property
    def _all(self) -> NDArray[np.float32]:
        out = np.full((self._frames, self.n_vertices, 3), np.nan, np.float32)
        walk, cloud = Walk(self._path), message_class("foxglove.PointCloud")
        for found in walk.messages(lambda schema: schema == "foxglove.PointCloud"):
            if walk.channels[found.channel].topic != self._topic or found.sequence >= len(out):
                continue
            points = np.frombuffer(cloud.FromString(found.data).data, "<f4")
            if len(points) not in (0, 3 * self.n_vertices):
                raise InputError(
                    f"a mesh of {self._topic} has {len(points) / 3:g} vertices,"
                    f" expected {self.n_vertices}",
                    self._path,
                )
            if len(points):
                out[found.sequence] = points.reshape(-1, 3)
        return out
