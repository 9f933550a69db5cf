"""What a residual is made of: what lasts, bones that breathe, noise, and the model."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.noise import noise_level
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ARRIVING

Array = NDArray[np.float64]

# noise that is left by a hand of balls, with 36 unknowns a frame, over that by ours, with 26
_OF_BOUND = 27.0 / 37.0


@dataclass(frozen=True)
class Split:
    """Parts of a residual; their squares make up its mean square. Root mean squares [m].

    Attributes:
        bias: what each joint is off by in all frames, in the frame of its bone.
        breathing: what any hand of rigid bones leaves too: their lengths change in the data.
        noise: what is new in every frame.
        model: the rest: a pose outside limits, or movement that no such hand makes.
    """

    bias: float
    breathing: float
    noise: float
    model: float

    def summary(self) -> dict[str, float]:
        """The parts in millimetres."""
        return {name: 1e3 * value for name, value in vars(self).items()}


def residuals(model: HandModel, angles: Array, turn: Array, off: Array) -> Array:
    """(T, 21, 3) residuals in the frames of the bones that arrive at the joints [m].

    Args:
        model: the hand.
        angles, turn: (T, 20) [rad], (T, 3, 3) of the fitted poses.
        off: (T, 21, 3) observed less fitted joints in the world [m], NaN where missing.
    """
    bones = turn[:, None] @ model.rotations(angles)[:, ARRIVING]
    return np.asarray((off[..., None, :] @ bones)[..., 0, :])


def split_of(clips: Iterable[Array], bound: float) -> Split:
    """The parts of the residuals of one hand's clips, each clip with a bias of its own.

    Args:
        clips: (T, 21, 3) each, frames in order, in the bones' frames [m], NaN where missing.
        bound: what any hand of rigid bones leaves, root mean square of distances [m].
    """
    squares, count = np.zeros(3), 0
    for off in clips:
        seen = np.isfinite(off[..., 0])
        if not seen.any():
            continue
        total = float(np.square(off[seen]).sum())
        mean = np.nansum(off, 0) / np.maximum(seen.sum(0), 1)[:, None]
        bias = float((np.square(mean).sum(-1) * seen.sum(0)).sum())
        white = 3.0 * noise_level(off) ** 2 * int(seen.sum())
        squares += total, bias, min(white, total - bias)
        count += int(seen.sum())
    total, bias, noise = squares / max(count, 1)
    rest = total - bias - noise
    breathing = min(max(bound**2 - _OF_BOUND * noise, 0.0), rest)
    parts = (bias, breathing, noise, rest - breathing)
    return Split(*(float(np.sqrt(max(part, 0.0))) for part in parts))


def told(found: Mapping[str, object]) -> str | None:
    """The parts in one line, where a calibration's summary has them."""
    parts = found.get("split_mm")
    if not isinstance(parts, Mapping):
        return None
    known = [f"{n} {x:.2f} mm" for n, x in parts.items() if isinstance(x, int | float)]
    return f"residual by its parts, rms: {', '.join(known)}" if known else None
