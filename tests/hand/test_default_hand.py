"""The free hand: its bones, its axes, its skin at rest and how the skin bends."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_NAMES, BASES, FINGERS, PARENTS, TIPS
from tools.make.default_hand import make_hand

Array = NDArray[np.float64]

MIRROR = np.array([1.0, -1.0, 1.0])
ORIGIN = np.zeros(3)

# Buryanov and Kotiuk 2010, Table of means [mm]: the bones beyond each base, pulp on the last
LENGTHS = {
    "thumb": (46.22, 31.57, 21.67 + 5.67),
    "index": (39.78, 22.38, 15.82 + 3.84),
    "middle": (44.63, 26.33, 17.40 + 3.95),
    "ring": (41.37, 25.65, 17.30 + 3.95),
    "little": (32.74, 18.11, 15.96 + 3.73),
}


@pytest.fixture(scope="module")
def right() -> HandModel:
    return HandModel.default("right")


@pytest.fixture(scope="module")
def left() -> HandModel:
    return HandModel.default("left")


def angle(**degrees: float) -> Array:
    """(20,) angles by name, the others zero [rad]."""
    out = np.zeros(len(ANGLE_NAMES))
    for name, value in degrees.items():
        out[ANGLE_NAMES.index(name)] = np.deg2rad(value)
    return out


def fist() -> Array:
    degrees = {f"{f}_mcp_flexion": 80.0 for f in FINGERS[1:]}
    degrees |= {f"{f}_pip_flexion": 100.0 for f in FINGERS[1:]}
    degrees |= {f"{f}_dip_flexion": 60.0 for f in FINGERS[1:]}
    return angle(**degrees, thumb_mcp_flexion=40, thumb_ip_flexion=60)


def volume(vertices: Array, faces: NDArray[np.int32]) -> float:
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    return float((np.cross(a, b) * c).sum() / 6)


def winding(points: Array, vertices: Array, faces: NDArray[np.int32]) -> Array:
    """How often the surface winds about each point: 1 inside, 0 outside (solid angles)."""
    a, b, c = (vertices[faces[:, i]] - points[:, None] for i in range(3))
    la, lb, lc = (np.linalg.norm(x, axis=-1) for x in (a, b, c))
    det = (a * np.cross(b, c)).sum(-1)
    dots = (a * b).sum(-1) * lc + (b * c).sum(-1) * la + (c * a).sum(-1) * lb
    return np.arctan2(det, la * lb * lc + dots).sum(-1) / (2 * np.pi)


def surface_distance(point: Array, vertices: Array, faces: NDArray[np.int32]) -> float:
    """Distance to the surface, by a fine sampling of the nearest triangles."""
    corners = vertices[faces]
    near = corners[np.argsort(np.linalg.norm(corners.mean(1) - point, axis=1))[:30]]
    u, v = np.meshgrid(np.linspace(0, 1, 41), np.linspace(0, 1, 41))
    bary = np.stack([u * (1 - v), u * v, 1 - u], -1).reshape(-1, 3)
    return float(np.linalg.norm(bary @ near - point, axis=-1).min())


def directed_edges(faces: NDArray[np.int32]) -> NDArray[np.int32]:
    return np.concatenate([faces[:, [i, (i + 1) % 3]] for i in range(3)])


# bones and axes


def test_bones_have_the_published_lengths(right: HandModel) -> None:
    lengths = right.bone_lengths.reshape(5, 4)[:, 1:]
    np.testing.assert_allclose(lengths * 1000, list(LENGTHS.values()), atol=1e-6)


def test_axes_are_perpendicular_to_what_they_turn(right: HandModel) -> None:
    bones = right.rest_joints[1:] - right.rest_joints[PARENTS[1:]]
    bones /= np.linalg.norm(bones, axis=1, keepdims=True)
    np.testing.assert_allclose(np.linalg.norm(right.axes, axis=1), 1, atol=1e-12)
    for f in range(5):
        flexion, abduction, middle, last = right.axes[4 * f : 4 * f + 4]
        first_bone, second_bone, third_bone = bones[4 * f + 1 : 4 * f + 4]
        assert abs(flexion @ first_bone) < 1e-9
        assert abs(abduction @ first_bone) < 1e-9
        assert abs(flexion @ abduction) < 1e-9
        assert abs(middle @ second_bone) < 1e-9
        assert abs(last @ third_bone) < 1e-9


@pytest.mark.parametrize("hand", ["right", "left"])
def test_angles_turn_the_way_they_are_named(hand: str) -> None:
    model = HandModel.default("right" if hand == "right" else "left")
    radial = 1.0 if hand == "right" else -1.0
    rest = model.joints(np.zeros(20))
    for f, name in enumerate(FINGERS[1:], start=1):
        for joint in ("mcp", "pip", "dip"):
            moved = model.joints(angle(**{f"{name}_{joint}_flexion": 30}))[TIPS[f]]
            assert moved[2] < rest[TIPS[f], 2] - 0.005  # to the palm's side
        moved = model.joints(angle(**{f"{name}_mcp_abduction": 10}))[TIPS[f]]
        assert radial * (moved[1] - rest[TIPS[f], 1]) > 0.005  # to the thumb's side
    little = rest[BASES[4]]
    for joint in ("cmc", "mcp", "ip"):
        tip = model.joints(angle(**{f"thumb_{joint}_flexion": 30}))[4]
        assert np.linalg.norm(tip - little) < np.linalg.norm(rest[4] - little) - 0.002
    tip = model.joints(angle(thumb_cmc_abduction=20))[4]
    assert np.linalg.norm(tip - rest[8]) > np.linalg.norm(rest[4] - rest[8]) + 0.01


# the skin at rest


def test_skin_is_closed_and_of_one_piece(right: HandModel) -> None:
    faces, n = right.faces, len(right.rest_vertices)
    assert 1000 <= n <= 2500
    edges = directed_edges(faces)
    keys = edges[:, 0].astype(np.int64) * n + edges[:, 1]
    assert len(np.unique(keys)) == len(keys)  # no edge twice in the same direction
    back = edges[:, 1].astype(np.int64) * n + edges[:, 0]
    assert set(keys.tolist()) == set(back.tolist())  # each has its opposite
    assert len(np.unique(np.sort(faces, 1), axis=0)) == len(faces)
    assert np.array_equal(np.unique(faces), np.arange(n))
    assert n - len(edges) // 2 + len(faces) == 2
    label = np.arange(n)
    for _ in range(n):  # spread the least label along the edges
        before = label.copy()
        np.minimum.at(label, edges[:, 0], label[edges[:, 1]])
        if np.array_equal(before, label):
            break
    assert not label.any()


def test_triangles_are_well_shaped(right: HandModel) -> None:
    a, b, c = (right.rest_vertices[right.faces[:, i]] * 1000 for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    sides = sum(((x - y) ** 2).sum(1) for x, y in ((a, b), (b, c), (c, a)))
    quality = 4 * np.sqrt(3) * area / sides  # 1 for an equilateral triangle
    assert area.min() > 0.3
    assert quality.min() > 0.2
    assert np.percentile(quality, 5) > 0.5
    # neighbours do not fold over
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    edges = directed_edges(right.faces)
    face = np.tile(np.arange(len(right.faces)), 3)
    owner = {(int(p), int(q)): int(f) for (p, q), f in zip(edges, face, strict=True)}
    bend = [normal[f] @ normal[owner[q, p]] for (p, q), f in owner.items()]
    assert min(bend) > 0.1


def test_every_finger_has_a_nail(right: HandModel) -> None:
    """A plate over most of the fingertip's width: level along the finger, arched across it."""
    a, b, c = (right.rest_vertices[right.faces[:, i]] for i in range(3))
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1) / 2
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    for f, tip in enumerate(TIPS):
        along = right.rest_joints[tip] - right.rest_joints[tip - 1]
        along /= np.linalg.norm(along)
        back = np.cross(along, right.axes[4 * f + 3])
        local = (a + b + c) / 3 - right.rest_joints[tip]
        plate = (np.abs(normal @ along) < 0.2) & (normal @ back > 0.75)
        plate &= (local @ along > -0.010) & (local @ back > 0)
        plate &= np.linalg.norm(local, axis=1) < 0.013
        # the rounded tips without nails had 0 to 44 mm2 of such skin
        assert 55e-6 < area[plate].sum() < 100e-6


@pytest.mark.parametrize("hand", ["right", "left"])
def test_skin_encloses_a_hand(hand: str) -> None:
    model = HandModel.default("right" if hand == "right" else "left")
    cm3 = volume(model.rest_vertices, model.faces) * 1e6
    assert 250 < cm3 < 450
    inner = np.setdiff1d(np.arange(21), TIPS)
    inside = winding(model.rest_joints[inner], model.rest_vertices, model.faces)
    np.testing.assert_allclose(inside, 1, atol=1e-6)
    for tip in TIPS:
        d = surface_distance(model.rest_joints[tip], model.rest_vertices, model.faces)
        assert d < 0.0015


def test_webs_reach_about_half_the_first_bone(right: HandModel) -> None:
    joints = right.rest_joints
    for f in (1, 2, 3):
        a, b = BASES[f], BASES[f + 1]

        def between(s: float, a: int = a, b: int = b) -> Array:
            left = joints[a] + s * (joints[a + 1] - joints[a])
            right_ = joints[b] + s * (joints[b + 1] - joints[b])
            return 0.5 * (left + right_) - np.array([0, 0, 0.003])

        points = np.array([between(0.25), between(0.70)])
        inside = winding(points, right.rest_vertices, right.faces)
        assert inside[0] > 0.5
        assert inside[1] < 0.5


def test_weights_are_smooth_and_keep_to_their_finger(right: HandModel) -> None:
    w = right.weights
    assert w.min() >= 0
    np.testing.assert_allclose(w.sum(1), 1, atol=1e-6)
    assert (w > 0).sum(1).max() <= 4
    fingers = w[:, 1:].reshape(-1, 5, 3)
    beyond = fingers[:, :, 1:].sum(2) > 0  # moved by the second or third bone
    touched = fingers.sum(2) > 0
    assert not (beyond & (touched.sum(1) > 1)[:, None]).any()
    # in a web two neighbours' first bones meet, never fingers further apart
    first, last = touched.argmax(1), 4 - touched[:, ::-1].argmax(1)
    assert (last - first)[touched.any(1)].max() <= 1
    edges = directed_edges(right.faces)
    assert np.abs(w[edges[:, 0]] - w[edges[:, 1]]).max() < 0.7
    for part in range(16):  # each part has skin of its own
        assert (w[:, part] > 0.9).sum() > 10


# the skin when it bends


def test_left_is_the_mirror_of_right(right: HandModel, left: HandModel) -> None:
    assert volume(left.rest_vertices, left.faces) > 0
    np.testing.assert_allclose(left.rest_joints, right.rest_joints * MIRROR, atol=1e-12)
    rng = np.random.default_rng(3)
    angles = right.limits.clamp(rng.uniform(-1, 1.6, (20, 20)))
    np.testing.assert_allclose(left.joints(angles), right.joints(angles) * MIRROR, atol=1e-12)
    for a in angles[:4]:
        ours = left.vertices(a, translation=ORIGIN)
        np.testing.assert_allclose(ours, right.vertices(a, translation=ORIGIN) * MIRROR, atol=1e-9)


def test_bent_joints_do_not_collapse(right: HandModel) -> None:
    """The skin's sections near a joint bent by 100 degrees keep at least half their area."""
    bends = {f"{f}_pip_flexion": (4 * i + 2, i) for i, f in enumerate(FINGERS) if i}
    bends["thumb_ip_flexion"] = (3, 0)
    rest, faces = right.rest_vertices, right.faces
    for name, (joint, finger) in bends.items():
        bent = right.vertices(angle(**{name: 100 if finger else 90}), translation=ORIGIN)
        own = right.weights[:, 1 + 3 * finger : 4 + 3 * finger].sum(1) > 0.5
        mine = faces[own[faces].all(1)]
        bone = right.rest_joints[joint + 1] - right.rest_joints[joint]
        bone /= np.linalg.norm(bone)
        for offset in (-0.006, -0.003, 0.0, 0.003, 0.006):
            # the section of the skin at rest, carried along by the skin
            before, after = section(
                rest, bent, mine, right.rest_joints[joint] + offset * bone, bone
            )
            assert 1e-4 < before < 5e-4  # one finger's section: 100 to 500 mm2
            assert after > 0.5 * before, f"{name}, {offset * 1000:.0f} mm from the joint"


def section(
    rest: Array, bent: Array, faces: NDArray[np.int32], point: Array, normal: Array
) -> tuple[float, float]:
    """Area of a plane section of the rest skin, and of the same loop on the bent skin."""
    height = (rest - point) @ normal
    before, after = np.zeros(3), np.zeros(3)
    for face in faces:
        up = height[face] > 0
        if up.all() or not up.any():
            continue
        ends = {}
        for p, q in ((0, 1), (1, 2), (2, 0)):
            if up[p] != up[q]:
                i, j = face[p], face[q]
                t = height[i] / (height[i] - height[j])
                ends[bool(up[p])] = [x[i] + t * (x[j] - x[i]) for x in (rest, bent)]
        before += np.cross(ends[True][0] - point, ends[False][0] - point) / 2
        after += np.cross(ends[True][1] - point, ends[False][1] - point) / 2
    return float(np.linalg.norm(before)), float(np.linalg.norm(after))


def test_fist_keeps_volume_and_does_not_tear(right: HandModel) -> None:
    bent = right.vertices(fist(), translation=ORIGIN)
    rest = right.rest_vertices
    ratio = volume(bent, right.faces) / volume(rest, right.faces)
    assert 0.85 < ratio < 1.1
    edges = directed_edges(right.faces)
    length = np.linalg.norm(bent[edges[:, 0]] - bent[edges[:, 1]], axis=1)
    assert length.max() < 0.02


def test_skin_follows_the_bones(right: HandModel) -> None:
    """Fingertips stay at the skin, and inner joints inside it, in bent poses."""
    bent, joints = right.vertices(fist(), translation=ORIGIN), right.joints(fist())
    for tip in TIPS:
        assert surface_distance(joints[tip], bent, right.faces) < 0.0015
    inner = np.setdiff1d(np.arange(21), TIPS)
    assert winding(joints[inner], bent, right.faces).min() > 0.9


def test_file_is_what_the_tool_makes(right: HandModel) -> None:
    made = make_hand()
    np.testing.assert_allclose(made["rest_joints"], right.rest_joints, atol=1e-9)
    np.testing.assert_allclose(made["axes"], right.axes, atol=1e-9)
    np.testing.assert_allclose(made["rest_vertices"], right.rest_vertices, atol=1e-5)
    np.testing.assert_allclose(made["weights"], right.weights, atol=0.003)
    assert np.array_equal(made["faces"], right.faces)
