"""Read MANO's files: MANO_RIGHT.pkl and MANO_LEFT.pkl as distributed, and .npz conversions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.files.npz import read_npz
from handtrack.hand.skeleton import HANDS, Hand
from handtrack.hand.unpickle import plain, unpickle

N_VERTICES, N_FACES = 778, 1538
_LARGEST = 10**6
"""Numbers in an array."""

# every parent comes before its children; the root's is 2^32 - 1 in an unsigned table
PARENTS = (-1, 0, 1, 2, 0, 4, 5, 0, 7, 8, 0, 10, 11, 0, 13, 14)

_SHAPES: dict[str, tuple[int | None, ...]] = {
    "v_template": (N_VERTICES, 3),
    "shapedirs": (N_VERTICES, 3, None),
    "posedirs": (N_VERTICES, 3, 135),
    "J_regressor": (16, N_VERTICES),
    "weights": (N_VERTICES, 16),
    "kintree_table": (2, 16),
    "f": (N_FACES, 3),
    "hands_mean": (45,),
    "hands_components": (45, 45),
}


def find_mano(path: str | Path, hand: Hand) -> Path:
    """The MANO file of a hand, where people keep it.

    Args:
        path: the file, or a folder with MANO_RIGHT.pkl or MANO_LEFT.pkl (or .npz) in it or in
            its folder `mano` or `models`, as smplx and MANO's own archive have it.
        hand: which of the two.

    Raises:
        InputError: it is not there.
    """
    path = Path(path)
    if path.is_file():
        return path
    if not path.is_dir():
        raise InputError("no such file or folder", path)
    name = f"MANO_{hand.upper()}"
    for folder in (path, path / "mano", path / "models", path / "models" / "mano"):
        for suffix in (".pkl", ".npz"):
            if (folder / f"{name}{suffix}").is_file():
                return folder / f"{name}{suffix}"
    raise InputError(f"holds no {name}.pkl or {name}.npz, nor do its folders mano and models", path)


def hand_named(path: Path) -> Hand | None:
    """The hand that a file's name says it is of, as in MANO_LEFT.pkl."""
    named = [hand for hand in HANDS if hand in path.stem.lower()]
    return named[0] if len(named) == 1 else None


def read_mano(path: str | Path) -> dict[str, NDArray[Any]]:
    """The arrays of a MANO file, checked.

    Returns:
        v_template (778, 3) [m], shapedirs (778, 3, S), posedirs (778, 3, 135),
        J_regressor (16, 778), weights (778, 16), f (1538, 3), hands_mean (45,),
        hands_components (45, 45): float64, f int32.

    Raises:
        InputError: the file is not there, is no MANO file, holds code, lacks a key, or an
            array has another shape or impossible values.
    """
    path = Path(path)
    data = budget.read(path, budget.MODELS)
    raw = _npz(data, path) if data.startswith(b"PK\x03\x04") else _pkl(data, path)
    out = {key: _array(key, value, path) for key, value in raw.items()}
    parents = out.pop("kintree_table").astype(np.int64)[0]
    if not np.array_equal(parents[1:], PARENTS[1:]):
        raise InputError(
            f"kintree_table has parents {shown(str(parents))}, expected MANO's {list(PARENTS)}",
            path,
        )
    faces = out["f"]
    if not (faces.min() >= 0 and faces.max() < N_VERTICES and (faces % 1 == 0).all()):
        raise InputError("f names vertices that do not exist", path)
    out["f"] = faces.astype(np.int32)
    for key, axis in (("weights", 1), ("J_regressor", 1)):
        if np.abs(out[key].sum(axis) - 1).max() > 1e-3:
            raise InputError(f"the rows of {key} do not sum to one", path)
    if not 0.05 < np.ptp(out["v_template"], axis=0).max() < 0.5:
        size = np.ptp(out["v_template"], axis=0).max()
        raise InputError(f"v_template is {size:.3g} long, expected a hand in metres", path)
    # a partition of one, exactly
    out["weights"] = out["weights"] / out["weights"].sum(1, keepdims=True)
    return out


def _array(key: str, value: object, path: Path) -> NDArray[Any]:
    try:
        array = plain(value)
    except (
        AttributeError,
        LookupError,
        MemoryError,
        OverflowError,
        RecursionError,
        TypeError,
        ValueError,
    ) as error:
        raise InputError(
            f"{key} does not hold an array of numbers: {shown(str(error))}", path
        ) from error
    expected = _SHAPES[key]
    fits = array.ndim == len(expected) and all(
        want in (None, have) for have, want in zip(array.shape, expected, strict=True)
    )
    # before memory is taken for it
    if not fits or not 0 < array.size < _LARGEST:
        text = " x ".join("any" if n is None else str(n) for n in expected)
        raise InputError(f"{key} has shape {array.shape}, expected {text}", path)
    array = array.astype(np.float64)
    if not np.isfinite(array).all():
        raise InputError(f"{key} holds values that are not finite", path)
    return array


def _pkl(data: bytes, path: Path) -> dict[str, object]:
    content = unpickle(data, path)
    if not isinstance(content, dict):
        raise InputError(f"holds a {type(content).__name__}, expected MANO's dictionary", path)
    _complete(content, path)
    return {key: content[key] for key in _SHAPES}


def _npz(data: bytes, path: Path) -> dict[str, object]:
    arrays, names = read_npz(data, path, _SHAPES, lambda pickled: _single(pickled, path))
    _complete(names, path)
    return {key: arrays.get(key) for key in _SHAPES}


def _single(data: bytes, path: Path) -> object:
    """The object in a .npz; np.savez makes an array of one of it."""
    value = unpickle(data, path)
    return value[0] if isinstance(value, list) and len(value) == 1 else value


def _complete(keys: Any, path: Path) -> None:
    missing = [key for key in _SHAPES if key not in keys]
    if missing:
        raise InputError(
            f"lacks {', '.join(missing)}: no MANO file, or not all of one"
            f" (it has {shown(', '.join(sorted(shown(k, 40) for k in keys)[:20])) or 'nothing'})",
            path,
        )
