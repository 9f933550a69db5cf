"""One hand as calibrated cameras saw it."""

from __future__ import annotations

from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.cameras.triangulate import triangulate
from handtrack.detectors.profile import Profile
from handtrack.errors import InputError
from handtrack.fitting.images import shift_to_rays
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.sequences.picture import Picture
from handtrack.sequences.sequence import Sequence
from handtrack.video.detections import Detections

Array = NDArray[np.float64]

RATE_TOLERANCE = 0.01
"""Frame rates that differ by more than this share are not those of one rig."""
ABSURD_PX = 40.0
"""Views that disagree by more than this (median) are not those of this calibration."""


@dataclass(frozen=True, eq=False)
class Views:
    """One hand in the T frames of C synchronised cameras.

    Attributes:
        hand, name, source: as in a Sequence.
        cameras: C of them.
        time_ns, frame_index: (T,) int64.
        image: (T, C, 21, 2) [px], NaN where it was not seen.
        score: (T, C) how sure the detector was, 0..1.
        points: (T, 21, 3) [m] in the world: triangulated, or of a single camera its world
            joints, moved onto the rays of the picture. NaN where too little was seen, or nothing
            says how deep the hand is.
        notes: what the user should know.
        sure: (T, C, 21) of each joint, instead of the score, or None.
        detector: whose landmarks they are, as in `Detections`.
    """

    hand: Hand
    name: str
    source: str
    cameras: tuple[Camera, ...]
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    image: Array
    score: Array
    points: Array
    notes: tuple[str, ...] = ()
    sure: Array | None = None
    detector: str = "mediapipe"

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def weights(self) -> Array:
        """(T, C, 21): the score where a joint was seen, else 0."""
        sure = self.score[..., None] if self.sure is None else self.sure
        return np.asarray(np.isfinite(self.image).all(-1) * sure)

    @property
    def seen_by(self) -> str:
        """Name of the profile whose landmarks the points are; "" where none is known."""
        return f"{self.detector}-3d" if self.detector and len(self.cameras) > 1 else self.detector

    def corrected(self, profile: Profile | None, share: float = 1.0) -> Views:
        """With the points, and what each camera saw, as the detector's profile corrects the points.

        Of one camera its points are no place in the picture: only several are meant.

        Args:
            profile: the detector's; None, or one that corrects nothing: as they are.
            share: of the corrections.
        """
        if profile is None or profile.correction is None:
            return self
        whole = self.sequence().corrected(profile).joints
        points = self.points + share * (whole - self.points)
        moved = [c.project(points) - c.project(self.points) for c in self.cameras]
        image = self.image + np.nan_to_num(np.stack(moved, 1))
        return replace(self, image=image, points=points)

    def sequence(self) -> Sequence:
        """The points as a joint sequence, by which the hand is calibrated."""
        return Sequence(
            time_ns=self.time_ns,
            joints=self.points,
            confidence=np.repeat(self.score.max(1)[:, None], N_JOINTS, axis=1),
            hand=self.hand,
            frame_index=self.frame_index,
            name=self.name,
            source=self.source,
            notes=self.notes,
            detector=self.seen_by,
        )


def views_of(detections: Items[Detections], cameras: Items[Camera]) -> list[Views]:
    """What synchronised cameras saw, hand by hand.

    Where every camera saw a single hand it is the same one, whatever the detector called it.

    Args:
        detections: of each camera's video, in the order of the cameras.
        cameras: their calibration.

    Raises:
        InputError: not as many cameras as videos, videos of different length or rate, pictures
            of another size than was calibrated, or a calibration that does not belong to them.
    """
    _check(detections, cameras)
    first = detections[0]
    single = all(len(d.hands) == 1 for d in detections)
    found = []
    for hand in HANDS:
        named: list[Hand] = [d.hands[0] if single else hand for d in detections]
        if single and hand != _by_votes(detections):
            continue
        score = np.stack([d.score[h] for d, h in zip(detections, named, strict=True)], 1)
        if not score.any():
            continue
        image = np.stack([d.image[h] for d, h in zip(detections, named, strict=True)], 1)
        notes: tuple[str, ...] = ()
        if len(set(named)) > 1:
            notes = (f"the cameras' detections were called left and right: taken as {hand}",)
        if len(cameras) > 1:
            _check_belongs(image, cameras, detections)
            points, _ = triangulate(
                cameras, image.transpose(1, 0, 2, 3), np.repeat(score.T[..., None], 21, -1)
            )
        else:
            points = _onto_rays(first.world[named[0]], image[:, 0], cameras[0])
        if len(cameras) > 1 and not np.isfinite(points).any():
            continue
        found.append(
            Views(
                hand=hand,
                name=first.name or Path(first.source).stem,
                source=first.source,
                cameras=tuple(cameras),
                time_ns=first.time_ns,
                frame_index=first.frame_index,
                image=image,
                score=score,
                points=points,
                notes=notes,
                sure=_sure(detections, named),
                detector=first.detector,
            )
        )
    if not found:
        raise InputError("no hand is seen by two cameras at once", first.source)
    if len(found) > 1:
        found = [replace(v, name=f"{v.name} {v.hand}") for v in found]
    return found


def view_of(sequence: Sequence, picture: Picture, camera: Camera) -> Views:
    """What one camera saw of a hand.

    Args:
        sequence: the camera's joints of it, in its axes.
        picture: what its pictures show of them.
        camera: the camera.
    """
    return Views(
        hand=sequence.hand,
        name=sequence.name,
        source=sequence.source,
        cameras=(camera,),
        time_ns=sequence.time_ns,
        frame_index=sequence.frame_index,
        image=picture.image[:, None],
        score=picture.sure.max(1)[:, None],
        points=_onto_rays(sequence.joints, picture.image, camera),
        notes=sequence.notes,
        sure=picture.sure[:, None],
        detector=sequence.detector,
    )


def _sure(detections: Items[Detections], named: list[Hand]) -> Array | None:
    """(T, C, 21) of each joint, where all detectors say it."""
    each = [d.sure[h] for d, h in zip(detections, named, strict=True) if d.sure is not None]
    return np.stack(each, 1) if len(each) == len(detections) else None


def _by_votes(detections: Items[Detections]) -> Hand:
    votes = {h: sum(float(d.score[h].sum()) for d in detections) for h in HANDS}
    return max(HANDS, key=lambda h: votes[h])


def _check(detections: Items[Detections], cameras: Items[Camera]) -> None:
    if len(detections) != len(cameras):
        names = ", ".join(c.name for c in cameras)
        raise InputError(
            f"{len(detections)} videos for {len(cameras)} calibrated cameras ({names}):"
            " give them in the order of the calibration"
        )
    first = detections[0]
    for d in detections[1:]:
        if len(d) != len(first):
            raise InputError(
                f"{len(d)} frames, {first.source} has {len(first)}: the cameras must have run"
                " together",
                d.source,
            )
        rates = [_rate(first), _rate(d)]
        if abs(rates[0] - rates[1]) > RATE_TOLERANCE * rates[0]:
            raise InputError(
                f"{rates[1]:.2f} frames/s, {first.source} has {rates[0]:.2f}: the cameras must"
                " have run together",
                d.source,
            )
    for d, camera in zip(detections, cameras, strict=True):
        check_size(camera, d.size, d.source)


def check_size(camera: Camera, size: tuple[int, int], source: str) -> None:
    """Refuse pictures of another size than a camera was calibrated for.

    Raises:
        InputError: they are.
    """
    if camera.size is not None and camera.size != size:
        raise InputError(
            f"the pictures are {size[0]} x {size[1]}, camera {camera.name} was"
            f" calibrated for {camera.size[0]} x {camera.size[1]}",
            source or None,
        )


def _rate(d: Detections) -> float:
    return float(1e9 / np.median(np.diff(d.time_ns))) if len(d) > 1 else 1.0


def _check_belongs(image: Array, cameras: Items[Camera], detections: Items[Detections]) -> None:
    """Refuse a calibration by which the views do not see the same points."""
    for a, b in combinations(range(len(cameras)), 2):
        pair = image[:, [a, b]]
        both = np.isfinite(pair).all((1, 3))
        if both.sum() < N_JOINTS:
            continue
        seen = pair.transpose(1, 0, 2, 3)[:, both]
        points, _ = triangulate([cameras[a], cameras[b]], seen, inlier_px=np.inf, cauchy_px=np.inf)
        error = np.stack(
            [
                np.linalg.norm(cameras[c].project(points) - seen[i], axis=-1)
                for i, c in enumerate((a, b))
            ]
        )
        # points behind a camera are as wrong as can be
        median = float(np.median(np.where(np.isfinite(error), error, np.inf)))
        if median > ABSURD_PX:
            raise InputError(
                f"the calibration does not belong to these views: by cameras {cameras[a].name}"
                f" and {cameras[b].name} the same joints are {median:.0f} px apart",
                detections[b].source,
            )


def _onto_rays(world: Array, image: Array, camera: Camera) -> Array:
    """(T, 21, 3): a camera's own world joints, moved to where its picture shows them."""
    out = np.full_like(world, np.nan)
    seen = np.isfinite(world).all((1, 2)) & np.isfinite(image).all((1, 2))
    for t in np.flatnonzero(seen):
        shift = shift_to_rays(world[t], camera.undistorted(image[t]))
        out[t] = (world[t] + shift - camera.translation) @ camera.rotation
    return out
