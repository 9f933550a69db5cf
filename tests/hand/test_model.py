"""HandModel against the paper's equations, written out again with SciPy's rotations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from handtrack.errors import ModelError, SettingsError
from handtrack.hand.limits import Limits, preset
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import ANGLE_NAMES, BASES, FINGERS, HANDS, N_ANGLES

MIRROR = np.array([1.0, -1.0, 1.0])
PARTS = [(0, None), *((4 * f + 1 + i, 3 * f + i) for f in range(5) for i in range(3))]


@pytest.fixture(scope="module", params=HANDS)
def model(request) -> HandModel:
    return HandModel.default(request.param)


def poses(model: HandModel, n: int, seed: int = 0) -> np.ndarray:
    limits = model.limits
    rng = np.random.default_rng(seed)
    return limits.clamp(rng.uniform(1.2 * limits.lower, 1.2 * limits.upper, (n, N_ANGLES)))


def chain(model: HandModel, angles: np.ndarray, f: int) -> tuple[list, list]:
    """Rotations A_k and positions t_k of finger f's joints (eq. 1, 2, 4, 5), tip last."""
    z, y, hinge2, hinge3 = (model.axes[4 * f + a] * angles[4 * f + a] for a in range(4))
    saddle = Rotation.from_rotvec(z) * Rotation.from_rotvec(y)
    base = 4 * f + 1
    turns, places = [Rotation.identity()], [model.rest_joints[base]]
    for i, r in enumerate((saddle, Rotation.from_rotvec(hinge2), Rotation.from_rotvec(hinge3))):
        turns.append(turns[-1] * r)
        bone = model.rest_joints[base + i + 1] - model.rest_joints[base + i]
        places.append(places[-1] + turns[-1].apply(bone))
    return turns[1:], places


def slow_joints(model: HandModel, angles: np.ndarray) -> np.ndarray:
    out = np.empty((21, 3))
    out[0] = model.rest_joints[0]
    for f in range(5):
        out[4 * f + 1 : 4 * f + 5] = chain(model, angles, f)[1]
    return out


def slow_vertices(model: HandModel, angles: np.ndarray, which: np.ndarray) -> np.ndarray:
    """Linear-blend skinning, vertex by vertex, part by part."""
    chains = [chain(model, angles, f) for f in range(5)]
    out = np.zeros((len(which), 3))
    for row, v in enumerate(which):
        rest = model.rest_vertices[v]
        for part, w in enumerate(model.weights[v]):
            if part == 0:
                out[row] += w * rest
                continue
            f, i = divmod(part - 1, 3)
            joint = 4 * f + 1 + i
            turns, places = chains[f]
            out[row] += w * (turns[i].apply(rest - model.rest_joints[joint]) + places[i])
    return out


def test_joints_are_those_of_the_equations(model):
    for angles in poses(model, 40):
        assert np.allclose(model.joints(angles), slow_joints(model, angles), rtol=0, atol=1e-14)


def test_joints_of_another_hand_are_those_of_the_equations():
    # axes that are not perpendicular and bones in any direction
    rng = np.random.default_rng(1)
    axes = rng.normal(size=(20, 3))
    model = replace(
        HandModel.default(),
        rest_joints=rng.normal(size=(21, 3)),
        axes=axes / np.linalg.norm(axes, axis=1, keepdims=True),
    )
    for angles in rng.uniform(-3, 3, (40, 20)):
        assert np.allclose(model.joints(angles), slow_joints(model, angles), rtol=0, atol=1e-13)


def test_parts_are_the_rotations_and_places_of_the_equations(model):
    for angles in poses(model, 10):
        rotations, places = model.parts(angles)
        assert np.allclose(rotations[0], np.eye(3))
        assert np.allclose(places[0], model.rest_joints[0])
        for f in range(5):
            turns, joints = chain(model, angles, f)
            for i in range(3):
                part = 1 + 3 * f + i
                assert np.allclose(rotations[part], turns[i].as_matrix(), rtol=0, atol=1e-14)
                assert np.allclose(places[part], joints[i], rtol=0, atol=1e-14)


def test_no_angles_is_the_rest_pose(model):
    assert np.allclose(model.joints(np.zeros(20)), model.rest_joints, rtol=0, atol=1e-16)
    assert np.allclose(model.vertices(np.zeros(20)), model.rest_vertices, rtol=0, atol=1e-15)


def test_the_root_moves_everything_rigidly(model):
    angles = poses(model, 1)[0]
    turn, shift = Rotation.from_rotvec([0.4, -2.0, 1.1]), np.array([0.3, -1.0, 2.0])
    for points in (model.joints, model.vertices):
        expected = turn.apply(points(angles)) + shift
        assert np.allclose(points(angles, turn.as_matrix(), shift), expected, rtol=0, atol=1e-13)


def test_skin_is_linear_blend_skinning(model):
    which = np.random.default_rng(2).choice(len(model.rest_vertices), 60, replace=False)
    for angles in poses(model, 6):
        expected = slow_vertices(model, angles, which)
        assert np.allclose(model.vertices(angles)[which], expected, rtol=0, atol=1e-13)


def test_skin_of_one_part_moves_with_it_rigidly(model):
    # one vertex per part, fully on it; the palm's does not move
    weights = np.eye(16)
    rest = np.random.default_rng(3).normal(size=(16, 3))
    skin = replace(
        model, rest_vertices=rest, weights=weights, faces=np.zeros((0, 3), dtype=np.int32)
    )
    angles = poses(model, 5)
    rotations, places = skin.parts(angles)
    vertices = skin.vertices(angles)
    assert np.allclose(vertices[:, 0], rest[0])
    for part, (joint, _) in enumerate(PARTS):
        arm = rest[part] - model.rest_joints[joint]
        moved = np.einsum("nij,j->ni", rotations[:, part], arm) + places[:, part]
        assert np.allclose(vertices[:, part], moved, rtol=0, atol=1e-13)


def test_weights_of_the_free_hand_are_a_partition(model):
    assert (model.weights >= 0).all()
    assert np.allclose(model.weights.sum(1), 1, rtol=0, atol=1e-12)
    assert (model.weights.max(0) > 0.9).all()  # each part owns some skin


def test_bones_keep_their_lengths(model):
    joints = model.joints(poses(model, 50))
    for k in range(1, 21):
        parent = 0 if k in BASES else k - 1
        length = np.linalg.norm(joints[:, k] - joints[:, parent], axis=-1)
        assert np.allclose(length, model.bone_lengths[k - 1], rtol=0, atol=1e-14)


@pytest.mark.parametrize("lead", [(), (1,), (4,), (2, 3)])
def test_batches_equal_single_poses(model, lead):
    n = int(np.prod(lead))
    angles = poses(model, n).reshape(*lead, 20)
    turns = Rotation.random(n, rng=np.random.default_rng(4)).as_matrix().reshape(*lead, 3, 3)
    shifts = np.random.default_rng(5).normal(size=(*lead, 3))
    for points in (model.joints, model.vertices):
        moved = points(angles, turns, shifts)
        shared = points(angles, turns[(0,) * len(lead)], shifts)
        still = points(angles)
        assert moved.shape == still.shape == (*lead, *points(np.zeros(20)).shape)
        for i in np.ndindex(lead):
            one = points(angles[i], turns[i], shifts[i])
            assert np.allclose(moved[i], one, rtol=0, atol=1e-13)
            assert np.allclose(still[i], points(angles[i]), rtol=0, atol=1e-13)
            one = points(angles[i], turns[(0,) * len(lead)], shifts[i])
            assert np.allclose(shared[i], one, rtol=0, atol=1e-13)


@pytest.mark.parametrize("points", ["joints", "vertices"])
@pytest.mark.parametrize("turned", [False, True])
def test_one_pose_in_many_places(model, points, turned):
    angles = poses(model, 1)[0]
    shifts = np.random.default_rng(6).normal(size=(3, 3))
    turn = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix() if turned else None
    make = getattr(model, points)
    many = make(angles, turn, shifts)
    for i in range(3):
        assert np.allclose(many[i], make(angles, turn, shifts[i]), rtol=0, atol=1e-13)


@pytest.mark.parametrize("points", ["joints", "vertices"])
def test_one_pose_turned_many_ways(model, points):
    angles = poses(model, 1)[0]
    turns = Rotation.random(3, rng=np.random.default_rng(7)).as_matrix()
    make = getattr(model, points)
    many = make(angles, turns, [0.1, 0.2, 0.3])
    for i in range(3):
        assert np.allclose(many[i], make(angles, turns[i], [0.1, 0.2, 0.3]), rtol=0, atol=1e-13)


@pytest.mark.parametrize("points", ["joints", "vertices"])
def test_no_poses_are_no_points(model, points):
    many = getattr(model, points)(np.zeros((0, 20)))
    assert many.shape == (0, *getattr(model, points)(np.zeros(20)).shape)


def test_the_left_hand_mirrors_the_right():
    right, left = HandModel.default("right"), HandModel.default("left")
    angles = poses(right, 20)
    assert np.allclose(left.joints(angles), right.joints(angles) * MIRROR, rtol=0, atol=1e-14)
    assert np.allclose(left.vertices(angles), right.vertices(angles) * MIRROR, rtol=0, atol=1e-13)
    assert np.array_equal(left.faces, right.faces[:, ::-1])


def moved_by(model: HandModel, name: str) -> np.ndarray:
    """(21, 3) how the joints move with 0.1 rad of one angle from a slightly bent hand."""
    angles = np.tile([0.1, 0.0, 0.2, 0.2], 5)
    more = angles.copy()
    more[ANGLE_NAMES.index(name)] += 0.1
    return model.joints(more) - model.joints(angles)


def test_flexion_bends_to_the_palm(model):
    # z points out of the back of the hand
    for f, finger in enumerate(FINGERS[1:], 1):
        for joint in ("mcp", "pip", "dip"):
            move = moved_by(model, f"{finger}_{joint}_flexion")
            assert move[4 * f + 4, 2] < -1e-4
            assert np.abs(np.delete(move, range(4 * f + 2, 4 * f + 5), axis=0)).max() < 1e-15
    # the thumb's brings its tip nearer to the little finger's base
    bent = model.joints(np.tile([0.1, 0.0, 0.2, 0.2], 5))
    for joint in ("cmc", "mcp", "ip"):
        move = moved_by(model, f"thumb_{joint}_flexion")
        before, after = bent[4] - bent[17], bent[4] + move[4] - bent[17]
        assert np.linalg.norm(after) < np.linalg.norm(before) - 1e-4


def test_abduction_moves_to_the_thumbs_side(model):
    side = np.sign(model.rest_joints[1, 1] - model.rest_joints[17, 1])
    assert side == (1 if model.hand == "right" else -1)
    for f, finger in enumerate(FINGERS[1:], 1):
        move = moved_by(model, f"{finger}_mcp_abduction")
        assert side * move[4 * f + 4, 1] > 1e-3
    # the thumb's takes it away from the index finger
    bent = model.joints(np.tile([0.1, 0.0, 0.2, 0.2], 5))
    before = bent[4] - bent[6]
    assert np.linalg.norm(before + moved_by(model, "thumb_cmc_abduction")[4]) > np.linalg.norm(
        before
    )


def test_sizes(model):
    assert model.bone_lengths[7] == pytest.approx(
        np.linalg.norm(model.rest_joints[8] - model.rest_joints[7])
    )
    assert model.bone_lengths[16] == pytest.approx(
        np.linalg.norm(model.rest_joints[17] - model.rest_joints[0])
    )
    palm = model.rest_joints[[5, 9, 13, 17]] - model.rest_joints[0]
    assert model.size == pytest.approx(np.linalg.norm(palm, axis=1).mean())
    large = model.scaled(1.3)
    angles = poses(model, 1)[0]
    assert np.allclose(large.joints(angles), 1.3 * model.joints(angles), rtol=0, atol=1e-14)
    assert np.allclose(large.vertices(angles), 1.3 * model.vertices(angles), rtol=0, atol=1e-14)
    assert large.size == pytest.approx(1.3 * model.size)


def test_limits_can_be_exchanged(model):
    narrow = model.with_limits("li2021")
    assert narrow.limits is preset("li2021")
    assert np.array_equal(narrow.rest_joints, model.rest_joints)
    mine = Limits("mine", np.full(20, -0.05), np.full(20, 0.05))
    tight = model.with_limits(mine)
    for some in (model, narrow, tight):
        assert some.limits.contains(some.mean_angles)
    assert tight.mean_angles.max() <= 0.05
    with pytest.raises(SettingsError, match="huge"):
        model.with_limits("huge")


def bad(field: str, index, value) -> dict:
    array = np.array(getattr(HandModel.default(), field))
    array[index] = value
    return {field: array}


BAD = {
    "hand": ({"hand": "both"}, "'both'"),
    "rest joints' shape": ({"rest_joints": np.zeros((20, 3))}, r"rest_joints has shape \(20, 3\)"),
    "axes' shape": ({"axes": np.zeros((20, 2))}, "axes has shape"),
    "vertices' shape": ({"rest_vertices": np.zeros((5, 2))}, "rest_vertices has shape"),
    "faces' shape": ({"faces": np.zeros((5, 4), dtype=np.int32)}, "faces has shape"),
    "weights' rows": ({"weights": np.ones((3, 16)) / 16}, "weights has shape"),
    "weights' parts": ({"weights": np.ones((len(HandModel.default().weights), 15))}, "weights"),
    "NaN joint": (bad("rest_joints", (3, 1), np.nan), "rest_joints .*not finite"),
    "infinite axis": (bad("axes", (3, 1), np.inf), "axes .*not finite"),
    "NaN vertex": (bad("rest_vertices", (3, 1), np.nan), "rest_vertices .*not finite"),
    "NaN weight": (bad("weights", (3, 1), np.nan), "weights .*not finite"),
    "no bone": (bad("rest_joints", 7, HandModel.default().rest_joints[6]), "bone to joint 7 has"),
    "no palm": (bad("rest_joints", 13, HandModel.default().rest_joints[0]), "bone to joint 13"),
    "long axis": (bad("axes", 4, (0, 0, 1.01)), "unit length"),
    "no axis": (bad("axes", 19, 0), "unit length"),
    "heavy weights": (bad("weights", 0, 1.0), "sum to one"),
    "face beyond": (bad("faces", (0, 0), 10**6), "faces"),
    "face before": (bad("faces", (0, 0), -1), "faces"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_models_are_refused(case):
    fields, says = BAD[case]
    with pytest.raises(ModelError, match=says):
        replace(HandModel.default(), **fields)


def test_angles_of_another_number_are_refused(model):
    with pytest.raises(ModelError, match=r"\(19,\)"):
        model.joints(np.zeros(19))


def test_a_skeleton_has_no_skin():
    bare = replace(
        HandModel.default(),
        rest_vertices=np.zeros((0, 3)),
        faces=np.zeros((0, 3), dtype=np.int32),
        weights=np.zeros((0, 16)),
    )
    assert bare.joints(np.zeros(20)).shape == (21, 3)
    with pytest.raises(ModelError, match="no skin"):
        bare.vertices(np.zeros(20))


def test_a_model_keeps_its_own_copy():
    joints = np.array(HandModel.default().rest_joints)
    model = replace(HandModel.default(), rest_joints=joints)
    joints[5] += 1
    assert np.array_equal(model.rest_joints, HandModel.default().rest_joints)
    with pytest.raises(ValueError, match="read-only"):
        model.axes[0, 0] = 1
