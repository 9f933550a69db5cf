"""What cameras' pictures show, as `handtrack track` fits it: of one with its joints, of several."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.hand.reshape import without_landmarks
from handtrack.hand.skeleton import HANDS
from handtrack.sequences.picture import Picture
from handtrack.tracking.settings import TrackSettings
from handtrack.video.detections import Detections
from handtrack.video.following import follow
from handtrack.video.one_camera import hand_seen
from handtrack.video.pictured import fitted, noise_told
from handtrack.video.views import views_of
from tools.bench.rendered.cases import TRIANGULATED, Case
from tools.bench.rendered.layout import Clip


def seen_in_picture(
    case: Case, profiles: Callable[[Case], str], filter: str = "none", lens: bool = True
) -> ht.Track | None:
    """A case tracked in its camera's picture, in that camera's axes; None where there is none, or
    it does not show that hand.

    Args:
        case: of one camera.
        profiles: makes the profile of a case.
        filter: as of `handtrack.track`.
        lens: the camera's own, else the assumed one.
    """
    image, cameras = case.clip.image, case.clip.cameras
    if not case.centred or image is None or not cameras:
        return None
    camera = cameras[case.camera]
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(case.joints).all((1, 2)))[:, None]
    own = replace(camera, rotation=np.eye(3), translation=np.zeros(3)) if lens else None
    picture = Picture(
        np.where(seen[..., None], image[case.camera], np.nan),
        np.repeat(seen.astype(float), 21, 1),
        camera.size or (0, 0),
        own,
    )
    joints = replace(case.sequence, joints=np.where(seen[..., None], case.joints, np.nan))
    prior, settings = ht.HandModel.default(case.clip.hand), TrackSettings()
    in_picture = profiles(replace(case, input=TRIANGULATED))
    settings = settings.but(filter=filter, detector=profiles(case))
    found = fitted(joints, picture, prior, settings, pictured=in_picture)
    if found is None:
        return None
    settings = TrackSettings().but(filter=filter, calibrate="none", noise_mm=found.noise_mm)
    return ht.track(found.sequence, found.model, settings=settings)


def seen_by_cameras(
    case: Case, profiles: Callable[[Case], str], filter: str = "none"
) -> ht.Track | None:
    """A case tracked in the pictures of its cameras; None where they are not several.

    Args:
        case: triangulated.
        profiles: makes the profile of a case.
        filter: as of `handtrack.track`.
    """
    clip = case.clip
    if case.stored is None or clip.score is None:
        return None
    (views,) = views_of([_detections(clip, c) for c in range(len(clip.cameras))], clip.cameras)
    settings = TrackSettings().but(filter=filter, detector=profiles(case))
    hand = hand_seen(views, ht.HandModel.default(clip.hand), True, settings.detector)
    followed = follow(views, hand.model, hand.shown, settings)
    noise_mm = noise_told(followed, hand)
    bare = without_landmarks(hand.fitted)
    return ht.track(followed.sequence, bare, filter=filter, calibrate="none", noise_mm=noise_mm)


def _detections(clip: Clip, camera: int) -> Detections:
    """What one camera saw of the clip's hand."""
    n = len(clip.time_ns)
    # a case that is triangulated has both
    image, scores = np.asarray(clip.image)[camera], np.asarray(clip.score)[camera]
    seen = clip.seen(camera) & np.isfinite(image).all((1, 2))
    shown = np.where(seen[:, None, None], image, np.nan)
    score = np.where(seen, scores, 0.0)
    return Detections(
        clip.name,
        clip.cameras[camera].size or (0, 0),
        clip.time_ns,
        np.arange(n),
        {h: shown if h == clip.hand else np.full_like(shown, np.nan) for h in HANDS},
        {h: np.full((n, 21, 3), np.nan) for h in HANDS},
        {h: score if h == clip.hand else np.zeros(n) for h in HANDS},
    )
