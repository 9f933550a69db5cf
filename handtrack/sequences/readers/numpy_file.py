"""Reader of NumPy files: .npy with the joints, .npz with named arrays (see `fields`)."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.files import npz
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers import freemocap, mano_params, pickled, visionpro
from handtrack.sequences.readers.bare_table import LABELLED, is_label_last
from handtrack.sequences.readers.both_hands import by_frame, of_sides, two_hands
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.fields import from_fields
from handtrack.sequences.readers.joint_frames import as_frames, frames_and_sure
from handtrack.sequences.readers.json_file import flat_too
from handtrack.sequences.readers.raw import Raw, stem
from handtrack.sequences.titles import joints_key

NPY_MAGIC = b"\x93NUMPY"


def read_npy(data: bytes | NDArray[np.uint8], path: Path) -> list[Raw]:
    """The sequences of a .npy file's bytes: of (T, 21, 3), (T, 63), (21, 3) and the like, of a
    record type's fields, or of objects, of which nothing is run.

    Raises:
        InputError: damaged, not numbers, or another shape.
    """
    array = npz.read_npy(data, path, lambda objects: _Pickled(objects))
    if isinstance(array, _Pickled):
        return pickled.read_pickle(array.data, path)
    if array.dtype.names is not None:
        fields = {name: array[name] for name in array.dtype.names}
        return flat_too(lambda f: _named(f, path), _alone(fields))
    whole = freemocap.holistic(array, path)
    if whole is not None:
        return whole
    if array.ndim == 2 and array.shape[1] == 64 and array.dtype.kind in "fiu":
        return _of_64(array, path)
    return flat_too(lambda a: two_hands(_of_array(a, path)), array)


class _Pickled(NamedTuple):
    """An array of objects, as it stands in the file."""

    data: bytes


def _of_array(array: NDArray[Any], path: Path) -> Raw:
    joints, sure = frames_and_sure(array, path, "the array")
    return Raw(joints, path, stem(path), confidence=sure)


def _of_64(array: NDArray[Any], path: Path) -> list[Raw]:
    """The hands of rows of 64 numbers: a time or a frame's before the joints', or a label behind.

    Raises:
        InputError: neither.
    """
    numbers = array.astype(np.float64)
    if is_label_last(numbers):
        found = two_hands(_of_array(array[:, :-1], path))
        return [replace(raw, notes=(*raw.notes, LABELLED)) for raw in found]
    first = numbers[:, 0]
    if not (np.isfinite(first).all() and (np.diff(first) > 0).all()):
        as_frames(array, path, "the array")  # says what was expected
    raw = _of_array(array[:, 1:], path)
    if (first == np.round(first)).all() and np.abs(first).max() < _COUNTED:
        raw.frame_index = first.astype(np.int64)
    else:
        raw.stamps = Stamps(first, "the first column", None)
    return two_hands(raw)


_NUMBERED = re.compile(r"(.*?)(\d{1,12})")
_COUNTED = 1e7
"""Whole numbers below it count frames."""


def read_npz(data: bytes | Path, path: Path) -> list[Raw]:
    """The sequences of a .npz file: one, or one of each hand where names begin with the hand.

    Raises:
        NotJointsError: a whole file without joints.
        InputError: damaged, or a field that does not fit.
    """
    arrays, _ = npz.read_npz(data, path)
    fields = {name: _scalar(array) for name, array in arrays.items()}
    if not any(joints_key(key) for key in fields) and mano_params.is_mano(fields):
        return mano_params.from_named(fields, path)
    if visionpro.arrays(fields):
        return visionpro.from_arrays(fields, path)
    return flat_too(lambda f: _named(f, path), _alone(_one_a_frame(fields)))


def _one_a_frame(fields: dict[str, Any]) -> dict[str, Any]:
    """With the arrays of a frame each, under its number, as one; else as they are."""
    if not all(isinstance(v, np.ndarray) and v.shape == (N_JOINTS, 3) for v in fields.values()):
        return fields
    numbers = [_NUMBERED.fullmatch(name) for name in fields]
    if len(fields) < 2 or len({None if m is None else m[1] for m in numbers}) > 1:
        return fields
    frames = {int(m[2]): fields[m[0]] for m in numbers if m is not None}
    if len(frames) < len(fields):
        return fields
    return {
        "frame": np.array(sorted(frames)),
        "joints": np.stack([frames[n] for n in sorted(frames)]),
    }


def _named(fields: dict[str, Any], path: Path) -> list[Raw]:
    parts = [own for part in of_sides(fields) for own in by_frame(part, path)]
    return [raw for part in parts for raw in two_hands(from_fields(part, path))]


def _alone(fields: dict[str, Any]) -> dict[str, Any]:
    """With the only array under the joints' name: np.savez without names calls it arr_0, and of
    another name its shape says that it is a hand's."""
    arrays = [k for k, v in fields.items() if isinstance(v, np.ndarray) and v.ndim > 1]
    if len(arrays) != 1 or (arrays[0] != "arr_0" and not _of_hand(arrays[0], fields)):
        return fields
    return {("joints" if k == arrays[0] else k): v for k, v in fields.items()}


def _of_hand(name: str, fields: dict[str, Any]) -> bool:
    """Whether an array of unknown name has a hand's shape, and no other has a joints' name."""
    if any(joints_key(key) is not None for key in fields):
        return False
    array = fields[name]
    return array.dtype.kind in "fiu" and (
        array.shape[-2:] == (N_JOINTS, 3) or array.shape[1:] in ((63,), (126,))
    )


def _scalar(value: Any) -> Any:
    """0-d arrays as plain values, so that text looks the same in npz and JSON."""
    plain = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    return plain.decode("utf-8", "replace") if isinstance(plain, bytes) else plain


FORMATS = (
    Format(
        "NumPy, any detector",
        ".npz with `joints_m`, `joints`, `landmarks`, `keypoints` ... (+ `fps`, times, `hand`,"
        " `confidence`, `truth_m`), of both hands `left_joints_m` and `right_joints_m` ...; .npy;"
        " of one hand or of 42 joints; a folder of `joints_N.npy` or `.txt`, a frame each;"
        " pickles of such arrays, lists and objects",
        "handtrack",
        "m",
        "one or both",
        "file magic",
        suffixes=(".npz", ".npy"),
        ways=(
            Way("bytes", lambda data, path: data.startswith(NPY_MAGIC), read_npy),
            Way("bytes", lambda data, path: data.startswith(npz.ZIP), read_npz),
        ),
    ),
    Format(
        "MANO parameters",
        ".npz: `poses`, or `global_orient` and `hand_pose` (rotation vectors, matrices or"
        " principal components), `betas`, `transl`, `flat_hand_mean`; FreiHAND's `*_mano.json`",
        "by your MANO",
        "m",
        "one",
        "names of arrays",
        "`--mano DIR`",
        kinds={"mano": read_npz},
    ),
)
