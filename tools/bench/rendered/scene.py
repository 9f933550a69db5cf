"""A clip's pictures: a subject's moving hand before calibrated cameras in a room."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

import handtrack as ht
from tools.bench.rendered.motion import Motion
from tools.bench.rendered.people import Subject, exposed, lights
from tools.bench.rendered.raster import Mesh, Raster
from tools.bench.rendered.room import room
from tools.bench.rendered.surface import forearm, hand_mesh, skin_pattern

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]

HAND, ARM, CLOTH = range(3)


class Scene:
    """Everything of a clip but its movement."""

    def __init__(
        self, raster: Raster, person: Subject, cameras: list[ht.Camera], seed: list[int]
    ) -> None:
        """Args:
        raster: draws; of the cameras' picture size.
        person: whose hand.
        cameras: from where.
        seed: of light, room and noise.
        """
        self._raster, self._person, self.cameras = raster, person, cameras
        self._rng = np.random.default_rng(seed)
        self._model = person.model
        self._pattern = skin_pattern(person.hand)
        self._scale = self._model.size / ht.HandModel.default("right").size
        self._lights = exposed(lights(self._rng), person)
        self._blur = self._rng.uniform(0.5, 0.95)
        noise = self._rng.uniform(1.0, 3.0)
        self._store = noise * self._rng.standard_normal(4_000_000, dtype=np.float32)
        self._says = {
            "tone": person.tone,
            "tone_palm": person.tone_palm,
            "cloth": person.cloth,
            "joints_mm": self._pattern.joints,
            "half_mm": self._pattern.half,
            "seed": person.seed,
            "roughness": person.roughness,
            "wrinkles": person.wrinkles,
        }
        furniture = room(self._rng)
        soft = self._rng.uniform(1.5, 5.0)
        says: dict[str, object] = {"seed": person.seed}
        self._backdrops = []
        for camera in cameras:
            sharp = raster.draw(raster.room, camera, [(furniture, {})], self._lights, says)
            self._backdrops.append(
                gaussian_filter(sharp[..., :3].astype(np.float32), (soft, soft, 0))
            )

    def meshes(self, motion: Motion, frame: int) -> list[tuple[Mesh, dict[str, object]]]:
        """Hand, forearm and sleeve of a frame."""
        pose = motion.rotation[frame], motion.translation[frame]
        skin = self._model.vertices(motion.angles[frame], *pose)
        wrist = motion.translation[frame] + pose[0] @ self._model.rest_joints[0]
        arm = (pose[0], wrist, motion.arm[frame], self._scale)
        found: list[tuple[Mesh, dict[str, object]]] = [
            (hand_mesh(self._model, self._pattern, skin), {"material": HAND}),
            (forearm(*arm), {"material": ARM}),
        ]
        if self._person.sleeve_mm is not None:
            sleeve = forearm(*arm, self._person.sleeve_mm, self._person.loose_mm)
            found.append((sleeve, {"material": CLOTH}))
        return found

    def pictures(self, motion: Motion) -> Iterator[list[Picture]]:
        """For each frame a picture of each camera."""
        for frame in range(len(motion)):
            meshes = self.meshes(motion, frame)
            drawn = [
                self._raster.draw(self._raster.skin, camera, meshes, self._lights, self._says)
                for camera in self.cameras
            ]
            yield [self._taken(*both) for both in zip(drawn, self._backdrops, strict=True)]

    def _taken(self, hand: Picture, backdrop: NDArray[np.float32]) -> Picture:
        """Before the room, through the lens and onto the sensor: a little blur, and noise."""
        picture = backdrop.copy()
        rows, columns = (np.flatnonzero(hand[..., 3].any(i)) for i in (1, 0))
        if rows.size:
            box = np.s_[
                max(rows[0] - 4, 0) : rows[-1] + 5, max(columns[0] - 4, 0) : columns[-1] + 5
            ]
            part = hand[box].astype(np.float32)
            picture[box] *= 1.0 - part[..., 3:] / 255.0
            picture[box] += part[..., :3]
            picture[box] = gaussian_filter(picture[box], (self._blur, self._blur, 0), truncate=3.0)
        picture += self._grain(picture)
        return np.asarray(np.clip(picture + 0.5, 0, 255), dtype=np.uint8)

    def _grain(self, picture: NDArray[np.float32]) -> NDArray[np.float32]:
        """Noise, more where there is light, from a store of it."""
        start = int(self._rng.integers(self._store.size - picture.size))
        noise = self._store[start : start + picture.size].reshape(picture.shape)
        return np.asarray(noise * (0.6 + picture * (0.4 / 255.0)), dtype=np.float32)
