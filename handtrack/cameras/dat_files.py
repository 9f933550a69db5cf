"""Pairs of .dat files: `c0.dat` with a camera's lens, `rot_trans_c0.dat` with where it stands."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.cameras.numbers import as_number, numbers, rotation
from handtrack.errors import InputError
from handtrack.files.texts import read_text

Array = NDArray[np.float64]

_PLACE = "rot_trans_"
_TITLE = re.compile(r"(intrinsic|distortion|R|T):", re.IGNORECASE)


def from_dats(files: list[Path], folder: Path, metre: float) -> list[Camera]:
    """The cameras of .dat files, in order of name.

    Args:
        files: those of the lenses; where they stand is in files beside them.
        folder: that they are in.
        metre: the unit of `T` [m].

    Raises:
        InputError: a file lacks what it should have, or its partner.
    """
    lenses = [file for file in files if not file.name.startswith(_PLACE)]
    if not lenses:
        raise InputError(f"no NAME.dat with intrinsic: beside {_PLACE}NAME.dat", folder)
    cameras = []
    for file in lenses:
        place = file.with_name(_PLACE + file.name)
        if not place.is_file():
            raise InputError(f"{place.name}, which says where the camera stands, is missing", file)
        lens, stands = _numbers(file, "intrinsic"), _numbers(place, "R", "T")
        try:
            cameras.append(
                Camera(
                    file.stem,
                    numbers(lens["intrinsic"], "intrinsic", (3, 3)).reshape(3, 3),
                    np.array(lens.get("distortion", [])),
                    rotation(numbers(stands["r"], "R", (3, 3))),
                    metre * numbers(stands["t"], "T", (3,)),
                )
            )
        except InputError as error:
            raise InputError(str(error), file) from None
    return cameras


def _numbers(path: Path, *wanted: str) -> dict[str, list[float]]:
    """Numbers under their titles; what stands under one a second time is another camera's."""
    found: dict[str, list[float]] = {}
    own: list[float] = []
    for line in read_text(path, "is no camera calibration").splitlines():
        text = line.partition("#")[0].strip()
        title = _TITLE.fullmatch(text)
        if title is not None:
            own = []
            found.setdefault(title[1].lower(), own)
        else:
            own += [as_number(word, path.name) for word in text.replace(",", " ").split()]
    missing = [name for name in wanted if name.lower() not in found]
    if missing:
        raise InputError(f"there is no `{missing[0]}:` in it", path)
    return found
