"""Reader of DexYCB: a folder of `labels_%06d.npz`, one camera's view of a sequence.

Chao et al. 2021: joint_3d (1, 21, 3) in the camera's frame, m, this project's order, all -1
where no hand is seen. Which hand it is, and whose, says meta.yml in the folder above.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from handtrack.errors import InputError, shown
from handtrack.files import budget
from handtrack.files.npz import read_npz
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.readers import numpy_file
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.raw import Array, NoFramesError, Raw, as_hand

FILE_NAME = re.compile(r"labels_(\d{6})\.npz")
FPS = 30.0
_KEY = "joint_3d"
# each space in one place only: a meta.yml of line ends is passed once
_LISTED = r"^{}:[ \t]*(?:\r?\n[ \t]*-[ \t]*|\[[ \t]*)['\"]?([\w-]{{1,100}})"


def read_files(
    paths: Iterable[Path], folder: Path, frames: tuple[int, int] | None = None
) -> list[Raw]:
    """The one sequence of a folder; only files inside `frames` are opened.

    Raises:
        InputError: no file in that range, a file that is damaged or without joints.
    """
    numbered = sorted((int(m[1]), p) for p in paths if (m := FILE_NAME.fullmatch(p.name)))
    chosen = [(n, p) for n, p in numbered if frames is None or frames[0] <= n <= frames[1]]
    if not chosen:
        there = f"{numbered[0][0]}:{numbered[-1][0]}"
        raise NoFramesError(f"no frame in {frames}, there are {there}", folder)
    raw = Raw(
        np.concatenate([_joints(path) for _, path in chosen]),
        folder,
        f"{folder.resolve().parent.name} {folder.resolve().name}",
        unit="m",
        order="freihand",
        frame_index=np.array([n for n, _ in chosen]),
        fps=FPS,
    )
    meta = folder / "meta.yml"
    meta = meta if meta.exists() else folder.resolve().parent / "meta.yml"
    if meta.exists():
        text = budget.read(meta, budget.TEXT).decode("utf-8", "replace")
        side = re.search(_LISTED.format("mano_sides"), text, re.M)
        subject = re.search(_LISTED.format("mano_calib"), text, re.M)
        raw.hand = None if side is None else as_hand(side[1], meta, "mano_sides")
        raw.subject = "" if subject is None else subject[1]
    return [raw]


def _joints(path: Path) -> Array:
    """(1, 21, 3) joints of one file; its large pictures are not unpacked."""
    arrays, names = read_npz(path, path, (_KEY,))
    if _KEY not in arrays:
        there = ", ".join(shown(name, 40) for name in names[:5]) or "nothing"
        raise InputError(f"no {_KEY} in it, found {there}", path)
    joints = arrays[_KEY]
    if joints.shape != (1, N_JOINTS, 3) or joints.dtype.kind not in "fiu":
        raise InputError(f"{_KEY} has shape {joints.shape}, expected (1, 21, 3)", path)
    return np.asarray(joints, dtype=np.float64)


FORMATS = (
    Format(
        "DexYCB",
        "a camera's folder of `labels_*.npz`, or the folders above; `meta.yml` names the hand",
        "freihand",
        "m",
        "one",
        "file names",
        kinds={"dexycb": numpy_file.read_npz},
        numbered=(FILE_NAME, read_files),
    ),
)
