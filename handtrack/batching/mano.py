"""Poses of a clip as MANO's parameters."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.hand.mano_pose import to_mano
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.tracking.track import Track


def write_mano(tracks: Sequence[Track], path: Path) -> list[Path]:
    """MANO's 48 values of each frame and the translation, a file for each hand.

    `global_orient` (T, 3), `hand_pose` (T, 45) [rad], `transl` (T, 3) [m], `betas` (S,) where
    the hand is MANO's own, `time_ns`, `frame_index`, `hand`: as smplx takes them with
    flat_hand_mean=True and use_pca=False. NaN where the hand is lost.
    """
    written = []
    for i, track in enumerate(tracks):
        file = path if len(tracks) == 1 else path.with_stem(f"{path.stem}_{i}_{track.hand}")
        rotation = quaternion_to_matrix(track.quaternion)
        pose = to_mano(track.model, track.angles, rotation, track.translation)
        made: dict[str, Any] = {
            "global_orient": pose.global_orient,
            "hand_pose": pose.hand_pose,
            "transl": pose.transl,
            "time_ns": track.time_ns,
            "frame_index": track.frame_index,
            "hand": np.array(track.hand),
        }
        if pose.betas is not None:
            made["betas"] = pose.betas
        with file.open("wb") as stream:
            np.savez_compressed(stream, **made)
        written.append(file)
    return written
