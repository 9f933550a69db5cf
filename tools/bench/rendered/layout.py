"""The benchmark's file: what a detector said of a hand in a clip, beside the truth.

One `.npz` a clip. An array `X` may come as integers with a scalar `X_unit`: its values are then
the integers times the unit, and the type's least integer is "missing". Floats have NaN. T frames,
C cameras; joints in handtrack's order; metres, radians, pixels, nanoseconds.

| array | shape | what |
|---|---|---|
| `name`, `subject`, `hand`, `detector`, `motion` | text | of the clip; hand is left or right |
| `time_ns` | (T,) int64 | when |
| `truth_joints` | (T, 21, 3) | true joint centres in the world |
| `joints` | (T, 21, 3) | detected in 3D in the world: plainly triangulated, or a 3D detector's |
| `image` | (C, T, 21, 2) | detected in each picture [px] |
| `world` | (C, T, 21, 3) | detected about the hand's middle, camera's axes (x right, y down) |
| `score` | (C, T) | of the detection; missing: nothing was found |
| `label` | (C, T) int8 | the hand it was taken for: 0 none, 1 left, 2 right |
| `camera_matrix`, `camera_distortion` | (C, 3, 3), (C, 8) | as in `handtrack.Camera` |
| `camera_rotation`, `camera_translation` | (C, 3, 3), (C, 3) | world to camera |
| `camera_size` | (C, 2) | width and height [px] |
| `truth_angles` | (T, 20) | true angles, of the default hand of that day |
| `truth_rotation`, `truth_translation` | (T, 4) wxyz, (T, 3) | true pose of the root frame |
| `truth_shape`, `truth_rest_joints`, `truth_axes` | (S,), (21, 3), (20, 3) | true hand |
| `default_axes` | (20, 3) | axes of the default hand of that day, which define the angles |

`hand`, `time_ns`, `truth_joints` and at least one of `joints`, `world`, `image` with cameras
must be there; the rest may be left out, so that output recorded elsewhere is stored likewise.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.skeleton import HANDS, Hand

Array = NDArray[np.float64]

LABELS = ("none", "left", "right")
UNITS: dict[str, tuple[float, type[np.signedinteger[Any]]]] = {
    "truth_joints": (2.0**-18, np.int32),
    "joints": (2.0**-14, np.int32),
    "image": (2.0**-4, np.int16),
    "world": (2.0**-15, np.int16),
    "score": (1 / 250.0, np.int16),
    "truth_angles": (2.0**-14, np.int16),
    "truth_rotation": (2.0**-14, np.int16),
    "truth_translation": (2.0**-20, np.int32),
}
"""How numbers are kept in few bytes: 4 um, 61 um, 0.06 px, 31 um, 0.004, 0.0035 degrees."""
TEXTS = ("name", "hand", "subject", "detector", "motion")
RAW_INLIER_PX = 15.0
"""How near views had to be for the `joints` of the clips that ship, by the linear solution."""
NEEDED = ("hand", "time_ns", "truth_joints")


@dataclass(frozen=True, eq=False)
class Clip:
    """A clip as the module's text describes it; what is not there is None.

    Raises:
        InputError: something needed is missing, or shapes do not fit.
    """

    name: str
    hand: Hand
    time_ns: NDArray[np.int64]
    truth_joints: Array
    subject: str = ""
    detector: str = ""
    motion: str = ""
    joints: Array | None = None
    image: Array | None = None
    world: Array | None = None
    score: Array | None = None
    label: NDArray[np.int8] | None = None
    camera_matrix: Array | None = None
    camera_distortion: Array | None = None
    camera_rotation: Array | None = None
    camera_translation: Array | None = None
    camera_size: NDArray[np.int64] | None = None
    truth_angles: Array | None = None
    truth_rotation: Array | None = None
    truth_translation: Array | None = None
    truth_shape: Array | None = None
    truth_rest_joints: Array | None = None
    truth_axes: Array | None = None
    default_axes: Array | None = None

    def __post_init__(self) -> None:
        if self.hand not in HANDS:
            raise InputError(f"{self.name}: hand is {self.hand!r}, expected left or right")
        t = len(self.time_ns)
        c = next((len(x) for x in (self.image, self.world, self.camera_matrix) if x is not None), 0)
        shapes: dict[str, tuple[int, ...]] = {
            "truth_joints": (t, 21, 3),
            "joints": (t, 21, 3),
            "image": (c, t, 21, 2),
            "world": (c, t, 21, 3),
            "score": (c, t),
            "label": (c, t),
            "camera_matrix": (c, 3, 3),
            "camera_distortion": (c, 8),
            "camera_rotation": (c, 3, 3),
            "camera_translation": (c, 3),
            "camera_size": (c, 2),
            "truth_angles": (t, 20),
            "truth_rotation": (t, 4),
            "truth_translation": (t, 3),
            "truth_rest_joints": (21, 3),
            "truth_axes": (20, 3),
            "default_axes": (20, 3),
        }
        for name, shape in shapes.items():
            value = getattr(self, name)
            if value is not None and np.shape(value) != shape:
                raise InputError(
                    f"{self.name}: {name} has shape {np.shape(value)}, expected {shape}"
                )
        if self.joints is None and self.world is None and not self.cameras:
            raise InputError(
                f"{self.name}: no joints, no world, and no image with cameras: nothing detected"
            )

    @property
    def cameras(self) -> list[ht.Camera]:
        """The cameras; none where image or calibration is not there."""
        k, r, t = self.camera_matrix, self.camera_rotation, self.camera_translation
        if self.image is None or k is None or r is None or t is None:
            return []
        lens = np.zeros((len(k), 8)) if self.camera_distortion is None else self.camera_distortion
        sizes = self.camera_size
        return [
            ht.Camera(
                f"cam{i}",
                k[i],
                lens[i],
                r[i],
                t[i],
                None if sizes is None else (int(sizes[i, 0]), int(sizes[i, 1])),
            )
            for i in range(len(k))
        ]

    def seen(self, camera: int) -> NDArray[np.bool_]:
        """(T,) where that camera's detection is of the right hand."""
        if self.label is None:
            given = self.world if self.world is not None else self.image
            return np.zeros(len(self.time_ns), bool) if given is None else _there(given[camera])
        return np.asarray(self.label[camera] == LABELS.index(self.hand))


def _there(points: Array) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(points).all(-1).any(-1))


def write(path: Path, clip: Clip) -> None:
    """Write a clip, with numbers kept in few bytes.

    Raises:
        InputError: a number is too large for its unit.
    """
    arrays: dict[str, NDArray[np.generic]] = {}
    for field in fields(clip):
        value = getattr(clip, field.name)
        if value is None:
            continue
        a = np.asarray(value)
        if field.name in UNITS:
            unit, kind = UNITS[field.name]
            arrays[field.name] = _whole(a, unit, kind, f"{clip.name}: {field.name}")
            arrays[f"{field.name}_unit"] = np.array(unit)
        else:
            arrays[field.name] = a
    np.savez_compressed(path, **arrays)  # type: ignore[arg-type]


def _whole(
    a: Array, unit: float, kind: type[np.signedinteger[Any]], name: str
) -> NDArray[np.generic]:
    missing = np.isnan(a)
    whole = np.rint(np.where(missing, 0.0, a) / unit)
    if np.abs(whole).max(initial=0) > np.iinfo(kind).max:
        raise InputError(f"{name} is too large for units of {unit:g}")
    return np.where(missing, np.iinfo(kind).min, whole).astype(kind)


def read(path: Path) -> Clip:
    """A clip from its file.

    Raises:
        InputError: not such a file, or something needed is not in it.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
    except (OSError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(f"no .npz of detections and truth ({error})", path) from None
    missing = [name for name in NEEDED if name not in arrays]
    if missing:
        raise InputError(
            f"{', '.join(missing)} not there; see tools/bench/rendered/layout.py", path
        )
    values: dict[str, object] = {"name": path.stem}
    for field in fields(Clip):
        if field.name not in arrays:
            continue
        a = arrays[field.name]
        if field.name in TEXTS:
            values[field.name] = str(a)
        elif f"{field.name}_unit" in arrays:
            least = np.iinfo(a.dtype).min
            whole = np.where(a == least, np.nan, a.astype(np.float64))
            values[field.name] = whole * float(arrays[f"{field.name}_unit"])
        elif a.dtype.kind == "f":
            values[field.name] = a.astype(np.float64)
        else:
            values[field.name] = a
    return Clip(**values)  # type: ignore[arg-type]


def read_folder(path: Path) -> list[Clip]:
    """The clips of a folder, by name, or of one file.

    Raises:
        InputError: nothing there, or a file that is none.
    """
    files = [path] if path.is_file() else sorted(path.glob("*.npz"))
    if not files:
        raise InputError("no .npz of detections and truth here", path)
    return [read(file) for file in files]
