"""Units of length that joints and cameras come in."""

from __future__ import annotations

from typing import Literal

Unit = Literal["m", "cm", "mm"]
METRES: dict[Unit, float] = {"m": 1.0, "cm": 1e-2, "mm": 1e-3}
"""One of each unit in metres."""
