"""Detections as `handtrack detect` writes them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files.npz import read_npz
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.video.detections import Detections

Array = NDArray[np.float64]


def saved_detections(path: Path, frames: tuple[int, int] | None = None) -> Detections | None:
    """What `Detections.save` wrote, joints and pictures; None where a file is another.

    Args:
        path: of any file.
        frames: first frame and the one after the last, by row.

    Raises:
        InputError: the file is damaged, an array in it has another shape, or no frame is left.
    """
    if path.suffix.lower() != ".npz" or not path.is_file():
        return None
    names = {f"{hand}_{what}" for hand in HANDS for what in ("joints_m", "image_px", "confidence")}
    known = {"time_ns", "frame_index", "size_px", "source", "detector"}
    arrays, _ = read_npz(path, path, names | known)
    if not {"time_ns", "frame_index", "size_px"} <= set(arrays):
        return None
    if not any(f"{hand}_image_px" in arrays for hand in HANDS):
        return None
    n = len(np.atleast_1d(arrays["time_ns"]))
    rows = np.arange(n)[slice(*frames)] if frames is not None else np.arange(n)
    if not len(rows):
        raise InputError(f"there is no frame in {frames}, the file has {n}", path)

    def of(hand: Hand, what: str, shape: tuple[int, ...], empty: float) -> Array:
        value = arrays.get(f"{hand}_{what}")
        if value is None:
            return np.full((len(rows), *shape), empty)
        if value.shape != (n, *shape):
            raise InputError(f"{hand}_{what} has shape {value.shape}, expected {(n, *shape)}", path)
        return np.asarray(value, dtype=np.float64)[rows]

    found = Detections(
        str(path),
        _size(arrays["size_px"], path),
        np.asarray(arrays["time_ns"], dtype=np.int64)[rows],
        np.asarray(arrays["frame_index"], dtype=np.int64)[rows],
        {hand: of(hand, "image_px", (N_JOINTS, 2), np.nan) for hand in HANDS},
        {hand: of(hand, "joints_m", (N_JOINTS, 3), np.nan) for hand in HANDS},
        {hand: np.nan_to_num(of(hand, "confidence", (), 0.0)) for hand in HANDS},
    )
    return replace(found, detector=str(arrays.get("detector", "")))


def _size(value: Any, path: Path) -> tuple[int, int]:
    """(width, height) [px].

    Raises:
        InputError: it is none.
    """
    size = np.atleast_1d(value)
    if size.shape != (2,) or size.dtype.kind not in "iuf" or not (size > 0).all():
        raise InputError(f"size_px is {size.tolist()}, expected width and height", path)
    return int(size[0]), int(size[1])
