"""Reader of NumPy files: .npy with the joints, .npz with named arrays (see `fields`)."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.files import npz
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.readers import freemocap, mano_params, visionpro
from handtrack.sequences.readers.bare_table import LABELLED, is_label_last
from handtrack.sequences.readers.both_hands import by_frame, of_sides, two_hands
from handtrack.sequences.readers.catalogue import Format, Way
from handtrack.sequences.readers.fields import as_frames, from_fields
from handtrack.sequences.readers.json_file import flat_too
from handtrack.sequences.readers.raw import Raw, stem
from handtrack.sequences.titles import joints_key

NPY_MAGIC = b"\x93NUMPY"


def read_npy(data: bytes, path: Path) -> list[Raw]:
    """The one sequence of a .npy file: (T, 21, 3), (T, 63) or (21, 3).

    Raises:
        InputError: damaged, not numbers, or another shape.
    """
    array = npz.read_npy(data, path)
    whole = freemocap.holistic(array, path)
    if whole is not None:
        return whole
    if array.ndim == 2 and array.shape[1] == 64 and array.dtype.kind in "fiu":
        raws = [Raw(as_frames(a, path, "the array"), path, stem(path)) for a in _labelled(array)]
        return [replace(part, notes=(LABELLED,)) for raw in raws for part in two_hands(raw)]
    return flat_too(
        lambda a: two_hands(Raw(as_frames(a, path, "the array"), path, stem(path))), array
    )


def _labelled(array: NDArray[Any]) -> list[NDArray[Any]]:
    """The numbers of hands that have a label behind them; as they are, where they have none."""
    return [array[:, :-1] if is_label_last(array.astype(np.float64)) else array]


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
    return flat_too(lambda f: _named(f, path), _alone(fields))


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
