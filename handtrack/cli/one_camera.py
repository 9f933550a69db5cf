"""What one camera tells of a hand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from handtrack.video.following import Followed
    from handtrack.video.one_camera import SeenHand


def say_what_it_knows(followed: Followed, hand: SeenHand, is_own: bool, focal: str) -> None:
    """What one camera determines, and what it does not.

    Args:
        followed: the hand in its pictures.
        hand: that was fitted; is_own: it is the subject's, from a file.
        focal: where the focal length is from; "" where it is calibrated.
    """
    import numpy as np

    from handtrack.hand.skeleton import BASES
    from handtrack.sequences.size import palm_length

    name, model = followed.sequence.name, hand.fitted
    depth = float(np.nanmedian(followed.sequence.joints[:, [0, *BASES], 2]))
    palm = palm_length(model.joints(model.mean_angles)[None])
    click.echo(
        f"{name}: one camera determines where each joint is in the picture, and by that the hand's"
        " direction, its turn and how far fingers are bent in the picture's plane",
        err=True,
    )
    size = "its size is the file's"
    if not is_own:
        whose = "assumed" if hand.shown is None else "the detector's and people's"
        size = (
            f"its size is {whose} to {hand.size_deviation:.0%} (standard deviation; --hand-model"
            " FILE says it)"
        )
    told = f" and the focal length, {focal}: a lens 10 % longer puts it 10 % farther away"
    bent = "; and hardly how fingers bend towards the camera" if hand.shown is None else ""
    click.echo(
        f"{name}: it does not determine depth (median {depth:.2f} m), which follows from the hand's"
        f" size, a palm of {1e3 * palm:.0f} mm, {size}: a hand 10 % larger is 10 % farther away"
        f"{',' + told if focal else ''}{bent}",
        err=True,
    )
