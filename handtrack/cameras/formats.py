"""Camera calibrations as people have them: the files, and what is in TOML and JSON."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.cameras.named import LENS_NAMES, from_fields, from_named, refuse_other_lens
from handtrack.cameras.named_files import read_arrays, read_xml, read_yaml
from handtrack.cameras.numbers import (
    as_number,
    entry,
    metres_of,
    name,
    numbers,
    rotation,
    size,
)
from handtrack.errors import InputError, shown
from handtrack.files.texts import parse_json, parse_toml, read_text
from handtrack.hand.units import METRES

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


_OF_A_CAMERA = ("matrix", "rotation", "translation", "distortions")
_SUFFIXES = (".yml", ".yaml", ".json", ".toml", ".xml", ".npz")


def load_cameras(path: str | Path, unit: str | None = None) -> list[Camera]:
    """The cameras of a calibration file, or of the files of a folder in order of name.

    Understood are
    - TOML as aniposelib writes it: a table for each camera with `name`, `size`, `matrix`,
      `distortions`, `rotation` (axis times angle) and `translation`;
    - YAML and XML as OpenCV's FileStorage writes them, and .npz: `camera_matrix` or `K`,
      `distortion_coefficients` or `D`, `R` and `T`, `image_width` and `image_height` of one
      camera a file; or `K1`, `D1`, `K2`, `D2`, `R`, `T` of a stereo pair; in .npz also stacks
      of cameras, `K` (C, 3, 3) and so on; one camera may lack `R` and `T`: the world is its frame;
    - YAML of ROS: `camera_info` files, and messages as `ros2 topic echo` prints them; where a
      pair was calibrated together its world is the rectified frame of the first;
    - JSON with the same names, `fx fy cx cy` and `k1 k2 p1 p2` among them, of one camera or of an
      object for each;
    - JSON as CMU Panoptic gives it: `cameras` with `name`, `resolution`, `K`, `distCoef`, `R`,
      `t`; of its cameras the `hd` ones;
    - pairs of .dat: `NAME.dat` with `intrinsic:` and `distortion:`, `rot_trans_NAME.dat` with
      `R:` and `T:`.

    Args:
        path: the file or folder.
        unit: of the translations: m, cm or mm, or a length as in 42mm, for translations in
            squares of a board; by default cm for Panoptic and m else.

    Raises:
        InputError: nothing there, not one of these, or a camera that is inconsistent.
        SettingsError: a unit that is none.
    """
    path = Path(path)
    scale = None if unit is None else metres_of(unit)
    if not path.is_dir():
        return _distinct(_of_file(path, scale), path)
    inside = sorted(p for p in path.iterdir() if p.is_file())
    dats = [p for p in inside if p.suffix == ".dat"]
    files = [p for p in inside if p.suffix in _SUFFIXES]
    if dats and not files:
        return _distinct(from_dats(dats, path, scale or 1.0), path)
    if not files:
        raise InputError("no .toml, .yaml, .xml, .json, .npz or .dat calibration in it", path)
    return _distinct([camera for file in files for camera in _of_file(file, scale)], path)


def _of_file(path: Path, scale: float | None) -> list[Camera]:
    """The cameras of one file; `scale` [m] of its unit, None: the format's."""
    metre = scale or 1.0
    try:
        if path.suffix == ".npz":
            return from_named(read_arrays(path), path, metre)
        text = read_text(path, "is no camera calibration")
        if path.suffix == ".toml":
            return _from_toml(text, path, metre)
        if path.suffix == ".dat":
            return from_dats([path], path.parent, metre)
        if text.lstrip().startswith("{"):
            data = parse_json(text, path, "not valid JSON")
            return _from_json(data, path, scale)
        if text.lstrip().startswith("<?xml") or path.suffix == ".xml":
            return from_named(read_xml(text), path, metre)
        if text.startswith("%YAML") or path.suffix in (".yml", ".yaml"):
            return from_named(read_yaml(text), path, metre)
    except InputError as error:
        if error.path is not None:
            raise
        raise InputError(str(error), path) from None
    raise InputError(
        "not a calibration: expected TOML, OpenCV's YAML or XML, ROS's YAML, JSON, .dat or .npz",
        path,
    )


def _distinct(cameras: list[Camera], path: Path) -> list[Camera]:
    """The same, whose names all differ, for they are chosen by name, and whose places do.

    Raises:
        InputError: two have one name, or one place: it is not said where they stand.
    """
    names: set[str] = set()
    places: dict[bytes, str] = {}
    for camera in cameras:
        if camera.name in names:
            raise InputError(f"two cameras are called {shown(camera.name, 60)}", path)
        names.add(camera.name)
        place = np.column_stack([camera.rotation, camera.translation]).tobytes()
        if place in places:
            raise InputError(
                f"cameras {shown(places[place], 60)} and {shown(camera.name, 60)} stand at one"
                " place and look one way: expected R and T of each, from the world to the camera",
                path,
            )
        places[place] = camera.name
    return cameras


def _lens(table: dict[str, Any], usual: str, where: str) -> Array:
    """A lens's distortion, under its name or a usual one; none where nothing is called so.

    Raises:
        InputError: what is called a distortion by another name.
    """
    key = next((k for k in (usual, *LENS_NAMES) if k in table), None)
    if key is not None:
        return numbers(table[key], f"{where} {key}")
    refuse_other_lens((k for k, v in table.items() if isinstance(v, list)), f"{where} ", usual)
    return np.zeros(0)


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
                name(table.get("name", key), where),
                numbers(entry(table, ("matrix",), where), f"{where} matrix", (3, 3)).reshape(3, 3),
                _lens(table, "distortions", where),
                rotation(
                    numbers(
                        entry(table, ("rotation",), where),
                        f"{where} rotation",
                        (3,),
                        (3, 1),
                        (3, 3),
                    )
                ),
                metre
                * numbers(
                    entry(table, ("translation",), where), f"{where} translation", (3,), (3, 1)
                ),
                size(table["size"], f"{where} size") if "size" in table else None,
            )
        )
    if not cameras:
        raise InputError("no camera: expected tables with matrix, rotation, translation", path)
    return _distinct(cameras, path)


def _from_json(data: dict[str, Any], path: Path, scale: float | None) -> list[Camera]:
    """Panoptic's list of cameras, or any other's; one camera, or an object for each."""
    found = data.get("cameras", data)
    if isinstance(found, list):
        if any(not isinstance(c, dict) or "K" in c for c in found) or not found:
            return _from_panoptic(data, path, scale or METRES["cm"])
        found = {str(c.get("name", c.get("id", i))): c for i, c in enumerate(found)}
    return from_fields(found if isinstance(found, dict) else data, path, scale or 1.0)


def _from_panoptic(data: dict[str, Any], path: Path, metre: float) -> list[Camera]:
    found = data["cameras"]
    if not all(isinstance(c, dict) for c in found):
        raise InputError("no cameras in it: expected a list under `cameras`", path)
    kinds = {c.get("type", "hd") == "hd" for c in found}
    wanted = [c for c in found if c.get("type", "hd") == "hd" or True not in kinds]
    cameras = []
    for i, c in enumerate(wanted):
        where = f"camera {shown(c.get('name', i), 60)}"
        cameras.append(
            Camera(
                name(c.get("name", i), where),
                numbers(entry(c, ("K",), where), f"{where} K", (3, 3)).reshape(3, 3),
                _lens(c, "distCoef", where),
                numbers(entry(c, ("R",), where), f"{where} R", (3, 3)).reshape(3, 3),
                metre * numbers(entry(c, ("t",), where), f"{where} t", (3,), (3, 1)),
                None
                if c.get("resolution") is None
                else size(c["resolution"], f"{where} resolution"),
            )
        )
    if not cameras:
        raise InputError("the list of cameras is empty", path)
    return _distinct(cameras, path)
