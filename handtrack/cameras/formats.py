"""Camera calibrations as people have them: aniposelib's TOML, OpenCV's YAML, Panoptic's JSON."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.rotations import vector_to_matrix

Array = NDArray[np.float64]
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}


def load_cameras(path: Path, unit: str | None = None) -> list[Camera]:
    """The cameras of a calibration file, or of the files of a folder in order of name.

    Understood are
    - TOML as aniposelib writes it: a table for each camera with `name`, `size`, `matrix`,
      `distortions`, `rotation` (axis times angle) and `translation`;
    - YAML as OpenCV's FileStorage writes it, one camera a file: `camera_matrix` or `K`,
      `distortion_coefficients` or `D`, `R` and `T`, `image_width` and `image_height`;
    - JSON as CMU Panoptic gives it: `cameras` with `name`, `resolution`, `K`, `distCoef`, `R`,
      `t`; of its cameras the `hd` ones.

    Args:
        path: the file or folder.
        unit: of the translations: m, cm or mm; by default cm for Panoptic and m else.

    Raises:
        InputError: nothing there, not one of these, or a camera that is inconsistent.
    """
    if path.is_dir():
        files = sorted(p for p in path.iterdir() if p.suffix in (".yml", ".yaml", ".json", ".toml"))
        if not files:
            raise InputError("no .toml, .yaml or .json calibration in this folder", path)
        return [camera for file in files for camera in load_cameras(file, unit)]
    if not path.is_file():
        raise InputError("no such file or folder", path)
    try:
        text = path.read_text(encoding="utf-8")
    except (UnicodeDecodeError, OSError):
        raise InputError("not a text file, expected a camera calibration", path) from None
    try:
        if path.suffix == ".toml":
            return _from_toml(text, path, METRES[unit or "m"])
        if text.lstrip().startswith("{"):
            return _from_panoptic(text, path, METRES[unit or "cm"])
        if text.startswith("%YAML") or path.suffix in (".yml", ".yaml"):
            return [_from_opencv(text, path, METRES[unit or "m"])]
    except InputError as error:
        if error.path is not None:
            raise
        raise InputError(str(error), path) from None
    raise InputError("not a calibration: expected TOML, OpenCV's YAML or Panoptic's JSON", path)


def _numbers(value: Any, what: str, count: int | None = None) -> Array:
    try:
        array = np.array(value, dtype=np.float64)
    except (ValueError, TypeError):
        raise InputError(f"{what} holds something else than numbers") from None
    if count is not None and array.size != count:
        raise InputError(f"{what} has {array.size} numbers, expected {count}")
    return array


def _entry(table: dict[str, Any], keys: tuple[str, ...], where: str) -> Any:
    for key in keys:
        if key in table:
            return table[key]
    raise InputError(f"{where} has no {' or '.join(keys)}")


def _vector(table: dict[str, Any], key: str, where: str) -> Array:
    return _numbers(_entry(table, (key,), where), f"{where} {key}", 3).ravel()


def _from_toml(text: str, path: Path, metre: float) -> list[Camera]:
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"not valid TOML: {error}", path) from None
    cameras = []
    for key, table in tables.items():
        if not isinstance(table, dict) or "matrix" not in table:
            continue
        where = f"[{key}]"
        size = _numbers(table["size"], f"{where} size", 2) if "size" in table else None
        cameras.append(
            Camera(
                str(table.get("name", key)),
                _numbers(table["matrix"], f"{where} matrix", 9).reshape(3, 3),
                _numbers(table.get("distortions", []), f"{where} distortions").ravel(),
                vector_to_matrix(_vector(table, "rotation", where)),
                metre * _vector(table, "translation", where),
                None if size is None else (int(size[0]), int(size[1])),
            )
        )
    if not cameras:
        raise InputError("no camera: expected tables with matrix, rotation, translation", path)
    return cameras


def _from_panoptic(text: str, path: Path, metre: float) -> list[Camera]:
    try:
        data = msgspec.json.decode(text, type=dict[str, Any])
    except msgspec.DecodeError as error:
        raise InputError(f"not valid JSON: {error}", path) from None
    found = data.get("cameras")
    if not isinstance(found, list) or not all(isinstance(c, dict) for c in found):
        raise InputError("no cameras in it: expected a list under `cameras`", path)
    kinds = {str(c.get("type", "hd")) for c in found}
    wanted = [c for c in found if str(c.get("type", "hd")) == "hd" or "hd" not in kinds]
    cameras = []
    for i, c in enumerate(wanted):
        where = f"camera {c.get('name', i)}"
        size = c.get("resolution")
        cameras.append(
            Camera(
                str(c.get("name", i)),
                _numbers(_entry(c, ("K",), where), f"{where} K", 9).reshape(3, 3),
                _numbers(c.get("distCoef", []), f"{where} distCoef").ravel(),
                _numbers(_entry(c, ("R",), where), f"{where} R", 9).reshape(3, 3),
                metre * _vector(c, "t", where),
                None if size is None else (int(size[0]), int(size[1])),
            )
        )
    if not cameras:
        raise InputError("the list of cameras is empty", path)
    return cameras


_MATRIX = re.compile(
    r"^(?P<name>\w+):\s*!!opencv-matrix\s+rows:\s*\d+\s+cols:\s*\d+\s+dt:\s*\w+\s+"
    r"data:\s*\[(?P<data>[^\]]*)\]",
    re.MULTILINE,
)
_SCALAR = re.compile(r"^(?P<name>\w+):\s*(?P<value>[^\s!][^\n]*)$", re.MULTILINE)


def _from_opencv(text: str, path: Path, metre: float) -> Camera:
    """FileStorage's YAML: a few named matrices. General YAML readers refuse its first line."""
    matrices: dict[str, Any] = {}
    for match in _MATRIX.finditer(text):
        words = match["data"].replace(",", " ").split()
        matrices[match["name"]] = _numbers(words, match["name"])
    scalars = {match["name"]: match["value"].strip().strip('"') for match in _SCALAR.finditer(text)}
    where = "the file"
    k = _entry(matrices, ("camera_matrix", "K", "cameraMatrix", "intrinsic"), where)
    distortion = next(
        (
            matrices[n]
            for n in ("distortion_coefficients", "D", "distCoeffs", "dist")
            if n in matrices
        ),
        np.zeros(5),
    )
    rotation = _entry(matrices, ("R", "rotation", "rvec"), where)
    size = None
    if "image_width" in scalars and "image_height" in scalars:
        pair = _numbers([scalars["image_width"], scalars["image_height"]], "image size")
        size = (int(pair[0]), int(pair[1]))
    return Camera(
        scalars.get("camera_name", path.stem),
        _numbers(k, "camera_matrix", 9).reshape(3, 3),
        distortion,
        vector_to_matrix(rotation) if rotation.size == 3 else rotation.reshape(3, 3),
        metre * _numbers(_entry(matrices, ("T", "t", "translation", "tvec"), where), "T", 3),
        size,
    )
