"""A skin in pieces that move with the hand's parts: written once instead of in every frame."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_PARTS, PART_JOINT, PART_NAMES
from handtrack.mcap.foxglove import SKIN, tagged
from handtrack.mcap.layout import Layout, tag, timestamps

AGAIN_NS = 1_000_000_000
"""A skin that is gone is taken away, and written again, at most so often [ns]."""
_SHARED = 0.3
"""A part that moves a corner by at least this much has its triangle, so that bends have no gaps."""
_ALL = 1  # foxglove.SceneEntityDeletion.ALL


class PartSkinEncoder:
    """foxglove.SceneUpdate messages of one hand, whose entities follow the frames of its parts.

    The pieces are stiff: at the bends they overlap, where the skin itself is smooth.

    Args:
        topic: of the hand; its frames are those of `TransformEncoder`.
        model: the hand, with a skin.
    """

    def __init__(self, topic: str, model: HandModel) -> None:
        self._layout = Layout()
        colour = tagged(np.append(np.array(SKIN, np.float64) / 255, 1.0)[None]).tobytes()
        origin = Layout().field(2, tag(4, 1) + np.float64(1).tobytes())
        for part in range(N_PARTS):
            points, faces = piece(model, part)
            if not len(faces):
                continue
            triangles = Layout().field(1, origin).fields(2, tagged(points))
            triangles.field(3, colour).field(5, faces.astype("<u4").tobytes())
            name = f"{topic}/{PART_NAMES[part]}".encode()
            entity = Layout().timestamp(1).field(2, name).field(3, name).varint(5, 1)
            self._layout.field(2, entity.field(12, triangles))
        self._gone = Layout().field(1, Layout().timestamp(1).varint(2, _ALL))
        self._shown, self._since = False, -AGAIN_NS

    def messages(self, times: Sequence[int], known: Sequence[bool]) -> dict[int, bytes]:
        """What is to be written with some of the next frames: by their places among these.

        Args:
            times: (n,) log times [ns].
            known: (n,) whether the hand is there.
        """
        out: dict[int, bytes] = {}
        for i, (time, there) in enumerate(zip(times, known, strict=True)):
            if there == self._shown or (self._shown and time - self._since < AGAIN_NS):
                continue
            layout = self._layout if there else self._gone
            out[i] = layout.rows(1, **timestamps(np.array([time], np.uint64))).tobytes()
            self._shown = there
            self._since = time if there else self._since
        return out


def piece(model: HandModel, part: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """The skin that moves with a part: (V', 3) vertices in its frame [m], (F', 3) triangles."""
    corners = model.weights[model.faces, part]
    strongest = model.weights.argmax(1)[model.faces] == part
    faces = model.faces[(corners >= _SHARED).any(1) | strongest.any(1)]
    used, numbered = np.unique(faces, return_inverse=True)
    points = model.rest_vertices[used] - model.rest_joints[PART_JOINT[part]]
    return points, numbered.reshape(-1, 3).astype(np.int32)
