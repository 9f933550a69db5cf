"""What goes into a recording, and how."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import SettingsError

STEPS_PER_METRE = 2**13
"""Of a quantised mesh: 0.122 mm, a power of two so that float32 holds it with few digits."""
COMPRESSIONS = ("lz4", "zstd", "none")
EXPECTED = "full, quantised, every N, none, or quantised with every N, as in quantised,every:5"


@dataclass(frozen=True)
class MeshChoice:
    """How the skin is recorded.

    Attributes:
        quantised: vertices lie on a grid of 1/8192 m, so that they compress to two thirds (lz4)
            or half (zstd) of their size; no coordinate is off by more than 0.061 mm, no vertex
            by more than 0.106 mm. Still float32, so that viewers draw it.
        every: record the skin of every Nth frame; 0 for none.
    """

    quantised: bool = False
    every: int = 1

    @staticmethod
    def of(value: MeshChoice | str | bool) -> MeshChoice:
        """The choice that a text says: "full", "quantised", "every 5", "quantised,every:5", "none".

        True is "full", False "none".

        Raises:
            SettingsError: it says something else.
        """
        if isinstance(value, MeshChoice):
            return value
        if isinstance(value, bool):
            return MeshChoice(every=int(value))
        words = value.replace(",", " ").replace(":", " ").split()
        if words == ["full"]:
            return MeshChoice()
        if words == ["none"]:
            return MeshChoice(every=0)
        quantised, every = "quantised" in words, 1
        rest = [word for word in words if word != "quantised"]
        if rest:
            every = int(rest[1]) if rest[0] == "every" and rest[-1].isdecimal() else 0
        if len(words) != quantised + len(rest) or len(rest) not in (0, 2) or every < 1 or not words:
            raise SettingsError(f"mesh {value!r} is unknown, expected {EXPECTED}")
        return MeshChoice(quantised, every)

    def __str__(self) -> str:
        if not self.every:
            return "none"
        words = ["quantised"] * self.quantised + [f"every:{self.every}"] * (self.every > 1)
        return ",".join(words) or "full"

    def rounded(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """Vertices [m] as they are recorded quantised."""
        return np.asarray(np.rint(vertices * STEPS_PER_METRE) / STEPS_PER_METRE)


@dataclass(frozen=True)
class RecordingSettings:
    """What goes into a recording, and how.

    Attributes:
        mesh: which skins, and how exactly.
        compression: of chunks: "lz4", "zstd" or "none".
        foxglove_mesh: the same skins as foxglove.SceneUpdate too, in place of stiff pieces.

    Raises:
        SettingsError: compression is unknown, or a scene is wanted without a mesh.
    """

    mesh: MeshChoice = field(default_factory=MeshChoice)
    compression: str = "lz4"
    foxglove_mesh: bool = False

    def __post_init__(self) -> None:
        if self.compression not in COMPRESSIONS:
            known = ", ".join(COMPRESSIONS)
            raise SettingsError(
                f"compression {self.compression!r} is unknown, expected one of {known}"
            )
        if self.foxglove_mesh and not self.mesh.every:
            raise SettingsError("a mesh for Foxglove needs a mesh, but mesh is none")

    @staticmethod
    def of(
        mesh: MeshChoice | str | bool,
        compression: str,
        foxglove_mesh: bool,
        whole: RecordingSettings | None = None,
    ) -> RecordingSettings:
        """The settings that the arguments of `write_mcap` and `McapRecorder` say.

        Raises:
            SettingsError: one makes no sense, or is given beside the whole.
        """
        if whole is None:
            return RecordingSettings(MeshChoice.of(mesh), compression, foxglove_mesh)
        if (mesh, compression, foxglove_mesh) != ("full", "lz4", False):
            raise SettingsError("give a recording's settings as a whole, or one by one, not both")
        return whole
