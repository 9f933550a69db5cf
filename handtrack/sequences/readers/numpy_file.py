"""Reader of NumPy files: .npy with the joints, .npz with named arrays (see `fields`)."""

from __future__ import annotations

import io
import struct
import tokenize
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import HANDS, Hand
from handtrack.sequences.readers import mano_params
from handtrack.sequences.readers.fields import JOINT_KEYS, as_frames, from_fields
from handtrack.sequences.readers.raw import Raw, stem

# all that NumPy and zipfile raise for damaged files; MemoryError from a damaged shape
DAMAGED = (
    ValueError,
    EOFError,
    OSError,
    KeyError,
    IndexError,
    TypeError,
    OverflowError,
    MemoryError,
    NotImplementedError,
    RuntimeError,
    SyntaxError,
    UnicodeError,
    struct.error,
    tokenize.TokenError,
    zipfile.BadZipFile,
    zipfile.LargeZipFile,
    zlib.error,
)


def read_npy(data: bytes, path: Path) -> list[Raw]:
    """The one sequence of a .npy file: (T, 21, 3), (T, 63) or (21, 3).

    Raises:
        InputError: damaged, not numbers, or another shape.
    """
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except DAMAGED as error:
        raise InputError(damage("the .npy file", error), path) from None
    return [Raw(as_frames(array, path, "the array"), path, stem(path))]


def read_npz(data: bytes, path: Path) -> list[Raw]:
    """The sequences of a .npz file: one, or one of each hand where names begin with the hand.

    Raises:
        NotJointsError: a whole file without joints.
        InputError: damaged, or a field that does not fit.
    """
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as archive:
            fields = {str(name): _scalar(archive[name]) for name in archive.files}
    except DAMAGED as error:
        raise InputError(damage("the .npz file", error), path) from None
    if not any(key in fields for key in JOINT_KEYS) and mano_params.is_mano(fields):
        return mano_params.from_named(fields, path)
    hands = [of_hand for hand in HANDS if (of_hand := _of_hand(fields, hand))]
    return [from_fields(of_hand, path) for of_hand in hands] or [from_fields(fields, path)]


def _of_hand(fields: dict[str, Any], hand: Hand) -> dict[str, Any] | None:
    """The fields named after a hand (`left_joints_m`) without its name, and those of both."""
    own = {k.removeprefix(f"{hand}_"): v for k, v in fields.items() if k.startswith(f"{hand}_")}
    if not any(key in own for key in JOINT_KEYS):
        return None
    both = {k: v for k, v in fields.items() if not k.startswith(("left_", "right_"))}
    return both | own | {"hand": hand}


def _scalar(value: Any) -> Any:
    """0-d arrays as plain values, so that text looks the same in npz and JSON."""
    plain = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    return plain.decode("utf-8", "replace") if isinstance(plain, bytes) else plain


def damage(what: str, error: Exception) -> str:
    """What to say of a NumPy file that raised one of `DAMAGED`."""
    text = str(error)
    if "allow_pickle" in text or "Object arrays" in text:
        return f"{what} holds pickled Python objects, which are not read; expected plain arrays"
    detail = " ".join(text.split()) or type(error).__name__
    return f"{what} is damaged or cut short ({detail[:120]})"
