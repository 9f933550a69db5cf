"""How hands are shown, as a user chooses."""

from __future__ import annotations

from typing import NamedTuple

from handtrack.hand.limits import Limits


class Look(NamedTuple):
    """How hands are shown.

    Attributes:
        mesh: draw the skin, where there is one.
        limits: the limits to draw and to hold the angles against; each model's by default.
        light: on a light ground.
        apart: each recording in 3D views of its own, where there are several.
        still: the eye stays where it is, even if the hand goes far.
    """

    mesh: bool = True
    limits: Limits | None = None
    light: bool = False
    apart: bool = True
    still: bool = False
