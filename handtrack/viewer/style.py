"""Names and colours in the viewer, and how a user chooses them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from handtrack.hand.limits import Limits
from handtrack.hand.skeleton import ANGLE_NAMES, FINGERS
from handtrack.mcap.foxglove import SKIN

Colour = tuple[int, int, int, int]

SKINS: tuple[Colour, ...] = (
    (*SKIN, 255),
    (141, 178, 214, 255),
    (170, 206, 150, 255),
    (214, 160, 200, 255),
    (222, 205, 130, 255),
    (150, 205, 205, 255),
)
"""Opaque tints, one for each hand in a recording: skin first, then clearly others. Fists are
muddy in a skin that light goes through; the bones have a view of their own."""
LATER_ALPHA = 90
"""Of the skins of later runs that lie over the first one's."""


class Ground(NamedTuple):
    """What hands and plots are drawn on.

    Attributes:
        world: of the 3D views and the keys.
        grid: its lines.
        plot: of the plots; None for the viewer's own.
        text: what is written on it.
    """

    world: tuple[int, int, int]
    grid: Colour
    plot: tuple[int, int, int] | None
    text: Colour


DARK = Ground((24, 27, 34), (58, 64, 76, 255), None, (205, 210, 220, 255))
LIGHT = Ground((243, 244, 246), (198, 203, 212, 255), (251, 251, 252), (60, 66, 78, 255))
AXES: tuple[Colour, ...] = ((230, 85, 85, 255), (95, 185, 95, 255), (95, 135, 240, 255))
"""Of the world: x, y, z."""

OBSERVED, FITTED, FILTERED, TRUTH = 1, 2, 3, 4
SKELETONS: dict[int, tuple[str, Colour, float]] = {
    OBSERVED: ("observed", (255, 196, 0, 255), 0.0028),
    FITTED: ("fitted", (64, 156, 255, 255), 0.0022),
    FILTERED: ("filtered", (60, 220, 140, 255), 0.0025),
    TRUTH: ("truth", (240, 240, 240, 255), 0.0018),
}
"""Class id of a skeleton -> its name, colour and radius of a joint [m]."""

ANGLE_COLOURS: tuple[Colour, ...] = (
    (78, 156, 245, 255),  # base flexion
    (245, 170, 60, 255),  # base abduction
    (80, 205, 130, 255),  # first hinge
    (225, 100, 140, 255),  # second hinge
)
RAW_ALPHA, RAW_WIDTH, FILTERED_WIDTH = 110, 0.6, 2.2
LIMIT_ALPHA, LIMIT_WIDTH = 70, 5.0
"""A limit is a band, in the colour of its angle."""

OUTSIDE: Colour = (255, 20, 50, 255)
HELD: Colour = (190, 110, 255, 255)
MARKS = np.array([HELD, OUTSIDE], np.uint8)
"""Colours of the rings about joints that a limit holds, and about joints outside their limits."""
RING_WIDTH = 0.0007
"""Half of the line's [m]."""
REJECTED: Colour = (255, 70, 0, 255)
"""Observed joints that are outliers and were not used."""
REJECTED_RADIUS = 0.0055

ERRORS: tuple[tuple[str, Colour], ...] = (
    ("mean to observed", (78, 156, 245, 255)),
    ("max to observed", (120, 140, 165, 255)),
    ("mean to truth", (80, 205, 130, 255)),
)
STATUS_COLOURS: dict[str, Colour] = {
    "fitted": (80, 180, 120, 255),
    "predicted": (235, 185, 60, 255),
    "lost": (225, 85, 85, 255),
}

TURN_SIZE = 4.0
"""Of the points among the angles where the hand was lost or found."""


def angle_labels(finger: int) -> list[str]:
    """ "MCP flexion" and so on, for the four angles of a finger."""
    names = ANGLE_NAMES[4 * finger : 4 * finger + 4]
    out = []
    for name in names:
        joint, motion = name.removeprefix(FINGERS[finger] + "_").split("_")
        out.append(f"{joint.upper()} {motion}")
    return out


def skin_colour(number: int, pale: bool = False) -> Colour:
    """The tint of a hand; one that lies over another hides less of it."""
    red, green, blue, alpha = SKINS[number % len(SKINS)]
    return red, green, blue, LATER_ALPHA if pale else alpha


def ground(light: bool) -> Ground:
    """What things are drawn on."""
    return LIGHT if light else DARK


def toned(colour: Colour, light: bool) -> Colour:
    """A colour that can be seen on a light ground too: darker there, white as black."""
    if not light:
        return colour
    if min(colour[:3]) > 200:
        return (45, 48, 56, colour[3])
    return _mixed(colour, (0, 0, 0, colour[3]), 0.22)


def run_colour(run: int) -> Colour:
    """The tint of a run, opaque."""
    return (*SKINS[run % len(SKINS)][:3], 255)


def angle_colours(run: int, light: bool = False) -> list[Colour]:
    """Those of the four angles of a finger: of later runs paler."""
    share = min(0.6, 0.45 * run)
    return [_mixed(toned(colour, light), (255, 255, 255, 255), share) for colour in ANGLE_COLOURS]


def skeletons(run: int, light: bool = False) -> dict[int, tuple[str, Colour, float]]:
    """`SKELETONS` for a run: of later ones in the run's tint."""
    tint = run_colour(run)
    shares = {OBSERVED: 0.5, FITTED: 0.7, FILTERED: 0.85, TRUTH: 0.0}
    return {
        id_: (name, toned(_mixed(colour, tint, shares[id_] if run else 0.0), light), radius)
        for id_, (name, colour, radius) in SKELETONS.items()
    }


def _mixed(a: Colour, b: Colour, share: float) -> Colour:
    """Colour a with a share of b in it."""
    red, green, blue, alpha = (
        round((1 - share) * x + share * y) for x, y in zip(a, b, strict=True)
    )
    return red, green, blue, alpha


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
