"""`handtrack.track`: where a picture shows the joints as well, the hand is fitted to both."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from handtrack.deprecated import old_positions
from handtrack.detectors.chosen import AUTO
from handtrack.hand.model import HandModel
from handtrack.hand.reshape import without_landmarks
from handtrack.mcap.state import Stretch
from handtrack.sequences.arrays import sequence_of
from handtrack.sequences.picture import Picture
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.sequence_track import track_joints
from handtrack.tracking.settings import TrackSettings
from handtrack.tracking.track import Track
from handtrack.tracking.tracker import OLD_ORDER

if TYPE_CHECKING:
    from handtrack.video.following import Followed
    from handtrack.video.one_camera import SeenHand
    from handtrack.video.views import Views

ALONE = "its picture does not show the hand that its joints are: these alone are fitted"
LEAST_NOISE_MM = 1e-3
"""Made pictures are met exactly; no fit is told that there is no noise."""
FAR = 0.35
"""A hand that is off by more of its palm in most pictures [px/px] is not what they show."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A hand fitted to the pictures of one camera.

    Attributes:
        sequence: its joints, centres in the camera's world.
        model: the hand, to be fitted to them as it is.
        noise_mm: of them.
    """

    sequence: Sequence
    model: HandModel
    noise_mm: float


def fitted(
    sequence: Sequence,
    picture: Picture,
    model: HandModel,
    settings: TrackSettings,
    is_own: bool = False,
    ready: Callable[[], None] = lambda: None,
    pictured: str | None = None,
) -> Fitted | None:
    """A hand's joints as one camera's joints and picture say it together.

    Args:
        sequence: the camera's joints, in its axes.
        picture: what its pictures show of them.
        model: the prior, or the subject's hand.
        settings: how it is calibrated and steadied, and whose landmarks it has.
        is_own: the model is the subject's, of known size.
        ready: called when the hand is known.
        pictured: whose landmarks the picture shows; by default the same detector's.

    Returns:
        None where the pictures do not show that hand.

    Raises:
        InputError: no hand is found in the joints.
    """
    # joints without a picture need none of it
    from handtrack.video.following import follow
    from handtrack.video.one_camera import hand_seen
    from handtrack.video.placing import assumed_camera
    from handtrack.video.views import view_of

    views = view_of(sequence, picture, picture.camera or assumed_camera(picture.size))
    if not np.isfinite(views.points).any():
        return None
    method = settings.calibration.method
    hand = hand_seen(views, model, method, settings.detector, is_own, pictured)
    ready()
    followed = follow(views, hand.model, hand.shown, settings)
    if _is_elsewhere(followed, views):
        return None
    joints = replace(
        followed.sequence,
        truth=sequence.truth,
        subject=sequence.subject,
        remarks=sequence.remarks,
        timed=sequence.timed,
        numbered=sequence.numbered,
        cameras=about(followed, hand, 1, picture.lens),
    )
    return Fitted(joints, without_landmarks(hand.fitted), noise_told(followed, hand))


def noise_told(followed: Followed, hand: SeenHand) -> float:
    """The noise of one camera's joints that a filter is told [mm]."""
    return max(followed.noise_mm, hand.noise_mm, LEAST_NOISE_MM)


def about(followed: Followed, hand: SeenHand, views: int, lens: str) -> dict[str, Any]:
    """What recordings say of a hand that was fitted to the pictures of cameras."""
    pixels = followed.reprojection[np.isfinite(followed.reprojection)]
    values = (pixels.mean(), pixels.std(), *np.percentile(pixels, [50, 95]), pixels.max())
    kinds = ("mean", "std", "median", "p95", "max")
    error = {kind: round(float(x), 3) for kind, x in zip(kinds, values, strict=True)}
    said: dict[str, Any] = {"views": views, "reprojection_px": error}
    if views == 1:
        said["depth_deviation"] = round(hand.size_deviation, 3)
    said |= {"detector": hand.detector} if hand.detector else {}
    return said | ({"lens": lens} if lens else {})


def _is_elsewhere(followed: Followed, views: Views) -> bool:
    """Whether most pictures do not show the hand: they are of another size, or another hand."""
    error = np.nanmedian(followed.reprojection)
    palm = np.linalg.norm(views.image[:, 0, 9] - views.image[:, 0, 0], axis=-1)
    return not error <= FAR * np.nanmedian(palm)


@old_positions("calibrate", *OLD_ORDER, "progress", "on_part")
def track(
    sequence: Sequence | ArrayLike,
    model: HandModel | None = None,
    *,
    settings: TrackSettings | Mapping[str, Any] | None = None,
    progress: Callable[[int], None] | None = None,
    on_part: Callable[[Stretch], None] | None = None,
    **options: Any,
) -> Track:
    """Track a whole sequence.

    Where a camera's picture shows the joints as well (`Sequence.picture`: of videos, and of what
    `detect` wrote), the hand is fitted to both, and stands in the camera's world; where nobody says
    what lens it has, one is assumed, on which the place in the room and its scale depend, but
    hardly the pose. `picture=False` fits the joints alone.

    Args:
        sequence: the joints of one hand: a Sequence, or an array (T, 21, 3) or (T, 63) in metres in
            MediaPipe's order, NaN where a joint is missing, taken as 30 frames/s (it is warned).
        model: the hand; the free default hand of the sequence's side if left out.
        settings: how to track; the defaults if left out.
        progress: called with the number of frames done: 0 when the hand is known, then now and
            then.
        on_part: called with every stretch of frames as soon as it is final, in order: what it
            gets, one after another, is the track returned.
        options: settings by their names (see `TrackSettings`), such as filter="kalman" or
            calibrate=False, that replace these.

    Returns:
        The track, with the hand as calibrated. Of joints and picture `observed` are both together,
        joint centres; `settings["cameras"]` says how far they are from what the picture shows.

    Raises:
        InputError: model and sequence are of different hands, or the sequence shows no bone; an
            array has another shape, or is no hand's joints in metres.
        SettingsError: an option is unknown, or a value makes no sense.
    """
    chosen = TrackSettings.of(settings, options)
    sequence = sequence_of(sequence)
    picture = sequence.picture if chosen.picture else None
    if picture is None or (model is not None and model.hand != sequence.hand):
        return track_joints(sequence, model, chosen, progress, on_part)
    default = HandModel.default(sequence.hand)
    is_own = model is not None and not model.licensed and model.size != default.size
    known = (lambda: None) if progress is None else partial(progress, 0)
    found = fitted(sequence, picture, model or default, chosen, is_own, known)
    if found is None:
        alone = replace(sequence, picture=None, notes=(*sequence.notes, ALONE))
        return track_joints(alone, model, chosen, progress, on_part)
    # what was followed are joint centres of a hand that is known
    chosen = chosen.but(calibrate="none", detector=AUTO)
    if chosen.fit.noise_mm is None:
        chosen = chosen.but(noise_mm=found.noise_mm)

    def done(frames: int) -> None:
        if frames and progress is not None:
            progress(frames)

    return track_joints(found.sequence, found.model, chosen, done, on_part)
