"""A hand as a robot, loaded by MuJoCo and yourdfpy: the same joints, limits, capsules and skin."""

from __future__ import annotations

import csv
import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_tracks import make_track, without_skin
from screens import lacking

import handtrack as ht
from handtrack.cli import run
from handtrack.errors import SettingsError
from handtrack.exporting.robot import DENSITY, TWIST, links, part_meshes
from handtrack.hand.capsules import capsule_radii
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES
from handtrack.tracking.track import Track

WITHIN_M = 1e-5
"""What the issue asks for: 0.01 mm."""


@pytest.fixture(scope="module")
def mujoco() -> Any:
    try:
        import mujoco
    except ImportError:
        lacking("mujoco", "it loads the robot that is written")
    return mujoco


@pytest.fixture(scope="module")
def yourdfpy() -> Any:
    try:
        import yourdfpy
    except ImportError:
        lacking("yourdfpy", "it loads the robot that is written")
    return yourdfpy


def odd_track(hand: str, twist: float, frames: int = 20) -> Track:
    """A track of a hand whose bones and axes are nobody else's, as calibration makes them."""
    rng = np.random.default_rng(4)
    model = ht.HandModel.default(hand)
    rest = model.rest_joints + rng.normal(0, 0.004, (21, 3))
    turn = vector_to_matrix(rng.normal(0, 0.2, (20, 3)))
    axes = (turn @ model.axes[..., None])[..., 0]
    model = dataclasses.replace(model, rest_joints=rest, axes=axes, thumb_twist=twist)
    return dataclasses.replace(make_track(frames, hand), model=model)


def random_poses(track: Track) -> np.ndarray:
    rng = np.random.default_rng(7)
    limits = track.model.limits
    return rng.uniform(limits.lower, limits.upper, (100, 20))


def with_twist(track: Track, angles: np.ndarray) -> dict[str, float]:
    """Angles of all hinges by name."""
    found = dict(zip(ANGLE_NAMES, angles, strict=True))
    if track.model.thumb_twist:
        found[TWIST] = track.model.thumb_twist * found["thumb_cmc_abduction"]
    return found


@pytest.mark.parametrize(("hand", "twist"), [("right", 0.0), ("left", 0.7)])
@pytest.mark.parametrize("ending", [".urdf", ".xml", ".mjcf"])
def test_mujoco_puts_the_joints_where_the_hand_has_them(
    mujoco: Any, hand: str, twist: float, ending: str, tmp_path: Path
) -> None:
    track = odd_track(hand, twist)
    (file,) = ht.export(track, tmp_path / f"hand{ending}")
    model = mujoco.MjModel.from_xml_path(str(file.path))
    data = mujoco.MjData(model)
    limits = track.model.limits
    for a, name in enumerate(ANGLE_NAMES):
        low, high = model.joint(name).range
        assert (low, high) == pytest.approx((limits.lower[a], limits.upper[a]), abs=1e-7)
    off = []
    for angles in random_poses(track):
        for name, value in with_twist(track, angles).items():
            data.joint(name).qpos[:] = value
        mujoco.mj_kinematics(model, data)
        sites = [model.site(i).name for i in range(model.nsite)]
        places = [data.site(n).xpos if n in sites else data.body(n).xpos for n in JOINT_NAMES]
        joints = track.model.joints(angles)
        off.append(np.abs(np.array(places) - (joints - joints[0])).max())
    assert max(off) < WITHIN_M


@pytest.mark.parametrize(("hand", "twist"), [("left", 0.0), ("right", 0.7)])
def test_yourdfpy_puts_the_joints_and_the_skin_where_the_hand_has_them(
    yourdfpy: Any, hand: str, twist: float, tmp_path: Path
) -> None:
    track = odd_track(hand, twist)
    (file,) = ht.export(track, tmp_path / "hand.urdf")
    robot = yourdfpy.URDF.load(str(file.path), load_meshes=True)
    assert robot.validate()
    assert tuple(robot.actuated_joint_names) == ANGLE_NAMES  # the twist follows
    off = []
    for angles in random_poses(track):
        robot.update_cfg(dict(zip(ANGLE_NAMES, angles, strict=True)))
        places = [robot.get_transform(n, "wrist")[:3, 3] for n in JOINT_NAMES]
        joints = track.model.joints(angles)
        off.append(np.abs(np.array(places) - (joints - joints[0])).max())
    assert max(off) < WITHIN_M
    # vertices that one part alone moves are in its mesh, where skinning puts them
    model = track.model
    rigid = np.flatnonzero(model.weights.max(1) > 1 - 1e-9)
    expected = model.vertices(angles)[rigid] - joints[0]
    shown = robot.scene.to_geometry().vertices
    root = robot.scene.graph.get("wrist")[0]
    shown = (shown - root[:3, 3]) @ root[:3, :3]
    nearest = [np.linalg.norm(shown - point, axis=1).min() for point in expected[::7]]
    assert len(nearest) > 50
    assert max(nearest) < WITHIN_M


@pytest.mark.parametrize("ending", [".urdf", ".xml"])
def test_the_wrist_floats_in_a_named_frame(mujoco: Any, ending: str, tmp_path: Path) -> None:
    track = odd_track("right", 0.7)
    (file,) = ht.export(track, tmp_path / f"hand{ending}", base="world")
    model = mujoco.MjModel.from_xml_path(str(file.path))
    data = mujoco.MjData(model)
    moves = {".urdf": "hand_joints.csv", ".xml": "hand_xml_joints.csv"}[ending]
    with (tmp_path / moves).open() as text:
        rows = list(csv.DictReader(text))
    assert len(rows) == len(track)
    lost = np.isnan(track.angles).any(1)
    frames = np.flatnonzero(~lost)
    assert frames.size
    for t in frames[::5]:
        row = {name: float(value) for name, value in rows[t].items()}
        assert row["time_s"] == pytest.approx((track.time_ns[t] - track.time_ns[0]) * 1e-9)
        pose = [row[c] for c in ("x", "y", "z", "qw", "qx", "qy", "qz")]
        data.joint("world_to_wrist").qpos[:] = pose
        for name in (*ANGLE_NAMES, TWIST):
            data.joint(name).qpos[:] = row[name]
        mujoco.mj_kinematics(model, data)
        rotation = np.empty(9)
        mujoco.mju_quat2Mat(rotation, track.quaternion[t])
        expected = track.model.joints(track.angles[t], rotation.reshape(3, 3), track.translation[t])
        sites = [model.site(i).name for i in range(model.nsite)]
        places = [data.site(n).xpos if n in sites else data.body(n).xpos for n in JOINT_NAMES]
        assert np.abs(np.array(places) - expected).max() < WITHIN_M
    for t in np.flatnonzero(lost):
        assert rows[t]["x"] == rows[t]["index_mcp_flexion"] == ""


def test_motors_bring_the_fingers_to_a_pose(mujoco: Any, tmp_path: Path) -> None:
    track = make_track(5)
    track = dataclasses.replace(track, model=dataclasses.replace(track.model, thumb_twist=0.5))
    ht.export(track, tmp_path / "hand.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "hand.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == 0  # nothing pushes in the flat hand
    goal = track.model.limits.clamp(np.tile([0.5, 0.05, 0.7, 0.4], 5))
    for name, angle in zip(ANGLE_NAMES, goal, strict=True):
        data.actuator(name).ctrl[:] = angle
    for _ in range(1000):
        mujoco.mj_step(model, data)
    found = [data.joint(name).qpos[0] for name in ANGLE_NAMES]
    assert np.rad2deg(np.abs(found - goal)).max() < 5
    follows = data.joint(TWIST).qpos[0] - track.model.thumb_twist * data.joint(ANGLE_NAMES[1]).qpos
    assert abs(follows[0]) < 0.01


def test_capsules_and_masses_are_those_of_the_hand(mujoco: Any, tmp_path: Path) -> None:
    track = make_track(5)
    radii = capsule_radii(track.model)
    ht.export(track, tmp_path / "hand.xml")
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "hand.xml"))
    capsules = model.geom_type == mujoco.mjtGeom.mjGEOM_CAPSULE
    assert sorted(model.geom_size[capsules, 0]) == pytest.approx(sorted(radii), abs=1e-8)
    # MuJoCo computes a capsule's mass and inertia by itself
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="one")
    link = next(x for x in links(track.model) if x.name == "middle_mcp")
    ends = np.concatenate([link.capsules[0].first, link.capsules[0].last])
    geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=ends, density=DENSITY)
    geom.size = [link.capsules[0].radius, 0, 0]
    alone = spec.compile()
    assert link.mass == pytest.approx(alone.body_mass[1], rel=1e-6)
    moments = np.sort(np.linalg.eigvalsh(link.inertia))
    assert moments == pytest.approx(np.sort(alone.body_inertia[1]), rel=1e-5)
    total = model.body_subtreemass[0]
    assert 0.2 < total < 0.6  # a hand weighs some 0.4 kg


@pytest.mark.parametrize("hand", ["right", "left"])
def test_pieces_of_the_skin_are_closed(hand: str) -> None:
    model = ht.HandModel.default(hand)
    volume = 0.0
    for mesh in part_meshes(model):
        assert mesh is not None
        edges = mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
        there = {(int(a), int(b)) for a, b in edges}
        assert len(there) == len(edges)
        assert all((b, a) in there for a, b in there)
        a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
        inside = (a * np.cross(b, c)).sum() / 6
        assert inside > 0
        volume += inside
    a, b, c = np.moveaxis(model.rest_vertices[model.faces], 1, 0)
    # neighbours overlap at the joints, so that no gap opens where they bend
    whole = (a * np.cross(b, c)).sum() / 6
    assert whole < volume < 1.4 * whole


def test_a_hand_without_a_skin_shows_its_capsules(yourdfpy: Any, tmp_path: Path) -> None:
    track = make_track(5)
    track = dataclasses.replace(track, model=without_skin(track.model))
    (file,) = ht.export(track, tmp_path / "hand.urdf")
    assert "capsules are shown instead" in "; ".join(file.notes)
    assert not (tmp_path / "hand_meshes").exists()
    robot = yourdfpy.URDF.load(str(file.path))
    assert len(robot.scene.geometry) == 3 * 19


def test_command_line_and_names(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    ht.write_mcap([make_track(5), make_track(5, "left")], tmp_path / "x.mcap")
    assert run(["export", str(tmp_path / "x.mcap"), str(tmp_path / "two.urdf")]) == 0
    assert (tmp_path / "two_left.urdf").is_file()
    assert (tmp_path / "two_right_joints.csv").is_file()
    assert (tmp_path / "two_left_meshes" / "wrist.stl").is_file()
    said = capsys.readouterr().out
    assert "joints by time in two_left_joints.csv" in said
    for base in ("index_mcp", "", "a b", "<x>"):
        with pytest.raises(SettingsError, match="expected wrist or the name of the frame"):
            ht.export(make_track(5), tmp_path / "y.urdf", base=base)
    assert not list(tmp_path.glob("y*"))


def test_documents_of_one_name_keep_their_own_files(tmp_path: Path) -> None:
    for hand, ending, base in (("right", "urdf", "wrist"), ("left", "xml", "world")):
        ht.export(make_track(5, hand), tmp_path / f"hand.{ending}", base=base)
    first = (tmp_path / "hand_joints.csv").read_text().splitlines()
    second = (tmp_path / "hand_xml_joints.csv").read_text().splitlines()
    assert "qw" not in first[0]
    assert "qw" in second[0]
    skins = [tmp_path / f"hand{kind}_meshes" / "wrist.stl" for kind in ("", "_xml")]
    assert skins[0].read_bytes() != skins[1].read_bytes()
    for ending, folder in (("urdf", "hand_meshes"), ("xml", "hand_xml_meshes")):
        assert f"{folder}" in (tmp_path / f"hand.{ending}").read_text()


def test_quaternions_are_the_wrist_in_the_named_frame(tmp_path: Path) -> None:
    track = make_track(5)
    ht.export(track, tmp_path / "y.urdf", base="camera")
    text = (tmp_path / "y.urdf").read_text()
    assert '<link name="camera"' in text
    with (tmp_path / "y_joints.csv").open() as file:
        row = next(csv.DictReader(file))
    assert [float(row[f"q{c}"]) for c in "wxyz"] == pytest.approx(track.quaternion[0], abs=1e-8)
