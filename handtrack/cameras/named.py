"""Cameras of matrices that have names, as OpenCV, ROS, NumPy and JSON have them.

One camera, a stereo pair, a stack, or ROS's camera_info.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.cameras.named_files import Named, read_fields
from handtrack.cameras.numbers import as_number, entry, name, numbers, rotation, size
from handtrack.errors import InputError, shown

Array = NDArray[np.float64]


T = TypeVar("T")

_MATRIX = ("camera_matrix", "K", "cameraMatrix", "intrinsic", "intrinsics", "mtx", "matrix")
LENS_NAMES = ("distortion_coefficients", "D", "distCoeffs", "dist", "distortion", "distortions")
_TURN = ("R", "rotation", "rvec", "rotations", "rvecs")
_MOVE = ("T", "t", "translation", "tvec", "translations", "tvecs")
_BOTH_LENSES = tuple(
    f"{name}{i}" for i in (1, 2) for name in ("D", "dist", "distCoeffs", "distortion_coefficients_")
)
_OF_BOARDS = ("rvecs", "tvecs")
_BOTH = ("extrinsic", "extrinsics", "RT", "Rt")
_FIRST = tuple(n + end for n in ("K", "M", "cameraMatrix", "mtx", "camera_matrix_") for end in "1")
_FIRST += ("camera_matrix1",)
_ROS = ("projection_matrix", "P", "p")
_CALLED = {
    "camera_matrix": "cameramatrix k intrinsicmatrix cammatrix cammtx cameramtx matrixk",
    "distortion_coefficients": "distortioncoefficients d distcoeffs distcoeff distcoefs distcoef"
    " distortioncoeffs distortioncoeff distortioncoef distortioncoefs coeffs lensdistortion",
    "R": "rotationmatrix rotmat rmat rotationvector",
    "T": "translationvector transvec",
}
"""More names, without capitals and what stands between words."""
_SIDES = {"1": "1", "2": "2", "left": "1", "right": "2", "l": "1", "r": "2"}
_LENGTHS = (("fx", "fy", "cx", "cy"), ("fx", "fy", "ppx", "ppy"))
_NUMBERED = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")
_SIZES = ("image_size", "imageSize", "img_size", "resolution", "size")
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
    found = _with_known_names(found)
    matrices = found.matrices
    model = found.words.get("distortion_model", found.words.get("model", "")).lower()
    if any(kind in model for kind in _FISHEYE):
        raise InputError(f"distortion_model {model} is a fisheye's, which is not understood")
    if "inverse" in model and np.any(_first(matrices, LENS_NAMES, np.zeros(5))):
        raise InputError(f"distortion_model {model} is not understood")
    if any(key in matrices for key in _ROS):
        return [_from_ros(found, path)]
    if any(key in matrices for key in _FIRST):
        return _from_pair(found, path, metre)
    if "K" in matrices or any(k in matrices for k in _MATRIX):
        stack = entry(matrices, _MATRIX, "the file")
        if stack.ndim == 3:
            return _from_stack(found, path, metre, len(stack))
    return [_from_one(found, path, metre)]


def from_fields(data: dict[str, Any], path: Path, metre: float) -> list[Camera]:
    """The cameras of a JSON object: it is one, or each object in it.

    Raises:
        InputError: as `from_named`.
    """
    inside = {k: _with_known_names(read_fields(v)) for k, v in data.items() if isinstance(v, dict)}
    own = {k: v for k, v in inside.items() if any(name in v.matrices for name in _MATRIX)}
    if len(own) < 2:
        found = _with_known_names(read_fields(data))
        if not found.matrices:
            raise InputError(
                "no cameras in it: expected a list under `cameras`, or a camera_matrix"
            )
        return from_named(found, path, metre)
    cameras = []
    for key, found in own.items():
        try:
            cameras += from_named(
                Named(found.matrices, {"camera_name": key} | found.words), path, metre
            )
        except InputError as error:
            raise InputError(f"{shown(key, 60)}: {error}") from None
    return cameras


def _with_known_names(found: Named) -> Named:
    """The same under names that are looked for; focal lengths and the like as matrices.

    Raises:
        InputError: what is called a distortion by no name that is understood.
    """
    known = {*_MATRIX, *LENS_NAMES, *_BOTH_LENSES, *_TURN, *_MOVE, *_BOTH, *_FIRST, *_ROS}
    matrices: dict[str, Array] = {}
    for key, value in found.matrices.items():
        other = key if key in known else _known_name(key)
        matrices[key if other in found.matrices or other in matrices else other] = value
    words = found.words
    for four in _LENGTHS:
        if not any(k in matrices for k in _MATRIX) and all(k in words for k in four):
            fx, fy, cx, cy = (as_number(words[k], k) for k in four)
            matrices["camera_matrix"] = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1.0]])
    lenses = (*LENS_NAMES, *_BOTH_LENSES)
    if not any(k in matrices for k in lenses) and "k1" in words:
        bent = [as_number(words.get(k, "0"), k) for k in _NUMBERED]
        matrices["distortion_coefficients"] = np.array(bent)
    refuse_other_lens(k for k, v in matrices.items() if k not in lenses and v.size >= 4)
    return Named(matrices, words)


def refuse_other_lens(
    arrays: Iterable[str], where: str = "", usual: str = "distortion_coefficients"
) -> None:
    """Refuse arrays that are called a distortion, by no name of one: they would be left out.

    Args:
        arrays: their names, none of which is read.
        where: what they belong to, before their names.
        usual: the name to use instead.

    Raises:
        InputError: one is called so.
    """
    for key in arrays:
        if "dist" in key.lower():
            raise InputError(f"{where}{shown(key, 60)} is not understood, expected {usual}")


def _known_name(key: str) -> str:
    plain = re.sub(r"[\W_]", "", key).lower()
    for called, others in _CALLED.items():
        if plain in others.split():
            return called
    for end, number in _SIDES.items():
        base = plain.removesuffix(end)
        if base == plain or (end in "lr" and len(base) < 3):
            continue
        if base in ("mtx", *_CALLED["camera_matrix"].split()):
            return f"K{number}"
        if base in ("dist", *_CALLED["distortion_coefficients"].split()):
            return f"D{number}"
    return key


def _from_one(found: Named, path: Path, metre: float) -> Camera:
    matrices, where = found.matrices, "the file"
    matrix = entry(matrices, _MATRIX, where)
    if matrix.size != 9:
        raise InputError(f"camera_matrix has shape {matrix.shape}")
    if matrix.shape != (3, 3) and matrix.ravel()[2] == 0 < matrix.ravel()[6]:
        matrix = matrix.reshape(3, 3).T  # a column after the other, as Open3D writes it
    # cv2.calibrateCamera gives the places of its board as well, one for each picture
    matrices = {k: v for k, v in matrices.items() if k not in _OF_BOARDS or v.size == 3}
    placed = any(key in matrices for key in (*_TURN, *_MOVE, *_BOTH))
    # a lens alone: what it sees is in the camera's own frame
    turn, move = _pose(matrices, where) if placed else (np.eye(3), np.zeros(3))
    return Camera(
        name(found.words.get("camera_name", path.stem), where),
        matrix.reshape(3, 3),
        _first(matrices, LENS_NAMES, np.zeros(5)).ravel(),
        turn,
        metre * move,
        _size(found),
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
        lens = tuple(name for name in _BOTH_LENSES if name.endswith(str(i)))
        cameras.append(
            Camera(
                f"{path.stem} {i}",
                numbers(matrix.tolist(), f"{key[:-1]}{i}", (3, 3)).reshape(3, 3),
                _first(matrices, lens, np.zeros(5)).ravel(),
                r,
                t,
                _size(found),
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
    called = found.words.get("camera_name", path.stem)
    return Camera(
        name(called, where), matrix, lens.ravel(), rectified.T, rectified.T @ shift,
        _size(found),
    )  # fmt: skip


def _first(matrices: Mapping[str, Array], keys: tuple[str, ...], other: T) -> Array | T:
    return next((matrices[key] for key in keys if key in matrices), other)


def _size(found: Named) -> tuple[int, int] | None:
    """The pictures' size that a file says, or None."""
    words = found.words
    for keys in (("image_width", "image_height"), ("width", "height")):
        if all(key in words for key in keys):
            return size([as_number(words[key], key) for key in keys], "image size")
    pair = _first(found.matrices, _SIZES, None)
    return None if pair is None or pair.size != 2 else size(pair.ravel().tolist(), "image size")
