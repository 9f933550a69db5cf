"""One hand seen by several cameras: what belongs together, and what does not."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cameras.triangulate import triangulate
from handtrack.detectors.profile import load_profile
from handtrack.errors import InputError
from handtrack.video.detections import Detections
from handtrack.video.following import LASTING, _believed, _louder, follow
from handtrack.video.views import views_of

sys.path.append(str(Path(__file__).resolve().parents[1] / "cameras"))
from rigs import rig


def seen(cameras, joints, hand="right", fps=30.0) -> list[Detections]:
    """What each camera's perfect detector says of joints (T, 21, 3)."""
    n = len(joints)
    blank = {h: np.full((n, 21, 2), np.nan) for h in ("left", "right")}
    out = []
    for camera in cameras:
        turned = joints @ camera.rotation.T + camera.translation
        out.append(
            Detections(
                source=f"{camera.name}.mp4",
                size=camera.size,
                time_ns=(np.arange(n) / fps * 1e9).astype(np.int64),
                frame_index=np.arange(n),
                image={**blank, hand: camera.project(joints)},
                world={
                    **{h: np.full((n, 21, 3), np.nan) for h in blank},
                    hand: turned - turned.mean(1, keepdims=True),
                },
                score={h: np.full(n, 0.9 if h == hand else 0.0) for h in blank},
            )
        )
    return out


@pytest.fixture
def joints() -> np.ndarray:
    model = ht.HandModel.default("right")
    angles = np.tile(model.mean_angles, (5, 1)) + 0.05 * np.arange(5)[:, None]
    placed = model.joints(model.limits.clamp(angles))
    return placed - placed.mean((0, 1))


def test_points_are_triangulated(joints):
    cameras = rig(3)
    (views,) = views_of(seen(cameras, joints), cameras)
    assert np.allclose(views.points, joints, atol=1e-8)
    assert (views.hand, views.name, len(views)) == ("right", "cam0", 5)
    sequence = views.sequence()
    assert np.array_equal(sequence.joints, views.points)
    assert views.weights.shape == (5, 3, 21)
    assert np.allclose(views.weights, 0.9)


def test_one_camera_gives_its_own_joints_on_its_rays(joints):
    cameras = rig(1)
    (views,) = views_of(seen(cameras, joints), cameras)
    assert np.allclose(views.points, joints, atol=1e-6)


def test_a_hand_called_left_by_one_camera_is_the_same_hand(joints):
    cameras = rig(2)
    found = seen(cameras, joints)
    other = seen(cameras, joints, "left")[1]
    found[1] = replace(other, score={"left": np.full(5, 0.6), "right": np.zeros(5)})
    (views,) = views_of(found, cameras)
    assert views.hand == "right"
    assert np.allclose(views.points, joints, atol=1e-8)
    assert "called left and right" in views.notes[0]


def test_what_does_not_belong_together_is_refused(joints):
    cameras = rig(2)
    found = seen(cameras, joints)
    moved = replace(cameras[1], translation=cameras[1].translation + np.array([0, 0.2, 0]))
    for detections, cams, says in (
        (found[:1], cameras, r"1 videos for 2 calibrated cameras \(cam0, cam1\)"),
        (
            [found[0], seen(cameras, joints[:3])[1]],
            cameras,
            r"cam1\.mp4: 3 frames, cam0\.mp4 has 5",
        ),
        (
            [found[0], seen(cameras, joints, fps=25.0)[1]],
            cameras,
            r"cam1\.mp4: 25\.00 frames/s, cam0\.mp4 has 30\.00",
        ),
        (
            [found[0], replace(found[1], size=(640, 480))],
            cameras,
            r"cam1\.mp4: the pictures are 640 x 480, camera cam1 was calibrated for 1280 x 720",
        ),
        (found, [cameras[0], moved], "does not belong to these views"),
    ):
        with pytest.raises(InputError, match=says):
            views_of(detections, cams)


def test_pictures_are_moved_as_their_points_are_corrected(joints):
    cameras = rig(3)
    (views,) = views_of(seen(cameras, joints), cameras)
    views.image[2, 1, 8] = np.nan
    profile = load_profile("mediapipe-3d")
    wanted = profile.corrected(views.points, "right")
    moved = views.corrected(profile)
    assert np.linalg.norm(wanted - joints, axis=-1).mean() > 1e-3
    found, _ = triangulate(cameras, moved.image.transpose(1, 0, 2, 3))
    assert np.allclose(found, wanted, atol=1e-7)
    assert np.array_equal(moved.points, wanted)
    assert np.isnan(moved.image[2, 1, 8]).all()
    assert views.corrected(None) is views
    half = views.corrected(profile, 0.5)
    assert np.allclose(half.points, 0.5 * (joints + wanted), atol=1e-7)
    found, _ = triangulate(cameras, half.image.transpose(1, 0, 2, 3))
    assert np.allclose(found, half.points, atol=1e-7)


def test_a_camera_that_sees_another_hand_is_believed_less(joints):
    cameras, rng = rig(3), np.random.default_rng(2)
    found = seen(cameras, np.repeat(joints, 6, axis=0))
    for d in found:
        d.image["right"][:] += rng.normal(0, 1.0, d.image["right"].shape)
    found[1].image["right"][20:24] += (9.0, 6.0)
    found[2].image["right"][15] = np.nan
    found[0].image["right"][16], found[1].image["right"][16] = np.nan, np.nan
    (views,) = views_of(found, cameras)
    for is_whole in (True, False):
        believed = _believed(views, is_whole)
        assert believed.shape == (30, 3)
        assert (believed[20:24, 1] < 0.2).all()
        assert (believed[20:24, 1] < believed[20:24, [0, 2]].min(1)).all()
        rest = [*range(10, 15), *range(17, 20), *range(24, 30)]
        assert np.abs(believed[rest] - 0.5).max() < 0.35
        # of which nothing is known: as good as any
        assert believed[15, 2] == believed[16, 2] == 0.5
    # looking back, the first frames have nothing to be compared with
    assert (_believed(views, False)[:10] == 1.0).all()
    one = views_of(found[:1], cameras[:1])[0]
    assert (_believed(one, True) == 1.0).all()


def test_noise_that_lasts_is_louder():
    rng = np.random.default_rng(1)
    white = rng.normal(0, 1.0, (400, 3, 21, 2))
    lasting = np.empty_like(white)
    lasting[0] = white[0]
    for t in range(1, len(white)):
        lasting[t] = 0.5 * lasting[t - 1] + white[t]
    assert _louder(white) == pytest.approx(1.0, abs=0.03)
    assert _louder(lasting) == pytest.approx(np.sqrt(1.5 / 0.5), abs=0.05)
    # what is the same in all frames is no noise
    assert _louder(white + 30.0 * rng.normal(size=(3, 21, 2))) == pytest.approx(1.0, abs=0.03)
    slow = np.cumsum(white, axis=0)
    slow[5:9, 1] = np.nan
    assert _louder(slow) == LASTING
    assert _louder(white[:3]) == 1.0


def test_a_hand_is_followed_through_the_pictures(joints):
    """Noise of 1 px in three views, joints that one camera sees, and a gap."""
    cameras = rig(3)
    found = seen(cameras, np.repeat(joints, 4, axis=0))
    rng = np.random.default_rng(0)
    for d in found:
        d.image["right"][:] += rng.normal(0, 1.0, d.image["right"].shape)
    for c in (0, 1):
        found[c].image["right"][:, [8, 16]] = np.nan
    for d in found:
        d.image["right"][9] = np.nan
    (views,) = views_of(found, cameras)
    model = ht.HandModel.default("right")
    out = follow(views, model)
    truth = np.repeat(joints, 4, axis=0)
    error = np.linalg.norm(out.sequence.joints - truth, axis=-1)
    assert np.isnan(error[9]).all()
    rest = np.arange(20) != 9
    assert np.isfinite(error[rest]).all()
    # a pixel is 0.67 mm here
    assert error[rest].mean() < 0.67e-3
    triangulated = np.linalg.norm(views.points - truth, axis=-1)
    assert error[rest].mean() < np.nanmean(triangulated)
    assert 0.7 < np.nanmedian(out.reprojection) < 1.3
    assert 0.2 < out.noise_mm < 1.0
    assert np.isnan(out.reprojection[:, 0, 8]).all()
