"""Some of the benchmark's pictures in one file, to be looked at."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tools.bench.rendered import rig
from tools.bench.rendered.build import moved, plans
from tools.bench.rendered.motion import cut
from tools.bench.rendered.people import subject
from tools.bench.rendered.raster import Raster
from tools.bench.rendered.scene import Scene


def sheet(path: Path, clips: list[int]) -> None:
    """A row of three cameras for each clip of the tune split, from the middle of its movement."""
    from PIL import Image

    raster = Raster(rig.SIZE)
    rows = []
    for number in clips:
        plan = plans("tune")[number]
        person = subject(plan.subject)
        movement = moved(plan, person)
        cameras = rig.arc(np.random.default_rng([plan.seed, 2]), 3)
        scene = Scene(raster, person, cameras, [plan.seed, 3])
        (pictures,) = scene.pictures(cut(movement, len(movement) // 2, 1))
        rows.append(np.concatenate(pictures, axis=1))
    Image.fromarray(np.concatenate(rows)).save(path)
