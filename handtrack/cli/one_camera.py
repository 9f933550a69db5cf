"""What one camera tells of a hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from handtrack import Track
    from handtrack.video.following import Followed
    from handtrack.video.one_camera import SeenHand


@dataclass(frozen=True)
class Known:
    """What came of one camera's pictures of a hand.

    Attributes:
        name: of the sequence.
        depth: how far from the camera its palm is, median [m].
        palm: how long it is [m].
        size_deviation: of the logarithm of the hand's size.
        bends: whether something tells how fingers bend towards the camera.
    """

    name: str
    depth: float
    palm: float
    size_deviation: float
    bends: bool

    @staticmethod
    def of(followed: Followed, hand: SeenHand) -> Known:
        """Of a hand in its pictures."""
        import numpy as np

        from handtrack.hand.skeleton import BASES
        from handtrack.sequences.size import palm_length

        model = hand.fitted
        depth = float(np.nanmedian(followed.sequence.joints[:, [0, *BASES], 2]))
        palm = palm_length(model.joints(model.mean_angles)[None])
        deviation, bends = hand.size_deviation, hand.shown is not None
        return Known(followed.sequence.name, depth, palm, deviation, bends)

    @staticmethod
    def of_track(track: Track) -> Known:
        """Of a track fitted to joints and picture."""
        import numpy as np

        from handtrack.hand.skeleton import BASES
        from handtrack.sequences.size import palm_length

        model = track.model
        depth = float(np.nanmedian(track.observed[:, [0, *BASES], 2]))
        palm = palm_length(model.joints(model.mean_angles)[None])
        deviation = track.settings["cameras"]["depth_deviation"]
        return Known(track.name, depth, palm, deviation, True)


def say_what_it_knows(known: Known, is_own: bool, lens: str) -> None:
    """What one camera determines, and what it does not.

    Args:
        known: the hand in its pictures.
        is_own: it is the subject's, from a file.
        lens: what is known of it; "" where it is calibrated.
    """
    click.echo(
        f"{known.name}: one camera determines where each joint is in the picture, and by that the"
        " hand's direction, its turn and how far fingers are bent in the picture's plane",
        err=True,
    )
    size = "its size is the file's"
    if not is_own:
        whose = "the detector's and people's" if known.bends else "assumed"
        size = (
            f"its size is {whose} to {known.size_deviation:.0%} (standard deviation; --hand-model"
            " FILE says it)"
        )
    focal = "assumed" if lens == "assumed" else "as --fov says"
    told = f" and the focal length, {focal}: a lens 10 % longer puts it 10 % farther away"
    bent = "" if known.bends else "; and hardly how fingers bend towards the camera"
    click.echo(
        f"{known.name}: it does not determine depth (median {known.depth:.2f} m), which follows"
        f" from the hand's size, a palm of {1e3 * known.palm:.0f} mm, {size}: a hand 10 % larger is"
        f" 10 % farther away{',' + told if lens else ''}{bent}",
        err=True,
    )


def say_of_picture(track: Track, is_own: bool, said: set[str]) -> None:
    """How a hand fits the picture that its joints were found in, and what its lens leaves open.

    Args:
        track: it.
        is_own: the hand is the subject's, from a file.
        said: what was said of earlier ones already, and need not be again.
    """
    about = track.settings.get("cameras")
    if not isinstance(about, dict):
        return
    pixels, lens = about["reprojection_px"]["median"], about.get("lens", "")
    whose = f", landmarks as of {about['detector']}" if "detector" in about else ""
    click.echo(
        f"{track.name}: {track.hand} hand fitted to its joints and its picture, reprojection error"
        f" {pixels:.2f} px (median){whose}",
        err=True,
    )
    if lens != "assumed":
        say_what_it_knows(Known.of_track(track), is_own, lens)
        return
    if lens not in said:
        click.echo(
            "the lens is assumed, its focal length the picture's longer side: poses hardly depend"
            " on it, but how far away hands are is in proportion to it. --fov DEGREES or --camera"
            " FILE says it; --no-picture fits the joints alone",
            err=True,
        )
        said.add(lens)
