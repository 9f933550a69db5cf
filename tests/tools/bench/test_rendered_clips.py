"""The benchmark's clips: their file, their movement, and those that ship."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.cameras.triangulate import triangulate
from handtrack.errors import InputError
from handtrack.hand.rotations import quaternion_to_matrix
from tools.bench.rendered import build, layout, motion
from tools.bench.rendered import depth_networks as networks
from tools.bench.rendered.people import subject
from tools.bench.rendered.rig import arc

DATA = Path(__file__).resolve().parents[2] / "data" / "rendered"


def made(frames=20):
    rng = np.random.default_rng(0)
    movement = motion.generated(rng, frames)
    model = ht.HandModel.default("right")
    truth = model.joints(movement.angles, movement.rotation, movement.translation)
    cameras = arc(rng, 2)
    image = np.stack([c.project(truth) for c in cameras])
    image[1, 3] = np.nan
    return layout.Clip(
        "made",
        "right",
        np.arange(frames) * 33_333_333,
        truth,
        image=image,
        camera_matrix=np.stack([c.matrix for c in cameras]),
        camera_rotation=np.stack([c.rotation for c in cameras]),
        camera_translation=np.stack([c.translation for c in cameras]),
        truth_angles=movement.angles,
    )


def test_a_clip_comes_back_to_its_units(tmp_path):
    clip = made()
    layout.write(tmp_path / "made.npz", clip)
    (again,) = layout.read_folder(tmp_path)
    for field in fields(clip):
        value, read = getattr(clip, field.name), getattr(again, field.name)
        if value is None or isinstance(value, str):
            assert read == value
            continue
        unit = layout.UNITS.get(field.name, (1e-12,))[0]
        np.testing.assert_allclose(read, value, atol=0.51 * unit, rtol=0, err_msg=field.name)
    assert again.seen(0).all()
    assert not again.seen(1)[3]


def test_output_from_elsewhere_needs_little(tmp_path):
    clip = made()
    np.savez(
        tmp_path / "theirs.npz",
        hand=np.array("left"),
        time_ns=clip.time_ns,
        truth_joints=clip.truth_joints,
        joints=clip.truth_joints.astype(np.float32),
    )
    theirs = layout.read(tmp_path / "theirs.npz")
    assert (theirs.name, theirs.hand, theirs.cameras) == ("theirs", "left", [])


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        ({"hand": "right"}, r"time_ns, truth_joints not there"),
        ({"hand": "both", "joints": np.zeros((2, 21, 3))}, "expected left or right"),
        ({"hand": "right"}, "nothing detected"),
        ({"hand": "right", "joints": np.zeros((2, 20, 3))}, r"\(2, 20, 3\), expected \(2, 21, 3\)"),
    ],
)
def test_a_file_that_is_none_says_why(tmp_path, arrays, said):
    if said.startswith("time_ns"):
        content = arrays
    else:
        content = {"time_ns": np.arange(2), "truth_joints": np.zeros((2, 21, 3)), **arrays}
    np.savez(tmp_path / "bad.npz", **content)
    with pytest.raises(InputError, match=said):
        layout.read(tmp_path / "bad.npz")
    (tmp_path / "text.npz").write_text("no")
    with pytest.raises(InputError, match=r"no \.npz"):
        layout.read(tmp_path / "text.npz")


def test_movement_is_the_seeds_and_within_limits():
    first, again, other = (motion.generated(np.random.default_rng(s), 90) for s in (1, 1, 2))
    for field in fields(first):
        same = getattr(first, field.name), getattr(again, field.name)
        assert np.array_equal(*same), field.name
    assert not np.allclose(first.angles, other.angles)
    limits = ht.HandModel.default("right").limits
    clamped = np.stack([limits.clamp(a) for a in first.angles])
    assert np.abs(clamped - first.angles).max() < 1e-9
    steps = np.rad2deg(np.abs(np.diff(first.angles, axis=0)).max())
    assert 3 < steps < 60  # degrees a frame: it moves, and nothing jumps
    turned = np.einsum("tij,tik->tjk", first.rotation, first.rotation)
    assert turned == pytest.approx(np.broadcast_to(np.eye(3), turned.shape), abs=1e-9)


def test_a_mirrored_movement_is_the_other_hands_mirror_image():
    right = motion.generated(np.random.default_rng(3), 5)
    left = motion.mirrored(right)
    assert left.hand == "left"
    joints = [
        ht.HandModel.default(m.hand).joints(m.angles, m.rotation, m.translation)
        for m in (right, left)
    ]
    assert joints[1] == pytest.approx(joints[0] * [-1, 1, 1], abs=1e-12)


def test_no_subject_is_in_two_splits():
    named = (*build.SPLITS, build.NEXT, build.LEARN)
    splits = [{p.subject for p in build.plans(s)} for s in named]
    assert [len(build.plans(s)) for s in named] == [30, *[10] * (len(named) - 2), 95]
    everyone = set.union(*splits)
    assert len(everyone) == sum(map(len, splits))
    shapes = np.array([subject(n).shape for n in sorted(everyone)])
    apart = np.abs(shapes[:, None] - shapes).max(-1) + np.eye(len(shapes))
    assert apart.min() > 0.05
    assert all({subject(n).hand for n in split} == {"left", "right"} for split in splits)


@pytest.mark.parametrize("split", [*build.SPLITS, build.LEARN])
def test_the_clips_that_ship(split):
    clips = layout.read_folder(DATA / split)
    assert [clip.name for clip in clips] == [plan.name for plan in build.plans(split)]
    found = np.concatenate([build.found_share(clip) for clip in clips])
    # fingers that each go their own way are harder to see
    assert found.mean() > (0.85 if split == build.LEARN else 0.95)
    for clip in clips:
        rest, axes = clip.truth_rest_joints, clip.truth_axes
        axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
        bare = {"rest_vertices": np.zeros((0, 3)), "faces": np.zeros((0, 3), np.int32)}
        model = replace(
            ht.HandModel.default(clip.hand),
            rest_joints=rest,
            axes=axes,
            weights=np.zeros((0, 16)),
            **bare,
        )
        q = clip.truth_rotation / np.linalg.norm(clip.truth_rotation, axis=1, keepdims=True)
        joints = model.joints(clip.truth_angles, quaternion_to_matrix(q), clip.truth_translation)
        assert np.abs(joints - clip.truth_joints).max() < 1e-4
    clip = clips[0]
    seen = np.stack([clip.seen(c) for c in range(3)])[..., None, None]
    pixels = np.where(seen, clip.image, np.nan)
    again, _ = triangulate(clip.cameras, pixels, inlier_px=layout.RAW_INLIER_PX, cauchy_px=np.inf)
    assert np.nanmedian(np.linalg.norm(again - clip.joints, axis=-1)) < 2e-4


def test_depth_networks_predictions_become_clips(tmp_path):
    clip = made(20)
    truth = clip.truth_joints + np.array([0, 0.6, 0])
    camera = truth[..., [0, 2, 1]] * [1, -1, 1]  # x right, y down, z away
    given = np.concatenate([camera[:, networks.OURS], camera[:, [0, 0, 9]]], axis=1)
    given[:, 11, 0] += 0.02
    given[:, 12, 0] -= 0.02
    pixels = given[..., :2] / given[..., 2:] * networks.FOCAL + networks.CENTRE
    lines = np.concatenate([pixels, 1e3 * given[..., 2:]], -1).reshape(20, -1)
    for name in ("labels.txt", "Net.txt"):
        np.savetxt(tmp_path / name, lines, fmt="%.6f")
    (first, second) = networks.network_clips(tmp_path / "Net.txt", tmp_path / "labels.txt", 12)
    assert (first.name, len(first.time_ns), len(second.time_ns)) == ("Net-00000", 12, 8)
    seen = np.isfinite(first.joints[..., 0])
    assert seen.sum() == 12 * 12
    assert first.joints[seen] == pytest.approx(camera[:12][seen], abs=1e-5)
    (tmp_path / "Net.txt").write_text("1 2 3\n")
    with pytest.raises(InputError, match="line 1: expected 42 numbers"):
        networks.read_text(tmp_path / "Net.txt")
