"""Skinned hands of glTF files: the hand that went in comes out, and what is wrong is named."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.errors import InputError, SettingsError
from handtrack.hand.axes import local_axes, palm_frame
from handtrack.hand.gltf import JOINTS
from handtrack.hand.gltf_file import read_skinned_mesh

sys.path.insert(0, str(Path(__file__).parent))
from glb_files import NAMES, write_glb

HANDS = ("right", "left")


def in_its_palm(model):
    """The model moved as the reader does: wrist to the origin, palm's axes to x, y, z."""
    turn = palm_frame(model.rest_joints, model.hand)
    wrist = model.rest_joints[0]
    return turn, lambda points: (points - wrist) @ turn.T


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize(
    "options", [{}, {"scale": 0.01}, {"turned": True, "scale": 100.0}, {"text": True}]
)
def test_the_hand_that_went_in_comes_out(tmp_path, hand, options):
    model = ht.HandModel.default(hand)
    path = tmp_path / ("hand.gltf" if "text" in options else "hand.glb")
    write_glb(path, model, **options)
    read = ht.HandModel.from_gltf(path)
    turn, moved = in_its_palm(model)
    assert read.hand == hand
    assert np.abs(read.rest_joints - moved(model.rest_joints)).max() < 1e-6
    assert np.abs(read.rest_vertices - moved(model.rest_vertices)).max() < 1e-6
    assert np.array_equal(read.faces, model.faces)
    assert np.abs(read.weights - model.weights).max() < 3e-5
    assert np.abs(read.axes - model.axes @ turn.T).max() < 1e-5
    assert read.licensed
    # and so it moves the same
    angles = model.mean_angles
    posed = (model.vertices(angles) - model.rest_joints[0]) @ turn.T
    assert np.abs(read.vertices(angles) - posed).max() < 1e-5


def test_frames_that_are_not_webxrs_do_not_count(tmp_path):
    model = ht.HandModel.default("right")
    bone = model.rest_joints[2] - model.rest_joints[1]
    turn = Rotation.from_rotvec(np.deg2rad(40) * bone / np.linalg.norm(bone))
    axes = model.axes.copy()
    axes[:4] = turn.apply(axes[:4])  # as no geometry has them: only frames can tell
    path = tmp_path / "right.glb"
    write_glb(path, replace(model, axes=axes))
    by_frames = ht.HandModel.from_gltf(path).axes
    assert not np.allclose(by_frames[:4], local_axes(model.rest_joints, "right")[:4], atol=0.1)
    mesh = read_skinned_mesh(path)
    from handtrack.hand import gltf

    frames = mesh.joints[[mesh.names.index(name) for name in JOINTS]]
    ours = frames[list(gltf.ORDERS["webxr"]), :3, :3] @ np.array(
        [[0, 0, 1.0], [1, 0, 0], [0, 1, 0]]
    )
    rest = ht.HandModel.from_gltf(path).rest_joints
    assert np.array_equal(gltf._axes(rest, ours, "right"), local_axes(rest, "right"))


def test_names_are_webxrs():
    assert list(JOINTS) == NAMES
    assert JOINTS[4] == "thumb-tip"
    assert JOINTS[20] == "pinky-finger-metacarpal"


def test_a_tracked_glb(tmp_path, sample):
    write_glb(tmp_path / "right.glb", ht.HandModel.default("right"))
    model = ht.HandModel.from_gltf(tmp_path, "right")
    track = ht.track(sample.frames(0, 30), model)
    assert (track.status == "fitted").all()
    assert np.isfinite(track.vertices()).all()
    assert len(track.vertices()[0]) == len(model.rest_vertices)


@pytest.mark.parametrize("hand", HANDS)
def test_the_public_hands_of_webxr(hand):
    """npm install @webxr-input-profiles/assets; NODE_PATH names its node_modules."""
    inside = "@webxr-input-profiles/assets/dist/profiles/generic-hand"
    places = [Path(p) / inside for p in os.environ.get("NODE_PATH", "").split(os.pathsep) if p]
    found = [p for p in places if p.is_dir()]
    if not found:
        pytest.skip("@webxr-input-profiles/assets is not in NODE_PATH")
    model = ht.HandModel.from_gltf(found[0], hand)
    assert model.hand == hand
    assert len(model.rest_vertices) == 1360
    assert 0.08 < model.size < 0.1
    # its frames and the hand's geometry agree on where the joints bend
    off = np.rad2deg(np.arccos((model.axes * local_axes(model.rest_joints, hand)).sum(1)))
    assert off.max() < 16
    # flexing brings the fingertips to the palm, by joint and by skin
    fist = model.limits.clamp(np.deg2rad([0, 0, 20, 20] + [80, 0, 90, 60] * 4))
    assert (model.joints(fist)[[8, 12, 16, 20], 2] < -0.02).all()
    flexed = model.vertices(fist)
    assert flexed[:, 0].max() < 0.75 * model.rest_vertices[:, 0].max()


def no_skin(document):
    del document["nodes"][25]["skin"]


def unknown_names(document):
    for i, node in enumerate(document["nodes"][:25]):
        node["name"] = f"b_r_{i}"


def one_unknown(document):
    document["nodes"][9]["name"] = "index-finger-nail"


def two_skins(document):
    document["skins"].append(document["skins"][0])
    document["nodes"].append({"mesh": 0, "skin": 1})


def no_weights(document):
    del document["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"]


def compressed(document):
    document["extensionsRequired"] = ["KHR_draco_mesh_compression"]


def too_many(document):
    document["accessors"][0]["count"] *= 10


def lines(document):
    document["meshes"][0]["primitives"][0]["mode"] = 1


def wrong_type(document):
    document["nodes"][3]["name"] = 5


def sparse(document):
    document["accessors"][0]["sparse"] = {}


def foreign(document):
    document["buffers"][0]["uri"] = "../../etc/passwd"


def no_node(document):
    document["skins"][0]["joints"][3] = 99


def circular(document):
    document["nodes"][4]["children"] = [1]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (no_skin, "has no mesh with a skin"),
        (unknown_names, r"lacks the joints wrist, thumb-metacarpal, .* \.\.\. of WebXR's 25 \(it"),
        (one_unknown, "lacks the joints index-finger-tip of"),
        (two_skins, "several skins"),
        (no_weights, "a mesh without WEIGHTS_0"),
        (compressed, "needs KHR_draco"),
        (too_many, "accessor 0 ends after its buffer"),
        (lines, "something else than triangles"),
        (wrong_type, r"is no glTF 2.0: Expected `str`, got `int` - at `\$\.nodes\[3\]\.name`"),
        (sparse, "sparse data"),
        (foreign, "outside of its folder"),
        (no_node, "joints that do not exist"),
        (circular, "damaged"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, change, says):
    path = tmp_path / "hand.glb"
    write_glb(path, ht.HandModel.default("right"), change=change)
    with pytest.raises(InputError, match=f"hand.glb: .*{says}"):
        ht.HandModel.from_gltf(path)


def test_the_other_hand_is_refused(tmp_path):
    write_glb(tmp_path / "left.glb", ht.HandModel.default("right"))
    with pytest.raises(InputError, match="shows a right hand, by its joints' frames, not a left"):
        ht.HandModel.from_gltf(tmp_path / "left.glb")
    with pytest.raises(InputError, match="not a left"):
        ht.HandModel.from_gltf(tmp_path, "left")
    with pytest.raises(SettingsError, match="no hand is named"):
        ht.HandModel.from_gltf(tmp_path)
    with pytest.raises(InputError, match=r"holds no right\.glb"):
        ht.HandModel.from_gltf(tmp_path, "right")


def test_units_are_metres(tmp_path):
    write_glb(tmp_path / "hand.glb", ht.HandModel.default("right").scaled(100))
    with pytest.raises(InputError, match="expected a hand in metres"):
        ht.HandModel.from_gltf(tmp_path / "hand.glb")


def test_torn_files_are_input_errors(tmp_path):
    path = tmp_path / "hand.glb"
    write_glb(path, ht.HandModel.default("right"))
    data = path.read_bytes()
    for end in (0, 3, 11, 30, 3000, len(data) // 2, len(data) - 1):
        path.write_bytes(data[:end])
        with pytest.raises(InputError, match=r"hand\.glb"):
            ht.HandModel.from_gltf(path)
    path.write_text("{}")
    with pytest.raises(InputError, match="no glTF 2"):
        ht.HandModel.from_gltf(path)
    with pytest.raises(InputError, match="no such file"):
        ht.HandModel.from_gltf(tmp_path / "none.glb")
