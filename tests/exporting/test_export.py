"""Exports, read back by readers of their own: the same hand comes out."""

from __future__ import annotations

import csv
import dataclasses
import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from foreign_formats import Bvh, Glb
from made_tracks import make_track, with_skin, without_skin
from screens import lacking

import handtrack as ht
from handtrack.cli import run
from handtrack.errors import InputError, ModelError, SettingsError
from handtrack.exporting.bvh import euler_zxy
from handtrack.exporting.dress import dressed
from handtrack.hand.reshape import reshaped
from handtrack.hand.rotations import matrix_to_quaternion, vector_to_matrix
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track

Z_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])
"""From a frame with z up to one with y up."""


def held(values: np.ndarray) -> np.ndarray:
    """Values with every frame of NaN replaced by the one before, the first ones by the next."""
    out, known = values.copy(), np.isfinite(values).reshape(len(values), -1).all(1)
    first = int(np.flatnonzero(known)[0])
    for t in range(len(out)):
        if not known[t]:
            out[t] = out[t - 1] if t > first else values[first]
    return out


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
        n or f"{(file.names[p] or '').split('_')[0]}_tip"
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


def test_csv(track: Track, tmp_path: Path) -> None:
    (file,) = ht.export(track, tmp_path / "x.csv")
    assert file.notes == ("empty cells in 6 lost frames",)
    with file.path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert len(rows) == len(track)
    assert [int(row["frame"]) for row in rows] == track.frame_index.tolist()
    assert [int(row["time_ns"]) for row in rows] == track.time_ns.tolist()
    assert [row["status"] for row in rows] == track.status.tolist()
    assert [row["reason"] for row in rows] == track.reason.tolist()

    def read(name: str) -> np.ndarray:
        return np.array([float(row[name] or "nan") for row in rows])

    for a, name in enumerate(ANGLE_NAMES):
        for kind, angles in (("", track.angles), ("_raw", track.angles_raw)):
            np.testing.assert_allclose(
                read(f"{name}{kind}_deg"), np.degrees(angles[:, a]), atol=1e-6
            )
        sd = np.where(track.status == "lost", np.nan, np.degrees(0.01))
        np.testing.assert_allclose(read(f"{name}_sd_deg"), sd, atol=1e-6)
    assert track.truth is not None
    for j, name in enumerate(JOINT_NAMES):
        for kind, joints in (
            ("", track.filtered_joints),
            ("raw_", track.fitted_joints),
            ("observed_", track.observed),
            ("truth_", track.truth),
        ):
            for c in range(3):
                values = read(f"{kind}{name}_{'xyz'[c]}_mm")
                np.testing.assert_allclose(values, 1e3 * joints[:, j, c], atol=1e-6)
        np.testing.assert_allclose(read(f"error_{name}_mm"), 1e3 * track.error[:, j], atol=1e-6)
    known = track.status != "lost"
    np.testing.assert_allclose(
        read("error_mean_mm")[known], 1e3 * np.nanmean(track.error[known], 1), atol=1e-6
    )
    np.testing.assert_allclose(
        read("error_max_mm")[known], 1e3 * np.nanmax(track.error[known], 1), atol=1e-6
    )
    off = np.linalg.norm(track.filtered_joints - track.truth, axis=-1).mean(1)
    np.testing.assert_allclose(read("truth_error_mean_mm"), 1e3 * off, atol=1e-6)
    np.testing.assert_allclose(read("translation_y_mm"), 1e3 * track.translation[:, 1], atol=1e-6)
    np.testing.assert_allclose(read("rotation_w"), track.quaternion[:, 0], atol=1e-6)


def test_parquet_has_the_same_columns_in_full(track: Track, tmp_path: Path) -> None:
    from pyarrow import csv as arrow_csv
    from pyarrow import parquet

    for kind in ("csv", "parquet"):
        ht.export(track, tmp_path / f"x.{kind}")
    table = parquet.read_table(tmp_path / "x.parquet")
    assert table.column_names == arrow_csv.read_csv(tmp_path / "x.csv").column_names
    angles = table["ring_pip_flexion_deg"]
    assert angles.null_count == 6
    known = track.status != "lost"
    column = ANGLE_NAMES.index("ring_pip_flexion")
    np.testing.assert_array_equal(
        np.array(angles.drop_null()), np.rad2deg(track.angles[known, column])
    )
    about = json.loads(table.schema.metadata[b"handtrack"])
    assert about["settings"] == track.settings
    assert (about["hand"], about["version"]) == ("right", "0.1.0")


def test_without_filter_and_truth_there_are_fewer_columns(track: Track, tmp_path: Path) -> None:
    plain = dataclasses.replace(track, settings={"filter": "none"}, truth=None)
    ht.export(plain, tmp_path / "x.csv")
    names = next(csv.reader((tmp_path / "x.csv").open()))
    assert not any("raw" in name or "truth" in name for name in names)


def test_npz_is_all_of_the_track_and_can_be_tracked_again(track: Track, tmp_path: Path) -> None:
    ht.export(track, tmp_path / "x.npz")
    with np.load(tmp_path / "x.npz", allow_pickle=False) as found:
        for name, expected in (
            ("angles_rad", track.angles),
            ("angles_raw_rad", track.angles_raw),
            ("quaternion_wxyz", track.quaternion),
            ("translation_raw_m", track.translation_raw),
            ("fitted_joints_m", track.fitted_joints),
            ("filtered_joints_m", track.filtered_joints),
            ("angle_variance_rad2", track.angle_variance),
            ("error_m", track.error),
            ("status", track.status),
            ("reason", track.reason),
            ("rejected", track.rejected),
            ("restart", track.restart),
            ("rest_vertices_m", track.model.rest_vertices),
        ):
            np.testing.assert_array_equal(found[name], expected)
        assert json.loads(str(found["settings_json"])) == track.settings
        assert found["angle_names"].tolist() == list(ANGLE_NAMES)
        assert found["event_text"].tolist() == [e.text for e in track.events]
    (again,) = ht.load(tmp_path / "x.npz")
    np.testing.assert_array_equal(again.joints, track.observed)
    np.testing.assert_array_equal(again.truth, track.truth)
    np.testing.assert_array_equal(again.time_ns, track.time_ns)
    np.testing.assert_array_equal(again.frame_index, track.frame_index)
    assert (again.hand, again.name) == (track.hand, track.name)


def test_a_licensed_skin_stays_out_of_npz(track: Track, tmp_path: Path) -> None:
    model = dataclasses.replace(track.model, licensed=True)
    ht.export(dataclasses.replace(track, model=model), tmp_path / "x.npz")
    with np.load(tmp_path / "x.npz") as found:
        assert not {"rest_vertices_m", "faces", "skin_weights"} & set(found.files)


def test_a_licensed_skin_comes_back_from_its_model(tmp_path: Path) -> None:
    """A recording does not hold it; the user's model brings it, in the recorded proportions."""
    base = dataclasses.replace(ht.HandModel.default("left"), licensed=True)
    longer = base.rest_joints.copy()
    longer[7:9] += 0.1 * (longer[7] - longer[6])
    for model in (base, reshaped(base, longer)):
        track = make_track(12, "left", model=model, lost=slice(3, 5))
        (bare,) = ht.read_mcap(write_mcap(track, tmp_path / "x.mcap"))
        assert len(bare.model.rest_vertices) == 0
        full = dressed(bare, base)
        known = track.status != "lost"
        off = np.abs(full.vertices() - track.vertices())[known]
        assert off.max() < 1e-6
        (file,) = ht.export(full, tmp_path / "x.glb")
        assert file.notes[1:] == ("the skin is licensed: it may not be passed on",)
        assert np.abs(Glb(file.path).skinned("left_skin") - held(track.vertices())).max() < 2e-6
    with pytest.raises(
        InputError, match=r"not the hand that was recorded: skins are \d+\.\d mm apart"
    ):
        dressed(bare, reshaped(base, longer, thickness=1.3))
    with pytest.raises(InputError, match="not the hand that was recorded: other skins"):
        dressed(bare, with_skin(base))
    with pytest.raises(ModelError, match="is a right hand"):
        dressed(bare, ht.HandModel.default("right"))
    with pytest.raises(ModelError, match="has no skin"):
        dressed(bare, without_skin(base))
    plain = make_track(3, "left", lost=slice(0))
    assert dressed(plain, base) is plain


def test_what_cannot_be_done_is_said(track: Track, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"ends in \.csv, \.parquet, \.npz, \.bvh, \.glb"):
        ht.export(track, tmp_path / "x.fbx")
    with pytest.raises(SettingsError, match="no track has a frame"):
        ht.export([], tmp_path / "x.csv")
    with pytest.raises(SettingsError, match="unit 'ft' is unknown"):
        ht.export(track, tmp_path / "x.bvh", unit="ft")
    with pytest.raises(SettingsError, match="up 'w' is unknown"):
        ht.export(track, tmp_path / "x.glb", up="w")
    with pytest.raises(InputError, match="no folder"):
        ht.export(track, tmp_path / "nowhere" / "x.csv")
    lost = make_track(5, lost=slice(None))
    for kind in ("bvh", "glb"):
        with pytest.raises(InputError, match="no frame has a pose"):
            ht.export(lost, tmp_path / f"x.{kind}")
    close = make_track(3, lost=slice(0))
    close = dataclasses.replace(close, time_ns=np.array([0, 10**15, 10**15 + 1000]))
    with pytest.raises(SettingsError, match="float32"):
        ht.export(close, tmp_path / "x.glb")
    assert list(tmp_path.iterdir()) == []


def test_command_line(
    two_hands: list[Track], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = tmp_path / "in" / "clip.mcap"
    recording.parent.mkdir()
    write_mcap(two_hands, recording, mesh=False)

    def done(*arguments: str | Path) -> str:
        assert run(["export", *map(str, arguments)]) == 0
        return capsys.readouterr().out

    said = done(recording, tmp_path / "a.csv")
    assert f"{recording} -> {tmp_path / 'a_right.csv'}: right; 40 frames; empty cells" in said
    assert len((tmp_path / "a_left.csv").read_text().splitlines()) == 51
    said = done(recording, tmp_path / "b.csv", "--hand", "left", "--start", "0.5", "--end", "1")
    rows = list(csv.DictReader((tmp_path / "b.csv").open()))
    assert [float(row["time_s"]) for row in rows] == pytest.approx(np.arange(16) / 30, abs=1e-8)
    assert int(rows[0]["time_ns"]) == 500_000_000
    report = json.loads(done(recording.parent, tmp_path / "out", "--to", "glb", "--json"))
    (file,) = report["files"]
    assert file["hands"] == ["right", "left"]
    assert file["bytes"] == Path(file["path"]).stat().st_size
    assert done(recording, tmp_path / "c.npz", "-q") == ""
    assert (tmp_path / "c_left.npz").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["x.csv", "--hand", "left"], "no left hand in the recording, only right"),
        (["x.csv", "--start", "3"], "no frames in that part: the recording is 1.967 s long"),
        (["x.csv", "--start", "1", "--end", "1"], "from 1 s to 1 s is empty"),
        (["x.csv", "--to", "csv"], "--to is for folders"),
        (["x"], "say the format with --to"),
        (["x.obj"], "expected a name that ends in .csv"),
    ],
)
def test_wrong_commands(
    arguments: list[str],
    message: str,
    recording: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    output, *options = arguments
    assert run(["export", str(recording), str(tmp_path / "o" / output), *options]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "o" / "x.csv").exists()
