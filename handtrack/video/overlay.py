"""Pictures of the result: the hand's skin drawn over what the camera saw."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.cameras.camera import Camera
from handtrack.errors import HandtrackError, SettingsError
from handtrack.files.whole import whole_file
from handtrack.hand.skeleton import BONES
from handtrack.tracking.track import Track
from handtrack.video.media import opencv, pictures
from handtrack.video.placing import Seen

Array = NDArray[np.float64]
Rgb = NDArray[np.uint8]

Colour = tuple[int, int, int]

SKINS: dict[str, Colour] = {
    "blue": (92, 160, 235),
    "green": (110, 205, 130),
    "violet": (176, 132, 232),
    "grey": (190, 194, 200),
    "skin": (232, 176, 142),
}
"""Colours of the skin that have names."""
SKIN = {"right": SKINS["blue"], "left": SKINS["green"]}
"""Unlike anybody's, so that what is drawn is told from what was filmed."""
BONES_OF: tuple[Colour, ...] = (
    (230, 75, 65),  # thumb
    (240, 160, 40),  # index
    (70, 185, 85),  # middle
    (60, 120, 235),  # ring
    (175, 80, 215),  # little
)
"""Colours of the fingers' bones."""
STATUS: dict[str, Colour] = {
    "fitted": (130, 235, 165),
    "predicted": (250, 205, 85),
    "lost": (250, 115, 115),
}
SEEN = (255, 214, 64)
OPACITY = 0.7
# outlines are drawn to a sixteenth of a pixel
_SHIFT = 4


class Drawn(NamedTuple):
    """One hand in one picture.

    Attributes:
        hand: "left" or "right".
        vertices: (V, 3) in the world [m]; faces: (F, 3), counter-clockwise from outside.
        joints: (21, 3) in the world [m].
        seen: (21, 2) where the joints were seen [px], or None.
    """

    hand: str
    vertices: Array
    faces: NDArray[np.int32]
    joints: Array
    seen: Array | None


def draw(rgb: Rgb, camera: Camera, hands: list[Drawn], skin_colour: Colour | None = None) -> Rgb:
    """A new picture with hands drawn into it: skin, fitted bones, and the joints seen.

    Triangles that face the camera are painted from the farthest to the nearest; bones have
    their finger's colour of `BONES_OF`, skin the one given or that of the hand in `SKIN`.
    """
    cv2 = opencv()
    skin = rgb.copy()
    painted: list[tuple[float, Array, Colour]] = []
    for hand in hands:
        painted += _triangles(camera, hand, skin_colour or SKIN[hand.hand])
    for _, corners, colour in sorted(painted, key=lambda item: -item[0]):
        points = np.round(corners * (1 << _SHIFT)).astype(np.int32)
        cv2.fillConvexPoly(skin, points, colour, cv2.LINE_AA, _SHIFT)
    out: Rgb = cv2.addWeighted(skin, OPACITY, rgb, 1.0 - OPACITY, 0.0)
    thick = max(1, round(rgb.shape[1] / 640))
    for hand in hands:
        bones = camera.project(hand.joints)
        for a, b in BONES:
            if np.isfinite(bones[[a, b]]).all():
                p, q = (np.round(bones[j]).astype(int).tolist() for j in (a, b))
                cv2.line(out, p, q, BONES_OF[(b - 1) // 4], 2 * thick, cv2.LINE_AA)
        for point in hand.seen if hand.seen is not None else ():
            if np.isfinite(point).all():
                centre = np.round(point).astype(int).tolist()
                cv2.circle(out, centre, 2 * thick, SEEN, -1, cv2.LINE_AA)
    return out


def label(rgb: Rgb, frame: int, statuses: Sequence[tuple[str, str]]) -> None:
    """Write the frame's number, and (hand, status) of each, into the corner of a picture."""
    cv2 = opencv()
    size = max(0.4, rgb.shape[1] / 1280)
    line = round(30 * size)
    lines = [(f"frame {frame}", (255, 255, 255))]
    lines += [(f"{hand}: {status}", STATUS[status]) for hand, status in statuses]
    thick = max(1, round(size))
    for n, (text, colour) in enumerate(lines, 1):
        # a shadow is read on any ground
        for shift, ink in ((thick, (20, 20, 20)), (0, colour)):
            place = (line // 2 + shift, n * line + shift)
            cv2.putText(rgb, text, place, cv2.FONT_HERSHEY_SIMPLEX, size, ink, thick, cv2.LINE_AA)


def _triangles(camera: Camera, hand: Drawn, skin: Colour) -> Iterator[tuple[float, Array, Colour]]:
    """Depth, corners [px] and colour of the triangles that face the camera."""
    x = hand.vertices @ camera.rotation.T + camera.translation
    if not np.isfinite(x).all() or (x[:, 2] <= 0).any():
        return
    pixels = camera.project(hand.vertices)
    a, b, c = (x[hand.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-15)
    middle = (a + b + c) / 3
    towards = -(normal * middle).sum(1) / np.linalg.norm(middle, axis=1)
    base = np.array(skin, dtype=np.float64)
    for f in np.flatnonzero(towards > 0):
        light = 0.35 + 0.65 * towards[f]
        red, green, blue = (base * light).astype(int).tolist()
        yield float(middle[f, 2]), pixels[hand.faces[f]], (red, green, blue)


def overlay(
    path: Path,
    cameras: Sequence[Seen],
    tracks: Sequence[Track],
    progress: Callable[[int], None] | None = None,
    skin: Colour | None = None,
) -> None:
    """Draw hands over the pictures that they were tracked in; of several cameras side by side.

    The first camera's picture has the frame's number and what became of each hand.

    Args:
        path: .mp4, or .png for the first picture.
        cameras: their pictures.
        tracks: the hands.
        progress: called with the number of pictures done.
        skin: red, green, blue of the skin; blue for right hands and green for left by default.

    Raises:
        SettingsError: another ending.
        HandtrackError: it cannot be written.
    """
    if path.suffix not in (".mp4", ".png"):
        raise SettingsError(f"{path}: expected a name that ends in .mp4 or .png")
    hands = [_hands(camera, tracks) for camera in cameras]
    statuses = [
        (track.hand, dict(zip(track.frame_index.tolist(), track.status.tolist(), strict=True)))
        for track in tracks
    ]

    def drawn() -> Iterator[tuple[int, Rgb]]:
        for row in zip(
            *(pictures(camera.source, camera.found.fps) for camera in cameras), strict=False
        ):
            done = [
                draw(picture.rgb, camera.camera, of_camera.get(picture.index, []), skin)
                for picture, camera, of_camera in zip(row, cameras, hands, strict=True)
            ]
            index = row[0].index
            told = [(hand, of[index]) for hand, of in statuses if index in of]
            label(done[0], index, told)
            yield row[0].time_ns, _side_by_side(done)

    with whole_file(path) as part:
        if path.suffix == ".png":
            _write_png(part, next(drawn())[1])
        else:
            _write_mp4(part, drawn(), progress)


def _hands(camera: Seen, tracks: Sequence[Track]) -> dict[int, list[Drawn]]:
    """What is to be drawn, by the number of the picture."""
    out: dict[int, list[Drawn]] = {}
    for track in tracks:
        angles, rotation, translation, image = camera.place(track)
        joints = track.model.joints(angles, rotation, translation)
        for t in np.flatnonzero(np.isfinite(translation[:, 0])):
            skin = track.model.vertices(angles[t], rotation[t], translation[t])
            hand = Drawn(track.hand, skin, track.model.faces, joints[t], image[t])
            out.setdefault(int(track.frame_index[t]), []).append(hand)
    return out


def _side_by_side(rgbs: list[Rgb]) -> Rgb:
    """Pictures in a row, cut to the height of the lowest."""
    height = min(len(rgb) for rgb in rgbs)
    return np.concatenate([rgb[:height] for rgb in rgbs], axis=1)


def _write_png(path: Path, rgb: Rgb) -> None:
    cv2 = opencv()
    done, data = cv2.imencode(".png", rgb[..., ::-1])
    if not done:
        raise HandtrackError(f"{path}: the picture cannot be encoded")
    path.write_bytes(data.tobytes())


def _write_mp4(
    path: Path,
    drawn: Iterator[tuple[int, Rgb]],
    progress: Callable[[int], None] | None,
) -> None:
    """Times [ns] and pictures into a video."""
    import av

    base = Fraction(1, 90_000)
    with av.open(str(path), "w", format="mp4") as container:
        stream: Any = None
        for n, (time_ns, rgb) in enumerate(drawn, 1):
            if stream is None:
                stream = container.add_stream("h264", rate=90_000)
                # its colours come in blocks of two by two
                stream.height, stream.width = (side - side % 2 for side in rgb.shape[:2])
                stream.pix_fmt = "yuv420p"
                stream.codec_context.time_base = base
            rgb = np.ascontiguousarray(rgb[: stream.height, : stream.width])
            frame = av.VideoFrame.from_ndarray(rgb, format="rgb24")
            frame.pts, frame.time_base = round(time_ns * 9e-5), base
            container.mux(stream.encode(frame))
            if progress is not None:
                progress(n)
        container.mux(stream.encode())
