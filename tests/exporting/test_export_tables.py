"""Exports of numbers: CSV, Parquet, arrays; and what cannot be done."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest
from foreign_formats import Glb
from held_poses import held
from made_tracks import make_track, with_skin, without_skin

import handtrack as ht
from handtrack.cli import run
from handtrack.errors import InputError, ModelError, SettingsError
from handtrack.exporting.dress import dressed
from handtrack.hand.reshape import reshaped
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track


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
