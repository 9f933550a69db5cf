"""Landmarks that another program found in pictures, as the detections of a video are."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from handtrack.cameras.camera import Camera
from handtrack.errors import InputError
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.sequences.chirality import DECIDED, chirality
from handtrack.sequences.hands import OTHER
from handtrack.sequences.picture_landmarks import PictureLandmarks
from handtrack.sequences.size import palm_length
from handtrack.video.detections import Array, Detections
from handtrack.video.placing import ASSUMED

HandChoice = Literal["auto", "left", "right", "swap"]
PALM = 0.088
"""[m] An adult's, to which a guessed relief is brought: fits start from it, no more."""


@dataclass(frozen=True, eq=False)
class Found:
    """One person's hands in one camera's pictures.

    Attributes:
        detections: as a detector gives them.
        notes: what the user should know.
        named: whether the file, or the user, says which hand it is.
    """

    detections: Detections
    notes: tuple[str, ...]
    named: bool = True


def camera_of_view(size: tuple[int, int], fov_deg: float) -> Camera:
    """A camera without lens distortion by its picture's size [px] and how wide it sees.

    Args:
        size: width and height.
        fov_deg: the horizontal field of view.
    """
    width, height = size
    focal = width / (2 * np.tan(np.deg2rad(fov_deg) / 2))
    matrix = np.array([[focal, 0, width / 2], [0, focal, height / 2], [0, 0, 1]])
    return Camera(ASSUMED, matrix, np.zeros(0), np.eye(3), np.zeros(3), size)


def found_in(
    landmarks: Iterable[PictureLandmarks],
    size: tuple[int, int] | None,
    choice: HandChoice = "auto",
) -> list[Found]:
    """Detections of each person whose landmarks were stored.

    Args:
        landmarks: of one camera.
        size: (width, height) of its pictures [px]; None: not known.
        choice: which hand, as the user says.

    Raises:
        InputError: landmarks are shares of the pictures' sides, whose size nobody says; or far
            outside of pictures of that size.
    """
    people: list[dict[Hand, PictureLandmarks]] = []
    notes: list[list[str]] = []
    for one in landmarks:
        hand, said = _hand_of(one, choice)
        if choice in HANDS and hand != choice:
            continue
        at = next((i for i, p in enumerate(people) if hand not in p and _name(p) == one.name), None)
        if at is None:
            people.append({})
            notes.append([])
            at = len(people) - 1
        people[at][hand] = one
        notes[at] += [*one.notes, *said]
    return [
        Found(
            _detections(hands, size),
            tuple(dict.fromkeys(said)),
            choice in HANDS or all(one.hand is not None for one in hands.values()),
        )
        for hands, said in zip(people, notes, strict=True)
    ]


def _name(hands: dict[Hand, PictureLandmarks]) -> str:
    return next(iter(hands.values())).name


def _hand_of(one: PictureLandmarks, choice: HandChoice) -> tuple[Hand, list[str]]:
    """Which hand it is, and what to say of that."""
    if one.hand is not None:
        return (OTHER[one.hand] if choice == "swap" else one.hand), []
    for hand in HANDS:
        if choice == hand:
            return hand, []
    relief = one.relief((1000, 1000))
    bends = 0.0 if relief is None else chirality(relief)
    if abs(bends) > DECIDED:
        side: Hand = "right" if bends > 0 else "left"
        return side, [f"hand not named: {side} by its fingers' bend (--hand)"]
    return "right", [
        "hand not named, and a picture alone does not tell it: taken as right (--hand left)"
    ]


def _detections(hands: dict[Hand, PictureLandmarks], size: tuple[int, int] | None) -> Detections:
    first = next(iter(hands.values()))
    if size is None:
        raise InputError(
            "landmarks are shares of the picture's sides: --image-size WxH says how large it is"
            if first.shares
            else "no size of the pictures is known: --image-size WxH says it",
            first.source,
        )
    index = np.unique(np.concatenate([one.frame_index for one in hands.values()]))
    times = np.zeros(len(index), dtype=np.int64)
    blank: dict[Hand, Array] = {h: np.full((len(index), N_JOINTS, 2), np.nan) for h in HANDS}
    world: dict[Hand, Array] = {h: np.full((len(index), N_JOINTS, 3), np.nan) for h in HANDS}
    sure: dict[Hand, Array] = {h: np.zeros((len(index), N_JOINTS)) for h in HANDS}
    for hand, one in hands.items():
        rows = np.searchsorted(index, one.frame_index)
        times[rows] = one.time_ns
        blank[hand][rows], sure[hand][rows] = one.pixels(size), one.sure
        relief = one.relief(size)
        if relief is not None:
            world[hand][rows] = _about_a_palm(relief)
    _check_inside(blank, size, first.source)
    deep = any(one.depth is not None for one in hands.values())
    return Detections(
        source=first.source,
        size=size,
        time_ns=times,
        frame_index=index,
        image=blank,
        world=world,
        score={h: sure[h].max(1) for h in HANDS},
        detector="mediapipe" if deep else "",
        sure=sure,
        name=first.name,
    )


def _about_a_palm(relief: Array) -> Array:
    """Each frame's relief (T, 21, 3) [px] in metres, as a hand of an adult's size."""
    out = np.full_like(relief, np.nan)
    for t in np.flatnonzero(np.isfinite(relief).all((1, 2))):
        palm = palm_length(relief[t : t + 1])
        if palm > 0:
            out[t] = relief[t] * (PALM / palm)
    return out


def _check_inside(image: dict[Hand, Array], size: tuple[int, int], source: str) -> None:
    """Refuse landmarks of which most lie outside of the picture: it is of another size.

    Raises:
        InputError: they do.
    """
    points = np.concatenate([image[h].reshape(-1, 2) for h in HANDS])
    points = points[np.isfinite(points).all(-1)]
    if len(points) and (np.median(points, axis=0) > size).any():
        far = points.max(0)
        raise InputError(
            f"landmarks reach to {far[0]:.0f}, {far[1]:.0f} px, the picture is {size[0]} x"
            f" {size[1]}: is --image-size, or the camera, another's?",
            source,
        )
