""".trc and .c3d after their documented layouts, FreeMoCap, anipose and DeepLabCut."""

from __future__ import annotations

import io
import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import JOINT_NAMES

BODY = ("RASI", "LASI", "C7", "RKNE")


def trc_text(names, markers, unit="mm", rate=100.0, blank=True, seen=None):
    """markers: (T, M, 3) in the unit."""
    n = len(markers)
    lines = [
        "PathFileType\t4\t(X/Y/Z)\ttrial.trc",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames",
        f"{rate:.2f}\t{rate:.2f}\t{n}\t{len(names)}\t{unit}\t{rate:.2f}\t1\t{n}",
        "Frame#\tTime\t" + "\t\t\t".join(names) + "\t\t",
        "\t\t" + "\t".join(f"{a}{i}" for i in range(1, len(names) + 1) for a in "XYZ"),
        *([""] if blank else []),
    ]
    for t, row in enumerate(markers):
        cells = [str(t + 1), f"{t / rate:.5f}"]
        for m, place in enumerate(row):
            shown = seen is None or seen[t, m]
            cells += [f"{x:.6f}" for x in place] if shown else ["", "", ""]
        lines.append("\t".join(cells))
    return "\r\n".join(lines) + "\r\n"


def with_body(joints):
    return np.concatenate([np.full((len(joints), len(BODY), 3), 2.0), joints], axis=1)


@pytest.mark.parametrize("prefix", ["R_", "right_", "Subject1:R", "R"])
def test_trc_of_named_joints(tmp_path, right, prefix):
    names = [f"{prefix}{n.upper() if prefix == 'R_' else n}" for n in JOINT_NAMES]
    path = tmp_path / "a.trc"
    path.write_text(trc_text([*BODY, *names], 1e3 * with_body(right)))
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-8)
    assert (sequence.hand, sequence.fps) == ("right", pytest.approx(100))
    assert sequence.frame_index[0] == 1
    # read again without the reader
    rows = [line.split("\t") for line in path.read_text().splitlines()[6:]]
    column = 2 + 3 * (len(BODY) + JOINT_NAMES.index("ring_pip"))
    mine = np.array([[float(c) / 1e3 for c in row[column : column + 3]] for row in rows])
    np.testing.assert_allclose(sequence.joints[:, JOINT_NAMES.index("ring_pip")], mine, atol=1e-12)


def test_trc_of_both_hands_and_gaps(tmp_path, left, right):
    names = [f"{side}_{n}" for side in "LR" for n in JOINT_NAMES]
    both = np.concatenate([left, right], axis=1)
    seen = np.ones(both.shape[:2], dtype=bool)
    seen[2:4, 7] = False
    seen[5, 41] = False  # the last columns of a row
    path = tmp_path / "a.trc"
    path.write_text(trc_text(names, both, "m", blank=False, seen=seen))
    sequences = ht.load(path)
    assert [s.hand for s in sequences] == ["left", "right"]
    assert (~sequences[0].present).sum() == 2
    assert (~sequences[1].present).sum() == 1
    np.testing.assert_allclose(sequences[0].joints[4], left[4], atol=1e-6)


def test_markers_of_other_names_need_a_file(tmp_path, right):
    keep = [j for j in range(21) if j not in (0, 4, 8)]  # no wrist, two tips missing
    names = [f"RH{j:02d}x" for j in keep]
    path = tmp_path / "a.trc"
    path.write_text(trc_text(names, 100 * right[:, keep], "cm"))
    with pytest.raises(HandtrackError, match="--markers FILE says which marker is which") as caught:
        ht.load(path)
    assert "RH01x" in str(caught.value)
    assert "\n" not in str(caught.value)
    said = {f"RH{j:02d}x": f"right {JOINT_NAMES[j]}" for j in keep}
    files = {
        "a.json": json.dumps(said),
        "b.json": json.dumps({"right": {k: v.removeprefix("right ") for k, v in said.items()}}),
        "c.csv": "".join(f"{k},{v}\n" for k, v in said.items()),
        "d.csv": "".join(f"{v};{k}\n" for k, v in said.items()),
    }
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        (sequence,) = ht.load(path, markers=tmp_path / name)
        np.testing.assert_allclose(sequence.joints[:, keep], right[:, keep], atol=1e-6)
        assert not sequence.present[:, [0, 4, 8]].any()
        assert any("no marker is wrist, thumb_tip, index_tip" in note for note in sequence.notes)
    for text, match in (
        ('{"RH01x": "nose"}', "'nose', which is no joint"),
        ('{"other": "wrist"}', "names none of the file's markers"),
        ("RH01x", "line 1 is no pair"),
    ):
        (tmp_path / "bad").write_text(text)
        with pytest.raises(HandtrackError, match=match):
            ht.load(path, markers=tmp_path / "bad")


def test_trc_that_is_wrong(tmp_path, right, refused):
    names = [f"R_{n}" for n in JOINT_NAMES]
    whole = trc_text(names, 1e3 * right)
    path = tmp_path / "a.trc"
    for text, match in (
        (whole[:150], "the header is cut short"),
        ("\n".join(whole.splitlines()[:6]), "a header, but no frames"),
        (whole[: len(whole) - 40], "line 18 has .* columns, expected 65"),
        (whole.replace("\tmm\t", "\tcm\t"), "--unit mm would fit"),
        (whole.replace("12\t0.11000\t", "twelve\t0.11000\t"), "Frame# is 'twelve'"),
    ):
        refused(path, text, match)
    path.write_text(trc_text([*names, "R_wrist"], 1e3 * np.concatenate([right, right[:, :1]], 1)))
    with pytest.raises(HandtrackError, match="both wrist"):
        ht.load(path)


def c3d_bytes(names, markers, rate=120.0, seen=None):
    c3d = pytest.importorskip("c3d", reason="the extra `formats` is not installed")
    writer = c3d.Writer(point_rate=rate, analog_rate=0, point_scale=-1.0)
    writer.set_point_labels([n.ljust(24) for n in names])
    for t, row in enumerate(markers):
        points = np.zeros((len(row), 5), np.float32)
        points[:, :3] = row
        if seen is not None:
            points[~seen[t], 3:] = -1
        writer.add_frames([(points, np.zeros((0, 0), np.float32))])
    out = io.BytesIO()
    writer.write(out)
    return out.getvalue()


def test_c3d(tmp_path, right):
    names = [*BODY, *(f"R_{n}" for n in JOINT_NAMES)]
    seen = np.ones((len(right), len(names)), dtype=bool)
    seen[3, 4 + 8] = False
    path = tmp_path / "a.c3d"
    data = c3d_bytes(names, 1e3 * with_body(right), seen=seen)
    path.write_bytes(data)
    (sequence,) = ht.load(path)
    assert (sequence.hand, sequence.fps) == ("right", pytest.approx(120))
    assert np.isnan(sequence.joints[3, 8]).all()
    assert (~sequence.present).sum() == 1
    right[3, 8] = np.nan
    np.testing.assert_allclose(sequence.joints, right, atol=1e-5)
    path.write_bytes(data[: len(data) - 1500])
    (part,) = ht.load(path)
    assert any("the header tells of 12 frames, there are" in note for note in part.notes)
    assert len(part) < 12
    path.write_bytes(data[:700])
    with pytest.raises(HandtrackError, match=r"damaged or cut short|tells of"):
        ht.load(path)


def test_freemocap(tmp_path, left, right):
    np.save(tmp_path / "mediapipe_right_hand_3d_xyz.npy", 1e3 * right)
    (sequence,) = ht.load(tmp_path / "mediapipe_right_hand_3d_xyz.npy")
    np.testing.assert_allclose(sequence.joints, right, atol=1e-9)
    assert sequence.hand == "right"
    names = [f"left_hand_{n}" for n in JOINT_NAMES]
    titles = ",".join(f"{n}_{a}" for n in names for a in "xyz")
    path = tmp_path / "mediapipe_left_hand_3d_xyz.csv"
    np.savetxt(path, 1e3 * left.reshape(len(left), -1), delimiter=",", header=titles, comments="")
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, left, atol=1e-9)
    whole = np.full((len(left), 553, 3), 5.0)
    whole[:, 33:54], whole[:, 54:75] = 1e3 * right, 1e3 * left
    path = tmp_path / "mediapipe_3dData_numFrames_numTrackedPoints_spatialXYZ.npy"
    np.save(path, whole)
    mine = {s.hand: s for s in ht.load(path)}
    np.testing.assert_allclose(mine["left"].joints, left, atol=1e-9)
    np.testing.assert_allclose(mine["right"].joints, right, atol=1e-9)


def test_anipose(tmp_path, right):
    titles, columns = [], []
    for j, name in enumerate(JOINT_NAMES):
        titles += [f"{name}_{a}" for a in ("x", "y", "z", "error", "ncams", "score")]
        columns += [*(1e3 * right[:, j].T), *np.tile([[1.5], [3], [0.9]], len(right))]
    titles += [f"M_{i}{j}" for i in range(3) for j in range(3)]
    titles += [f"center_{i}" for i in range(3)] + ["fnum"]
    columns += [*np.tile(np.eye(3).reshape(9, 1), len(right)), *np.zeros((3, len(right)))]
    columns.append(np.arange(len(right)))
    path = tmp_path / "pose-3d.csv"
    table = np.stack(columns, axis=1)
    np.savetxt(path, table, delimiter=",", header=",".join(titles), comments="", fmt="%.9g")
    (sequence,) = ht.load(path, unit="mm", hand="right")
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)
    np.testing.assert_allclose(sequence.confidence, 0.9)
    assert sequence.numbered


def test_deeplabcut_3d(tmp_path, right):
    scorer = "DLC_3D"
    lines = [
        ",".join(["scorer", *[scorer] * 63]),
        ",".join(["bodyparts", *(n for n in JOINT_NAMES for _ in "xyz")]),
        ",".join(["coords", *(a for _ in JOINT_NAMES for a in "xyz")]),
    ]
    for t, row in enumerate(right):
        lines.append(",".join([str(t), *(f"{100 * x:.9g}" for x in row.ravel())]))
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n")
    (sequence,) = ht.load(path, unit="cm", hand="right")
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)


@pytest.mark.parametrize("end", ["\n\n", "\r\n\r\n", "\t\r\n"])
def test_trc_with_blank_lines_keeps_its_unit(tmp_path, right, end):
    text = trc_text([f"R_{n}" for n in JOINT_NAMES], 1e3 * right)
    path = tmp_path / "a.trc"
    path.write_text(text.replace("\n", end), newline="")
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)
