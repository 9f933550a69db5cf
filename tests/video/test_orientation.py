"""Pictures are turned as their EXIF or their display matrix says: all eight ways of each."""

import struct
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from clips import Told, seen

import handtrack as ht
from handtrack.video.detections import detect
from handtrack.video.media import pictures, read_image
from handtrack.video.orientation import upright, way_of_image, way_of_matrix

av = pytest.importorskip("av", reason="the extra video is not installed")

WIDTH, HEIGHT = 96, 64
# colours of the corners of the picture as it is stored: where each must lie when it is upright
CORNERS = {
    "top left": (220, 30, 30),
    "top right": (30, 200, 30),
    "bottom left": (30, 30, 220),
    "bottom right": (230, 230, 230),
}
# EXIF 2.32: the visual top and left of the stored row 0 and column 0, written out by hand
UPRIGHT = {
    1: ("top left", "top right", "bottom left", "bottom right"),
    2: ("top right", "top left", "bottom right", "bottom left"),
    3: ("bottom right", "bottom left", "top right", "top left"),
    4: ("bottom left", "bottom right", "top left", "top right"),
    5: ("top left", "bottom left", "top right", "bottom right"),
    6: ("bottom left", "top left", "bottom right", "top right"),
    7: ("bottom right", "top right", "bottom left", "top left"),
    8: ("top right", "bottom right", "top left", "bottom left"),
}
ROTATIONS = {  # counter-clockwise, then mirrored left to right, as PyAV wants them
    1: (0, False),
    2: (0, True),
    3: (180, False),
    4: (180, True),
    5: (270, True),
    6: (270, False),
    7: (90, True),
    8: (90, False),
}


def stored():
    rgb = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    top, left = slice(0, HEIGHT // 2), slice(0, WIDTH // 2)
    bottom, right = slice(HEIGHT // 2, None), slice(WIDTH // 2, None)
    rgb[top, left], rgb[top, right] = CORNERS["top left"], CORNERS["top right"]
    rgb[bottom, left], rgb[bottom, right] = CORNERS["bottom left"], CORNERS["bottom right"]
    return rgb


def corners(rgb):
    """The names of the colours at a picture's corners, row by row."""
    height, width = rgb.shape[:2]
    found = []
    for y in (height // 4, 3 * height // 4):
        for x in (width // 4, 3 * width // 4):
            apart = {n: np.abs(np.array(c) - rgb[y, x]).sum() for n, c in CORNERS.items()}
            found.append(min(apart, key=apart.get))
    return tuple(found)


def exif(way, order="<"):
    mark = b"II" if order == "<" else b"MM"
    entries = struct.pack(f"{order}HHII", 0x010F, 2, 4, 0x00414141)  # the maker, before it
    entries += struct.pack(f"{order}HHIHH", 0x0112, 3, 1, way, 0)
    return mark + struct.pack(f"{order}HIH", 42, 8, 2) + entries + struct.pack(f"{order}I", 0)


def encoded(kind, tmp_path):
    path = tmp_path / f"plain.{kind}"
    with av.open(str(path), "w", format="image2") as container:
        stream = container.add_stream({"png": "png", "jpg": "mjpeg"}[kind])
        stream.width, stream.height = WIDTH, HEIGHT
        stream.pix_fmt = "rgb24" if kind == "png" else "yuvj420p"
        container.mux(stream.encode(av.VideoFrame.from_ndarray(stored(), format="rgb24")))
        container.mux(stream.encode())
    return path.read_bytes()


def image(tmp_path, way, kind, order="<"):
    """An image file of the stored picture with EXIF; behind another segment or chunk."""
    data, tiff = encoded(kind, tmp_path), exif(way, order)
    path = tmp_path / f"{way}.{kind}"
    if kind == "jpg":
        other = b"\xff\xe1" + struct.pack(">H", 12) + b"http://ns\0"
        body = b"Exif\0\0" + tiff
        path.write_bytes(
            data[:2] + other + b"\xff\xe1" + struct.pack(">H", len(body) + 2) + body + data[2:]
        )
        return path
    from zlib import crc32

    chunk = struct.pack(">I", len(tiff)) + b"eXIf" + tiff
    end = data.rindex(b"\0\0\0\0IEND")
    path.write_bytes(data[:end] + chunk + struct.pack(">I", crc32(chunk[4:])) + data[end:])
    return path


@pytest.mark.parametrize("way", UPRIGHT)
@pytest.mark.parametrize(("kind", "order"), [("jpg", "<"), ("jpg", ">"), ("png", ">")])
def test_images_are_turned_as_their_exif_says(tmp_path, way, kind, order):
    rgb = read_image(image(tmp_path, way, kind, order))
    assert rgb.shape == ((HEIGHT, WIDTH, 3) if way < 5 else (WIDTH, HEIGHT, 3))
    assert corners(rgb) == UPRIGHT[way]


@pytest.mark.parametrize("way", [0, 9, 77])
def test_a_way_that_is_none_leaves_the_picture(tmp_path, way):
    assert corners(read_image(image(tmp_path, way, "jpg"))) == UPRIGHT[1]


def test_damaged_exif_leaves_the_picture(tmp_path):
    whole = image(tmp_path, 6, "jpg").read_bytes()
    at = whole.index(b"Exif")
    for i in range(at - 4, at + 34):
        for value in (0, 255):
            path = tmp_path / "b.jpg"
            path.write_bytes(whole[:i] + bytes([value]) + whole[i + 1 :])
            assert 1 <= way_of_image(path) <= 8
        path.write_bytes(whole[:i])
        assert way_of_image(path) in (1, 6)


def clip(path, way, frames=2):
    degrees, mirrored = ROTATIONS[way]
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=30)
        if not hasattr(stream, "set_display_rotation"):
            pytest.skip("this PyAV writes no display matrices")
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, "yuv420p"
        stream.bit_rate = 4_000_000
        stream.codec_context.time_base = Fraction(1, 30)
        stream.set_display_rotation(degrees, hflip=mirrored)
        for i in range(frames):
            frame = av.VideoFrame.from_ndarray(stored(), format="rgb24")
            frame.pts, frame.time_base = i, Fraction(1, 30)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


@pytest.mark.parametrize("ending", ["mp4", "mov", "mkv"])
@pytest.mark.parametrize("way", UPRIGHT)
def test_videos_are_turned_by_their_display_matrix(tmp_path, way, ending):
    if ending == "mkv" and way not in (1, 3, 6, 8):
        pytest.skip("Matroska has rotations only")
    for picture in pictures(clip(tmp_path / f"a.{ending}", way)):
        assert corners(picture.rgb) == UPRIGHT[way]


@pytest.mark.parametrize("way", UPRIGHT)
def test_a_matrix_moves_pixels_as_ffmpeg_defines_it(way):
    """x' = a x + c y, y' = b x + d y, shifted so that the smallest is 0."""
    a, b, c, d = {
        1: (1, 0, 0, 1),
        2: (-1, 0, 0, 1),
        3: (-1, 0, 0, -1),
        4: (1, 0, 0, -1),
        5: (0, 1, 1, 0),
        6: (0, 1, -1, 0),
        7: (0, -1, -1, 0),
        8: (0, -1, 1, 0),
    }[way]
    y, x = np.mgrid[0:4, 0:6]
    to_x, to_y = a * x + c * y, b * x + d * y
    to_x, to_y = to_x - to_x.min(), to_y - to_y.min()
    rgb = np.random.default_rng(0).integers(0, 255, (4, 6, 3)).astype(np.uint8)
    expected = np.zeros((to_y.max() + 1, to_x.max() + 1, 3), np.uint8)
    expected[to_y, to_x] = rgb
    one = 1 << 16
    data = struct.pack("=9i", a * one, b * one, 0, c * one, d * one, 0, 0, 0, 1 << 30)
    assert way_of_matrix(data) == way
    np.testing.assert_array_equal(upright(rgb, way_of_matrix(data)), expected)


def test_detection_sees_the_turned_picture(tmp_path):
    found = Told([seen("left", 30)], [seen("left", 30)])
    detections = detect(clip(tmp_path / "a.mp4", 6), detector=found)
    assert detections.size == (HEIGHT, WIDTH)
    assert corners(found.pictures[0][0]) == UPRIGHT[6]


@pytest.mark.parametrize("fps", [0, -1, float("nan"), float("inf"), 1e9])
def test_rates_that_are_none(tmp_path, fps):
    with pytest.raises(ht.SettingsError, match="fps is"):
        list(pictures(image(tmp_path, 1, "png"), fps))


@pytest.mark.parametrize("name", ["rotated_meta.mp4", "exif6.jpg"])
def test_the_cases_are_turned(name):
    cases = Path(__file__).resolve().parents[3] / "shared" / "cases"
    if not cases.is_dir():
        pytest.skip(f"the failing inputs are not there: {cases}")
    for picture in pictures(cases / name):
        assert picture.rgb.shape == (720, 1280, 3)
