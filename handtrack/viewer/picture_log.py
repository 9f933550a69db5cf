"""A camera's pictures in Rerun, with the joints that were seen in them and those fitted."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from handtrack.hand.skeleton import BONES
from handtrack.viewer import style

if TYPE_CHECKING:
    import rerun as rr

Array = NDArray[np.float64]

BATCH = 16
"""Pictures sent at a time."""


@dataclass(frozen=True)
class PictureView:
    """What one camera saw, over T pictures.

    Attributes:
        name: of the camera: its place in the viewer.
        time_ns, frame_index: (T,) int64.
        jpegs: gives the T pictures one by one, as JPEG files.
        joints: skeleton (see `viewer.style`) of each hand -> (T, 21, 2) in the pictures [px],
            NaN = not there; by the hand's topic.
    """

    name: str
    time_ns: NDArray[np.int64]
    frame_index: NDArray[np.int64]
    jpegs: Callable[[], Iterator[bytes]]
    joints: Mapping[str, Mapping[int, Array]]


def log_pictures(
    recording: rr.RecordingStream,
    views: Sequence[PictureView],
    indexes: Callable[[NDArray[np.int64], NDArray[np.int64]], list[Any]],
    begun: set[str] | None = None,
) -> None:
    """Send pictures under `pictures/NAME`, the joints under `pictures/NAME/HAND/KIND`.

    Args:
        recording: where to.
        views: the cameras.
        indexes: makes time columns of frame numbers and times.
        begun: what was sent of that which stays, where more of the same cameras follows; what is
            sent now is added.
    """
    begun = set() if begun is None else begun
    for view in views:
        _joints(recording, view, indexes, begun)
        blobs: list[bytes] = []
        first = 0
        for jpeg in view.jpegs():
            blobs.append(jpeg)
            if len(blobs) == BATCH:
                _send(recording, view, indexes, first, blobs)
                first, blobs = first + len(blobs), []
        _send(recording, view, indexes, first, blobs)


def _send(
    recording: rr.RecordingStream,
    view: PictureView,
    indexes: Callable[[NDArray[np.int64], NDArray[np.int64]], list[Any]],
    first: int,
    blobs: list[bytes],
) -> None:
    import rerun as rr

    if not blobs:
        return
    rows = slice(first, first + len(blobs))
    columns = rr.EncodedImage.columns(blob=blobs, media_type=["image/jpeg"] * len(blobs))
    times = indexes(view.frame_index[rows], view.time_ns[rows])
    recording.send_columns(f"pictures/{view.name}", times, columns)


def _joints(
    recording: rr.RecordingStream,
    view: PictureView,
    indexes: Callable[[NDArray[np.int64], NDArray[np.int64]], list[Any]],
    begun: set[str],
) -> None:
    import rerun as rr

    entity = f"pictures/{view.name}"
    descriptions = [
        rr.ClassDescription(
            info=rr.AnnotationInfo(id=id_, label=label, color=colour),
            keypoint_connections=BONES,
        )
        for id_, (label, colour, _) in style.SKELETONS.items()
    ]
    if entity not in begun:
        recording.log(entity, rr.AnnotationContext(descriptions), static=True)
        begun.add(entity)
    times = indexes(view.frame_index, view.time_ns)
    for topic, kinds in view.joints.items():
        for class_id, joints in kinds.items():
            place = f"{entity}/{topic}/{style.SKELETONS[class_id][0]}"
            static = rr.Points2D.from_fields(class_ids=class_id, radii=-2.0, show_labels=False)
            if place not in begun:
                recording.log(place, static, static=True)
                begun.add(place)
            present = np.isfinite(joints).all(-1)
            columns = rr.Points2D.columns(
                positions=joints[present].astype(np.float32), keypoint_ids=np.nonzero(present)[1]
            )
            recording.send_columns(place, times, columns.partition(present.sum(1)))
