"""The picture that leads the README: a rendered hand, and what handtrack draws over it.

    python -m tools.docs.overlay_picture OUT.jpg

Needs the extra `video`, and an OpenGL driver (a software one will do).
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.cli import run
from tools.bench.rendered import motion, rig
from tools.bench.rendered.build import moved, plans
from tools.bench.rendered.people import subject
from tools.bench.rendered.raster import Raster
from tools.bench.rendered.scene import Scene

Rgb = NDArray[np.uint8]

CLIP = 4
"""Of the split to tune on: it moves as the sample does."""
STEP = 3
"""Of its pictures every third is used."""
SHOWN = (0.15, 0.5, 0.85)
"""Where in the clip the pictures are from."""
WIDTH = 320
"""Of each of them [px]."""
QUALITY = 82


def rendered(clip: int) -> list[Rgb]:
    """The pictures of a clip's first camera."""
    plan = plans("tune")[clip]
    person = subject(plan.subject)
    movement = moved(plan, person)
    cameras = rig.arc(np.random.default_rng([plan.seed, 2]), 1)
    scene = Scene(Raster(rig.SIZE), person, cameras, [plan.seed, 3])
    return [np.asarray(row[0], np.uint8) for row in scene.pictures(movement)][::STEP]


def write_video(path: Path, pictures: list[Rgb]) -> None:
    """Pictures as a video of the clip's rate."""
    import av

    with av.open(str(path), "w") as container:
        stream: Any = container.add_stream(
            "h264", rate=round(motion.FPS / STEP), options={"crf": "12"}
        )
        stream.height, stream.width = pictures[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        for rgb in pictures:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(rgb, format="rgb24")))
        container.mux(stream.encode())


def read_video(path: Path) -> list[Rgb]:
    """The pictures of a video."""
    import av

    with av.open(str(path)) as container:
        frames = container.decode(video=0)
        return [np.asarray(frame.to_ndarray(format="rgb24"), np.uint8) for frame in frames]


def main(arguments: list[str] | None = None) -> None:
    """Render, track, draw, and put pictures and overlays below one another."""
    from PIL import Image

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--clip", type=int, default=CLIP)
    options = parser.parse_args(arguments)
    seen = rendered(options.clip)
    with tempfile.TemporaryDirectory(prefix="handtrack-overlay-") as folder:
        clip, drawn = Path(folder) / "clip.mp4", Path(folder) / "drawn.mp4"
        write_video(clip, seen)
        command = ["track", str(clip), "-o", f"{folder}/clip.mcap", "-q"]
        if run([*command, "--overlay", str(drawn)]):
            raise SystemExit("the clip was not tracked")
        over = read_video(drawn)
    frames = [round(share * (len(seen) - 1)) for share in SHOWN]
    rows = [np.concatenate([kind[i] for i in frames], axis=1) for kind in (seen, over)]
    whole = Image.fromarray(np.concatenate(rows))
    height = round(whole.height * WIDTH * len(SHOWN) / whole.width)
    small = whole.resize((WIDTH * len(SHOWN), height), Image.Resampling.LANCZOS)
    small.save(options.out, quality=QUALITY, optimize=True)


if __name__ == "__main__":
    main()
