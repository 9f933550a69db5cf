"""Cameras of matrices that have names, as OpenCV, ROS and NumPy write them.

One camera, a stereo pair, a stack, or ROS's camera_info.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, TypeVar
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.cameras.numbers import as_number, entry, name, numbers, rotation, size
from handtrack.errors import InputError, shown
from handtrack.files import npz

Array = NDArray[np.float64]


class Named(NamedTuple):
    """What a calibration file holds.

    Attributes:
        matrices: by name; one row or column of numbers too.
        words: text and single numbers by name.
    """

    matrices: dict[str, Array]
    words: dict[str, str]


_WRITTEN = re.compile(
    r"^(?P<name>\w{1,80}):[ \t]*(?:!!opencv-matrix)?\s{1,80}rows:[ \t]*(?P<rows>\d{1,4})\s{1,80}"
    r"cols:[ \t]*(?P<columns>\d{1,4})\s{1,80}(?:dt:[ \t]*\w{1,9}\s{1,80})?"
    r"data:\s{0,80}\[(?P<data>[^\]]{0,1000})\]",
    re.MULTILINE,
)
_ROW = re.compile(r"^(?P<name>\w{1,80}):[ \t]*\[(?P<data>[^\]]{0,1000})\]", re.MULTILINE)
_BLOCK = re.compile(
    r"^(?P<name>\w{1,80}):[ \t]*\n"
    r"(?P<data>(?:[ \t]{0,20}-[ \t]{1,20}[^\s\[\]:]{1,40}[ \t]*\n){1,40})",
    re.MULTILINE,
)
_WORD = re.compile(r"^(?P<name>\w{1,80}):[ \t]*(?P<value>[^\s!\[][^\n]{0,300})$", re.MULTILINE)


def read_yaml(text: str) -> Named:
    """OpenCV's FileStorage, whose first line general YAML readers refuse, and ROS's files and
    messages: matrices, lists and words by name.

    Raises:
        InputError: a name twice, or what is no number among numbers.
    """
    matrices: dict[str, Array] = {}
    for match in _WRITTEN.finditer(text):
        shape = int(match["rows"]), int(match["columns"])
        words = match["data"].replace(",", " ").split()
        _add(matrices, match["name"], _read(words, match["name"], shape))
    for pattern, marks in ((_ROW, ","), (_BLOCK, "-")):
        for match in pattern.finditer(text if marks == "," else text + "\n"):
            data = match["data"].replace(",", " ") if marks == "," else match["data"]
            words = [w for w in data.split() if w != "-"]
            if words:
                _add(matrices, match["name"], _read(words, match["name"], (1, len(words))))
    found: dict[str, str] = {}
    for match in _WORD.finditer(text):
        if match["name"] in found:
            raise InputError(f"{match['name']} is there twice")
        found[match["name"]] = match["value"].strip().strip("\"'")
    return Named(matrices, found)


def read_xml(text: str) -> Named:
    """OpenCV's FileStorage as XML.

    Raises:
        InputError: no XML, or one that declares what it is made of; a name twice, or what is no
            number among numbers.
    """
    if "<!" in text.replace("<!--", ""):
        raise InputError("not a calibration: XML with declarations, which are not read")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError) as error:
        raise InputError(f"not valid XML: {shown(str(error), 120)}") from None
    matrices: dict[str, Array] = {}
    words: dict[str, str] = {}
    for element in root:
        name = str(element.tag)
        rows, columns, data = (element.findtext(n) for n in ("rows", "cols", "data"))
        if data is not None:
            shape = (
                int(as_number(rows or "", f"{name}'s rows")),
                int(as_number(columns or "", f"{name}'s cols")),
            )
            _add(matrices, name, _read(data.split(), name, shape))
        elif not len(element) and element.text:
            words[name] = element.text.strip().strip('"')
    return Named(matrices, words)


def read_arrays(path: Path) -> Named:
    """Arrays of a .npz.

    Raises:
        InputError: damaged, or numbers that are not finite.
    """
    arrays, _ = npz.read_npz(path, path)
    matrices: dict[str, Array] = {}
    words: dict[str, str] = {}
    for key, value in arrays.items():
        array = np.asarray(value)
        if array.dtype.kind in "fiu" and array.ndim:
            matrices[key] = array.astype(np.float64)
        elif array.ndim == 0 and array.dtype.kind in "fiuU":
            words[key] = str(array.item())
    return Named(matrices, words)


def _add(matrices: dict[str, Array], name: str, matrix: Array) -> None:
    if name in matrices:
        raise InputError(f"{name} is there twice")
    matrices[name] = matrix


def _read(words: list[str], name: str, shape: tuple[int, int]) -> Array:
    return numbers([as_number(word, name) for word in words], name, shape).reshape(shape)


T = TypeVar("T")

_MATRIX = ("camera_matrix", "K", "cameraMatrix", "intrinsic", "intrinsics", "mtx", "matrix")
_LENS = ("distortion_coefficients", "D", "distCoeffs", "dist", "distortion", "distortions")
_TURN = ("R", "rotation", "rvec", "rotations", "rvecs")
_MOVE = ("T", "t", "translation", "tvec", "translations", "tvecs")
_OF_BOARDS = ("rvecs", "tvecs")
_BOTH = ("extrinsic", "extrinsics", "RT", "Rt")
_FIRST = tuple(n + end for n in ("K", "M", "cameraMatrix", "mtx", "camera_matrix_") for end in "1")
_FIRST += ("camera_matrix1",)
_ROS = ("projection_matrix", "P", "p")
_TURNS = ((3, 3), (3, 1), (1, 3), (3,), (1, 9))
_FISHEYE = ("equidistant", "fisheye", "kannala_brandt")


def from_named(found: Named, path: Path, metre: float) -> list[Camera]:
    """The cameras of a file.

    Args:
        found: what is in it.
        path: it; its name is the camera's where none is said.
        metre: the unit of its translations [m]; of ROS it is always 1.

    Raises:
        InputError: it has no camera matrix, or one that does not fit.
    """
    matrices = found.matrices
    model = found.words.get("distortion_model", "").lower()
    if model in _FISHEYE:
        raise InputError(f"distortion_model {model} is a fisheye's, which is not understood")
    if any(key in matrices for key in _ROS):
        return [_from_ros(found, path)]
    if any(key in matrices for key in _FIRST):
        return _from_pair(found, path, metre)
    if "K" in matrices or any(k in matrices for k in _MATRIX):
        stack = entry(matrices, _MATRIX, "the file")
        if stack.ndim == 3:
            return _from_stack(found, path, metre, len(stack))
    return [_from_one(found, path, metre)]


def _from_one(found: Named, path: Path, metre: float) -> Camera:
    matrices, where = found.matrices, "the file"
    matrix = entry(matrices, _MATRIX, where)
    if matrix.shape != (3, 3):
        raise InputError(f"camera_matrix has shape {matrix.shape}")
    # cv2.calibrateCamera gives the places of its board as well, one for each picture
    matrices = {k: v for k, v in matrices.items() if k not in _OF_BOARDS or v.size == 3}
    placed = any(key in matrices for key in (*_TURN, *_MOVE, *_BOTH))
    # a lens alone: what it sees is in the camera's own frame
    turn, move = _pose(matrices, where) if placed else (np.eye(3), np.zeros(3))
    return Camera(
        name(found.words.get("camera_name", path.stem), where),
        matrix.reshape(3, 3),
        _first(matrices, _LENS, np.zeros(5)).ravel(),
        turn,
        metre * move,
        _size(found.words),
    )


def _pose(matrices: Mapping[str, Array], where: str) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,) from the world to a camera."""
    both = _first(matrices, _BOTH, None)
    if both is not None:
        if both.shape not in ((3, 4), (4, 4)):
            raise InputError(f"the extrinsic matrix has shape {both.shape}, expected 3 x 4")
        return rotation(both[:3, :3]), both[:3, 3]
    turn, move = entry(matrices, _TURN, where), entry(matrices, _MOVE, where)
    for what, value, shapes in (
        ("R", turn, _TURNS),
        ("T", move, ((3, 1), (1, 3), (3,))),
    ):
        if value.shape not in shapes:
            raise InputError(f"{what} has shape {value.shape}")
    return rotation(turn), move.ravel()


def _from_pair(found: Named, path: Path, metre: float) -> list[Camera]:
    """cv2.stereoCalibrate's result: the world is the first camera's frame."""
    matrices = found.matrices
    key = next(key for key in _FIRST if key in matrices)
    turn, move = _pose(matrices, "the file")
    poses = ((np.eye(3), np.zeros(3)), (turn, metre * move))
    cameras = []
    for i, (r, t) in enumerate(poses, 1):
        matrix = entry(matrices, (f"{key[:-1]}{i}",), "the file")
        lens = tuple(f"{n}{i}" for n in ("D", "dist", "distCoeffs", "distortion_coefficients_"))
        cameras.append(
            Camera(
                f"{path.stem} {i}",
                numbers(matrix.tolist(), f"{key[:-1]}{i}", (3, 3)).reshape(3, 3),
                _first(matrices, lens, np.zeros(5)).ravel(),
                r,
                t,
                _size(found.words),
            )
        )
    return cameras


def _from_stack(found: Named, path: Path, metre: float, n: int) -> list[Camera]:
    """Arrays whose first axis is the cameras'."""
    cameras = []
    stacked = {k: v for k, v in found.matrices.items() if v.ndim > 1 and len(v) == n}
    for i in range(n):
        own = Named({k: v[i] for k, v in stacked.items()}, found.words)
        own.matrices.update({k: v.reshape(1, -1) for k, v in own.matrices.items() if v.ndim == 1})
        camera = _from_one(own, path, metre)
        cameras.append(
            Camera(
                f"{path.stem} {i}",
                camera.matrix,
                camera.distortion,
                camera.rotation,
                camera.translation,
                camera.size,
            )
        )
    return cameras


def _from_ros(found: Named, path: Path) -> Camera:
    """sensor_msgs/CameraInfo: P = K' [I | t] sees the rectified world of the pair's first camera,
    R turns the camera's frame into the rectified one.

    X_rectified = X + (P_14 / P_11, P_24 / P_22, 0), and X_camera = R^T X_rectified.
    """
    matrices, where = found.matrices, "the file"
    matrix = numbers(
        entry(matrices, ("camera_matrix", "K", "k"), where).tolist(), "K", (3, 3), (1, 9)
    ).reshape(3, 3)
    turn = _first(matrices, ("rectification_matrix", "R", "r"), np.eye(3))
    p = numbers(entry(matrices, _ROS, where).tolist(), "P", (3, 4), (1, 12)).reshape(3, 4)
    rectified = numbers(turn.tolist(), "R", (3, 3), (1, 9)).reshape(3, 3)
    if not (p[0, 0] > 0 and p[1, 1] > 0):
        raise InputError("P has no focal length: the camera is not calibrated")
    shift = np.array([p[0, 3] / p[0, 0], p[1, 3] / p[1, 1], 0.0])
    lens = _first(matrices, ("distortion_coefficients", "D", "d"), np.zeros(5))
    words = found.words
    plain = {"image_width": words.get("width"), "image_height": words.get("height")}
    size_words = words if "image_width" in words else {k: v for k, v in plain.items() if v}
    called = words.get("camera_name", path.stem)
    return Camera(
        name(called, where), matrix, lens.ravel(), rectified.T, rectified.T @ shift,
        _size(size_words),
    )  # fmt: skip


def _first(matrices: Mapping[str, Array], keys: tuple[str, ...], other: T) -> Array | T:
    return next((matrices[key] for key in keys if key in matrices), other)


def _size(words: Mapping[str, str]) -> tuple[int, int] | None:
    """The pictures' size that a file says, or None."""
    if "image_width" not in words or "image_height" not in words:
        return None
    pair = [as_number(words[key], key) for key in ("image_width", "image_height")]
    return size(pair, "image size")
