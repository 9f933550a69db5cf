"""The skin as Foxglove's SceneUpdate: drawn as triangles by Foxglove, without any script."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from handtrack.mcap.layout import Layout, tag, timestamps, varint
from handtrack.recording.encode import Times, known_rows, tagged

SKIN = (226, 178, 148)
"""Its colour, red, green, blue."""
_POINT = 29  # bytes of a Point3 in a list: tag, length, three tagged doubles


class SceneEncoder:
    """foxglove.SceneUpdate messages of one hand: an entity with one list of triangles.

    Args:
        topic: of the hand; names the entity.
        faces: (F, 3) triangles.
        vertices: how many there are.
    """

    def __init__(self, topic: str, faces: NDArray[np.int32], vertices: int) -> None:
        colour = np.array(SKIN, np.float64) / 255
        triangles = Layout()
        triangles.field(1, Layout().field(2, tag(4, 1) + np.float64(1).tobytes()))
        triangles.slot("points", vertices * _POINT)
        triangles.field(3, tagged(np.append(colour, 1.0)[None]).tobytes())
        triangles.field(5, faces.astype("<u4").tobytes())
        entity = Layout().timestamp(1).field(2, b"world").field(3, topic.encode())
        self._layout = Layout().field(2, entity.field(12, triangles))
        self._gone = Layout().field(1, Layout().timestamp(1).field(3, topic.encode()))

    def messages(self, times: Times, vertices: NDArray[np.float64]) -> list[bytes]:
        """One message a frame; where the skin is not known, the entity's deletion.

        Args:
            times: (n,) log times [ns].
            vertices: (n, V, 3) in the world [m].
        """
        n, count = vertices.shape[:2]
        points = np.empty((n, count, _POINT), np.uint8)
        points[..., :2] = np.frombuffer(tag(2, 2) + varint(_POINT - 2), np.uint8)
        points[..., 2:] = tagged(vertices.reshape(-1, 3)).reshape(n, count, _POINT - 2)
        stamps = timestamps(times)
        shown = self._layout.rows(n, **stamps, points=points)
        gone = self._gone.rows(n, **stamps)
        known = known_rows(vertices)
        return [
            (a if ok else b).tobytes() for a, b, ok in zip(shown, gone, known.tolist(), strict=True)
        ]
