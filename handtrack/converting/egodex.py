"""Hands as EgoDex has them: HDF5 with a transform for each of visionOS's 25 joints a hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.converting.loss import at_times, turned_at
from handtrack.converting.openxr import places
from handtrack.converting.source import Source
from handtrack.errors import SettingsError
from handtrack.sequences.readers.egodex import FPS

Array = NDArray[np.float64]

_ENDS = ("Metacarpal", "Knuckle", "IntermediateBase", "IntermediateTip", "Tip")
_FINGERS = ("Index", "Middle", "Ring", "Little")
NAMES: tuple[str, ...] = (
    "Hand",
    *(f"Thumb{end}" for end in _ENDS[1:]),
    *(f"{finger}Finger{end}" for finger in _FINGERS for end in _ENDS),
)
"""EgoDex's joints of a hand, in the order of OpenXR's, which has a palm before them."""

# OpenXR's z is back along the bone and its y out of the back of the hand; here x is along the
# bone to the tip
_AXES = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])


def write_egodex(sources: list[Source], path: Path, origin_ns: int) -> str:
    """`transforms/leftIndexFingerTip` (T, 4, 4) [m] ... and `confidences/...` (T,), float32.

    Frames are 30 a second, by interpolation where the source's are not. A hand that is not
    there is NaN with confidence 0. Joints' frames have x along the bone and y out of the back
    of the hand, where Apple's have their own.

    Returns:
        What was done, in words; else "".

    Raises:
        SettingsError: h5py is not there.
    """
    try:
        import h5py
    except ImportError:
        raise SettingsError(
            'HDF5 needs the package h5py: pip install "handtrack[formats]"'
        ) from None
    last = max(int(s.time_ns[-1]) for s in sources)
    count = int(np.floor((last - origin_ns) * 1e-9 * FPS + 1e-3)) + 1
    grid = origin_ns + np.round(np.arange(count) * 1e9 / FPS).astype(np.int64)
    moved = any(len(s) != count or np.abs(s.time_ns - grid).max() > 1e6 for s in sources)
    with h5py.File(path, "w") as file:
        transforms, sure = file.create_group("transforms"), file.create_group("confidences")
        for source in sources:
            found = places(source, source.whole)
            rotation = turned_at(grid, source.time_ns, found.orientations[:, 1:] @ _AXES)
            position = at_times(grid, source.time_ns, found.positions[:, 1:])
            seen = np.asarray(np.isfinite(position).all(-1))
            own = at_times(grid, source.time_ns, np.isnan(found.sd[:, 1:]).astype(float))
            for j, name in enumerate(NAMES):
                pose = np.tile(np.eye(4, dtype=np.float32), (count, 1, 1))
                pose[:, :3, :3], pose[:, :3, 3] = rotation[:, j], position[:, j]
                transforms[f"{source.hand}{name}"] = pose
                # what the fitted hand says is half as sure as what was seen
                confidence = np.where(seen[:, j], 0.5 + 0.5 * np.nan_to_num(own[:, j]), 0.0)
                sure[f"{source.hand}{name}"] = confidence.astype(np.float32)
    return f"brought onto {FPS:g} frames/s ({count} frames)" if moved else ""
