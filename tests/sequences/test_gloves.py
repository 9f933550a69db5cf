"""BVH with fingers, Manus Core's and Rokoko's CSV: a real file, and made ones after the layouts."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import handtrack as ht


def forward(path, names):
    """Places [file's unit] of named joints and of their first end sites: an own small parser."""
    head, _, motion = path.read_text().partition("MOTION")
    rows = np.array([line.split() for line in motion.strip().splitlines()[2:]], dtype=float)
    stack, column, out = [], 0, {}
    name = parent = None
    for line in head.splitlines():
        cells = line.split()
        if cells[0] in ("ROOT", "JOINT", "End"):
            name = cells[1].rpartition(":")[2] if cells[0] != "End" else stack[-1][0] + " end"
        elif cells[0] == "OFFSET":
            offset = np.array(cells[1:], float)
            parent = stack[-1][1] if stack else np.tile(np.eye(4), (len(rows), 1, 1))
            local = np.tile(np.eye(4), (len(rows), 1, 1))
            local[:, :3, 3] = offset
            stack.append([name, parent @ local])
        elif cells[0] == "CHANNELS":
            own = [c[0] for c in cells[2:] if c.endswith("rotation")]
            n = int(cells[1])
            given = rows[:, column : column + n]
            local = np.tile(np.eye(4), (len(rows), 1, 1))
            local[:, :3, 3] = given[:, :3] if n == 6 else offset
            turns = given[:, n - 3 :]
            local[:, :3, :3] = Rotation.from_euler("".join(own), turns, degrees=True).as_matrix()
            stack[-1][1] = parent @ local
            column += n
        elif cells[0] == "}":
            done, pose = stack.pop()
            out.setdefault(done, pose[:, :3, 3])
    return np.stack([out[n] for n in names], axis=1)


def test_mixamo_by_an_independent_parser(shared_data):
    path = shared_data / "formats" / "bvh" / "mixamo.bvh"
    if not path.is_file():
        pytest.skip(f"real data not there: {path}")
    sequences = ht.load(path)
    assert [s.hand for s in sequences] == ["left", "right"]
    for sequence, side in zip(sequences, ("Left", "Right"), strict=True):
        names = [f"{side}Hand"]
        for finger in ("Thumb", "Index", "Middle", "Ring", "Pinky"):
            names += [f"{side}Hand{finger}{i}" for i in (1, 2, 3)] + [f"{side}Hand{finger}3 end"]
        np.testing.assert_allclose(sequence.joints, forward(path, names) / 100, atol=1e-9)
        assert sequence.fps == pytest.approx(30, abs=0.01)
        assert "read as cm" in sequence.notes[0]


def bvh_text(names, joints, tips=True, order="Zrotation Xrotation Yrotation", hand="LeftHand"):
    """A hand that does not bend, carried about: 4 names a finger, (T, 21, 3) [cm]."""
    rest = joints[0]
    lines = ["HIERARCHY", f"ROOT {hand}", "{", "OFFSET 0 0 0"]
    lines.append(f"CHANNELS 6 Xposition Yposition Zposition {order}")
    for f in range(5):
        before = rest[0]
        for k in range(3):
            place = rest[1 + 4 * f + k]
            lines += [f"JOINT {names[3 * f + k]}", "{"]
            lines += ["OFFSET " + " ".join(f"{x:.9f}" for x in place - before)]
            lines += [f"CHANNELS 3 {order}"]
            before = place
        if tips:
            lines += ["End Site {", "OFFSET " + " ".join(map(str, rest[4 + 4 * f] - before)), "}"]
        lines += ["}"] * 3
    lines += ["}", "MOTION", f"Frames: {len(joints)}", "Frame Time: 0.01"]
    for row in joints:
        lines.append(" ".join([*(f"{x:.9f}" for x in row[0]), *["0.0"] * 48]))
    return "\n".join(lines) + "\n"


DIGITS = ("Thumb", "Index", "Middle", "Ring", "Pinky")
STYLES = {
    "mixamo": [f"LeftHand{f}{k}" for f in DIGITS for k in (1, 2, 3)],
    "rokoko": [f"LeftFinger1{p}" for p in ("Metacarpal", "Proximal", "Distal")]
    + [f"LeftFinger{f}{p}" for f in (2, 3, 4, 5) for p in ("Proximal", "Medial", "Distal")],
    "manus": [f"{f.lower()}_0{k}_l" for f in DIGITS for k in (1, 2, 3)],
    "xsens": [f"LeftDigit1{p}" for p in ("Metacarpal", "Proximal", "Distal")]
    + [f"LeftDigit{f}{p}" for f in (2, 3, 4, 5) for p in ("Proximal", "Intermediate", "Distal")],
}


@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("tips", [True, False])
def test_names_of_programs(tmp_path, left, style, tips):
    still = left[:1] + 0.01 * np.arange(9)[:, None, None]
    path = tmp_path / "a.bvh"
    hand = "hand_l" if style == "manus" else "LeftHand"
    path.write_text(bvh_text(STYLES[style], 100 * still, tips, hand=hand))
    (sequence,) = ht.load(path)
    there = [j for j in range(21) if tips or j % 4 or j == 0]
    assert (sequence.hand, sequence.fps) == ("left", pytest.approx(100))
    np.testing.assert_allclose(sequence.joints[:, there], still[:, there], atol=1e-8)
    assert sequence.present.all() == tips


def test_own_export_comes_back(tmp_path, right):
    path = tmp_path / "a.npz"
    np.savez(path, joints_m=right, fps=30.0, hand="right")
    (sequence,) = ht.load(path)
    track = ht.track(sequence)
    ht.export([track], tmp_path / "a.bvh")
    (back,) = ht.load(tmp_path / "a.bvh", hand="right")
    apart = [
        np.linalg.norm(x[:, :, None] - x[:, None], axis=-1)
        for x in (back.joints, track.filtered_joints)
    ]
    np.testing.assert_allclose(apart[0], apart[1], atol=2e-6)  # y is up in it


def test_bvh_that_is_wrong(tmp_path, left, refused):
    whole = bvh_text(STYLES["mixamo"], 100 * left)
    path = tmp_path / "a.bvh"
    lines = whole.splitlines()
    for text, match in (
        ("\n".join(lines[:12]), "cut short: there is no MOTION"),
        ("\n".join(lines[:-3]), "Frames: 12, but 9 follow"),
        ("\n".join([*lines[:-1], lines[-1][:60]]), "numbers, the channels are 51"),
        (whole.replace("Frame Time: 0.01", "Frame Time: 0"), "seconds above 0"),
        (whole.replace("JOINT LeftHandIndex1", "OFFSET a b c\nJOINT x", 1), "no three numbers"),
        (whole.replace("LeftHand", "Spine"), "no hand with fingers"),
        (whole.replace("Zrotation Xrotation", "Wrotation Xrotation", 1), "channel Wrotation"),
        (whole.replace("0.0 0.0", "0.0 zero", 1), "is 'zero', expected a number"),
        ("HIERARCHY\nROOT a\n{\n" + "JOINT b\n{\n" * 300, "line 404: more joints than any body"),
        ("HIERARCHY\nROOT a\n{\n" + "JOINT b\n{\n}\n" * 5100, "more joints than any body has"),
    ):
        refused(path, text, match)


# --- tables

PARTS = dict.fromkeys(DIGITS, ("CMC", "MCP", "PIP", "DIP", "TIP"))
PARTS["Thumb"] = ("CMC", "MCP", "DIP", "TIP")


def manus_csv(joints, middle, rotations, mark=",", comma="."):
    """As Manus Core writes it: wrist at the origin, 25 joints, cm."""
    titles, columns = [], []
    local = 100 * (joints - joints[:, :1])
    named = {"Hand": local[:, 0]}
    for f, (finger, parts) in enumerate(PARTS.items()):
        mine = [local[:, 1 + 4 * f + k] for k in range(4)]
        if len(parts) == 5:
            mine = [0.2 * mine[0], *mine]
        named |= {f"{finger}_{p}": x for p, x in zip(parts, mine, strict=True)}
    for name, x in named.items():
        titles += [f"{name}{middle}_{a}" for a in "XYZ"]
        columns += list(x.T)
    for name in named:
        titles += [f"{name}{rotations}_{a}" for a in "XYZ"]
        columns += list(np.full((3, len(joints)), 170.0))
    titles += ["Pinch_ThumbToIndex", "Thumb_CMC_Spread", "Index_MCP_Flex"]
    titles += ["Index_MCP_Flex_AngularVelocity"]
    columns += list(np.full((4, len(joints)), 4.3))
    rows = [["Frame", "Elapsed_Time_In_Milliseconds", "Time", *titles]]
    for t in range(len(joints)):
        cells = [f"{1e3 * t / 60:.5f}", f"00:00:00:{round(1e3 * t / 60):03d}"]
        cells += [f"{c[t]:.6f}" for c in columns]
        rows.append([str(t), *cells])
    return "\n".join(mark.join(row) for row in rows).replace(".", comma) + "\n"


@pytest.mark.parametrize(
    ("middle", "rotations", "mark", "comma"),
    [("_Position", "_Rotation", ",", "."), ("", "", ";", ",")],
    ids=["long names", "names twice, decimal commas"],
)
def test_manus_core(tmp_path, right, middle, rotations, mark, comma):
    path = tmp_path / "take_R.csv"
    path.write_text(manus_csv(right, middle, rotations, mark, comma))
    (sequence,) = ht.load(path)
    np.testing.assert_allclose(sequence.joints, right - right[:, :1], atol=1e-7)
    assert (sequence.hand, sequence.fps) == ("right", pytest.approx(60, rel=1e-3))
    assert any("cm" in note for note in sequence.notes)


def test_rokoko_csv(tmp_path, left, right):
    titles, columns = ["timestamp"], [np.arange(len(left)) / 100]
    for side, joints in (("Left", left), ("Right", right)):
        named = {f"{side}Hand": joints[:, 0]}
        for f in range(5):
            parts = ("Metacarpal", "Proximal", "Distal", "Tip")
            if f:
                parts = ("Proximal", "Medial", "Distal", "Tip")
                named[f"{side}Finger{f + 1}Metacarpal"] = (
                    0.7 * joints[:, 0] + 0.3 * joints[:, 1 + 4 * f]
                )
            for k, part in enumerate(parts):
                named[f"{side}Finger{f + 1}{part}"] = joints[:, 1 + 4 * f + k]
        named["Hips"] = np.zeros((len(left), 3))
        for name, x in named.items():
            if name == "Hips" and side == "Right":
                continue
            titles += [f"{name}_position_{a}" for a in "xyz"]
            titles += [f"{name}_rotation_{a}" for a in "xyz"]
            columns += [*x.T, *np.full((3, len(left)), 30.0)]
    path = tmp_path / "take.csv"
    table = np.stack(columns, axis=1)
    np.savetxt(path, table, delimiter=",", header=",".join(titles), comments="", fmt="%.9f")
    mine, other = ht.load(path)
    np.testing.assert_allclose(mine.joints, left, atol=1e-8)
    np.testing.assert_allclose(other.joints, right, atol=1e-8)
    assert mine.fps == pytest.approx(100, rel=1e-3)
