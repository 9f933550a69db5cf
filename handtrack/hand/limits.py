"""Biomechanical limits of the 20 angles: named presets, and the saddle joint's ellipse.

A hinge has an interval. A saddle has two angles whose limits form an ellipse per quadrant
(Li et al. 2021, eq. 3): (phi_y / phi_y*)^2 + (phi_z / phi_z*)^2 <= 1, where each phi* is the
minimum or the maximum of that angle, by its sign.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import SettingsError
from handtrack.hand.skeleton import ANGLE_NAMES, FINGERS, N_ANGLES

SADDLE_FLEXION = np.array([0, 4, 8, 12, 16])
"""Index of each saddle's flexion angle; its abduction angle comes next."""


@dataclass(frozen=True, eq=False)
class Limits:
    """Limits of the 20 angles.

    Attributes:
        name: name of the preset, or of where the limits come from.
        lower: (20,) least angles [rad].
        upper: (20,) greatest angles [rad].

    Raises:
        SettingsError: shapes are wrong, a limit is not finite, lower > upper, or a saddle's
            range does not hold zero inside it (its ellipse would have no interior).
    """

    name: str
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]

    def __post_init__(self) -> None:
        for field in ("lower", "upper"):
            value = np.array(getattr(self, field), dtype=np.float64)
            if value.shape != (N_ANGLES,) or not np.isfinite(value).all():
                raise SettingsError(
                    f"limits {self.name}: {field} has shape {value.shape},"
                    " expected 20 finite angles in radians"
                )
            value.flags.writeable = False
            object.__setattr__(self, field, value)
        bad = np.flatnonzero(self.lower > self.upper)
        if bad.size:
            raise SettingsError(
                f"limits {self.name}: {ANGLE_NAMES[bad[0]]} has a lower limit above its upper one"
            )
        for a in np.concatenate([SADDLE_FLEXION, SADDLE_FLEXION + 1]):
            if not self.lower[a] < 0 < self.upper[a]:
                raise SettingsError(
                    f"limits {self.name}: the range of {ANGLE_NAMES[a]} must hold 0 inside it"
                )

    def contains(self, angles: ArrayLike, tolerance: float = 1e-9) -> NDArray[np.bool_]:
        """Whether angles (..., 20) [rad] keep every interval and every ellipse."""
        return np.asarray(self.violation(angles).max(axis=-1) <= tolerance, dtype=np.bool_)

    def violation(self, angles: ArrayLike) -> NDArray[np.float64]:
        """How far each angle (..., 20) [rad] is from its nearest valid value [rad]."""
        angles = np.asarray(angles, dtype=np.float64)
        return np.asarray(np.abs(angles - self.clamp(angles)))

    def clamp(self, angles: ArrayLike) -> NDArray[np.float64]:
        """Nearest valid angles: hinges clipped, saddles moved to the ellipse's nearest point.

        Args:
            angles: (..., 20) [rad].

        Returns:
            A new array (..., 20) [rad]; NaN stays NaN.
        """
        from handtrack.kernels.limits import clamp_poses

        return clamp_poses(self.lower, self.upper, np.asarray(angles, dtype=np.float64))


def _preset(name: str, rows: dict[str, tuple[float, ...]]) -> Limits:
    """Limits from rows of degrees: finger -> base z min, max, y min, max, then two hinges."""
    table = np.deg2rad(np.array([rows[f] for f in FINGERS])).reshape(5, 4, 2)
    return Limits(name, table[..., 0].ravel(), table[..., 1].ravel())


# Li et al. 2021, Table 1
_LI2021 = _preset(
    "li2021",
    {
        "thumb": (-20, 20, -30, 30, 0, 80, 0, 90),
        "index": (-10, 85, -10, 10, 0, 100, 0, 90),
        "middle": (-10, 85, -10, 10, 0, 100, 0, 90),
        "ring": (-10, 85, -10, 10, 0, 100, 0, 90),
        "little": (-10, 85, -10, 10, 0, 100, 0, 90),
    },
)

# The widest end of each angle among these sources, the source in brackets behind each end:
#   [c] clinical ranges: MCP -45..90, PIP 0..100, DIP 0..80, thumb MCP -10..55, thumb IP -15..80;
#       PIP and DIP hyperextend by up to 10 degrees
#   [m] MobileHand's 23 DoF: MCP -10..90, abduction index -20..30, middle +-20, ring -10..20,
#       little -30..20, PIP and DIP -1..90, thumb CMC and MCP +-45, thumb IP -1..90
#   [u] UmeTrack's generic hand: thumb -45..74, -35..35, 0..74, -15..62; index -19..28;
#       middle -28..16; ring +-16; little -39..28; PIP 0..108; DIP 0..82
#   [t] Table 1 of Li et al. 2021
# Abduction is positive towards the thumb.
_ANATOMICAL = _preset(
    "anatomical",
    {
        #         CMC/MCP flexion   abduction         MCP/PIP           IP/DIP
        "thumb": (-45, 74, -45, 45, -10, 80, -15, 90),  # u u, m m, c t, c m
        "index": (-45, 90, -20, 30, -10, 108, -10, 90),  # c c, m m, c u, c m
        "middle": (-45, 90, -28, 20, -10, 108, -10, 90),  # c c, u m, c u, c m
        "ring": (-45, 90, -16, 20, -10, 108, -10, 90),  # c c, u m, c u, c m
        "little": (-45, 90, -39, 28, -10, 108, -10, 90),  # c c, u u, c u, c m
    },
)

PRESETS: dict[str, Limits] = {limits.name: limits for limits in (_LI2021, _ANATOMICAL)}
DEFAULT_LIMITS = "anatomical"


def preset(name: str) -> Limits:
    """The preset of that name.

    Raises:
        SettingsError: there is none; the message lists those there are.
    """
    if name not in PRESETS:
        raise SettingsError(f"limits {name!r} are unknown, expected one of {', '.join(PRESETS)}")
    return PRESETS[name]
