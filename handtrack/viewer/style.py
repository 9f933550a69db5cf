"""Names and colours in the viewer."""

from __future__ import annotations

import numpy as np

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
RAW_ALPHA, RAW_WIDTH, FILTERED_WIDTH = 110, 1.0, 2.2
LIMIT_ALPHA = 100

OUTSIDE: Colour = (255, 20, 50, 255)
MARKS = np.array([(170, 80, 255, 255), OUTSIDE], np.uint8)
"""Colours of joints that a limit holds, and of joints outside their limits."""
MARK_RADIUS = 0.0045
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


def skin_colour(number: int, run: int) -> Colour:
    """The tint of a hand; those of later runs hide less of the first."""
    red, green, blue, alpha = SKINS[number % len(SKINS)]
    return red, green, blue, alpha if run == 0 else LATER_ALPHA


def run_colour(run: int) -> Colour:
    """The tint of a run, opaque."""
    return (*SKINS[run % len(SKINS)][:3], 255)


def angle_colours(run: int) -> list[Colour]:
    """Those of the four angles of a finger: of later runs paler."""
    share = min(0.55, 0.4 * run)
    return [_mixed(colour, (255, 255, 255, 255), share) for colour in ANGLE_COLOURS]


def skeletons(run: int) -> dict[int, tuple[str, Colour, float]]:
    """`SKELETONS` for a run: of later ones in the run's tint."""
    if run == 0:
        return SKELETONS
    tint = run_colour(run)
    shares = {OBSERVED: 0.5, FITTED: 0.7, FILTERED: 0.85, TRUTH: 0.0}
    return {
        id_: (name, _mixed(colour, tint, shares[id_]), radius)
        for id_, (name, colour, radius) in SKELETONS.items()
    }


def _mixed(a: Colour, b: Colour, share: float) -> Colour:
    """Colour a with a share of b in it."""
    red, green, blue, alpha = (
        round((1 - share) * x + share * y) for x, y in zip(a, b, strict=True)
    )
    return red, green, blue, alpha
