"""Detections of hands whose true joints are known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.cameras.camera import Camera
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import HANDS, Hand
from handtrack.video.detections import Detections
from handtrack.video.placing import assumed_camera

Array = NDArray[np.float64]
SIZE = (1280, 720)


def made(
    n: int = 40,
    shake_deg: float = 12.0,
    noise_px: float = 1.0,
    hand: Hand = "right",
    longer: float = 1.0,
) -> tuple[ht.HandModel, Array, Camera, Detections]:
    """Detections of a moving hand: joints of wrong turn, size and bend, a picture nearly right.

    Args:
        n: frames.
        shake_deg: how far the joints are turned away.
        noise_px: of the picture.
        hand: which.
        longer: by how much the lens is longer than the assumed one.

    Returns:
        The hand, its joints (n, 21, 3), the camera, and what a detector says.
    """
    rng, model = np.random.default_rng(5), ht.HandModel.default(hand)
    t = np.arange(n)
    low, high = model.limits.lower, model.limits.upper
    share = 0.5 + 0.3 * np.sin(t[:, None] * 0.15 + rng.uniform(0, 6, 20))
    angles = model.limits.clamp(low + share * (high - low))
    turns = np.array([vector_to_matrix([0.3, 0.1 * np.sin(0.1 * i), 2.0]) for i in t])
    places = np.stack([0.05 * np.sin(0.1 * t), 0.02 * np.cos(0.1 * t), 0.5 + 0.002 * t], 1)
    truth = model.joints(angles, turns, places)
    camera = assumed_camera(SIZE)
    matrix = camera.matrix * np.array([[longer], [longer], [1.0]])
    matrix[:2, 2] = camera.matrix[:2, 2]
    camera = replace(camera, matrix=matrix)
    image = camera.project(truth) + rng.normal(0, noise_px, (n, 21, 2))
    bent = model.limits.clamp(angles + np.deg2rad(5.0) * rng.normal(size=(n, 20)))
    wrong = vector_to_matrix(np.deg2rad([shake_deg, shake_deg, 0.0]))
    world = 1.1 * model.joints(bent, wrong @ turns)
    score = np.ones(n)
    found = Detections(
        "made.npz",
        SIZE,
        (t * 33_333_333).astype(np.int64),
        t.astype(np.int64),
        {h: image if h == hand else np.full((n, 21, 2), np.nan) for h in HANDS},
        {h: world if h == hand else np.full((n, 21, 3), np.nan) for h in HANDS},
        {h: score if h == hand else np.zeros(n) for h in HANDS},
        detector="",
    )
    return model, truth, camera, found
