"""Detectors of hands in pictures: what one does, and MediaPipe's."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import HandtrackError, SettingsError, needed
from handtrack.hand.skeleton import Hand
from handtrack.video.model_file import find

Array = NDArray[np.float64]

# MediaPipe's threads print things on stderr, the first time that they do them
_NOISY_CALLS = 8


@dataclass(frozen=True, eq=False)
class Detection:
    """One hand seen in one picture.

    Attributes:
        hand: which hand the detector takes it for.
        score: how sure it is of that, 0..1.
        image: (21, 2) joints in the picture [px], x to the right, y down, the top left corner
            of the top left pixel at (0, 0).
        world: (21, 3) joints around the hand's middle [m], camera axes (x right, y down, z
            away); None where the detector gives no third dimension.
    """

    hand: Hand
    score: float
    image: Array
    world: Array | None


class Detector(Protocol):
    """What finds hands in pictures. Any class with these two methods will do."""

    def detect(self, rgb: NDArray[np.uint8], time_ns: int) -> list[Detection]:
        """The hands in a picture.

        Args:
            rgb: (height, width, 3).
            time_ns: its time, after that of the picture before [ns].
        """

    def close(self) -> None:
        """Let go of what it holds."""


class MediaPipeDetector:
    """MediaPipe Hands: two small networks, about 15 ms a picture on one CPU core.

    Tracks from picture to picture; with `still`, pictures have nothing to do with each other.
    """

    def __init__(
        self,
        model: Path | None = None,
        hands: int = 2,
        still: bool = False,
        confidence: float = 0.5,
    ):
        """Args:
        model: a `hand_landmarker.task`; the one kept in the user's cache by default.
        hands: how many hands to look for.
        still: whether each picture stands alone.
        confidence: least score of a detection and of tracking, 0..1.

        Raises:
            InputError, SettingsError: as `model_file.find`; the extra `video` is missing; or
                a setting makes no sense.
        """
        if hands < 1:
            raise SettingsError(f"hands is {hands}, expected at least 1")
        if not 0 <= confidence <= 1:
            raise SettingsError(f"confidence is {confidence}, expected 0..1")
        data = find(model).read_bytes()
        # what is said before its logging is set up cannot be turned off by settings
        with _native_log() as log:
            mp, vision, base = _mediapipe()
            self._image = mp.Image
            self._format = mp.ImageFormat.SRGB
            mode = vision.RunningMode.IMAGE if still else vision.RunningMode.VIDEO
            options = vision.HandLandmarkerOptions(
                base_options=base(model_asset_buffer=data),
                running_mode=mode,
                num_hands=hands,
                min_hand_detection_confidence=confidence,
                min_hand_presence_confidence=confidence,
                min_tracking_confidence=confidence,
            )
            try:
                self._landmarker = vision.HandLandmarker.create_from_options(options)
            except (RuntimeError, ValueError) as error:
                raise HandtrackError(f"MediaPipe cannot start: {_line(error)}{log()}") from None
        self._still = still
        self._time_ms = -1
        self._noisy = _NOISY_CALLS

    def detect(self, rgb: NDArray[np.uint8], time_ns: int) -> list[Detection]:
        """As `Detector.detect`.

        Raises:
            HandtrackError: MediaPipe failed.
        """
        image = self._image(image_format=self._format, data=np.ascontiguousarray(rgb))
        try:
            if self._noisy:
                self._noisy -= 1
                with _native_log():
                    found = self._run(image, time_ns)
            else:
                found = self._run(image, time_ns)
        except (RuntimeError, ValueError) as error:
            raise HandtrackError(f"MediaPipe failed: {_line(error)}") from None
        height, width = rgb.shape[:2]
        hands = zip(found.handedness, found.hand_landmarks, found.hand_world_landmarks, strict=True)
        return [
            Detection(
                hand="left" if label[0].category_name == "Left" else "right",
                score=float(label[0].score),
                image=np.array([(p.x * width, p.y * height) for p in image_points]),
                world=np.array([(p.x, p.y, p.z) for p in world_points]),
            )
            for label, image_points, world_points in hands
        ]

    def _run(self, image: Any, time_ns: int) -> Any:
        if self._still:
            return self._landmarker.detect(image)
        # it counts in milliseconds, and they must increase
        self._time_ms = max(self._time_ms + 1, time_ns // 1_000_000)
        return self._landmarker.detect_for_video(image, self._time_ms)

    def close(self) -> None:
        with _native_log():
            self._landmarker.close()


def _mediapipe() -> tuple[Any, Any, Any]:
    what = "finding hands in pictures needs MediaPipe"
    mediapipe = needed("mediapipe", what, "video")
    tasks = needed("mediapipe.tasks.python", what, "video")
    return mediapipe, tasks.vision, tasks.BaseOptions


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:200]


@contextmanager
def _native_log() -> Iterator[Any]:
    """Keep what native code prints on stderr; the last error line is to be had by a call."""
    sys.stderr.flush()
    with tempfile.TemporaryFile() as kept:
        before = os.dup(2)
        os.dup2(kept.fileno(), 2)

        def last() -> str:
            kept.seek(0)
            lines = kept.read().decode(errors="replace").splitlines()
            errors = [line for line in lines if line.startswith(("E0", "F0", "ERROR"))]
            return f" ({errors[-1][:200]})" if errors else ""

        try:
            yield last
        finally:
            os.dup2(before, 2)
            os.close(before)
