"""Pictures over time: what is one, their order, their times, and what is wrong with them."""

from __future__ import annotations

import numpy as np
import pytest
from clips import write_image, write_video

from handtrack.errors import InputError
from handtrack.files.pictures import pictures_in
from handtrack.video.media import count, pictures, read_image

pytest.importorskip("av", reason="the extra video is not installed")


TICKS = [0, 33, 67, 167, 180]


def test_times_of_a_variable_frame_rate_are_the_files_own(tmp_path):
    path = tmp_path / "a.mp4"
    write_video(path, TICKS)
    found = list(pictures(path))
    assert pictures_in(path) == "video"
    assert [p.time_ns for p in found] == [t * 1_000_000 for t in TICKS]
    assert [p.index for p in found] == [0, 1, 2, 3, 4]
    assert found[0].rgb.shape == (48, 64, 3)
    # grey levels survive the codec well enough to tell the frames' order
    levels = [float(p.rgb.mean()) for p in found]
    assert np.allclose(levels, [10, 20, 30, 40, 50], atol=4)
    assert count(path) in (0, 5)


def test_a_given_rate_replaces_the_times(tmp_path):
    write_video(tmp_path / "a.mp4", TICKS)
    assert [p.time_ns for p in pictures(tmp_path / "a.mp4", fps=50)][:3] == [
        0,
        20_000_000,
        40_000_000,
    ]


def test_images_of_a_folder_come_in_order_of_name(tmp_path):
    for name, bright in (("b.png", 90), ("a.png", 40)):
        write_image(tmp_path / name, bright)
    assert pictures_in(tmp_path) == "images"
    found = list(pictures(tmp_path))
    assert [p.path.name for p in found] == ["a.png", "b.png"]
    assert [int(p.rgb[0, 0, 0]) for p in found] == [40, 90]
    assert int(read_image(tmp_path / "b.png").max()) == 90
    (tmp_path / "joints.csv").write_text("1,2,3")
    assert pictures_in(tmp_path) is None


def test_a_video_cut_short_gives_its_frames_and_then_an_error(tmp_path):
    whole = tmp_path / "a.avi"
    write_video(whole, [i * 40 for i in range(20)])
    data = whole.read_bytes()
    broken = tmp_path / "b.avi"
    broken.write_bytes(data[:64])
    with pytest.raises(InputError, match=r"b\.avi: "):
        list(pictures(broken))


@pytest.mark.parametrize("data", [b"", b"hello", b"\x89PNG\r\n\x1a\n garbage", b"\0" * 40])
def test_what_is_no_picture_is_refused(tmp_path, data):
    path = tmp_path / "x.png"
    path.write_bytes(data)
    with pytest.raises(InputError, match=r"x\.png: "):
        list(pictures(path))
