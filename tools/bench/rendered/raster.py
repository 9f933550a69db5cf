"""Pictures of meshes by OpenGL without a display: Mesa's software rasteriser does on EGL.

A `Raster` holds the context, the programs and buffers of one picture size. Everything it draws is
in world coordinates, through a `handtrack.Camera` (without lens distortion).
"""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence as Many
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.errors import SettingsError

Array = NDArray[np.float64]

SHADERS = Path(__file__).parent / "shaders"
NEAR, FAR = 0.05, 12.0
"""Depths that are drawn [m]."""
SHADOW_PIXELS, SHADOW_REACH = 512, 0.32
"""Size of a shadow map, and how far from the middle of the hand it reaches [m]."""
LIGHTS = 3


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles with what their surface needs.

    Attributes:
        vertices: (V, 3) in the world [m].
        normals: (V, 3).
        faces: (F, 3).
        rest: (V, 3) where the surface's pattern is looked up.
        local: (V, 3) further coordinates of the pattern.
        finger: (V,) -1..4, or a kind of surface.
    """

    vertices: Array
    normals: Array
    faces: NDArray[np.int32]
    rest: Array
    local: Array
    finger: Array


@dataclass(frozen=True, eq=False)
class Lights:
    """Three distant lights, and the light that comes from everywhere; linear RGB.

    Attributes:
        directions: (3, 3) the way that the light goes.
        colours: (3, 3).
        above, below: (3,) ambient light from the ceiling and from the floor.
        exposure: of the picture.
    """

    directions: Array
    colours: Array
    above: Array
    below: Array
    exposure: float


def clip_matrix(camera: ht.Camera) -> Array:
    """(4, 4) from world points to OpenGL's clip coordinates, first row of the picture first.

    Raises:
        SettingsError: the camera has no picture size, or a lens that bends.
    """
    if camera.size is None or np.any(camera.distortion):
        raise SettingsError(f"camera {camera.name}: expected a size and no lens distortion")
    width, height = camera.size
    k = camera.matrix
    out = np.zeros((4, 4))
    out[0, :3] = 2 * k[0] / width - [0, 0, 1]
    out[1, :3] = 2 * k[1] / height - [0, 0, 1]
    out[2, 2:] = (FAR + NEAR) / (FAR - NEAR), -2 * FAR * NEAR / (FAR - NEAR)
    out[3, 2] = 1.0
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.rotation, camera.translation
    return out @ pose


def light_matrix(direction: Array, middle: Array) -> Array:
    """(4, 4) from the world to the shadow map of a distant light."""
    z = direction / np.linalg.norm(direction)
    x = np.cross(z, [0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    turn = np.stack([x, np.cross(z, x), z]) / SHADOW_REACH
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = turn, -turn @ middle
    return out


def _packed(value: object) -> bytes:
    """Matrices column by column, as OpenGL has them."""
    a = np.asarray(value, dtype=np.float32)
    if a.ndim >= 2 and a.shape[-2:] == (4, 4):
        a = a.swapaxes(-1, -2)
    return a.tobytes()


class Raster:
    """Draws meshes; one picture size."""

    def __init__(self, size: tuple[int, int]) -> None:
        """Args:
        size: width and height [px].

        Raises:
            SettingsError: moderngl is not installed, or EGL does not start.
        """
        os.environ.setdefault("EGL_PLATFORM", "surfaceless")
        os.environ.setdefault("LP_NUM_THREADS", "1")  # one core, as everything here
        try:
            moderngl: Any = importlib.import_module("moderngl")
        except ImportError:
            raise SettingsError("pictures need OpenGL: pip install moderngl") from None
        try:
            self._gl = moderngl.create_standalone_context(backend="egl")
        except (RuntimeError, OSError, ValueError) as error:
            raise SettingsError(
                f"EGL does not start ({error}); Debian: libegl1 libgl1-mesa-dri"
            ) from None
        self.size = size
        self._flags = moderngl.DEPTH_TEST
        # edges are not smoothed here: four samples a pixel cost twice the time, and the lens blurs
        self._frame = self._gl.framebuffer(
            [self._gl.renderbuffer(size, 4)], self._gl.depth_renderbuffer(size)
        )
        side = (SHADOW_PIXELS, SHADOW_PIXELS)
        self._maps = [self._gl.depth_texture(side) for _ in range(LIGHTS)]
        for texture in self._maps:
            texture.compare_func = "<="
            texture.filter = (moderngl.LINEAR, moderngl.LINEAR)
        self._shadows = [self._gl.framebuffer(depth_attachment=t) for t in self._maps]
        self.skin = self._program("place.vert", "skin.frag")
        self.room = self._program("place.vert", "room.frag")
        self._shadow = self._program("shadow.vert", "shadow.frag")

    def _program(self, vertex: str, fragment: str) -> Any:
        common = (SHADERS / "common.glsl").read_text()
        texts = [
            (SHADERS / name).read_text().replace("//COMMON", common) for name in (vertex, fragment)
        ]
        return self._gl.program(*texts)

    def draw(
        self,
        program: Any,
        camera: ht.Camera,
        meshes: Many[tuple[Mesh, dict[str, object]]],
        lights: Lights,
        settings: dict[str, object],
    ) -> NDArray[np.uint8]:
        """A picture (height, width, 4): colour by how much of the pixel it covers, and that.

        Args:
            program: `skin` (with shadows) or `room`.
            camera: of this size.
            meshes: what to draw, each with what is said to the program for it alone.
            lights, settings: what is said to the program.
        """
        if camera.size != self.size:
            raise SettingsError(f"camera {camera.name} has {camera.size} pixels, not {self.size}")
        buffers = [_Buffers(self._gl, mesh) for mesh, _ in meshes]
        uniforms = dict(settings)
        if program is self.skin:
            uniforms |= self._cast(meshes, buffers, lights)
        uniforms |= {
            "clip": clip_matrix(camera),
            "light_direction": lights.directions,
            "light_colour": lights.colours,
            "ambient_above": lights.above,
            "ambient_below": lights.below,
            "exposure": lights.exposure,
            "eye": camera.centre,
        }
        self._frame.use()
        self._frame.clear(0.0, 0.0, 0.0, 0.0, depth=1.0)
        self._gl.enable_only(self._flags)
        for i, texture in enumerate(self._maps):
            texture.use(1 + i)
        for (_, own), buffer in zip(meshes, buffers, strict=True):
            _say(program, uniforms | own)
            buffer.render(program)
        data = self._frame.read(components=4, alignment=1)
        for buffer in buffers:
            buffer.release()
        return np.frombuffer(data, np.uint8).reshape(self.size[1], self.size[0], 4)

    def depth(self, camera: ht.Camera, mesh: Mesh) -> Array:
        """(height, width) depth of a mesh before the camera [m]; inf where there is none."""
        target = self._gl.depth_texture(self.size)
        frame = self._gl.framebuffer(depth_attachment=target)
        buffer = _Buffers(self._gl, mesh)
        frame.use()
        frame.clear(depth=1.0)
        self._gl.enable_only(self._flags)
        _say(self._shadow, {"clip": clip_matrix(camera)})
        buffer.render(self._shadow)
        z = np.frombuffer(target.read(alignment=1), np.float32).astype(np.float64)
        z = 2 * z.reshape(self.size[::-1]) - 1
        for thing in (buffer, frame, target):
            thing.release()
        with np.errstate(divide="ignore"):
            depth = 2 * FAR * NEAR / (FAR + NEAR - z * (FAR - NEAR))
        return np.where(z >= 1.0, np.inf, depth)

    def _cast(
        self, meshes: Many[tuple[Mesh, dict[str, object]]], buffers: list[_Buffers], lights: Lights
    ) -> dict[str, object]:
        middle = meshes[0][0].vertices.mean(0)
        matrices = np.stack([light_matrix(d, middle) for d in lights.directions])
        self._gl.enable_only(self._flags)
        for frame, matrix in zip(self._shadows, matrices, strict=True):
            frame.use()
            frame.clear(depth=1.0)
            _say(self._shadow, {"clip": matrix})
            for buffer in buffers:
                buffer.render(self._shadow)
        return {"light_clip": matrices, "shadow": np.arange(1, 1 + LIGHTS)}

    def close(self) -> None:
        """Give the context back."""
        self._gl.release()


def _say(program: Any, uniforms: dict[str, object]) -> None:
    for name, value in uniforms.items():
        if name in program:
            if name in ("shadow", "material"):
                program[name].write(np.asarray(value, dtype=np.int32).tobytes())
            else:
                program[name].write(_packed(value))


class _Buffers:
    """A mesh on the rasteriser's side."""

    def __init__(self, gl: Any, mesh: Mesh) -> None:
        columns = [mesh.vertices, mesh.normals, mesh.rest, mesh.local, mesh.finger[:, None]]
        data = np.concatenate(columns, axis=1).astype(np.float32)
        self._gl = gl
        self._vertices = gl.buffer(data.tobytes())
        self._faces = gl.buffer(np.ascontiguousarray(mesh.faces, dtype=np.int32).tobytes())

    def render(self, program: Any) -> None:
        names, form = ["position", "normal", "rest", "local", "finger"], ["3f"] * 4 + ["1f"]
        used = [name for name in names if name in program]
        form = [f if name in program else f[0] + "x4" for name, f in zip(names, form, strict=True)]
        form = [{"3x4": "12x", "1x4": "4x"}.get(f, f) for f in form]
        array = self._gl.vertex_array(
            program, [(self._vertices, " ".join(form), *used)], index_buffer=self._faces
        )
        array.render()
        array.release()

    def release(self) -> None:
        self._vertices.release()
        self._faces.release()
