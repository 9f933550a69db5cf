"""Small videos and images, made by PyAV, and a detector that is told what to see."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np

from handtrack.hand.model import HandModel
from handtrack.video.detector import Detection


def write_video(path: Path, ticks: list[int], size: tuple[int, int] = (64, 48)) -> None:
    """A video whose frame i is grey, 10 + 10 i bright, at ticks[i] milliseconds."""
    import av

    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=1000)
        stream.width, stream.height = size
        stream.pix_fmt = "yuv420p"
        stream.codec_context.time_base = Fraction(1, 1000)
        for i, tick in enumerate(ticks):
            grey = np.full((size[1], size[0], 3), 10 + 10 * i, dtype=np.uint8)
            frame = av.VideoFrame.from_ndarray(grey, format="rgb24")
            frame.pts, frame.time_base = tick, Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())


def write_image(path: Path, bright: int) -> None:
    import av

    with av.open(str(path), "w", format="image2") as container:
        stream = container.add_stream("png" if path.suffix == ".png" else "mjpeg")
        stream.width, stream.height = 64, 48
        stream.pix_fmt = "rgb24" if path.suffix == ".png" else "yuvj420p"
        grey = np.full((48, 64, 3), bright, dtype=np.uint8)
        container.mux(stream.encode(av.VideoFrame.from_ndarray(grey, format="rgb24")))
        container.mux(stream.encode())


def seen(hand: str, x: float, score: float = 0.9) -> Detection:
    """A hand of 100 px palm whose middle is about x px from the left."""
    rng = np.random.default_rng(3)
    image = rng.uniform(-50, 50, (21, 2)) + np.array([x, 200])
    image[0], image[9] = (x, 250), (x, 150)
    model = HandModel.default(hand)
    world = model.joints(model.mean_angles) + 0.001
    return Detection(hand, score, image, world + rng.normal(0, 0.001, (21, 3)))


class Told:
    """A detector that reports what it is told, picture by picture."""

    def __init__(self, *rows: list[Detection]):
        self.rows, self.pictures = list(rows), []
        self.closed = False

    def detect(self, rgb, time_ns):
        self.pictures.append((rgb, time_ns))
        return self.rows[len(self.pictures) - 1]

    def close(self):
        self.closed = True
