"""Exports, read back by readers of their own: the same hand comes out."""

from __future__ import annotations

import dataclasses
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from foreign_formats import Bvh, Glb
from held_poses import held
from made_tracks import make_track, with_skin, without_skin
from screens import lacking

import handtrack as ht
from handtrack.exporting.bvh import euler_zxy
from handtrack.hand.rotations import matrix_to_quaternion, vector_to_matrix
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.tracking.track import Track

Z_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From a frame with z up to one with y up."""


def tumbling(track: Track) -> Track:
    """The same hand, turning about all axes, through every attitude of its root."""
    t = np.arange(len(track))[:, None] / 30
    turn = vector_to_matrix([1.7, 0.4, 0.9] * t * 2.5) @ vector_to_matrix([0.0, 2.9, 0.3] * t)
    quaternion = matrix_to_quaternion(turn)
    quaternion[np.isnan(track.quaternion).any(1)] = np.nan
    joints = track.model.joints(track.angles, turn, track.translation)
    return dataclasses.replace(track, quaternion=quaternion, filtered_joints=joints)


def bvh_joints(path: Path, unit_m: float) -> np.ndarray:
    """(T, 21, 3) [m] of a BVH file: end sites are the tips."""
    file = Bvh(path)
    names = [
        (n or f"{(file.names[p] or '').rpartition('_')[0]}_tip").partition("_")[2]
        for n, p in zip(file.names, file.parents, strict=True)
    ]
    return file.positions()[:, [names.index(name) for name in JOINT_NAMES]] * unit_m


def validate(path: Path) -> None:
    """Ask the Khronos validator, where node and its package are there (NODE_PATH)."""
    code = (
        "const v = require('gltf-validator'), fs = require('fs');"
        "v.validateBytes(new Uint8Array(fs.readFileSync(process.argv[1])))"
        ".then(r => console.log(JSON.stringify(r.issues)))"
    )
    if shutil.which("node") is None:
        lacking("node", "the Khronos validator needs it")
    done = subprocess.run(["node", "-e", code, str(path)], capture_output=True, text=True)
    if "Cannot find module" in done.stderr:
        lacking("node", "the Khronos validator is not there (npm install gltf-validator)")
    issues = json.loads(done.stdout)
    assert (issues["numErrors"], issues["numWarnings"]) == (0, 0), issues["messages"]


@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize(("unit", "unit_m"), [("cm", 0.01), ("m", 1.0), ("mm", 0.001)])
def test_bvh_moves_the_same_joints(hand: str, unit: str, unit_m: float, tmp_path: Path) -> None:
    track = tumbling(make_track(90, hand))
    (file,) = ht.export(track, tmp_path / "x.bvh", unit=unit)
    assert file.frames == 90
    assert file.lost == 6
    assert file.notes == ("the last pose held in 6 lost frames", f"in {unit}")
    found = bvh_joints(file.path, unit_m)
    assert np.abs(found - held(track.filtered_joints)).max() < 1e-5
    assert Bvh(file.path).step == pytest.approx(1 / 30, abs=1e-8)


def test_bvh_numbers_do_not_jump(tmp_path: Path) -> None:
    # a turn of the wrist straight through the attitude where z and y are the same axis
    track = make_track(60, lost=slice(0, 0))
    angle = np.linspace(0, 3, 60)[:, None]
    turn = vector_to_matrix([1.0, 0.002, 0.001] * angle)
    track = dataclasses.replace(track, quaternion=matrix_to_quaternion(turn))
    ht.export(track, tmp_path / "x.bvh")
    values = Bvh(tmp_path / "x.bvh").values[:, 3:]
    assert np.abs(np.diff(values, axis=0)).max() < 60
    expected = track.model.joints(track.angles, turn, track.translation)
    assert np.abs(bvh_joints(tmp_path / "x.bvh", 0.01) - expected).max() < 1e-5


def test_euler_angles_at_the_pole() -> None:
    for x in (np.pi / 2, -np.pi / 2):
        turn = vector_to_matrix([0, 0, 0.7]) @ vector_to_matrix([x, 0, 0])
        z, x_found, y = euler_zxy(turn[None, None])[0, 0]
        again = vector_to_matrix([0, 0, z]) @ vector_to_matrix([x_found, 0, 0])
        np.testing.assert_allclose(again @ vector_to_matrix([0, y, 0]), turn, atol=1e-7)


def test_bvh_of_uneven_times_goes_onto_a_grid(tmp_path: Path) -> None:
    track = make_track(120, lost=slice(0, 0))
    rng = np.random.default_rng(0)
    keep = np.sort(rng.choice(120, 100, replace=False))
    arrays = {
        f.name: getattr(track, f.name)[keep]
        for f in dataclasses.fields(Track)
        if isinstance(getattr(track, f.name), np.ndarray)
    }
    (file,) = ht.export(dataclasses.replace(track, **arrays), tmp_path / "x.bvh")
    assert "even grid of 30.00 frames/s" in file.notes[-1]
    found = bvh_joints(file.path, 0.01)
    assert len(found) == keep[-1] - keep[0] + 1
    off = np.linalg.norm(found - track.filtered_joints[keep[0] : keep[-1] + 1], axis=-1).max(1)
    # frames that are there are as they were, between them the motion goes on
    assert off[keep - keep[0]].max() < 1e-5
    assert off.max() < 0.004


@pytest.mark.parametrize("gap_s", [600, 86_400 * 365, 50 * 86_400 * 365])
def test_bvh_of_a_long_gap_is_short(gap_s: int, tmp_path: Path) -> None:
    track = make_track(60, lost=slice(0, 0))
    time_ns = track.time_ns.copy()
    time_ns[30:] += gap_s * 10**9
    (file,) = ht.export(dataclasses.replace(track, time_ns=time_ns), tmp_path / "x.bvh")
    assert "1 gap of more than 10 s shortened" in file.notes[-1]
    assert f"{gap_s - 1:,} s left out" in file.notes[-1]
    found = bvh_joints(file.path, 0.01)
    assert len(found) == 60 + 29  # a second between frames 29 and 30
    for rows, there in ((slice(0, 30), slice(0, 30)), (slice(59, None), slice(30, None))):
        assert np.abs(found[rows] - track.filtered_joints[there]).max() < 1e-5


def test_bvh_of_bursts_has_a_coarser_grid(tmp_path: Path) -> None:
    track = make_track(60, lost=slice(0, 0))
    # ten bursts of six frames, a millisecond apart in each, nine seconds between
    time_ns = (np.arange(60) % 6 + 9000 * (np.arange(60) // 6)) * 10**6
    (file,) = ht.export(dataclasses.replace(track, time_ns=time_ns), tmp_path / "x.bvh")
    assert len(Bvh(file.path).values) == 20 * 60 + 1000
    assert "(2200 frames)" in file.notes[-1]


@pytest.mark.parametrize("hand", ["right", "left"])
def test_glb_moves_the_same_joints_and_skin(hand: str, tmp_path: Path) -> None:
    track = tumbling(make_track(50, hand))
    (file,) = ht.export(track, tmp_path / "x.glb")
    assert file.notes == ("the last pose held in 6 lost frames",)
    glb = Glb(file.path)
    joints = [glb.node(f"{hand}_{name}") for name in JOINT_NAMES]
    found = glb.worlds()[:, joints][..., :3, 3]
    assert np.abs(found - held(track.filtered_joints)).max() < 1e-6
    vertices = glb.skinned(f"{hand}_skin")
    assert np.abs(vertices - held(track.vertices())).max() < 2e-6
    for times, values in glb.keys("rotation").values():
        np.testing.assert_allclose(times, track.time_ns * 1e-9, atol=1e-6)
        np.testing.assert_allclose(np.linalg.norm(values, axis=1), 1, atol=1e-6)
        assert ((values[1:] * values[:-1]).sum(1) > 0).all()
    # the bind pose is the rest pose
    skin = glb.json["skins"][0]
    bind = glb.array(skin["inverseBindMatrices"]).reshape(-1, 4, 4).swapaxes(1, 2)
    np.testing.assert_allclose(np.linalg.inv(bind)[:, :3, 3], track.model.rest_joints, atol=1e-7)
    (primitive,) = glb.json["meshes"][0]["primitives"]
    faces = glb.array(primitive["indices"]).reshape(-1, 3)
    np.testing.assert_array_equal(faces, track.model.faces)
    weights = glb.array(primitive["attributes"]["WEIGHTS_0"])
    np.testing.assert_allclose(weights.sum(1), 1, atol=1e-6)
    validate(file.path)


def test_glb_of_two_hands_without_skin_and_with_dense_weights(tmp_path: Path) -> None:
    right = make_track(
        20, "right", model=without_skin(ht.HandModel.default("right")), lost=slice(3)
    )
    model = with_skin(ht.HandModel.default("left"))
    rng = np.random.default_rng(0)
    weights = model.weights + 0.01 * rng.random(model.weights.shape)
    weights /= weights.sum(1, keepdims=True)
    model = dataclasses.replace(model, weights=weights, licensed=True)
    left = make_track(30, "left", model=model, start_ns=500_000_000, lost=slice(0))
    (file,) = ht.export([right, left], tmp_path / "x.glb", up="z")
    assert file.hands == ("right", "left")
    assert (file.frames, file.lost) == (50, 3)
    notes = "; ".join(file.notes)
    assert "no skin here: bones are drawn" in notes
    assert "four weights are kept" in notes
    assert "licensed" in notes
    glb = Glb(file.path)
    rotations = glb.keys("rotation")
    assert rotations[glb.node("left_wrist")][0][0] == pytest.approx(0.5)
    assert rotations[glb.node("right_wrist")][0][0] == 0
    wrist = glb.keys("translation")[glb.node("left_wrist")][1]
    np.testing.assert_allclose(wrist, left.filtered_joints[:, 0] @ Z_UP.T, atol=1e-6)
    wrist = glb.keys("translation")[glb.node("right_wrist")][1]
    np.testing.assert_allclose(wrist, held(right.filtered_joints)[:, 0] @ Z_UP.T, atol=1e-6)
    validate(file.path)


def test_raw_poses_on_demand(track: Track, tmp_path: Path) -> None:
    ht.export(track, tmp_path / "x.bvh", raw=True)
    found = bvh_joints(tmp_path / "x.bvh", 0.01)
    assert np.abs(found - held(track.fitted_joints)).max() < 1e-5
    assert np.abs(found - held(track.filtered_joints)).max() > 1e-3
