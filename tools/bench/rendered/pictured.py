"""One camera's joints and its picture together, as `handtrack track` fits them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.hand.reshape import without_landmarks
from handtrack.hand.skeleton import HANDS, Hand
from handtrack.tracking.settings import TrackSettings
from handtrack.video.detections import Detections
from handtrack.video.following import follow
from handtrack.video.one_camera import hand_seen
from handtrack.video.pictured import noise_told
from handtrack.video.placing import assumed_camera
from handtrack.video.views import views_of
from tools.bench.rendered.cases import TRIANGULATED, Case
from tools.bench.rendered.layout import Array


def seen_in_picture(
    case: Case, profiles: Callable[[Case], str], filter: str = "none", lens: bool = True
) -> ht.Track | None:
    """A case tracked in its camera's picture, in that camera's axes; None where there is none.

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
    found = _detections(case, camera, image[case.camera])
    own = replace(camera, rotation=np.eye(3), translation=np.zeros(3))
    (views,) = views_of([found], [own if lens else assumed_camera(found.size)])
    in_picture = profiles(replace(case, input=TRIANGULATED))
    prior = ht.HandModel.default(case.clip.hand)
    hand = hand_seen(views, prior, True, profiles(case), pictured=in_picture)
    settings = TrackSettings().but(filter=filter, detector=profiles(case))
    followed = follow(views, hand.model, hand.shown, settings)
    bare = without_landmarks(hand.shown or hand.model)
    noise_mm = noise_told(followed, hand)
    return ht.track(followed.sequence, bare, filter=filter, calibrate="none", noise_mm=noise_mm)


def _detections(case: Case, camera: ht.Camera, image: Array) -> Detections:
    clip, n = case.clip, len(case.joints)
    seen: NDArray[np.bool_] = np.asarray(np.isfinite(case.joints).all((1, 2)))

    def only(points: Array, width: int) -> dict[Hand, Array]:
        mine = np.where(seen[:, None, None], points, np.nan)
        return {h: mine if h == clip.hand else np.full((n, 21, width), np.nan) for h in HANDS}

    score = np.where(seen, 1.0, 0.0)
    return Detections(
        clip.name,
        camera.size or (0, 0),
        clip.time_ns,
        np.arange(n),
        only(image, 2),
        only(case.joints, 3),
        {h: score if h == clip.hand else np.zeros(n) for h in HANDS},
    )
