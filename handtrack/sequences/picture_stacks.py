"""Joints in the pictures of several cameras, kept in one array."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.files import npz
from handtrack.hand.skeleton import HANDS, N_JOINTS, ORDERS, Hand
from handtrack.sequences.clock import Clock, Stamps, read_clock
from handtrack.sequences.picture_landmarks import PictureLandmarks

Array = NDArray[np.float64]

_SHARES = 4.0
"""Places that are all nearer to 0 than this are shares of the picture's width and height."""
_TIMES: dict[str, Any] = {"time_ns": "ns", "time_s": "s", "time": None, "timestamps": None}


def stack_in(
    path: Path,
    key: str | None = None,
    order: str | None = None,
    fps: float | None = None,
    frames: tuple[int, int] | None = None,
) -> list[PictureLandmarks] | None:
    """What each of several cameras saw; None where a file is no such stack.

    An .npz or .npy with an array (C, T, 21, 2) or (T, C, 21, 2) of C cameras: the shorter of the
    two first axes is the cameras'. A third number is the detector's confidence. Places may be
    shares of the pictures' size, which the file may say (`size`, `size_px`). Times are `time_ns`,
    `time_s`, `time` or by `fps`; `hand` says which it is.

    Args:
        path: the file.
        key: the array's name, where several could be it.
        order: joint order, a name of `ORDERS`; by default ours, which is MediaPipe's.
        fps: frames per second instead of the file's times.
        frames: first and last frame to keep.

    Raises:
        InputError: the array that is asked for does not fit.
    """
    if not path.is_file() or path.suffix not in (".npz", ".npy"):
        return None
    fields = _fields(path)
    name = key or _only(fields)
    if name is None:
        return None
    if name not in fields:
        known = ", ".join(shown(n, 40) for n in fields)
        raise InputError(f"there is no {shown(name, 40)} in it, only {known}", path)
    stack = np.asarray(fields[name])
    if stack.ndim != 4:
        return None
    points, sure = _by_camera(stack, path, order)
    size = fields.get("size_px", fields.get("size"))
    seen = points[np.isfinite(points).all(-1)]
    if not len(seen):
        raise InputError("no joint is seen in any picture", path)
    shares = bool(np.abs(seen).max() < _SHARES)
    if shares and size is not None:
        points, shares = points * np.asarray(size, dtype=np.float64).ravel()[:2], False
    clock = _clock(fields, points.shape[1], path, fps)
    index = np.arange(points.shape[1])
    keep = index >= 0 if frames is None else (index >= frames[0]) & (index <= frames[1])
    if not keep.any():
        raise InputError(f"no frame in {frames}, there are 0:{index[-1]}", path)
    hand: Hand | None = next((h for h in HANDS if str(fields.get("hand", "")) == h), None)
    return [
        PictureLandmarks(
            points=points[c][clock.rows][keep],
            depth=None,
            sure=sure[c][clock.rows][keep],
            shares=shares,
            time_ns=clock.time_ns[keep],
            frame_index=index[keep],
            timed=clock.stated,
            hand=hand,
            name=path.stem,
            source=str(path),
            notes=clock.notes if c == 0 else (),
        )
        for c in range(len(points))
    ]


def _fields(path: Path) -> Mapping[str, Any]:
    if path.suffix == ".npy":
        return {"the array": npz.read_npy(path.read_bytes(), path)}
    arrays, _ = npz.read_npz(path, path)
    return {n: (a.item() if np.ndim(a) == 0 else a) for n, a in arrays.items()}


def _only(fields: Mapping[str, Any]) -> str | None:
    """The one array that has the shape of a stack."""
    fit = [
        name
        for name, value in fields.items()
        if np.ndim(value) == 4 and np.shape(value)[-2] >= N_JOINTS and np.shape(value)[-1] in (2, 3)
    ]
    two = [name for name in fit if np.shape(fields[name])[-1] == 2]
    found = two or fit
    return found[0] if len(found) == 1 else None


def _by_camera(stack: NDArray[Any], path: Path, order: str | None) -> tuple[Array, Array]:
    """(C, T, 21, 2) places, NaN where not seen, and (C, T, 21) how sure."""
    if stack.dtype.kind not in "fiu" or stack.shape[-1] not in (2, 3):
        raise InputError(
            f"the joints have shape {stack.shape}, expected numbers (cameras, frames, 21, 2)", path
        )
    array = stack.astype(np.float64)
    if array.shape[0] > array.shape[1]:
        array = array.swapaxes(0, 1)
    places = ORDERS.get(order or "handtrack")
    if places is None or min(places) < 0 or max(places) >= array.shape[2]:
        raise InputError(
            f"{array.shape[2]} joints are not in the order {shown(order or 'handtrack', 40)}", path
        )
    array = array[:, :, list(places)]
    gone = ~np.isfinite(array[..., :2]).all(-1) | (array[..., :2] == 0).all(-1)
    sure = (~gone).astype(np.float64)
    if array.shape[-1] == 3:
        sure *= np.clip(np.nan_to_num(array[..., 2]), 0, 1)
    return np.where((sure > 0)[..., None], array[..., :2], np.nan), sure


def _clock(fields: Mapping[str, Any], n: int, path: Path, fps: float | None) -> Clock:
    stamps = next((Stamps(fields[k], k, u) for k, u in _TIMES.items() if k in fields), None)
    rate = fields.get("fps")
    return read_clock(n, path, stamps, fps=None if rate is None else float(rate), given_fps=fps)
