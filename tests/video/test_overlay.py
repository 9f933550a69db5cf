"""Hands placed in front of a camera and drawn over its pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from clips import Told, write_image, write_video
from screens import keep

import handtrack as ht
from handtrack.cli import run
from handtrack.detectors.profile import load_profile
from handtrack.errors import SettingsError
from handtrack.hand.rotations import vector_to_matrix
from handtrack.video.detections import detect
from handtrack.video.detector import Detection
from handtrack.video.media import pictures, read_image
from handtrack.video.overlay import BONES_OF, STATUS, Drawn, draw, label, overlay
from handtrack.video.placing import Seen, assumed_camera, place_in_view

pytest.importorskip("av", reason="the extra video is not installed")
pytest.importorskip("cv2", reason="the extra video is not installed")


SIZE = (640, 480)
CAMERA = assumed_camera(SIZE)


def moving_hand(n: int = 4):
    """A model, and poses of a hand half a metre in front of the camera."""
    model = ht.HandModel.default("right")
    angles = np.tile(model.mean_angles, (n, 1))
    angles[:, 4::4] += 0.1 * np.arange(n)[:, None]
    rotation = np.stack([vector_to_matrix(np.array([0.3, 0.2 + 0.1 * t, -1.4])) for t in range(n)])
    shift = np.array([[-0.02 + 0.01 * t, 0.05, 0.5] for t in range(n)])
    return model, angles, rotation, shift


def seen_hands(joints: np.ndarray) -> list[list[Detection]]:
    """What a perfect detector would say of joints (T, 21, 3) in the camera's frame."""
    return [[Detection("right", 0.95, CAMERA.project(x), x - x.mean(0))] for x in joints]


@pytest.fixture
def made(tmp_path):
    """A video, what was detected in it, and the true joints."""
    path = tmp_path / "clip.mp4"
    write_video(path, [0, 33, 67, 100], SIZE)
    model, angles, rotation, shift = moving_hand()
    joints = model.joints(angles, rotation, shift)
    return path, detect(path, Told(*seen_hands(joints))), joints


def test_a_hand_is_placed_where_it_was(made):
    _, found, joints = made
    (sequence,) = found.sequences()
    assert sequence.detector == ""  # nothing is known of where its landmarks lie
    track = ht.track(sequence)
    angles, rotation, translation = place_in_view(track, found.image["right"], CAMERA)
    placed = track.model.joints(angles, rotation, translation)
    assert np.linalg.norm(placed - joints, axis=-1).max() < 3e-3
    image = found.image["right"].copy()
    image[1, 3:] = np.nan  # too little is seen
    assert np.isnan(place_in_view(track, image, CAMERA)[2][1]).all()


def test_a_detectors_landmarks_in_pictures_are_not_those_in_space(made):
    """One camera's profile in space would put the hand half a centimetre and more beside."""
    _, found, joints = made
    track = ht.track(found.sequences()[0])
    model, angles, rotation, shift = moving_hand()
    seen = load_profile("mediapipe-3d").on(model).landmarks(angles, rotation, shift)
    image = np.stack([CAMERA.project(points) for points in seen])
    in_space = load_profile("mediapipe").on(track.model)
    off = {}
    for name in ("mediapipe", "of-ones-own.json"):
        told = replace(track, model=in_space, settings={**track.settings, "detector": name})
        placed = track.model.joints(*place_in_view(told, image, CAMERA))
        at = np.stack([CAMERA.project(points) for points in placed])
        true = np.stack([CAMERA.project(points) for points in joints])
        off[name] = np.linalg.norm(at - true, axis=-1).mean()
    assert off["mediapipe"] < 2
    assert off["of-ones-own.json"] > 3 * off["mediapipe"]


def test_skin_is_drawn_where_the_hand_is_and_nowhere_else():
    model, angles, rotation, shift = moving_hand()
    skin = model.vertices(angles[0], rotation[0], shift[0])
    joints = model.joints(angles[0], rotation[0], shift[0])
    grey = np.full((480, 640, 3), 90, dtype=np.uint8)
    out = draw(grey, CAMERA, [Drawn("right", skin, model.faces, joints, None)])
    assert (grey == 90).all()
    changed = (out != 90).any(-1)
    low, high = CAMERA.project(skin).min(0), CAMERA.project(skin).max(0)
    y, x = np.nonzero(changed)
    assert x.min() >= low[0] - 2
    assert x.max() <= high[0] + 2
    assert y.min() >= low[1] - 2
    assert y.max() <= high[1] + 2
    for px, py in np.round(CAMERA.project(joints)).astype(int):
        assert changed[py, px]
    # the palm's silhouette has no holes
    mx, my = np.round(CAMERA.project(joints[[0, 5, 9, 13, 17]].mean(0))).astype(int)
    assert changed[my - 5 : my + 6, mx - 5 : mx + 6].all()


def test_the_nearer_hand_hides_the_other():
    model, angles, rotation, shift = moving_hand()
    grey = np.full((480, 640, 3), 90, dtype=np.uint8)

    def hand(name, depth):
        place = shift[0] * depth  # the same place in the picture
        skin = depth * (model.vertices(angles[0], rotation[0], np.zeros(3)))
        return Drawn(name, skin + place, model.faces, np.full((21, 3), np.nan), None)

    near, far = hand("right", 1.0), hand("left", 1.5)
    alone = draw(grey, CAMERA, [near])
    both = draw(grey, CAMERA, [near, far])
    assert np.array_equal(both, draw(grey, CAMERA, [far, near]))
    assert (both != alone).any(-1).sum() < 0.05 * (alone != 90).any(-1).sum()
    behind = Drawn("right", near.vertices * [1, 1, -1], model.faces, near.joints, None)
    assert np.array_equal(draw(grey, CAMERA, [behind]), grey)


def test_an_overlay_keeps_the_videos_times(made, tmp_path):
    path, found, _ = made
    (sequence,) = found.sequences()
    track = ht.track(sequence)
    overlay(tmp_path / "out.mp4", [Seen.alone(found)], [track])
    before, after = list(pictures(path)), list(pictures(tmp_path / "out.mp4"))
    assert [p.time_ns // 10**6 for p in after] == pytest.approx(
        [p.time_ns // 10**6 for p in before], abs=1
    )
    for a, b in zip(before, after, strict=True):
        changed = np.abs(a.rgb.astype(int) - b.rgb.astype(int)).max(-1) > 25
        assert 0.01 < changed.mean() < 0.4
    overlay(tmp_path / "out.png", [Seen.alone(found)], [track])
    assert read_image(tmp_path / "out.png").shape == (480, 640, 3)
    keep("overlay", (tmp_path / "out.png").read_bytes())
    with pytest.raises(SettingsError, match=r"\.mp4 or \.png"):
        overlay(tmp_path / "out.gif", [Seen.alone(found)], [track])


def test_bones_have_their_fingers_colour_and_skin_the_one_asked_for():
    model, angles, rotation, shift = moving_hand()
    skin = model.vertices(angles[0], rotation[0], shift[0])
    joints = model.joints(angles[0], rotation[0], shift[0])
    grey = np.full((480, 640, 3), 90, dtype=np.uint8)
    bare = draw(grey, CAMERA, [Drawn("right", skin[:0], model.faces[:0], joints, None)])
    for finger in range(5):
        a, b = joints[1 + 4 * finger], joints[2 + 4 * finger]
        x, y = np.round(CAMERA.project((0.5 * (a + b))[None])[0]).astype(int)
        near = bare[y - 1 : y + 2, x - 1 : x + 2].reshape(-1, 3).astype(int)
        off = [np.abs(near - colour).sum(1).min() for colour in BONES_OF]
        assert int(np.argmin(off)) == finger
    nowhere = np.full((21, 3), np.nan)
    red = draw(grey, CAMERA, [Drawn("right", skin, model.faces, nowhere, None)], (255, 0, 0))
    drawn = red[(red != 90).any(-1)].astype(int)
    assert (drawn[:, 1] == drawn[:, 2]).all()
    assert (drawn[:, 0] > drawn[:, 1]).all()


def test_the_number_and_the_status_are_written_in_the_corner():
    black = np.zeros((480, 640, 3), np.uint8)
    first, second, lost = black.copy(), black.copy(), black.copy()
    label(first, 7, [("right", "fitted")])
    label(second, 8, [("right", "fitted")])
    label(lost, 7, [("right", "lost")])
    changed = (first != 0).any(-1)
    assert changed[:40, :200].sum() > 100
    assert changed.sum() == changed[:40, :200].sum()
    assert (first[:16] != second[:16]).any()
    assert (first[18:] == second[18:]).all()  # the status is the same
    assert (lost[18:] == STATUS["lost"]).all(-1).any()
    assert not (first == STATUS["lost"]).all(-1).any()


def test_the_skin_of_the_overlay_is_a_colour(tmp_path, capsys, sample_file):
    for given, said in (("pink", "violet, grey, skin or #rrggbb"), ("#ff0000", "give both")):
        assert run(["track", str(sample_file), "--overlay-skin", given]) == 2
        assert said in capsys.readouterr().err


def test_the_command_line_refuses_what_cannot_be_drawn(tmp_path, capsys, sample_file):
    write_image(tmp_path / "a.png", 100)
    assert run(["track", str(sample_file), "--overlay", str(tmp_path / "o.mp4")]) == 2
    assert "neither a video nor an image" in capsys.readouterr().err
    assert run(["track", str(sample_file), "--camera", str(tmp_path / "none.toml")]) == 2
    assert "none.toml: no such file" in capsys.readouterr().err
