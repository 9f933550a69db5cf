"""HO-3D's and FrankMocap's pickles, and MANO parameters, in exactly their layouts."""

from __future__ import annotations

import json
import os
import pickle
from collections import OrderedDict

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run
from handtrack.errors import InputError
from handtrack.hand.mano import MANO
from handtrack.hand.mano_pose import decode, to_mano
from handtrack.hand.skeleton import ORDERS
from tools.make import mano_like


class Evil:
    """Would run a command if it were unpickled."""

    def __reduce__(self):
        return os.system, ("touch pwned",)


def write(path, content, protocol=2):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(pickle.dumps(content, protocol=protocol))


# --- HO-3D


def ho3d(folder, joints):
    """train/ABF10/meta/0000.pkl ... as distributed, beside the pictures."""
    meta = folder / "train" / "ABF10" / "meta"
    for t, x in enumerate(joints):
        theirs = np.empty((21, 3))
        theirs[list(ORDERS["mano"])] = x * [1, -1, -1]  # OpenGL looks along -z
        content = {
            "objTrans": np.zeros(3, np.float32),
            "objRot": np.zeros((3, 1), np.float32),
            "objCorners3D": np.zeros((8, 3)),
            "camMat": np.eye(3),
            "objName": "021_bleach_cleanser",
            "objLabel": 12,
            "handJoints3D": theirs,
            "handPose": np.zeros(48, np.float32),
            "handTrans": np.zeros(3, np.float32),
            "handBeta": np.zeros(10, np.float32),
        }
        write(meta / f"{t:04d}.pkl", content)
    return meta


def test_ho3d(tmp_path, right):
    meta = ho3d(tmp_path, right)
    with (meta / "0004.pkl").open("rb") as file:
        content = pickle.load(file)
    write(meta / "0004.pkl", content | {"handJoints3D": None})  # no annotation
    right[4] = np.nan
    for folder in (meta, tmp_path):
        (sequence,) = ht.load(folder)
        np.testing.assert_allclose(sequence.joints, right, atol=1e-12)
        assert (sequence.name, sequence.hand, sequence.fps) == ("ABF10", "right", pytest.approx(30))
    (part,) = ht.load(tmp_path, frames=(6, 8))
    np.testing.assert_array_equal(part.frame_index, [6, 7, 8])
    (single,) = ht.load(meta / "0003.pkl", format="ho3d")
    np.testing.assert_allclose(single.joints[0], right[3], atol=1e-12)


def test_ho3ds_evaluation_split_holds_no_joints(tmp_path, right):
    content = {"handJoints3D": right[0, 0], "handBoundingBox": [1, 2, 3, 4]}
    write(tmp_path / "meta" / "0000.pkl", content)
    with pytest.raises(InputError, match="only wrists: this is HO-3D's evaluation split"):
        ht.load(tmp_path)


def test_nothing_in_a_pickle_is_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path / "meta" / "0000.pkl", {"handJoints3D": Evil()})
    with pytest.raises(InputError, match=r"0000.pkl: asks for posix.system, which has no place"):
        ht.load(tmp_path)
    assert not (tmp_path / "pwned").exists()
    write(tmp_path / "other.pkl", {"weights": np.zeros(3)})
    with pytest.raises(
        InputError, match=r"other.pkl: no joints in it: expected joints_m or joints, found weights"
    ):
        ht.load(tmp_path / "other.pkl")


# --- FrankMocap


def frankmocap(folder, left, right):
    """out/mocap/%05d_prediction_result.pkl as demo_handmocap --save_pred_pkl writes them."""
    for t, pair in enumerate(zip(left, right, strict=True)):
        people = {}
        for hand, x in zip(("left_hand", "right_hand"), pair, strict=True):
            people[hand] = {}
            if not np.isnan(x).any():
                middle = x[9].astype(np.float32)
                people[hand] = {
                    "pred_joints_smpl": x.astype(np.float32) - middle,
                    "pred_joints_img": np.zeros((21, 3), np.float32),
                    "faces": np.zeros((1538, 3), np.int32),
                    "bbox_scale_ratio": 1.5,
                    "bbox_top_left": np.array([10, 20]),
                    "pred_camera": np.zeros(3, np.float32),
                    "img_cropped": np.zeros((224, 224, 3), np.uint8),
                    "pred_hand_pose": np.zeros((1, 48), np.float32),
                    "pred_hand_betas": np.zeros((1, 10), np.float32),
                }
        saved = OrderedDict(
            demo_type="hand",
            smpl_type="smplx",
            image_path=f"/data/clip/frames/{t:05d}.jpg",
            body_bbox_list=[None],
            hand_bbox_list=[{"left_hand": np.zeros(4), "right_hand": None}],
            save_mesh=False,
            pred_output_list=[people],
        )
        write(folder / "mocap" / f"{t:05d}_prediction_result.pkl", saved, protocol=4)


def test_frankmocap(tmp_path, left, right):
    left[3] = np.nan
    frankmocap(tmp_path / "clip", left, right)
    (tmp_path / "clip" / "rendered").mkdir()
    (tmp_path / "clip" / "rendered" / "00000.jpg").write_bytes(b"\xff\xd8")
    found = {s.hand: s for s in ht.load(tmp_path / "clip", fps=25)}
    assert [s.name for s in found.values()] == ["clip left", "clip right"]
    np.testing.assert_allclose(found["right"].joints, right - right[:, 9:10], atol=1e-6)
    np.testing.assert_allclose(found["left"].joints, left - left[:, 9:10], atol=1e-6)
    assert np.isnan(found["left"].joints[3]).all()
    assert found["right"].fps == pytest.approx(25)


def test_frankmocap_is_judged_by_stability(tmp_path, left, right, capsys):
    """The folder is an estimate: aligned, it is the truth; its places are not."""
    frankmocap(tmp_path / "clip", left, right)
    truth = tmp_path / "truth.npz"
    np.savez(truth, joints_m=right, hand="right", fps=30.0)
    arguments = ["stability", tmp_path / "clip", "--truth", truth, "--hand", "right", "--json"]
    assert run([str(a) for a in arguments]) == 0
    (row,) = json.loads(capsys.readouterr().out)["sequences"]
    assert row["pa_mpjpe_mm"]["max"] < 1e-3
    assert row["mpjpe_mm"]["mean"] > 100
    assert any("another world frame?" in note for note in row["notes"])


def test_frankmocap_of_before_it_saved_joints(tmp_path):
    people = {"left_hand": {}, "right_hand": {"pred_hand_pose": np.zeros((1, 48))}}
    write(tmp_path / "00000_prediction_result.pkl", {"pred_output_list": [people]})
    with pytest.raises(InputError, match="right_hand has no pred_joints_smpl: older FrankMocap"):
        ht.load(tmp_path)


# --- MANO parameters


@pytest.fixture(scope="module")
def mano_folder(tmp_path_factory):
    """Free stand-ins for MANO's files, stored as MANO's are."""
    folder = tmp_path_factory.mktemp("mano")
    for hand in ("right", "left"):
        with (folder / f"MANO_{hand.upper()}.pkl").open("wb") as file:
            mano_like.write_pickle(mano_like.make_mano_like(hand), file)
    return folder


@pytest.fixture
def poses():
    """(T, 48) poses, (10,) shape, (T, 3) translations."""
    rng = np.random.default_rng(3)
    orient = np.array([1.0, 0.4, -0.3]) + 0.05 * np.arange(6)[:, None]
    hand = np.tile(rng.normal(0, 0.15, 45), (6, 1)) + rng.normal(0, 0.02, (6, 45))
    return np.concatenate([orient, hand], 1), rng.normal(0, 1, 10), rng.normal(0, 0.2, (6, 3))


def matrices(vectors):
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vectors.reshape(-1, 3)).as_matrix().reshape(len(vectors), -1, 3, 3)


@pytest.mark.parametrize("layout", ["poses", "parts", "matrices", "mean"])
@pytest.mark.parametrize("hand", ["right", "left"])
def test_mano_parameters(tmp_path, mano_folder, poses, layout, hand):
    values, betas, transl = poses
    mano = MANO.load(mano_folder, hand, tips="manopth")
    fields = {"betas": betas, "transl": transl, "hand": hand, "fps": 30.0}
    if layout == "poses":
        fields |= {"poses": values}
    elif layout == "parts":
        fields |= {"global_orient": values[:, :3], "hand_pose": values[:, 3:]}
    elif layout == "matrices":  # HaMeR's
        parts = {"global_orient": values[:, :3], "hand_pose": values[:, 3:]}
        fields |= {k: matrices(v) for k, v in parts.items()}
    else:
        fields |= {"pose": values - np.r_[np.zeros(3), mano.hands_mean], "flat_hand_mean": False}
    path = tmp_path / "a.npz"
    np.savez(path, **fields)
    expected, _ = decode(mano, values, betas, transl)
    (sequence,) = ht.load(path, mano=mano_folder, mano_tips="manopth")
    np.testing.assert_allclose(sequence.joints, expected, atol=1e-9)
    assert sequence.hand == hand
    said = any("flat_hand_mean" in n for n in sequence.notes)
    assert said == (layout != "mean")


def test_mano_principal_components(tmp_path, mano_folder, poses):
    _, betas, transl = poses
    coefficients = np.random.default_rng(4).normal(0, 0.3, (6, 12))
    orient = poses[0][:, :3]
    path = tmp_path / "right.npz"
    np.savez(path, global_orient=orient, hand_pose=coefficients, betas=betas, trans=transl)
    mano = MANO.load(mano_folder, "right")
    pose = mano.hands_mean + coefficients @ mano.hands_components[:12]
    expected, _ = decode(mano, np.concatenate([orient, pose], 1), betas, transl)
    (sequence,) = ht.load(path, mano=mano_folder)
    np.testing.assert_allclose(sequence.joints, expected, atol=1e-12)
    assert any("poses taken from MANO's mean pose" in n for n in sequence.notes)


def test_freihands_parameters(tmp_path, mano_folder, poses):
    values, betas, _ = poses
    rows = [[[*v, *betas, 112.0, 98.0, 4.2e3]] for v in values.tolist()]
    (tmp_path / "training_mano.json").write_text(json.dumps(rows))
    mano = MANO.load(mano_folder, "right", tips="freihand")
    full = values + np.r_[np.zeros(3), mano.hands_mean]
    expected, _ = decode(mano, full, betas)
    (sequence,) = ht.load(tmp_path, mano=mano_folder, mano_tips="freihand")
    np.testing.assert_allclose(sequence.joints, expected, atol=1e-12)


def test_mano_parameters_without_mano_or_hand(tmp_path, mano_folder, poses):
    path = tmp_path / "a.npz"
    np.savez(path, poses=poses[0])
    with pytest.raises(InputError, match=r"a.npz: holds MANO parameters: .* \(--mano DIR\)"):
        ht.load(path)
    with pytest.raises(InputError, match="which hand's parameters: choose --hand left"):
        ht.load(path, mano=mano_folder)
    assert ht.load(path, mano=mano_folder, hand="left")[0].hand == "left"
    np.savez(path, poses=poses[0], betas=np.zeros((4, 10)), hand="right")
    with pytest.raises(InputError, match="MANO parameters: betas have shape"):
        ht.load(path, mano=mano_folder)
    np.savez(path, poses=poses[0][:, :2], betas=np.zeros(10))
    with pytest.raises(InputError, match=r"poses have shape \(6, 2\), expected \(frames, 48\)"):
        ht.load(path, mano=mano_folder)


def test_mano_parameters_are_tracked_and_judged(tmp_path, mano_folder, monkeypatch, capsys):
    """The commands: track the parameters with MANO itself, then judge it by them."""
    monkeypatch.chdir(tmp_path)
    model = MANO.load(mano_folder, "right").model()
    angles = model.mean_angles + 0.1 * np.sin(np.arange(12)[:, None] / 3 + np.arange(20))
    pose = to_mano(model, model.limits.clamp(angles))
    np.savez("clip.npz", poses=pose.values, transl=pose.transl, hand="right", fps=30.0)
    mano = ["--mano", str(mano_folder)]
    assert run(["track", "clip.npz", *mano, "-o", "clip.mcap", "-q"]) == 0
    capsys.readouterr()
    assert run(["stability", "clip.mcap", "--truth", "clip.npz", *mano, "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["sequences"]
    assert row["against"] == "truth"
    assert row["pa_mpjpe_mm"]["mean"] < 0.5


# --- joints that a script pickled


@pytest.mark.parametrize("protocol", [0, 2, 5])
@pytest.mark.parametrize(
    "made",
    [
        lambda x: x,
        lambda x: x.astype(np.float32),
        lambda x: {"joints": x, "hand": "right"},
        lambda x: [{"hand": "right", "landmarks": frame} for frame in x],
        lambda x: [None, *x[1:]],
        lambda x: {"left": x * [1, -1, 1], "right": x},
    ],
)
def test_joints_of_a_script(tmp_path, right, made, protocol):
    write(tmp_path / "mine.pkl", made(right), protocol)
    *_, found = ht.load(tmp_path / "mine.pkl")
    assert (found.name.split()[0], found.hand, len(found)) == ("mine", "right", len(right))
    np.testing.assert_allclose(found.joints[1:], right[1:], atol=1e-6)


def test_a_pickle_without_joints(tmp_path):
    write(tmp_path / "other.pkl", {"a": 1, "b": [2, 3]})
    with pytest.raises(InputError, match=r"other.pkl: no joints in it: .*found a, b"):
        ht.load(tmp_path / "other.pkl")


@pytest.mark.parametrize("place", [0, 30, 50])
@pytest.mark.parametrize("wrong", [1e200, -1e160, 1e5])
def test_numbers_that_no_hand_has(tmp_path, mano_folder, place, wrong):
    row = np.zeros(61)
    row[place] = wrong
    (tmp_path / "training_mano.json").write_text(json.dumps([[row.tolist()]]))
    with pytest.raises(InputError, match=r"training_mano.json: MANO parameters: .* up to 10000"):
        ht.load(tmp_path / "training_mano.json", mano=mano_folder)
