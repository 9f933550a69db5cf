"""Detections: the hands that a detector found in a video, an image or a folder of images."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError, NoHandError
from handtrack.files.npz import read_npz
from handtrack.files.pictures import pictures_in
from handtrack.files.whole import whole_file
from handtrack.hand.skeleton import HANDS, N_JOINTS, Hand
from handtrack.sequences.hands import HandChoice, label_hands
from handtrack.sequences.picture import Picture
from handtrack.sequences.sequence import Sequence
from handtrack.video.detector import Detection, Detector, MediaPipeDetector
from handtrack.video.hand_tracks import HandTracks
from handtrack.video.media import pictures

Array = NDArray[np.float64]


SIZES_DIFFER = "its pictures are of several sizes, so of several lenses: its joints alone are used"


@dataclass(frozen=True, eq=False)
class Detections:
    """Both hands of one person in the T frames of one source.

    Attributes:
        source: the file or folder.
        size: (width, height) of the pictures [px]; of images, of the first.
        time_ns: (T,) int64; frame_index: (T,) int64.
        image: hand -> (T, 21, 2) [px], NaN where it was not found (see `Detection.image`).
        world: hand -> (T, 21, 3) [m], NaN where it was not found.
        score: hand -> (T,) 0..1, 0 where it was not found.
        fps: the rate that was given instead of the source's times, or None.
        still: whether the pictures are images of which nothing says that they follow one another.
        detector: whose landmarks these are, "mediapipe", or "" of a detector that is not known.
        sure: hand -> (T, 21) 0..1 of each joint in the picture; None: as `score` says.
        name: short name; "": by the source.
        one_size: whether all pictures are of that size, so that one lens may have taken them.
    """

    source: str
    size: tuple[int, int]
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    image: dict[Hand, Array]
    world: dict[Hand, Array]
    score: dict[Hand, Array]
    fps: float | None = None
    still: bool = False
    detector: str = "mediapipe"
    sure: dict[Hand, Array] | None = None
    name: str = ""
    one_size: bool = True

    def __len__(self) -> int:
        return len(self.time_ns)

    @property
    def hands(self) -> tuple[Hand, ...]:
        """The hands that were found at all, left first."""
        return tuple(h for h in HANDS if self.score[h].any())

    def sequences(self) -> list[Sequence]:
        """The world joints of each hand found, as sequences.

        They are around the hand's own middle: how the hand moves through the room is not in
        them.
        """
        name = Path(self.source).stem
        found = self.hands
        return [
            Sequence(
                time_ns=self.time_ns,
                joints=self.world[hand],
                confidence=np.repeat(self.score[hand][:, None], N_JOINTS, axis=1),
                hand=hand,
                frame_index=self.frame_index,
                name=f"{name} {hand}" if len(found) > 1 else name,
                source=self.source,
                detector=self.detector,
                picture=self.picture(hand) if self.one_size else None,
                notes=() if self.one_size else (SIZES_DIFFER,),
            )
            for hand in found
            if np.isfinite(self.world[hand]).all((1, 2)).any()
        ]

    def picture(self, hand: Hand) -> Picture:
        """What the pictures show of a hand."""
        score = np.repeat(self.score[hand][:, None], N_JOINTS, axis=1)
        sure = score if self.sure is None else self.sure[hand]
        seen = np.isfinite(self.image[hand]).all(-1)
        return Picture(self.image[hand], np.where(seen, sure, 0.0), self.size)

    def save(self, path: Path) -> None:
        """Write an .npz that `handtrack track` and `load` read.

        Keys: `time_ns`, `frame_index`, `size_px` (2,), `source`, `detector` if it is known; for
        each hand found `HAND_joints_m` (T, 21, 3), `HAND_image_px` (T, 21, 2) and
        `HAND_confidence` (T,).

        Raises:
            HandtrackError: it cannot be written.
        """
        arrays: dict[str, Any] = {
            "time_ns": self.time_ns,
            "frame_index": self.frame_index,
            "size_px": self.size,
            "source": self.source,
            **({"detector": self.detector} if self.detector else {}),
            **({} if self.one_size else {"one_size": False}),
        }
        for hand in self.hands:
            arrays[f"{hand}_joints_m"] = self.world[hand].astype(np.float32)
            arrays[f"{hand}_image_px"] = self.image[hand].astype(np.float32)
            arrays[f"{hand}_confidence"] = self.score[hand].astype(np.float32)
        with whole_file(path) as part, part.open("wb") as stream:
            np.savez_compressed(stream, **arrays)


def detect(
    source: Path,
    detector: Detector | None = None,
    model: Path | None = None,
    fps: float | None = None,
    frames: tuple[int, int] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Detections:
    """Find the hands of one person in a video, an image or a folder of images.

    Args:
        source: what `media.kind` knows.
        detector: MediaPipe's by default; it is closed at the end only if it is made here.
        model: for MediaPipe, as in `MediaPipeDetector`.
        fps: frames per second, instead of the video's time stamps; with it images are those of
            a clip, without it unrelated pictures.
        frames: first and last frame to look at, both included.
        progress: called with the number of frames done.

    Returns:
        What was found; frames without a hand are NaN.

    Raises:
        InputError: the source cannot be read, or no frame lies in `frames`.
        NoHandError: no hand in any frame.
        SettingsError: MediaPipe or its model is missing.
    """
    own = detector is None
    name = "mediapipe" if own or isinstance(detector, MediaPipeDetector) else ""
    # images become a clip by a rate
    still = pictures_in(source) != "video" and fps is None
    shown = pictures(source, fps)
    # what cannot be read is told before a detector is asked for
    first = list(islice(shown, 1))
    detector = detector or MediaPipeDetector(model, still=still)
    tracks = HandTracks(linked=not still)
    rows: list[list[tuple[int, Detection]]] = []
    times: list[int] = []
    index: list[int] = []
    sizes: list[tuple[int, int]] = []
    try:
        for picture in chain(first, shown):
            if frames is not None and picture.index < frames[0]:
                continue
            if frames is not None and picture.index > frames[1]:
                break
            sizes.append((picture.rgb.shape[1], picture.rgb.shape[0]))
            rows.append(tracks.add(detector.detect(picture.rgb, picture.time_ns)))
            times.append(picture.time_ns)
            index.append(picture.index)
            if progress is not None:
                progress(len(rows))
    finally:
        if own:
            detector.close()
    if not rows:
        where = "" if frames is None else f" in frames {frames[0]}:{frames[1]}"
        raise InputError(f"no picture{where}", source)
    if not any(rows):
        raise NoHandError(f"{source}: no hand was found in {len(rows)} frames")
    found = _gathered(source, sizes[0], times, index, [tracks.named(row) for row in rows])
    one_size = len(set(sizes)) == 1
    return replace(found, fps=fps, still=still, detector=name, one_size=one_size)


def labelled(found: Detections, choice: HandChoice = "auto") -> list[Sequence]:
    """The joints of detected hands, labelled as the user wants them.

    Args:
        found: they.
        choice: as in `handtrack.load`.
    """
    labels: list[Hand | None] = list(found.hands)
    tagged = [False] * len(labels)
    return label_hands(found.sequences(), labels, tagged, choice, len(labels) > 1)


def _gathered(
    source: Path,
    size: tuple[int, int],
    times: list[int],
    index: list[int],
    rows: list[dict[Hand, Detection]],
) -> Detections:
    n = len(rows)
    image: dict[Hand, Array] = {h: np.full((n, N_JOINTS, 2), np.nan) for h in HANDS}
    world: dict[Hand, Array] = {h: np.full((n, N_JOINTS, 3), np.nan) for h in HANDS}
    score: dict[Hand, Array] = {h: np.zeros(n) for h in HANDS}
    for t, row in enumerate(rows):
        for hand, found in row.items():
            image[hand][t] = found.image
            if found.world is not None:
                world[hand][t] = found.world
            score[hand][t] = found.score
    return Detections(str(source), size, np.array(times), np.array(index), image, world, score)


def saved_detections(path: Path, frames: tuple[int, int] | None = None) -> Detections | None:
    """What `Detections.save` wrote, joints and pictures; None where a file is another.

    Args:
        path: of any file.
        frames: first frame and the one after the last, by row.

    Raises:
        InputError: the file is damaged, an array in it has another shape, or no frame is left.
    """
    if path.suffix.lower() != ".npz" or not path.is_file():
        return None
    names = {f"{hand}_{what}" for hand in HANDS for what in ("joints_m", "image_px", "confidence")}
    known = {"time_ns", "frame_index", "size_px", "source", "detector"}
    arrays, _ = read_npz(path, path, names | known)
    if not {"time_ns", "frame_index", "size_px"} <= set(arrays):
        return None
    if not any(f"{hand}_image_px" in arrays for hand in HANDS):
        return None
    n = len(np.atleast_1d(arrays["time_ns"]))
    rows = np.arange(n)[slice(*frames)] if frames is not None else np.arange(n)
    if not len(rows):
        raise InputError(f"there is no frame in {frames}, the file has {n}", path)

    def of(hand: Hand, what: str, shape: tuple[int, ...], empty: float) -> Array:
        value = arrays.get(f"{hand}_{what}")
        if value is None:
            return np.full((len(rows), *shape), empty)
        if value.shape != (n, *shape):
            raise InputError(f"{hand}_{what} has shape {value.shape}, expected {(n, *shape)}", path)
        return np.asarray(value, dtype=np.float64)[rows]

    found = Detections(
        str(path),
        _size(arrays["size_px"], path),
        np.asarray(arrays["time_ns"], dtype=np.int64)[rows],
        np.asarray(arrays["frame_index"], dtype=np.int64)[rows],
        {hand: of(hand, "image_px", (N_JOINTS, 2), np.nan) for hand in HANDS},
        {hand: of(hand, "joints_m", (N_JOINTS, 3), np.nan) for hand in HANDS},
        {hand: np.nan_to_num(of(hand, "confidence", (), 0.0)) for hand in HANDS},
    )
    return replace(found, detector=str(arrays.get("detector", "")))


def _size(value: Any, path: Path) -> tuple[int, int]:
    """(width, height) [px].

    Raises:
        InputError: it is none.
    """
    size = np.atleast_1d(value)
    if size.shape != (2,) or size.dtype.kind not in "iuf" or not (size > 0).all():
        raise InputError(f"size_px is {size.tolist()}, expected width and height", path)
    return int(size[0]), int(size[1])
