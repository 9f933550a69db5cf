"""Names and places as people write them: short names, paths, labels before places, places as text,
decimal commas, bones with two ends; lists of which only the values tell what they are."""

from __future__ import annotations

import io
import json
import zipfile

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.skeleton import FINGERS, JOINT_NAMES
from handtrack.sequences.names import joint_name, words
from handtrack.sequences.settled import settle
from handtrack.sequences.short_names import spelt_out

PARTS = ("mcp", "pip", "dip", "tip")
THUMB = ("cmc", "mcp", "ip", "tip")
SHORT = {
    "t1": ["w", *(f"{f}{k}" for f in "timrp" for k in range(1, 5))],
    "t_0": ["wrist", *(f"{f}_{k}" for f in "TIMRL" for k in range(4))],
    "IMCP": ["WRI", *(f"T{p}" for p in THUMB), *(f"{f}{p}" for f in "IMRP" for p in PARTS)],
    "r_pip": ["w", *(f"{f}_{p}" for f in "timrp" for p in PARTS)],
    "F1J1": ["wrist", *(f"F{f}J{k}" for f in range(1, 6) for k in range(1, 5))],
    "finger0_0": ["wrist", *(f"finger{f}_{k}" for f in range(5) for k in range(4))],
    "R_t1": ["R_w", *(f"R_{f}{k}" for f in "timrp" for k in range(1, 5))],
    "thu": ["wr", *(f"{f}{k}" for f in ("thu", "ind", "mid", "rin", "pin") for k in range(1, 5))],
}
CAPITALS = [f.capitalize() for f in ("thumb", "index", "middle", "ring", "pinky")]
NESTED = ["/".join(f"{f}{j}" for j in range(1, k + 1)) for f in CAPITALS for k in range(1, 5)]
PATHS = {
    "nested": ["Rig/Hand_R", *(f"Rig/Hand_R/{joint}" for joint in NESTED)],
    "beside": ["XR/RightHand", *(f"XR/RightHand/{f}{k}" for f in CAPITALS for k in range(1, 5))],
    "maya": ["|root|R_Hand", *(f"|root|R_Hand|{f}{k}" for f in CAPITALS for k in range(1, 5))],
}


def same(path, right, atol=1e-6, **options):
    found = {s.hand: s for s in ht.load(path, **options)}
    np.testing.assert_allclose(found["right"].joints, right, atol=atol)
    return found


def put(path, lines):
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def comma(point):
    return "(" + ", ".join(f"{v:.7f}".replace(".", ",") for v in point) + ")"


@pytest.mark.parametrize("names", [*SHORT.values(), *PATHS.values()], ids=[*SHORT, *PATHS])
def test_short_names_and_paths(tmp_path, right, names):
    head = ",".join(f"{n}_{a}" for n in names for a in "xyz")
    rows = [",".join(map(str, [i / 30, *f.ravel()])) for i, f in enumerate(right)]
    same(put(tmp_path / "wide.csv", ["time," + head, *rows]), right)
    named = [dict(zip(names, f.tolist(), strict=True)) for f in right]
    rows = [f"{i},{n},{x},{y},{z}" for i, f in enumerate(named) for n, (x, y, z) in f.items()]
    same(put(tmp_path / "long.csv", ["frame,name,x,y,z", *rows]), right)
    records = [{"t": i / 30, "joints": f} for i, f in enumerate(named)]
    same(put(tmp_path / "a.json", [json.dumps(records)]), right)


def test_letters_that_make_no_hand_stay_as_they_are():
    for names in (["t", "x1", "r1", "l1"], ["r1", "r2", "r3", "r4", "l1", "l2", "l3"], ["p_1_x"]):
        assert spelt_out(names) == names
    assert spelt_out(["index_mcp", "ring_tip"]) == ["index_mcp", "ring_tip"]


@pytest.mark.parametrize("form", ["{},{},{}", "{} {} {}", "({}, {}, {})", "[{};{};{}]", "comma"])
def test_places_as_texts_in_json(tmp_path, right, form):
    text = comma if form == "comma" else lambda p: form.format(*(f"{v:.7f}" for v in p))
    lists = [{"time": i / 30, "joints": [text(p) for p in f]} for i, f in enumerate(right)]
    same(put(tmp_path / "a.json", [json.dumps(lists)]), right)
    named = [dict(zip(JOINT_NAMES, map(text, f), strict=True)) for f in right]
    flat = [{"time": i / 30, **f} for i, f in enumerate(named)]
    same(put(tmp_path / "a.jsonl", map(json.dumps, flat)), right)


@pytest.mark.parametrize("mark", [";", ",", "\t"])
def test_places_with_decimal_commas_in_brackets(tmp_path, right, mark):
    head = mark.join(("frame", *JOINT_NAMES))
    rows = [mark.join((str(i), *map(comma, f))) for i, f in enumerate(right)]
    same(put(tmp_path / "a.csv", [head, *rows]), right)


@pytest.mark.parametrize("place", ["{}:{},{},{}", "{}=({}, {}, {})", "{} [{} {} {}]"])
def test_labels_before_places(tmp_path, right, place):
    texts = np.char.mod("%.7f", right)
    cells = [[place.format(n, *p) for n, p in zip(JOINT_NAMES, f, strict=True)] for f in texts]
    lines = [f"{i / 30:.4f}; " + "; ".join(row) for i, row in enumerate(cells)]
    found = same(put(tmp_path / "a.txt", lines), right)
    assert found["right"].fps == pytest.approx(30, rel=2e-3)
    lines = [line for i, row in enumerate(cells) for line in (f"Frame {i + 7}", *row)]
    found = same(put(tmp_path / "b.txt", lines), right)
    assert found["right"].frame_index[0] == 7


def test_the_name_of_a_type_before_each_place_is_no_joint(tmp_path, right):
    lines = ["; ".join(f"Point({x}, {y}, {z})" for x, y, z in f.tolist()) for f in right]
    same(put(tmp_path / "a.txt", lines), right)


@pytest.mark.parametrize(("scale", "unit"), [(1000, "mm"), (1, "m"), (100, "cm")])
@pytest.mark.parametrize("metacarpals", [True, False])
@pytest.mark.parametrize("named", [True, False])
def test_bones_with_both_ends(tmp_path, right, scale, unit, metacarpals, named):
    bones = ("TYPE_METACARPAL", "TYPE_PROXIMAL", "TYPE_INTERMEDIATE", "TYPE_DISTAL")
    lines = ["frame,timestamp,hand,finger,bone,prev_x,prev_y,prev_z,next_x,next_y,next_z"]
    for i, frame in enumerate(right * scale):
        for finger in range(5):
            chain = [frame[1] if finger == 0 else frame[0], *frame[4 * finger + 1 : 4 * finger + 5]]
            for b in range(0 if metacarpals else 1, 4):
                who = (f"TYPE_{FINGERS[finger].upper()}", bones[b]) if named else (finger, b)
                cells = (i, round(i * 1e6 / 30), "Right", *who, *chain[b], *chain[b + 1])
                lines.append(",".join(map(str, cells)))
    (found,) = ht.load(put(tmp_path / "leap.csv", lines))
    np.testing.assert_allclose(found.joints[:, 1:], right[:, 1:], atol=1e-9)
    assert np.isnan(found.joints[:, 0]).all()
    assert found.hand == "right"
    assert found.fps == pytest.approx(30, rel=1e-3)
    assert any(f"read as {unit}" in note for note in found.notes)


def zipped(path, files):
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in files.items():
            archive.writestr(name, text)
    path.write_bytes(out.getvalue())
    return path


def test_a_zip_of_several_files_reads_as_a_folder(tmp_path, right):
    lines = json.dumps([{"time": i / 30, "joints": f.tolist()} for i, f in enumerate(right)])
    short = json.dumps([{"time": i / 30, "joints": f.tolist()} for i, f in enumerate(right[:5])])
    path = zipped(tmp_path / "a.zip", {"s/one.json": lines, "s/two.json": short, "README.md": "hi"})
    one, two = ht.load(path)
    assert (one.name, len(one), two.name, len(two)) == ("one", len(right), "two", 5)
    np.testing.assert_array_equal(one.joints, right)
    assert one.source == f"{path}/s/one.json"


def test_what_is_wrong_in_a_zip_names_archive_and_member(tmp_path, right):
    bad = json.dumps(
        [{"time": 0, "joints": right[0].tolist()}, {"time": 1, "joints": [[1, 2]] * 21}]
    )
    path = zipped(tmp_path / "a.zip", {"one.json": bad, "two.json": bad, "../out.json": bad})
    with pytest.raises(InputError) as refused:
        ht.load(path)
    assert str(refused.value).startswith(f"{path}: ")
    assert "one.json" in str(refused.value)
    assert not (tmp_path.parent / "out.json").exists()
    with pytest.raises(InputError, match="no joint sequence found"):
        ht.load(zipped(tmp_path / "b.zip", {"one.txt": "hello", "two.txt": "there"}))


def landmarks(*hands):
    return {"landmarks": [[dict(zip("xyz", p, strict=True)) for p in h.tolist()] for h in hands]}


def test_a_few_lists_of_landmarks_are_frames_or_hands_by_where_they_are(tmp_path, right):
    path = tmp_path / "a.json"
    path.write_text(json.dumps(landmarks(right[0], right[0] + 0.002, right[0] + 0.004)))
    (frames,) = ht.load(path)
    assert len(frames) == 3
    path.write_text(json.dumps(landmarks(right[0] * [-1, 1, 1] - [0.3, 0, 0], right[0])))
    assert sorted(s.hand for s in ht.load(path)) == ["left", "right"]
    path.write_text(json.dumps(landmarks(right[0], right[0] + [0.05, 0, 0])))
    with pytest.raises(InputError, match=r"may be frames of one hand or hands.*--key landmarks"):
        ht.load(path)
    (frames,) = ht.load(path, key="landmarks")
    assert len(frames) == 2


@pytest.mark.parametrize("suffix", ["json", "csv"])
def test_a_folder_of_one_file_a_frame_has_a_sequence_of_each_hand(tmp_path, left, right, suffix):
    for i, (a, b) in enumerate(zip(left, right, strict=True)):
        path = tmp_path / f"frame_{i + 3:04d}.{suffix}"
        if suffix == "json":
            hands = {"left": a.tolist(), "right": b.tolist()} if i != 1 else {"right": b.tolist()}
            path.write_text(json.dumps({"time": i / 60, **hands}))
        else:
            path.write_text("x,y,z\n" + "\n".join(",".join(map(str, p)) for p in b.tolist()))
    found = {s.hand: s for s in ht.load(tmp_path)}
    np.testing.assert_allclose(found["right"].joints, right, atol=1e-12)
    assert found["right"].frame_index[0] == 3
    if suffix == "json":
        assert found["right"].fps == pytest.approx(60)
        assert np.isnan(found["left"].joints[1]).all()
        np.testing.assert_allclose(found["left"].joints[2:], left[2:], atol=1e-12)
    else:
        assert len(found) == 1


def test_rows_that_stand_twice_are_left_out(tmp_path, right):
    records = [{"time": i / 30, "joints": f.tolist()} for i, f in enumerate(right) for _ in (0, 1)]
    path = put(tmp_path / "a.jsonl", map(json.dumps, records))
    found = same(path, right)["right"]
    assert found.fps == pytest.approx(30)
    assert any("the row before again" in note for note in found.notes)


def test_hands_of_one_file_in_different_units_are_refused(tmp_path, left, right):
    records = [
        {"left": (a * 1000).tolist(), "right": b.tolist()} for a, b in zip(left, right, strict=True)
    ]
    with pytest.raises(InputError, match="would be in mm; write both in one unit"):
        ht.load(put(tmp_path / "a.json", [json.dumps(records)]))


def test_confidences_of_nothing_beside_lost_frames(tmp_path, right):
    lines = ["frame,hand,landmark,x,y,z,visibility"]
    for i, frame in enumerate(right):
        cells = [f"{k},{x},{y},{z},0.0" for k, (x, y, z) in enumerate(frame.tolist())]
        lines += [f"{i},,,,,,"] if i == 1 else [f"{i},Right,{c}" for c in cells]
    truth = right.copy()
    truth[1] = np.nan
    same(put(tmp_path / "a.csv", lines), truth)


def test_one_frame_of_landmarks_in_a_picture_is_not_read_as_metres(tmp_path, right):
    seen = right[0] - right[0, :1] + [0.4, 0.6, 0.0]
    with pytest.raises(InputError, match="landmarks in a picture"):
        ht.load(put(tmp_path / "a.json", [json.dumps({"landmarks": seen.tolist()})]))


@pytest.mark.parametrize("first", [0, 1])
def test_counted_columns_beside_a_label(tmp_path, right, first):
    rows = [",".join(map(str, [*f.ravel(), "fist"])) for f in right]
    numbers = [*map(str, range(first, first + 63))]
    same(put(tmp_path / "a.csv", [",".join([*numbers, "label"]), *rows]), right)
    same(put(tmp_path / "b.csv", [",".join([*(f"f{k}" for k in numbers), "label"]), *rows]), right)


def test_sides_in_short_titles_and_as_truths(tmp_path, left, right):
    head = ",".join(f"{h}{a}{j}" for h in "lr" for j in range(21) for a in "xyz")
    rows = [",".join(map(str, [*a.ravel(), *b.ravel()])) for a, b in zip(left, right, strict=True)]
    found = same(put(tmp_path / "a.csv", [head, *rows]), right)
    np.testing.assert_allclose(found["left"].joints, left, atol=1e-9)
    lines = ["t,is_right," + ",".join(f"{a}{j}" for j in range(21) for a in "xyz")]
    for i, (a, b) in enumerate(zip(left, right, strict=True)):
        lines += [",".join(map(str, [i / 30, h, *f.ravel()])) for h, f in (("False", a), (True, b))]
    found = same(put(tmp_path / "b.csv", lines), right)
    np.testing.assert_allclose(found["left"].joints, left, atol=1e-9)
    rows = [",".join(map(str, [i / 30, "R", *f.ravel()])) for i, f in enumerate(right)]
    assert same(put(tmp_path / "c.txt", rows), right)["right"].fps == pytest.approx(30, rel=1e-3)


@pytest.mark.parametrize("axes", [(1, 2, 0), (2, 1, 0)])
def test_arrays_with_the_frames_last(tmp_path, right, axes):
    clip = np.concatenate([right] * (60 // len(right) + 1))
    np.save(tmp_path / "a.npy", clip.transpose(axes))
    same(tmp_path / "a.npy", clip)
    np.save(tmp_path / "b.npy", np.stack([clip * [-1, 1, 1], clip]))
    assert sorted(s.hand for s in ht.load(tmp_path / "b.npy")) == ["left", "right"]


def h5(path, **arrays):
    h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")
    with h5py.File(path, "w") as file:
        for name, value in arrays.items():
            file[name.replace("__", "/")] = value
    return path


def test_hands_in_groups_of_an_hdf5_are_all_read(tmp_path, left, right):
    times = np.arange(len(right)) / 60
    path = h5(tmp_path / "a.h5", left__joints=left, right__joints=right, timestamps=times)
    found = same(path, right)
    np.testing.assert_allclose(found["left"].joints, left)
    assert found["left"].fps == pytest.approx(60)
    path = h5(tmp_path / "b.h5", demo_0__joints=right, demo_1__joints=right[:5])
    assert [(s.name, len(s)) for s in ht.load(path)] == [
        ("b demo_0 right", len(right)),
        ("b demo_1 right", 5),
    ]


def test_records_of_other_kinds_are_no_frames(tmp_path, right):
    lines = [{"type": "header", "fps": 30, "unit": "mm"}]
    for i, frame in enumerate(right):
        lines += [{"type": "frame", "t": i / 30, "joints": (frame * 1000).tolist()}]
        lines += [{"type": "button", "t": i / 30, "pressed": True}]
    found = same(put(tmp_path / "a.jsonl", map(json.dumps, lines)), right)["right"]
    assert found.fps == pytest.approx(30)
    assert any("of another kind: left out" in note for note in found.notes)
    lines = [{"subject": "p1", "unit": "cm"}]
    lines += [{"t": i / 30, "joints": (frame * 100).tolist()} for i, frame in enumerate(right)]
    assert same(put(tmp_path / "b.jsonl", map(json.dumps, lines)), right)["right"].subject == "p1"
    lost = [{"t": i / 30, "joints": f.tolist()} for i, f in enumerate(right)]
    del lost[1]["joints"]
    truth = right.copy()
    truth[1] = np.nan
    same(put(tmp_path / "c.jsonl", map(json.dumps, lost)), truth)


def test_frames_under_their_times(tmp_path, right):
    frames = {f"{i / 30:.5f}": {"right": f.tolist()} for i, f in enumerate(right)}
    found = same(put(tmp_path / "a.json", [json.dumps(frames)]), right)["right"]
    assert found.fps == pytest.approx(30, rel=1e-3)


RIGS = {
    "iclone": ("CC_Base_R_Hand", "CC_Base_R_{}{}", ("Thumb", "Index", "Mid", "Ring", "Pinky")),
    "rigify": ("DEF-hand.R", "DEF-{}.0{}.R", ("thumb", "f_index", "f_middle", "f_ring", "f_pinky")),
    "vrm": ("J_Bip_R_Hand", "J_Bip_R_{}{}", ("Thumb", "Index", "Middle", "Ring", "Little")),
}


@pytest.mark.parametrize("rig", [*RIGS, "biped"])
def test_names_of_rigs(rig):
    if rig == "biped":
        names = ["Bip01 R Hand", *(f"Bip01 R Finger{f}{k}" for f in range(5) for k in ("", 1, 2))]
    else:
        wrist, form, fingers = RIGS[rig]
        names = [wrist, *(form.format(f, k) for f in fingers for k in (1, 2, 3))]
    said = [joint_name(words(name)) for name in names]
    assert all(s.hand == "right" for s in said)
    assert settle(said) == [0, *(4 * f + k for f in range(5) for k in (1, 2, 3))]


def test_world_coordinates_under_wx_beside_the_picture(tmp_path, right):
    axes = ("x", "y", "z", "wx", "wy", "wz")
    head = ",".join(f"{n}_{a}" for n in JOINT_NAMES for a in axes)
    both = np.concatenate([right * 0.3 + 0.2, right], axis=2)
    rows = [",".join(map(str, f.ravel())) for f in both]
    same(put(tmp_path / "a.csv", [head, *rows]), right)


@pytest.mark.parametrize("gone", [None, 8])
def test_hands_without_names_in_lists_of_changing_order(tmp_path, left, right, gone):
    other = left + np.array([0.3, 0, 0])
    if gone is not None:  # a joint that the source never has
        other[:, gone] = right[:, gone] = np.nan
    pairs = [(a, b) if i % 3 else (b, a) for i, (a, b) in enumerate(zip(other, right, strict=True))]
    pairs[4] = (right[4],)
    hands = [[{"joints": hand.tolist()} for hand in of] for of in pairs]
    frames = [{"frame": i, "hands": of} for i, of in enumerate(hands)]
    found = ht.load(put(tmp_path / "a.json", [json.dumps(frames)]))
    truth = other.copy()
    truth[4] = np.nan
    first, second = sorted(found, key=lambda s: np.nanmean(s.joints[:, 0, 0]))
    np.testing.assert_allclose(first.joints, right, atol=1e-9)
    np.testing.assert_allclose(second.joints, truth, atol=1e-9)
    assert any("put back by where they were" in note for note in first.notes)
