"""The skins that a recording holds frame by frame, read when they are asked for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.mcap.chunk import Place
from handtrack.mcap.index import read_index
from handtrack.mcap.schema import message_class
from handtrack.mcap.walk import Walk


class StoredSkin:
    """The /HAND/mesh topic of a file, as `handtrack.tracking.track.Skin`.

    Args:
        path: the file.
        topic: the mesh's.
        frames: numbers of the first frame and of the one after the last.
        n_vertices: of the skin.
        faces: (F, 3) triangles.
        places: of the chunks to look in; everywhere if left out.
    """

    def __init__(
        self,
        path: Path,
        topic: str,
        frames: tuple[int, int],
        n_vertices: int,
        faces: NDArray[np.int32],
        places: Sequence[Place] | None = None,
    ) -> None:
        self._path, self._topic, self._frames, self._places = path, topic, frames, places
        self.n_vertices, self.faces = n_vertices, faces

    def vertices(self, frames: slice | NDArray[np.int64]) -> NDArray[np.float64]:
        """(n, V, 3) in the world [m], NaN where none was recorded.

        Raises:
            InputError: the file is not there any more, or is damaged.
        """
        return self._all[frames].astype(np.float64)

    @cached_property
    def _all(self) -> NDArray[np.float32]:
        first, end = self._frames
        out = np.full((end - first, self.n_vertices, 3), np.nan, np.float32)
        cloud = message_class("foxglove.PointCloud")
        index = None if self._places is None else read_index(self._path)
        walk = Walk(self._path) if index is None else index.walk()
        for found in walk.messages(lambda schema: schema == "foxglove.PointCloud", self._places):
            frame = found.sequence - first
            if walk.channels[found.channel].topic != self._topic or not 0 <= frame < len(out):
                continue
            points = np.frombuffer(cloud.FromString(found.data).data, "<f4")
            if len(points) not in (0, 3 * self.n_vertices):
                raise InputError(
                    f"a mesh of {self._topic} has {len(points) / 3:g} vertices,"
                    f" expected {self.n_vertices}",
                    self._path,
                )
            if len(points):
                out[frame] = points.reshape(-1, 3)
        return out
