"""MANO as hand models: surface and joints by the published equations, and poses there and back."""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.errors import InputError, SettingsError
from handtrack.hand.mano import MANO, TIP_VERTICES, mano_axes
from handtrack.hand.mano_pose import from_mano, to_mano
from handtrack.hand.skeleton import ORDERS, PART_JOINT, TIPS

sys.path.insert(0, str(Path(__file__).parent))
from mano_equations import mano as by_the_equations

BETAS = np.array([1.5, -1, 0.5, 2, -0.5, 0.3, -2, 1, 0.2, -0.7])


@pytest.fixture(scope="module", params=["right", "left"])
def hand(request) -> str:
    return request.param


@pytest.fixture(scope="module")
def mano(mano_folder, hand) -> MANO:
    return MANO.load(mano_folder, hand)


def poses(model, n, seed=0):
    """Random angles inside the limits, rotations and translations."""
    rng = np.random.default_rng(seed)
    low, high = model.limits.lower, model.limits.upper
    angles = model.limits.clamp(rng.uniform(low, high, (n, 20)))
    return angles, Rotation.random(n, random_state=seed).as_matrix(), rng.normal(0, 0.3, (n, 3))


@pytest.mark.parametrize("betas", [None, BETAS[:3], BETAS])
def test_poses_fed_to_the_equations_give_our_surface(mano, contents, hand, betas):
    model = mano.model(betas)
    angles, rotation, translation = poses(model, 6)
    ours = model.vertices(angles, rotation, translation)
    joints = model.joints(angles, rotation, translation)
    made = to_mano(model, angles, rotation, translation)
    assert np.array_equal(made.betas[: len(BETAS if betas is None else betas)], betas) or (
        betas is None and not made.betas.any()
    )
    for i in range(len(angles)):
        vertices, theirs = by_the_equations(
            contents[hand], made.betas, made.values[i], made.transl[i]
        )
        assert np.abs(ours[i] - vertices).max() < 1e-9
        order = np.array(ORDERS["mano"])[PART_JOINT]
        assert np.abs(joints[i][PART_JOINT] - theirs[order]).max() < 1e-9


def test_tips_move_with_their_vertex_but_for_the_blend_shapes(mano):
    model = mano.model(BETAS)
    angles, rotation, translation = poses(model, 20, 1)
    tips = list(TIP_VERTICES["smplx"][0])
    at_rest = model.rest_vertices[tips]
    assert np.abs(at_rest - model.rest_joints[TIPS]).max() < 1e-12
    apart = np.linalg.norm(
        model.joints(angles, rotation, translation)[:, TIPS]
        - model.vertices(angles, rotation, translation)[:, tips],
        axis=-1,
    )
    assert apart.max() < 1e-3


@pytest.mark.parametrize("tips", TIP_VERTICES)
def test_the_set_of_tips_is_a_setting(mano_folder, hand, tips, contents):
    model = MANO.load(mano_folder, hand, tips=tips).model()
    raw = contents[hand]["v_template"] @ mano_axes(hand).T
    picked = TIP_VERTICES[tips][hand == "left"]
    assert np.abs(model.rest_joints[TIPS] - raw[list(picked)]).max() < 1e-12


def test_the_sets_of_tips_are_the_published_ones():
    assert TIP_VERTICES["manopth"] == ((745, 317, 444, 556, 673), (745, 317, 445, 556, 673))
    assert TIP_VERTICES["smplx"][1] == (744, 320, 443, 554, 671)
    assert TIP_VERTICES["freihand"][0] == (744, 320, 443, 555, 672)
    assert TIP_VERTICES["minimal-hand"][1] == (744, 333, 444, 555, 672)


def test_poses_come_back(mano):
    model = mano.model(BETAS)
    angles, rotation, translation = poses(model, 50, 2)
    made = to_mano(model, angles, rotation, translation)
    back = from_mano(model, made.values, made.transl)
    assert np.abs(back.angles - angles).max() < 1e-8
    assert np.abs(back.rotation - rotation).max() < 1e-12
    assert np.abs(back.translation - translation).max() < 1e-12
    assert back.lost.max() < 1e-7


def test_poses_of_a_twisting_thumb_come_back(mano):
    model = replace(mano.model(), thumb_twist=0.6)
    angles, _, _ = poses(model, 50, 3)
    back = from_mano(model, to_mano(model, angles).values)
    assert np.abs(back.angles - angles).max() < 1e-7
    assert back.lost.max() < 1e-6


def test_one_pose_is_a_batch_of_one(mano):
    model = mano.model()
    angles, rotation, translation = poses(model, 3, 4)
    many = to_mano(model, angles, rotation, translation)
    one = to_mano(model, angles[1], rotation[1], translation[1])
    assert one.values.shape == (48,)
    assert np.abs(one.values - many.values[1]).max() < 1e-14
    back = from_mano(model, one.values, one.transl)
    assert back.angles.shape == (20,)
    assert back.lost.shape == (15,)


def test_the_nearest_angles_are_the_nearest(mano):
    """Rotations that no angles reach: a general minimiser finds nothing nearer."""
    model = mano.model()
    angles, _, _ = poses(model, 8, 5)
    values = to_mano(model, angles).values + np.random.default_rng(6).normal(0, 0.15, (8, 48))
    values[:, :3] = 0
    back = from_mano(model, values)
    target = Rotation.from_rotvec(values[:, 3:].reshape(-1, 3)).as_matrix().reshape(8, 15, 3, 3)

    def miss(x, i):
        made = to_mano(model, x).values[3:].reshape(15, 3)
        return ((Rotation.from_rotvec(made).as_matrix() - target[i]) ** 2).sum()

    assert back.lost.max() > 0.1
    for i in range(8):
        found = minimize(miss, back.angles[i] + 0.05, args=(i,), method="BFGS", tol=1e-10)
        assert miss(back.angles[i], i) <= found.fun + 1e-9
        assert np.abs(found.x - back.angles[i]).max() < 1e-4
    # what was lost is the rotation that is left, joint by joint
    made = Rotation.from_rotvec(to_mano(model, back.angles).values[:, 3:].reshape(-1, 3))
    left = (made.inv() * Rotation.from_rotvec(values[:, 3:].reshape(-1, 3))).magnitude()
    assert np.abs(np.sort(left.reshape(8, 15)) - np.sort(back.lost)).max() < 1e-9


def test_the_mean_pose_is_explicit(mano):
    model = mano.model()
    angles, rotation, _ = poses(model, 4, 7)
    flat = to_mano(model, angles, rotation)
    mean = to_mano(model, angles, rotation, hands_mean=mano.hands_mean)
    assert np.abs(mean.hand_pose + mano.hands_mean - flat.hand_pose).max() < 1e-14
    assert np.array_equal(mean.global_orient, flat.global_orient)
    back = from_mano(model, mean.values, mean.transl, hands_mean=mano.hands_mean)
    assert np.abs(back.angles - angles).max() < 1e-8
    # the stand-in's mean pose is the relaxed hand of our angles
    assert np.abs(mano.hands_mean).max() > 0.2


def test_principal_components(mano):
    c = np.random.default_rng(8).normal(size=(5, 45))
    full = mano.hand_pose(c, flat_hand_mean=True)
    assert np.abs(full - c @ mano.hands_components).max() < 1e-14
    some = mano.hand_pose(c[:, :6], flat_hand_mean=False)
    assert np.abs(some - mano.hands_mean - c[:, :6] @ mano.hands_components[:6]).max() < 1e-14
    with pytest.raises(SettingsError, match="at most 45"):
        mano.hand_pose(np.zeros((2, 46)), flat_hand_mean=True)


def test_rest_joints_are_linear_in_the_shape(mano):
    assert (
        np.abs(mano.joint_template + mano.joint_basis @ BETAS - mano.model(BETAS).rest_joints).max()
        < 1e-14
    )
    assert np.array_equal(mano.model(BETAS).shape, BETAS)
    assert not mano.model().shape.any()


def test_a_changed_hand_no_longer_claims_its_shape(mano):
    from handtrack.hand.reshape import reshaped

    model = mano.model(BETAS)
    assert len(model.with_limits("li2021").shape) == 10
    assert not len(model.scaled(1.1).shape)
    assert not len(reshaped(model, model.rest_joints * 1.05).shape)
    angles = model.mean_angles
    assert np.abs(model.scaled(1.1).vertices(angles) - 1.1 * model.vertices(angles)).max() < 1e-12


def test_left_mirrors_right(mano_folder):
    right, left = (MANO.load(mano_folder, h).model(BETAS) for h in ("right", "left"))
    mirror = np.array([1, -1, 1])
    angles, _, _ = poses(right, 5, 9)
    assert np.abs(right.joints(angles) * mirror - left.joints(angles)).max() < 1e-12
    assert np.abs(right.vertices(angles) * mirror - left.vertices(angles)).max() < 1e-12
    made = (to_mano(model, angles) for model in (right, left))
    turned, mirrored = (pose.hand_pose.reshape(-1, 15, 3) for pose in made)
    assert np.abs(turned * [1, -1, -1] - mirrored).max() < 1e-12


def test_the_rest_pose_lies_as_promised(mano, hand):
    model = mano.model()
    along = model.rest_joints[9] - model.rest_joints[0]
    assert along[0] > 0.9 * np.linalg.norm(along)
    thumb = model.rest_joints[1] - model.rest_joints[17]
    assert thumb[1] * (1 if hand == "right" else -1) > 0.02
    assert model.licensed
    assert model.hand == hand


def test_manos_order():
    ours = np.arange(63.0).reshape(21, 3)
    theirs = ours[np.argsort(ORDERS["mano"])]
    assert np.array_equal(theirs[13], ours[1])  # MANO's first thumb joint
    assert np.array_equal(theirs[7], ours[17])  # the little finger comes before the ring finger
    assert np.array_equal(theirs[16:], ours[TIPS])


def test_a_mano_hand_is_fitted_and_tracked(mano, sample):
    """Joints made with a shape are found again with that shape's hand."""
    model = mano.model(BETAS)
    angles, rotation, translation = poses(model, 5, 10)
    for i in range(5):
        joints = model.joints(angles[i], rotation[i], translation[i])
        fit = ht.fit(model, joints)
        assert np.linalg.norm(fit.joints - joints, axis=1).max() < 2e-4


def test_from_mano_takes_files_and_folders(mano_folder, hand):
    a = ht.HandModel.from_mano(mano_folder, hand, betas=BETAS, limits="li2021", tips="freihand")
    b = ht.HandModel.from_mano(mano_folder / f"MANO_{hand.upper()}.pkl", betas=BETAS)
    assert a.limits.name == "li2021"
    assert np.array_equal(a.rest_vertices, b.rest_vertices)
    assert not np.array_equal(a.rest_joints, b.rest_joints)


@pytest.mark.parametrize(
    ("betas", "says"), [(np.zeros(11), "up to 10"), ([np.nan], "finite"), (np.eye(2), "shape")]
)
def test_impossible_shapes_are_refused(mano, betas, says):
    with pytest.raises(SettingsError, match=says):
        mano.model(betas)


def test_impossible_poses_are_refused(mano):
    for values in (np.zeros(45), np.full(48, np.nan)):
        with pytest.raises(InputError, match="48"):
            from_mano(mano.model(), values)


SMPLX = """
import sys, numpy as np, torch
sys.path.insert(0, sys.argv[1])
from tools.make.mano_like import chumpy_modules
sys.modules.update(chumpy_modules())
import smplx
poses = np.load(sys.argv[3])
options = dict(is_rhand=sys.argv[4] == "right", flat_hand_mean=True, use_pca=False)
layer = smplx.MANOLayer(sys.argv[2], dtype=torch.float64, **options)
t = {name: torch.tensor(poses[name]) for name in poses.files}
n = len(t["transl"])
betas = t["betas"].expand(n, -1)
turns = smplx.lbs.batch_rodrigues(t["values"].reshape(-1, 3)).reshape(n, 16, 3, 3)
a = layer(betas, turns[:, :1], turns[:, 1:], t["transl"])
options["flat_hand_mean"] = False
full = smplx.MANO(sys.argv[2], dtype=torch.float64, batch_size=n, **options)
b = full(betas, t["mean"][:, :3], t["mean"][:, 3:], t["transl"])
np.savez(sys.argv[5], layer=a.vertices, joints=a.joints, full=b.vertices.detach())
"""


def test_smplx_makes_the_same_surface(mano, mano_folder, hand, tmp_path, maker):
    """smplx, loading the same file, fed with our poses as its 48 values and transl."""
    if importlib.util.find_spec("smplx") is None:
        pytest.skip("smplx is not installed (the extra `bench`)")
    model = mano.model(BETAS)
    angles, rotation, translation = poses(model, 6, 11)
    made = to_mano(model, angles, rotation, translation)
    mean = to_mano(model, angles, rotation, translation, hands_mean=mano.hands_mean)
    np.savez(
        tmp_path / "in.npz", values=made.values, mean=mean.values, transl=made.transl, betas=BETAS
    )
    file = mano_folder / f"MANO_{hand.upper()}.pkl"
    places = [str(Path(maker.__file__).parent), str(file), str(tmp_path / "in.npz"), hand]
    command = [sys.executable, "-c", SMPLX, *places, str(tmp_path / "out.npz")]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    theirs = np.load(tmp_path / "out.npz")
    ours = model.vertices(angles, rotation, translation)
    assert np.abs(theirs["layer"] - ours).max() < 1e-6
    assert np.abs(theirs["full"] - ours).max() < 1e-6
    joints = model.joints(angles, rotation, translation)[:, PART_JOINT]
    order = np.array(ORDERS["mano"])[PART_JOINT]
    assert np.abs(theirs["joints"][:, order] - joints).max() < 1e-6


def test_a_left_hand_with_the_rights_signs_is_repaired(maker, contents, tmp_path, mano_folder):
    with (tmp_path / "MANO_LEFT.pkl").open("wb") as file:
        maker.write_pickle(maker.make_mano_like("left", wrong_left=True), file)
    with pytest.warns(UserWarning, match="without MANO_RIGHT"):
        wrong = MANO.load(tmp_path, "left")
    (tmp_path / "MANO_RIGHT.pkl").write_bytes((mano_folder / "MANO_RIGHT.pkl").read_bytes())
    with pytest.warns(UserWarning, match="turned round"):
        repaired = MANO.load(tmp_path, "left")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        true = MANO.load(mano_folder, "left")
    assert np.abs(true.shape_basis - repaired.shape_basis).max() < 1e-15
    assert np.abs(true.shape_basis - wrong.shape_basis).max() > 1e-3


def test_recorded_poses_make_the_recorded_surface(mano, contents, hand, sample, tmp_path):
    """MCAP and .npz of a fitted MANO hand: the equations, fed with them, give its meshes."""
    from handtrack.exporting.arrays import arrays

    sequence = sample.frames(0, 4)
    if hand == "left":
        sequence = replace(sequence, joints=sequence.joints * [1, -1, 1], truth=None, hand="left")
    track = ht.track(sequence, mano.model(BETAS), calibrate=False)
    # a hand that was scaled is no longer one of MANO's shapes
    assert not arrays(track)["mano_betas"].size
    track = replace(track, model=mano.model(BETAS))
    ht.write_mcap([track], tmp_path / "x.mcap")
    (again,) = ht.read_mcap(tmp_path / "x.mcap")
    made = arrays(again)
    assert "rest_vertices_m" not in made
    for i in range(5):
        pose = np.concatenate([made["mano_global_orient_rad"][i], made["mano_hand_pose_rad"][i]])
        vertices, _ = by_the_equations(
            contents[hand], made["mano_betas"], pose, made["mano_transl_m"][i]
        )
        assert np.abs(vertices - again.vertices()[i]).max() < 1e-6
