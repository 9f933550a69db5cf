"""Camera calibrations as people have them: aniposelib's TOML, OpenCV's YAML, Panoptic's JSON."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.errors import InputError, shown
from handtrack.files.texts import parse_json, parse_toml, read_text
from handtrack.hand.rotations import vector_to_matrix

Array = NDArray[np.float64]
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001}
_OF_A_CAMERA = ("matrix", "rotation", "translation", "distortions")
# no camera has as many pixels, is as far away, is turned as often or has a longer name
_PIXELS, _FAR, _TURNS, _LONGEST = 100_000, 1e9, 100.0, 200


def load_cameras(path: str | Path, unit: str | None = None) -> list[Camera]:
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
    path = Path(path)
    if path.is_dir():
        files = sorted(p for p in path.iterdir() if p.suffix in (".yml", ".yaml", ".json", ".toml"))
        if not files:
            raise InputError("no .toml, .yaml or .json calibration in this folder", path)
        return _distinct([c for file in files for c in load_cameras(file, unit)], path)
    text = read_text(path, "is no camera calibration")
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


def _distinct(cameras: list[Camera], path: Path) -> list[Camera]:
    """The same, whose names all differ: they are chosen by name.

    Raises:
        InputError: two have one name.
    """
    names: set[str] = set()
    for camera in cameras:
        if camera.name in names:
            raise InputError(f"two cameras are called {shown(camera.name, 60)}", path)
        names.add(camera.name)
    return cameras


def _numbers(value: Any, what: str, *shapes: tuple[int, ...]) -> Array:
    """Numbers in one of some shapes; a flat list is as good as rows.

    Raises:
        InputError: text, NaN, numbers that are no place of a camera's, another shape.
    """
    flat, shape = _flat(value, what)
    if not all(abs(x) < _FAR for x in flat):  # as is NaN
        raise InputError(f"{what} holds a number that is not finite")
    counts = {math.prod(s) for s in shapes}
    if shapes and (len(flat) not in counts or shape not in (*shapes, (len(flat),))):
        wanted = " or ".join(" x ".join(map(str, s)) for s in shapes)
        has = f"shape {shape}" if len(flat) in counts else f"{len(flat)} numbers"
        raise InputError(f"{what} has {has}, expected {wanted} numbers")
    return np.array(flat, dtype=np.float64)


def _flat(value: Any, what: str) -> tuple[list[float], tuple[int, ...]]:
    """The numbers of a list, or of a list of lists, and its shape."""
    rows = value if isinstance(value, list) else [value]
    nested = bool(rows) and all(isinstance(row, list) for row in rows)
    if nested and len({len(row) for row in rows}) > 1:
        raise InputError(f"{what} has rows of different length")
    flat = [x for row in rows for x in row] if nested else rows
    for x in flat:
        if isinstance(x, bool) or not isinstance(x, int | float):
            raise InputError(f"{what} holds {shown(x, 40)}, expected numbers")
    return flat, (len(rows), len(rows[0])) if nested else (len(flat),)


def _size(value: Any, what: str) -> tuple[int, int]:
    """Width and height of the pictures [px]."""
    width, height = _numbers(value, what, (2,))
    if not (0 < width < _PIXELS and 0 < height < _PIXELS and width % 1 == height % 1 == 0):
        raise InputError(f"{what} is {width:g} x {height:g}, expected whole numbers of pixels")
    return int(width), int(height)


def _name(value: Any, where: str) -> str:
    if isinstance(value, bool) or not isinstance(value, str | int) or len(str(value)) > _LONGEST:
        raise InputError(f"{where} has the name {shown(value, 40)}, expected text")
    return str(value)


def _rotation(value: Array) -> Array:
    """(3, 3), of a matrix or of axis times angle."""
    if value.size == 9:
        return value.reshape(3, 3)
    if np.linalg.norm(value) > _TURNS:
        raise InputError(f"rotation is {np.linalg.norm(value):.3g} rad, expected axis times angle")
    return vector_to_matrix(value.ravel())


def _entry(table: dict[str, Any], keys: tuple[str, ...], where: str) -> Any:
    for key in keys:
        if key in table:
            return table[key]
    raise InputError(f"{where} has no {' or '.join(keys)}")


def _from_toml(text: str, path: Path, metre: float) -> list[Camera]:
    tables = parse_toml(text, path, "not valid TOML")
    cameras = []
    for key, table in tables.items():
        if not isinstance(table, dict) or not any(k in table for k in _OF_A_CAMERA):
            continue
        where = f"[{shown(key, 60)}]"
        if table.get("fisheye"):
            raise InputError(f"{where} is a fisheye camera, which is not understood", path)
        cameras.append(
            Camera(
                _name(table.get("name", key), where),
                _numbers(_entry(table, ("matrix",), where), f"{where} matrix", (3, 3)).reshape(
                    3, 3
                ),
                _numbers(table.get("distortions", []), f"{where} distortions"),
                _rotation(
                    _numbers(
                        _entry(table, ("rotation",), where),
                        f"{where} rotation",
                        (3,),
                        (3, 1),
                        (3, 3),
                    )
                ),
                metre
                * _numbers(
                    _entry(table, ("translation",), where), f"{where} translation", (3,), (3, 1)
                ),
                _size(table["size"], f"{where} size") if "size" in table else None,
            )
        )
    if not cameras:
        raise InputError("no camera: expected tables with matrix, rotation, translation", path)
    return _distinct(cameras, path)


def _from_panoptic(text: str, path: Path, metre: float) -> list[Camera]:
    data = parse_json(text, path, "not valid JSON")
    found = data.get("cameras")
    if not isinstance(found, list) or not all(isinstance(c, dict) for c in found):
        raise InputError("no cameras in it: expected a list under `cameras`", path)
    kinds = {c.get("type", "hd") == "hd" for c in found}
    wanted = [c for c in found if c.get("type", "hd") == "hd" or True not in kinds]
    cameras = []
    for i, c in enumerate(wanted):
        where = f"camera {shown(c.get('name', i), 60)}"
        cameras.append(
            Camera(
                _name(c.get("name", i), where),
                _numbers(_entry(c, ("K",), where), f"{where} K", (3, 3)).reshape(3, 3),
                _numbers(c.get("distCoef", []), f"{where} distCoef"),
                _numbers(_entry(c, ("R",), where), f"{where} R", (3, 3)).reshape(3, 3),
                metre * _numbers(_entry(c, ("t",), where), f"{where} t", (3,), (3, 1)),
                None
                if c.get("resolution") is None
                else _size(c["resolution"], f"{where} resolution"),
            )
        )
    if not cameras:
        raise InputError("the list of cameras is empty", path)
    return _distinct(cameras, path)


_MATRIX = re.compile(
    r"^(?P<name>\w{1,80}):[ \t]*!!opencv-matrix\s{1,80}rows:[ \t]*(?P<rows>\d{1,4})\s{1,80}"
    r"cols:[ \t]*(?P<columns>\d{1,4})\s{1,80}dt:[ \t]*\w{1,9}\s{1,80}"
    r"data:\s{0,80}\[(?P<data>[^\]]{0,1000})\]",
    re.MULTILINE,
)
_SCALAR = re.compile(r"^(?P<name>\w{1,80}):[ \t]*(?P<value>[^\s!][^\n]{0,300})$", re.MULTILINE)


def _from_opencv(text: str, path: Path, metre: float) -> Camera:
    """FileStorage's YAML: a few named matrices. General YAML readers refuse its first line."""
    matrices: dict[str, Array] = {}
    for match in _MATRIX.finditer(text):
        name, shape = match["name"], (int(match["rows"]), int(match["columns"]))
        if name in matrices:
            raise InputError(f"{name} is there twice", path)
        words = [_float(word, name) for word in match["data"].replace(",", " ").split()]
        matrices[name] = _numbers(words, name, shape).reshape(shape)
    scalars: dict[str, str] = {}
    for match in _SCALAR.finditer(text):
        if match["name"] in scalars:
            raise InputError(f"{match['name']} is there twice", path)
        scalars[match["name"]] = match["value"].strip().strip('"')
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
    move = _entry(matrices, ("T", "t", "translation", "tvec"), where)
    size = None
    if "image_width" in scalars and "image_height" in scalars:
        pair = [_float(scalars[name], name) for name in ("image_width", "image_height")]
        size = _size(pair, "image size")
    for name, value, shapes in (
        ("camera_matrix", k, ((3, 3),)),
        ("R", rotation, ((3, 3), (3, 1), (1, 3))),
        ("T", move, ((3, 1), (1, 3))),
    ):
        if value.shape not in shapes:
            raise InputError(f"{name} has shape {value.shape}", path)
    return Camera(
        _name(scalars.get("camera_name", path.stem), where),
        k,
        distortion.ravel(),
        _rotation(rotation),
        metre * move.ravel(),
        size,
    )


def _float(word: str, what: str) -> float:
    try:
        return float(word)
    except ValueError:
        raise InputError(f"{what} holds {shown(word, 40)}, expected numbers") from None
