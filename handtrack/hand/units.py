"""Units of length that joints and cameras come in."""

from __future__ import annotations

from typing import Literal

Unit = Literal["m", "cm", "mm", "in"]
METRES: dict[Unit, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
"""One of each unit in metres."""
METRIC: dict[Unit, float] = {unit: size for unit, size in METRES.items() if unit != "in"}
"""Those that are guessed: few but animators measure in inches."""
