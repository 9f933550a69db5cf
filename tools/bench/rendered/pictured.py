"""One camera's joints and its picture together, as `handtrack track` fits them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.sequences.picture import Picture
from handtrack.tracking.settings import TrackSettings
from handtrack.video.pictured import fitted
from tools.bench.rendered.cases import TRIANGULATED, Case


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
