"""OptiTrack Motive's CSV after its documented layout, version 1.2x."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import JOINT_NAMES

_PER_M = {"Meters": 1, "Centimeters": 100, "Millimeters": 1000}
_BONES = ["Hand"] + [
    f"{finger}{i}" for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky") for i in (1, 2, 3)
]
_OF_BONES = [0, *(4 * finger + i for finger in range(5) for i in (1, 2, 3))]


def motive_text(things, unit="Meters", version="1.23", rate=120.0, space="Global", end="\r\n"):
    """things: (type, name, (T, 3) places [m]; NaN = lost) of each marker or bone."""
    n = len(things[0][2])
    said = (
        f"Format Version,{version},Take Name,Take 2026-01-01,Take Notes,,"
        f"Capture Frame Rate,{rate:.6f},Export Frame Rate,{rate:.6f},"
        f"Capture Start Time,2026-01-01 10.00.00.000 AM,Capture Start Frame,0,"
        f"Total Frames in Take,{n + 50},Total Exported Frames,{n},Rotation Type,Quaternion,"
        f"Length Units,{unit},Coordinate Space,{space}"
    )
    rows = [[""] * 2 for _ in range(5)] + [["Frame", "Time (Seconds)"]]
    for row, title in zip(rows, ("Type", "Name", "ID", "Parent"), strict=False):
        row[1] = title
    for i, (kind, name, _) in enumerate(things):
        turns = kind in ("Bone", "Rigid Body")
        axes = ["X", "Y", "Z", "W"] * turns + ["X", "Y", "Z"]
        what = ["Rotation"] * 4 * turns + ["Position"] * 3
        for row, cells in zip(
            rows,
            ([kind] * len(axes), [name] * len(axes), [f"{i:X}"] * len(axes), [""] * len(axes)),
            strict=False,
        ):
            row += cells
        rows[4] += what
        rows[5] += axes
    for t in range(n):
        row = [str(t), f"{t / rate:.6f}"]
        for kind, _, places in things:
            seen = np.isfinite(places[t]).all()
            if kind in ("Bone", "Rigid Body"):
                row += ["0.1", "0.2", "0.3", "0.9"] if seen else [""] * 4
            row += [f"{_PER_M[unit] * x:.9f}" for x in places[t]] if seen else [""] * 3
        rows.append(row)
    return end.join([said, "", *(",".join(row) for row in rows)]) + end


def markers_of(joints, prefix, kind="Marker"):
    return [(kind, f"{prefix}{name}", joints[:, j]) for j, name in enumerate(JOINT_NAMES)]


def bones_of(joints, side):
    return [
        ("Bone", f"Ann:{side}{name}", joints[:, j])
        for name, j in zip(_BONES, _OF_BONES, strict=True)
    ]


def written(path, *args, **choices):
    path.write_text(motive_text(*args, **choices), newline="")
    return path


@pytest.mark.parametrize("unit", list(_PER_M))
@pytest.mark.parametrize("version", ["1.1", "1.21", "1.23", "1.25"])
def test_named_markers(tmp_path, right, unit, version):
    body = [("Marker", "Ann:Chest", right[:, 0] + 1), ("Marker", "Unlabeled 1001", right[:, 0])]
    things = [*body, *markers_of(right, "Ann:R_")]
    (found,) = ht.load(written(tmp_path / "a.csv", things, unit, version, rate=60.0))
    np.testing.assert_allclose(found.joints, right, atol=1e-8)
    assert (found.hand, found.fps) == ("right", pytest.approx(60, rel=1e-4))
    assert found.frame_index[0] == 0
    # read again without the reader
    rows = [li.split(",") for li in (tmp_path / "a.csv").read_text().splitlines()[8:]]
    mine = np.array([[float(c) / _PER_M[unit] for c in row[8:11]] for row in rows])
    np.testing.assert_allclose(found.joints[:, 0], mine, atol=1e-12)


def test_both_hands_and_lost_markers(tmp_path, left, right):
    left[2:4, 7] = np.nan
    right[5, 20] = np.nan  # the last columns of a row
    things = [*markers_of(left, "Ann:L_"), *markers_of(right, "Ann:R_")]
    found = {s.hand: s for s in ht.load(written(tmp_path / "a.csv", things))}
    np.testing.assert_allclose(found["left"].joints, left, atol=1e-8)
    np.testing.assert_allclose(found["right"].joints, right, atol=1e-8)


def test_bones_of_fingers(tmp_path, left, right):
    body = [("Bone", f"Ann:{n}", right[:, 0] - 1) for n in ("Hip", "RFArm", "RToe")]
    expected = [("Bone Marker", f"Ann:RHand{n}", right[:, 0]) for n in ("Out", "In")]
    things = [*body, *bones_of(left, "L"), *bones_of(right, "R"), *expected]
    found = {s.hand: s for s in ht.load(written(tmp_path / "a.csv", things, "Millimeters"))}
    for hand, joints in (("left", left), ("right", right)):
        got = found[hand].joints
        np.testing.assert_allclose(got[:, _OF_BONES], joints[:, _OF_BONES], atol=1e-8)
        assert np.isnan(got[:, [4, 8, 12, 16, 20]]).all()
    with pytest.raises(HandtrackError, match="export them with Coordinate Space Global"):
        ht.load(written(tmp_path / "b.csv", bones_of(left, "L"), space="Local"))


def test_measured_markers_and_those_expected(tmp_path, right):
    """A marker stands twice: where the skeleton expects it, and where it was seen."""
    expected = markers_of(right + 0.01, "Ann:R_", "Bone Marker")
    things = [*expected, *markers_of(right, "Ann:R_")]
    path = written(tmp_path / "a.csv", things)
    (found,) = ht.load(path)
    np.testing.assert_allclose(found.joints, right, atol=1e-8)
    said = {f"Ann:R_{name}": f"right {name}" for name in JOINT_NAMES}
    (tmp_path / "m.json").write_text(json.dumps(said))
    (found,) = ht.load(path, markers=tmp_path / "m.json")
    np.testing.assert_allclose(found.joints, right, atol=1e-8)


def test_other_names_need_a_file(tmp_path, right):
    things = [("Marker", f"Glove:M{j:02d}x", right[:, j]) for j in range(21)]
    path = written(tmp_path / "a.csv", things)
    with pytest.raises(HandtrackError, match="--markers FILE says which marker is which joint"):
        ht.load(path)
    said = {f"Glove:M{j:02d}x": f"right {name}" for j, name in enumerate(JOINT_NAMES)}
    (tmp_path / "m.json").write_text(json.dumps(said))
    (found,) = ht.load(path, markers=tmp_path / "m.json")
    np.testing.assert_allclose(found.joints, right, atol=1e-8)


def test_time_codes_semicolons_and_no_labels(tmp_path, right):
    whole = motive_text(markers_of(right, "Ann:R_"), end="\n")
    head, rows = whole.split("\nFrame,")
    coded = "Frame," + rows
    lines = [*head.split("\n")[:2], *(f",{li}" for li in head.split("\n")[2:])]
    for t, line in enumerate(coded.split("\n")[:-1]):
        a, b, rest = line.split(",", 2)
        lines.append(f"{a},{b},{'TimeCode' if t == 0 else f'15:26:46:{t:02d}.01'},{rest}")
    (tmp_path / "a.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "b.csv").write_text(whole.replace(".", "#").replace(",", ";").replace("#", ","))
    bare = whole
    for label in ("Type", "Name", "ID", "Parent"):
        bare = bare.replace(f"\n,{label},", "\n,,")
    (tmp_path / "c.csv").write_text(bare)
    for name in "abc":
        (found,) = ht.load(tmp_path / f"{name}.csv", hand="right")
        np.testing.assert_allclose(found.joints, right, atol=1e-8)


def test_motive_that_is_wrong(tmp_path, right, refused):
    whole = motive_text(markers_of(right, "Ann:R_"), end="\n")
    lines = whole.split("\n")
    path = tmp_path / "a.csv"
    for text, match in (
        (whole.replace("Version,1.23", "Version,x1"), "line 1: Format Version is 'x1', expected 1"),
        (whole.replace("Version,1.23", "Version,2.0"), "line 1: Format Version is '2.0'"),
        (lines[0] + "\n", "the header is cut short: expected a line that begins with Frame"),
        ("\n".join(lines[:4]), "the header is cut short"),
        ("\n".join([*lines[:2], lines[7], lines[8]]), "the header has no row of Type"),
        ("\n".join(lines[:8]), "a header, but no frames"),
        (whole[:-200], r"line 20 has \d+ columns, expected 65 .*: it is cut short, leave it out"),
        (whole.replace("\n3,0.025000,", "\n3,0.025000,what"), r"line 12: Ann:R_wrist X is 'what"),
        (whole.replace(",Meters,", ",Millimeters,"), "--unit m would fit"),
        (whole.replace("Position", "Rotation"), "no markers or bones with a position"),
    ):
        refused(path, text, match)
    path.write_text("\n".join(lines[:-4]) + "\n")
    (found,) = ht.load(path)
    assert any("the header tells of 12 frames, there are 9" in note for note in found.notes)
