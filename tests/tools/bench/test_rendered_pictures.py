"""The rasteriser against closed forms, and pictures that their seed makes alone."""

from __future__ import annotations

import numpy as np
import pytest

from handtrack.errors import SettingsError
from handtrack.hand.skeleton import TIPS
from tools.bench.rendered import motion, rig
from tools.bench.rendered.people import subject
from tools.bench.rendered.raster import Mesh, Raster
from tools.bench.rendered.scene import Scene
from tools.bench.rendered.surface import forearm, skin_pattern, vertex_normals

SIZE = (320, 240)
FOCAL = 300.0


@pytest.fixture(scope="module")
def raster():
    pytest.importorskip("moderngl", reason="moderngl is not installed")
    try:
        made = Raster(SIZE)
    except SettingsError as error:
        pytest.skip(str(error))
    yield made
    made.close()


@pytest.fixture
def camera():
    return rig.looking("cam", np.array([0.1, -1.0, 0.2]), np.zeros(3), FOCAL, SIZE)


def mesh(vertices, faces):
    n = len(vertices)
    zeros, up = np.zeros((n, 3)), np.tile([0.0, 0.0, 1.0], (n, 1))
    return Mesh(
        vertices,
        up,
        np.asarray(faces, np.int32),
        zeros,
        zeros,
        zeros[:, 0],
    )


def before(camera, points):
    """Points of the camera's frame in the world."""
    return (np.asarray(points) - camera.translation) @ camera.rotation


def test_a_quad_covers_its_area_at_its_depth(raster, camera):
    wide, high, z = 0.30, 0.21, 0.8
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * [wide / 2, high / 2, 0]
    quad = mesh(before(camera, corners + np.array([0.02, 0.01, z])), [[0, 1, 2], [0, 2, 3]])
    depth = raster.depth(camera, quad)
    seen = np.isfinite(depth)
    assert seen.sum() == pytest.approx(wide * high * FOCAL**2 / z**2, rel=0.01)
    assert depth[seen] == pytest.approx(z, abs=2e-4)


def test_a_sphere_covers_its_silhouette(raster, camera):
    r, d = 0.15, 0.7
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 121), np.linspace(0, np.pi, 81))
    ball = np.stack([np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)], -1).reshape(-1, 3)
    i = np.arange(121 * 81).reshape(81, 121)
    a, b, c, e = (x.ravel() for x in (i[:-1, :-1], i[:-1, 1:], i[1:, 1:], i[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, e], 1)])
    depth = raster.depth(camera, mesh(before(camera, r * ball + [0, 0, d]), faces))
    seen = np.isfinite(depth)
    # the cone that touches the sphere: tan(half its angle) = r / sqrt(d^2 - r^2)
    assert seen.sum() == pytest.approx(np.pi * FOCAL**2 * r**2 / (d**2 - r**2), rel=0.01)
    assert depth.min() == pytest.approx(d - r, abs=1e-3)


def test_a_point_is_drawn_where_the_camera_projects_it(raster, camera):
    for point in ([0.1, 0.05, -0.08], [-0.2, 0.3, 0.15]):
        small = 0.012 * np.array([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]])
        depth = raster.depth(camera, mesh(point + small, [[0, 1, 2], [0, 2, 3]]))
        rows, columns = np.nonzero(np.isfinite(depth))
        middle = np.array([columns.mean(), rows.mean()]) + 0.5
        assert middle == pytest.approx(camera.project(point), abs=0.6)


def test_normals_point_out_of_a_hand():
    model = subject(0).model
    normals = vertex_normals(model.rest_vertices, model.faces)
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1.0)
    # volume by the divergence theorem: positive if they point outwards
    assert (normals * (model.rest_vertices - model.rest_joints[9])).sum(1).mean() > 0
    arm = forearm(np.eye(3), np.zeros(3), np.array([-1.0, 0, 0]), 1.0)
    outwards = (arm.normals[:, 1:] * arm.vertices[:, 1:]).sum(1)
    # either winding will do: the shader turns them to the eye
    assert (outwards > 0).all() or (outwards < 0).all()


@pytest.mark.parametrize("hand", ["left", "right"])
def test_nails_are_on_the_back(hand):
    pattern = skin_pattern(hand)
    tips = (pattern.finger >= 0) & (
        pattern.local[:, 0] > pattern.joints[pattern.finger.astype(int), 3] - 6
    )
    assert pattern.local[tips, 2].max() > 2
    # the back of a flat hand is where z is
    for finger in (1, 2, 3, 4):
        mine = tips & (pattern.finger == finger)
        assert np.corrcoef(pattern.local[mine, 2], pattern.rest[mine, 2])[0, 1] > 0.9


def taken(raster, seed):
    person = subject(3)
    movement = motion.mirrored(motion.generated(np.random.default_rng(4), 2))
    cameras = rig.arc(np.random.default_rng(5), 2, SIZE)
    return list(Scene(raster, person, cameras, [seed]).pictures(movement)), cameras, movement


def test_a_seed_makes_its_pictures_alone(raster):
    (first, _, _), (again, _, _), (other, _, _) = (taken(raster, seed) for seed in (1, 1, 2))
    assert len(first) == 2
    assert [p.shape for p in first[0]] == [(240, 320, 3)] * 2
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_the_hand_is_drawn_where_its_joints_are(raster):
    person = subject(3)
    _, cameras, movement = taken(raster, 1)
    scene = Scene(raster, person, cameras, [1])
    hand = scene.meshes(movement, 0)[0][0]
    joints = person.model.joints(movement.angles[0], movement.rotation[0], movement.translation[0])
    for camera in cameras:
        depth = raster.depth(camera, hand)
        u, v = np.floor(camera.project(joints)).astype(int).T
        behind = (joints @ camera.rotation.T + camera.translation)[:, 2] - depth[v, u]
        # inside the skin, or behind another part of the hand; tips are on the skin itself
        assert (np.delete(behind, TIPS) > 2e-3).all()
        assert np.isfinite(np.delete(behind, TIPS)).all()
