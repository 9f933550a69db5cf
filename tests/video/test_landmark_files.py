"""Landmarks that other programs found in pictures: read to the pixel, and fitted in the picture."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.rotations import vector_to_matrix
from handtrack.sequences.picture_landmarks import load_picture_landmarks
from handtrack.sequences.readers import keypoints_2d
from handtrack.video.following import follow
from handtrack.video.landmark_files import camera_of_view, found_in
from handtrack.video.views import views_of

sys.path.append(str(Path(__file__).resolve().parents[1] / "cameras"))
from rigs import rig

SIZE = (1280, 720)
MODEL = ht.HandModel.default("right")


@pytest.fixture(scope="module")
def joints() -> np.ndarray:
    """(8, 21, 3) a hand that bends and turns at the rig's origin."""
    angles = MODEL.mean_angles + 0.03 * np.arange(8)[:, None]
    turns = np.stack([vector_to_matrix(np.array([1.2, 0.05 * t, 0.0])) for t in range(8)])
    placed = np.stack(
        [MODEL.joints(MODEL.limits.clamp(a), r) for a, r in zip(angles, turns, strict=True)]
    )
    return placed - placed.mean((0, 1))


@pytest.fixture(scope="module")
def pixels(joints) -> np.ndarray:
    return rig(1)[0].project(joints)


def shares(pixels) -> np.ndarray:
    return pixels / SIZE


def wide(pixels) -> str:
    head = ",".join(f"x_{i},y_{i}" for i in range(21))
    rows = [f"{t}," + ",".join(f"{v:.3f}" for v in p.ravel()) for t, p in enumerate(pixels)]
    return "\n".join([f"frame,{head}", *rows])


def openpose(pixels) -> dict:
    hand = np.concatenate([pixels, np.full((21, 1), 0.9)], axis=1).ravel().tolist()
    empty = [0.0] * 63
    person = {"hand_left_keypoints_2d": empty, "hand_right_keypoints_2d": hand}
    return {"version": 1.3, "people": [{"person_id": [-1], **person}]}


def instances(points) -> list:
    return [
        {
            "frame_id": t,
            "instances": [{"keypoints": p, "keypoint_scores": [0.0] * (len(p) - 21) + [0.8] * 21}],
        }
        for t, p in enumerate(points)
    ]


def texts(pixels) -> dict[str, str]:
    """Files of the same landmarks."""
    body = [[[1.0, 1.0]] * 112 + p for p in pixels.tolist()]
    x, y = shares(pixels).transpose(2, 0, 1).tolist()
    rows = [(t, j, x[t][j], y[t][j]) for t in range(len(pixels)) for j in range(21)]
    named = [[{"x": a, "y": b} for a, b in zip(x[t], y[t], strict=True)] for t in range(len(x))]
    coco = [
        {
            "image_id": t,
            "righthand_kpts": [v for a, b in p for v in (a, b, 2)],
            "keypoints": [0] * 51,
        }
        for t, p in enumerate(pixels.tolist())
    ]
    return {
        "wide.csv": wide(pixels),
        "semicolons.csv": wide(pixels).replace(",", ";").upper(),
        "long.csv": "frame,landmark,x,y\n" + "\n".join(",".join(map(str, r)) for r in rows),
        "frames.json": json.dumps(
            [{"time": t / 30, "landmarks": p.tolist()} for t, p in enumerate(pixels)]
        ),
        "lines.jsonl": "\n".join(
            json.dumps({"handedness": "Right", "landmarks": p}) for p in named
        ),
        "mmpose.json": json.dumps({"instance_info": instances(pixels.tolist())}),
        "whole.json": json.dumps({"instance_info": instances(body)}),
        "coco.json": json.dumps({"annotations": coco}),
        "triples.json": json.dumps(
            [np.concatenate([p, np.full((21, 1), 0.7)], 1).tolist() for p in pixels]
        ),
    }


def test_every_form_is_read_to_the_pixel(pixels, tmp_path):
    for name, text in texts(pixels).items():
        (tmp_path / name).write_text(text)
        (one,) = load_picture_landmarks(tmp_path / name)
        np.testing.assert_allclose(one.pixels(SIZE), pixels, atol=2e-3, err_msg=name)
        assert one.hand in (None, "right"), name
        assert one.depth is None
    np.save(tmp_path / "a.npy", pixels)
    np.savez(tmp_path / "a.npz", landmarks=pixels, fps=50.0, hand="left")
    (one,) = load_picture_landmarks(tmp_path / "a.npy")
    (left,) = load_picture_landmarks(tmp_path / "a.npz")
    assert np.array_equal(one.points, pixels)
    assert (left.hand, left.timed, left.time_ns[1]) == ("left", True, 20_000_000)
    for path in tmp_path.iterdir():
        with pytest.raises(InputError, match=r"picture|in one plane"):
            ht.load(path)


def test_openpose_by_video_and_frame(pixels, tmp_path):
    for t in (0, 1, 2, 5):
        (tmp_path / f"a_{t:012d}_keypoints.json").write_text(json.dumps(openpose(pixels[t])))
    (tmp_path / "a_000000000004_keypoints.json").write_text('{"people": []}')
    (tmp_path / "b_000000000000_keypoints.json").write_text(json.dumps(openpose(pixels[7])))
    one, other = load_picture_landmarks(tmp_path)
    assert (one.name, one.hand, one.frame_index.tolist()) == ("a", "right", [0, 1, 2, 4, 5])
    assert np.isnan(one.points[3]).all()
    assert np.allclose(one.points[[0, 1, 2, 4]], pixels[[0, 1, 2, 5]])
    assert (other.name, len(other.points)) == ("b", 1)
    assert one.sure[0, 0] == pytest.approx(0.9)
    with pytest.raises(InputError, match="only x and y"):
        ht.load(tmp_path)


@pytest.mark.parametrize("two", [False, True])
def test_openpose_files_together_are_as_one_by_one(pixels, tmp_path, monkeypatch, two):
    for t in range(8):
        file = openpose(pixels[t])
        person = file["people"][0]
        person["hand_left_keypoints_2d"] = [0.5 * t] * 63 if t % 3 else [0] * 63
        if t == 4:
            person["hand_right_keypoints_2d"] = []
        if two and t > 5:
            file["people"].append(person | {"person_id": [t]})
        (tmp_path / f"a_{t:012d}_keypoints.json").write_text(json.dumps(file))
    (tmp_path / "a_7_keypoints.json").write_text(json.dumps(openpose(pixels[0])))
    monkeypatch.setattr(keypoints_2d, "_AT_ONCE", 3)
    quick = load_picture_landmarks(tmp_path)
    monkeypatch.setattr(keypoints_2d, "of_one_person", lambda *_: None)
    for one, other in zip(quick, load_picture_landmarks(tmp_path), strict=True):
        assert (one.name, one.hand) == (other.name, other.hand)
        np.testing.assert_array_equal(one.points, other.points)
        np.testing.assert_array_equal(one.sure, other.sure)
        np.testing.assert_array_equal(one.frame_index, other.frame_index)
    right = quick[-1 if not two else [q.hand for q in quick].index("right")]
    assert np.isnan(right.points[4]).all()
    np.testing.assert_allclose(right.points[3], pixels[3], atol=2e-3)


def test_the_depth_that_mediapipe_guesses_is_used(joints, pixels, tmp_path):
    deep = joints[..., 2:] - joints[:, :1, 2:]
    places = np.concatenate([shares(pixels), deep * 900 / 0.6 / SIZE[0]], axis=-1)
    frames = [{"landmarks": [dict(zip("xyz", j, strict=True)) for j in p]} for p in places.tolist()]
    (tmp_path / "a.json").write_text(json.dumps(frames))
    (one,) = load_picture_landmarks(tmp_path / "a.json")
    assert one.shares
    assert one.depth is not None
    (found,) = found_in([one], SIZE)
    assert found.detections.hands == ("right",)
    assert any("fingers' bend" in note for note in found.notes)
    (views,) = views_of([found.detections], rig(1))
    fitted = follow(views, MODEL)
    assert np.nanmedian(fitted.reprojection) < 0.5
    assert np.nanmax(np.linalg.norm(fitted.sequence.joints - joints, axis=-1)) < 0.012


def test_x_and_y_of_one_camera_are_met(pixels, tmp_path):
    (tmp_path / "a.csv").write_text(wide(pixels))
    (found,) = found_in(load_picture_landmarks(tmp_path / "a.csv"), SIZE, "right")
    (views,) = views_of([found.detections], rig(1))
    fitted = follow(views, MODEL)
    assert np.nanmedian(fitted.reprojection) < 1.0
    depth = fitted.sequence.joints[:, 0, 2] + 0.6
    assert np.all(np.abs(depth - 0.6) < 0.06)


def test_two_cameras_find_the_joints(joints, tmp_path):
    cameras, seen = rig(2), []
    for camera in cameras:
        (tmp_path / "a.csv").write_text(wide(camera.project(joints)))
        (found,) = found_in(load_picture_landmarks(tmp_path / "a.csv"), SIZE, "right")
        seen.append(found.detections)
    (views,) = views_of(seen, cameras)
    assert np.nanmax(np.linalg.norm(follow(views, MODEL).sequence.joints - joints, axis=-1)) < 1e-4


def test_field_of_view_is_from_left_to_right():
    camera = camera_of_view((1000, 500), 90.0)
    assert camera.matrix[0, 0] == pytest.approx(500)
    assert camera.project([[1.0, 0.0, 1.0]])[0].tolist() == pytest.approx([1000, 250])


@pytest.mark.parametrize(
    ("size", "says"), [(None, "--image-size WxH says"), ((320, 240), "is --image-size")]
)
def test_pictures_of_another_size_are_refused(pixels, tmp_path, size, says):
    (tmp_path / "a.csv").write_text(wide(pixels))
    with pytest.raises(InputError, match=says):
        found_in(load_picture_landmarks(tmp_path / "a.csv"), size)


def test_joints_in_space_are_no_landmarks(joints, tmp_path):
    np.save(tmp_path / "a.npy", joints)
    with pytest.raises(InputError, match="joints in space"):
        load_picture_landmarks(tmp_path / "a.npy")
