"""Camera: a pinhole with lens distortion, and where it stands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError
from handtrack.kernels.workspace import LENS, Records

Array = NDArray[np.float64]

N_DISTORTION = 8
_UNDISTORT_STEPS = 30
_FAR = 1e9


@dataclass(frozen=True, eq=False)
class Camera:
    """A calibrated camera in OpenCV's convention: x right, y down, z into the picture.

    A world point X is at X_c = rotation X + translation in the camera's frame, at
    (x, y) = (X_c / Z_c, Y_c / Z_c) before the lens, and at
    (fx x' + skew y' + cx, fy y' + cy) in the picture [px], where with r^2 = x^2 + y^2
        radial = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6)
        x' = radial x + 2 p1 x y + p2 (r^2 + 2 x^2)
        y' = radial y + p1 (r^2 + 2 y^2) + 2 p2 x y
    (OpenCV's documentation of calib3d).

    Attributes:
        name: short name.
        matrix: (3, 3) intrinsic matrix [px].
        distortion: (8,) k1 k2 p1 p2 k3 k4 k5 k6; fewer are filled up with zeros.
        rotation: (3, 3) from the world to the camera.
        translation: (3,) of the world's origin in the camera's frame [m].
        size: (width, height) of the pictures [px], or None.

    Raises:
        InputError: a value is not finite, of another shape, or no rotation, or the focal length
            is not positive.
    """

    name: str
    matrix: Array
    distortion: Array
    rotation: Array
    translation: Array
    size: tuple[int, int] | None = None

    def __post_init__(self) -> None:
        k = self._checked("matrix", (3, 3))
        given = np.array(self.distortion, dtype=np.float64).ravel()
        if len(given) > N_DISTORTION:
            if np.any(given[N_DISTORTION:]):
                raise InputError(
                    f"camera {self.name}: {len(given)} distortion numbers, 8 are understood"
                    " (k1 k2 p1 p2 k3 k4 k5 k6)"
                )
            given = given[:N_DISTORTION]
        object.__setattr__(self, "distortion", np.pad(given, (0, N_DISTORTION - len(given))))
        self._checked("distortion", (N_DISTORTION,))
        r = self._checked("rotation", (3, 3))
        self._checked("translation", (3,))
        if not (k[0, 0] > 0 and k[1, 1] > 0):
            raise InputError(f"camera {self.name}: focal lengths must be positive, see matrix")
        if np.abs(k[2] - [0, 0, 1]).max() > 1e-6 or k[1, 0] != 0:
            raise InputError(
                f"camera {self.name}: matrix has {k[1, 0]:g} below the first focal length and"
                f" {k[2].tolist()} for its last row, expected 0 and 0 0 1"
            )
        if np.abs(r @ r.T - np.eye(3)).max() > 1e-4 or np.linalg.det(r) < 0:
            raise InputError(f"camera {self.name}: rotation is no rotation matrix")

    def _checked(self, field: str, shape: tuple[int, ...]) -> Array:
        value = np.array(getattr(self, field), dtype=np.float64, order="C")
        if value.shape != shape:
            raise InputError(
                f"camera {self.name}: {field} has shape {value.shape}, expected {shape}"
            )
        if not (np.abs(value) < _FAR).all():
            raise InputError(f"camera {self.name}: {field} holds values that are not finite")
        value.flags.writeable = False
        object.__setattr__(self, field, value)
        return value

    @property
    def centre(self) -> Array:
        """(3,) where the camera stands in the world [m]."""
        return np.asarray(-self.rotation.T @ self.translation)

    @property
    def lens(self) -> Records:
        """() LENS, as compiled code takes it."""
        k = self.matrix
        inner = (k[0, 0], k[0, 1], k[0, 2], k[1, 1], k[1, 2])
        return np.array((*inner, self.distortion, self.rotation, self.translation), LENS)

    def project(self, points: ArrayLike) -> Array:
        """Where world points are in the picture.

        Args:
            points: (..., 3) [m].

        Returns:
            (..., 2) [px]; NaN behind the camera.
        """
        x = np.asarray(points, dtype=np.float64) @ self.rotation.T + self.translation
        depth = np.where(x[..., 2:] > 0, x[..., 2:], np.nan)
        bent = self._bent(x[..., :2] / depth)
        k = self.matrix
        u = k[0, 0] * bent[..., 0] + k[0, 1] * bent[..., 1] + k[0, 2]
        return np.asarray(np.stack([u, k[1, 1] * bent[..., 1] + k[1, 2]], -1))

    def undistorted(self, pixels: ArrayLike) -> Array:
        """Directions of pixels: x, y at depth 1 in the camera's frame.

        Args:
            pixels: (..., 2) [px].

        Returns:
            (..., 2), by fixed-point iteration on the lens model.
        """
        p, k = np.asarray(pixels, dtype=np.float64), self.matrix
        y = (p[..., 1] - k[1, 2]) / k[1, 1]
        bent = np.stack([(p[..., 0] - k[0, 2] - k[0, 1] * y) / k[0, 0], y], -1)
        x = bent.copy()
        for _ in range(_UNDISTORT_STEPS):
            x = x - (self._bent(x) - bent)
        return np.asarray(x)

    def _bent(self, x: Array) -> Array:
        """Through the lens."""
        k1, k2, p1, p2, k3, k4, k5, k6 = self.distortion
        a, b = x[..., 0], x[..., 1]
        q = a * a + b * b
        radial = (1 + q * (k1 + q * (k2 + q * k3))) / (1 + q * (k4 + q * (k5 + q * k6)))
        return np.stack(
            [
                radial * a + 2 * p1 * a * b + p2 * (q + 2 * a * a),
                radial * b + p1 * (q + 2 * b * b) + 2 * p2 * a * b,
            ],
            -1,
        )
