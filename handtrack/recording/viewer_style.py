"""Names and colours in the viewer."""

from __future__ import annotations

from handtrack.hand.skeleton import ANGLE_NAMES, FINGERS

Colour = tuple[int, int, int, int]

SKINS: tuple[Colour, ...] = (
    (226, 178, 148, 150),
    (141, 178, 214, 150),
    (170, 206, 150, 150),
    (214, 160, 200, 150),
    (222, 205, 130, 150),
    (150, 205, 205, 150),
)
"""Semi-transparent tints, one for each hand in a recording: skin first, then clearly others."""

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


def angle_labels(finger: int) -> list[str]:
    """ "MCP flexion" and so on, for the four angles of a finger."""
    names = ANGLE_NAMES[4 * finger : 4 * finger + 4]
    out = []
    for name in names:
        joint, motion = name.removeprefix(FINGERS[finger] + "_").split("_")
        out.append(f"{joint.upper()} {motion}")
    return out
