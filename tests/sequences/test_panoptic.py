"""CMU Panoptic hands: files, folders, archives."""

import json
import shutil
import tarfile

import numpy as np
import pytest

import handtrack as ht


def hand(joints, score=0.6, **more):
    flat = np.where(np.isnan(joints), 0, joints * 100).ravel().tolist()
    return {
        "landmarks": flat,
        "averageScore": [score] * 21,
        "averageReproError": [1.5] * 21,
        "validity": [1] * 21,
        "visibility": [[0, 3, 7]] * 21,
        **more,
    }


def frame(people):
    return {"version": 0.5, "univTime": 1.0, "fpsType": "hd_29_97", "people": people}


def name(number):
    return f"handRecon3D_hd{number:08d}.json"


@pytest.fixture
def dataset(tmp_path, left, right):
    """171204_pose6 with two people: 0 with both hands, 2 with a right one that comes late."""
    folder = tmp_path / "171204_pose6" / "hdHand3d"
    folder.mkdir(parents=True)
    for i in range(12):
        people = [{"id": 0, "left_hand": hand(left[i]), "right_hand": hand(right[i], 0.3)}]
        if i >= 4 and i != 7:
            people.append({"id": 2, "right_hand": hand(right[i] + 1)})
        if i == 5:
            del people[0]["left_hand"]
        (folder / name(20701 + i)).write_text(json.dumps(frame(people)))
    return folder.parent


def check(sequences, left, right):
    assert [s.name for s in sequences] == [
        "171204_pose6 person0 left",
        "171204_pose6 person0 right",
        "171204_pose6 person2 right",
    ]
    a, b, c = sequences
    assert [s.hand for s in sequences] == ["left", "right", "right"]
    assert a.frame_index.tolist() == [n for n in range(20701, 20713) if n != 20706]
    np.testing.assert_allclose(a.joints, np.delete(left, 5, 0), atol=1e-12)
    np.testing.assert_allclose(b.joints, right, atol=1e-12)
    np.testing.assert_allclose(c.joints, np.delete(right, 7, 0)[4:] + 1, atol=1e-12)
    np.testing.assert_allclose(b.confidence, 0.3)
    assert b.fps == pytest.approx(29.97, abs=1e-3)
    assert a.time_ns[5] - a.time_ns[4] == pytest.approx(2e9 / 29.97, rel=1e-4)  # the gap
    assert b.time_ns[0] == round(20701 * 1001 / 30000 * 1e9)
    assert all(s.notes == () for s in sequences)


def test_folder_and_its_parent(dataset, left, right):
    check(ht.load(dataset), left, right)
    check(ht.load(dataset / "hdHand3d"), left, right)


def test_folder_with_everything_else_beside_it(dataset, left, right):
    (dataset / "hdVideos").mkdir()
    (dataset / "hdVideos" / "hd_00_00.mp4").write_bytes(b"\0" * 99)
    (dataset / "calibration_171204_pose6.json").write_text('{"cameras": []}')
    for sub, file in [
        ("hdPose3d", "body3DScene_0001.json"),
        ("hdFace3d", "faceRecon3D_hd001.json"),
    ]:
        (dataset / sub).mkdir()
        (dataset / sub / file).write_text('{"people": []}')
    sequences = ht.load(dataset)
    assert len(sequences) == 3
    assert "passed over: calibration_171204_pose6.json" in sequences[0].notes[0]


@pytest.mark.parametrize("mode", ["w", "w:gz", "w:bz2", "w:xz"])
def test_archives(dataset, tmp_path, left, right, mode):
    path = tmp_path / ("171204_pose6.tar" + mode[1:].replace(":", "."))
    with tarfile.open(path, mode) as archive:
        archive.add(dataset / "hdHand3d", "hdHand3d")
    check(ht.load(path), left, right)
    a, b, c = ht.load(path, frames=(20705, 20706))
    assert (len(a), len(b), len(c)) == (1, 2, 2)


def test_archive_named_as_the_folder_inside(dataset, left, right):
    with tarfile.open(dataset / "hdHand3d.tar.gz", "w:gz") as archive:
        archive.add(dataset / "hdHand3d", "hdHand3d")
    shutil.rmtree(dataset / "hdHand3d")
    check(ht.load(dataset / "hdHand3d.tar.gz"), left, right)


def test_one_file(dataset):
    a, b = ht.load(dataset / "hdHand3d" / name(20701))
    assert (len(a), a.frame_index[0], a.hand, b.hand) == (1, 20701, "left", "right")
    assert a.name == "handRecon3D_hd00020701 person0 left"


def test_files_under_another_name(dataset):
    for path in (dataset / "hdHand3d").iterdir():
        path.rename(path.with_name(path.name.replace("handRecon3D_hd", "frame_")))
    assert [len(s) for s in ht.load(dataset)] == [11, 12, 7]


@pytest.mark.parametrize("called", [name, "frame_{}.json".format])
def test_one_person_alone_is_named_by_the_recording(tmp_path, left, right, called):
    """Files of one hand of each side are Panoptic's, and no single frames of something else."""
    folder = tmp_path / "171204_pose6" / "hdHand3d"
    folder.mkdir(parents=True)
    for i in range(5):
        people = [{"id": 0, "left_hand": hand(left[i]), "right_hand": hand(right[i])}]
        (folder / called(i)).write_text(json.dumps(frame(people)))
    found = ht.load(folder)
    assert [s.name for s in found] == ["171204_pose6 person0 left", "171204_pose6 person0 right"]


def test_frame_range_opens_only_those_files(tmp_path, right):
    folder = tmp_path / "long"
    folder.mkdir()
    good = json.dumps(frame([{"id": 0, "right_hand": hand(right[3])}]))
    for number in range(18_000, 28_000):
        (folder / name(number)).touch()  # empty: an error if it were read
    for number in range(20_701, 20_801):
        (folder / name(number)).write_text(good)
    (sequence,) = ht.load(folder, frames=(20_701, 20_800))
    assert sequence.frame_index[[0, -1]].tolist() == [20_701, 20_800]
    with pytest.raises(ht.InputError, match="no frame in 1:5, there are 18000:27999"):
        ht.load(folder, frames=(1, 5))


def test_frame_range_over_several_recordings(tmp_path, right):
    for start in (100, 200, 300):
        folder = tmp_path / f"pose{start}" / "hdHand3d"
        folder.mkdir(parents=True)
        for i in range(3):
            text = json.dumps(frame([{"id": 0, "right_hand": hand(right[i])}]))
            (folder / name(start + i)).write_text(text)
    assert len(ht.load(tmp_path)) == 3
    (only,) = ht.load(tmp_path, frames=(201, 202))
    assert (only.name, len(only)) == ("pose200 person0 right", 2)


def test_missing_joints(tmp_path, right):
    joints = right[0].copy()
    joints[3] = np.nan  # written as zeros
    shown = hand(joints, validity=[1] * 20 + [0])
    shown["averageScore"] = [0.5] * 5 + [0, -1, 1.7] + [0.5] * 13
    (tmp_path / name(3)).write_text(json.dumps(frame([{"id": 4, "right_hand": shown}])))
    (sequence,) = ht.load(tmp_path / name(3))
    assert np.flatnonzero(~sequence.present[0]).tolist() == [3, 5, 6, 20]
    assert sequence.confidence[0, [3, 4, 6, 7, 20]].tolist() == [0, 0.5, 0, 1, 0]


@pytest.mark.parametrize("validity", [True, 1, [True] * 21, None])
def test_only_landmarks_are_needed(tmp_path, right, validity):
    shown = {"landmarks": (right[0] * 100).ravel().tolist()}
    if validity is not None:
        shown["validity"] = validity
    path = tmp_path / "one.json"
    path.write_text(json.dumps({"people": [{"id": 0, "right_hand": shown}]}))
    (sequence,) = ht.load(path)
    assert (sequence.confidence == 1).all()
    assert sequence.frame_index.tolist() == [0]


def test_hand_that_is_never_valid_is_left_out(tmp_path, left, right):
    people = [{"id": 0, "left_hand": hand(left[3]), "right_hand": hand(right[3], validity=False)}]
    (tmp_path / name(1)).write_text(json.dumps(frame(people)))
    (sequence,) = ht.load(tmp_path)
    assert sequence.hand == "left"
    assert "every joint is missing" in sequence.notes[0]


def test_one_badly_measured_hand_does_not_stop_the_others(tmp_path, left, right):
    people = [{"id": 0, "left_hand": hand(left[3])}, {"id": 1, "right_hand": hand(right[3] * 9)}]
    (tmp_path / name(1)).write_text(json.dumps(frame(people)))
    a, b = ht.load(tmp_path)
    assert a.notes == ()
    assert "is the scale right?" in b.notes[0]


def test_people_without_id(tmp_path, right):
    people = [{"id": i, "right_hand": hand(right[3])} for i in (-1, -1, 0)]
    (tmp_path / name(1)).write_text(json.dumps(frame(people)))
    (sequence,) = ht.load(tmp_path)
    assert "without an id" in sequence.notes[0]


@pytest.mark.parametrize(
    ("people", "message"),
    [
        (
            [{"id": 0, "right_hand": {"landmarks": [1.0] * 60}}],
            r"right_hand.landmarks has 60 numbers, expected 63 \(21 joints x 3\)$",
        ),
        (
            [{"id": 0}, {"id": 7, "left_hand": {"landmarks": []}}],
            "person 7: left_hand.landmarks has 0 numbers",
        ),
        (
            [{"id": 0, "left_hand": {"landmarks": [1.0] * 63, "averageScore": [1]}}],
            "left_hand.averageScore has 1 numbers, expected 21",
        ),
        (
            [{"id": 0, "left_hand": {"landmarks": [1.0] * 62 + ["a"]}}],
            r"expected `float \| null`, got `str` at `people\[0\].left_hand.landmarks\[62\]`",
        ),
        ([{"id": 0, "left_hand": {}}], "missing required field `landmarks`"),
        ([{"left_hand": None}], "missing required field `id` at `people.0.`"),
        ([], "no hand of anybody in 1 Panoptic"),
        ([{"id": 0}], "no hand of anybody"),
    ],
)
def test_bad_files(tmp_path, people, message):
    path = tmp_path / "panoptic" / name(20713)
    path.parent.mkdir()
    path.write_text(json.dumps(frame(people)))
    with pytest.raises(ht.InputError, match=message) as caught:
        ht.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    with pytest.raises(ht.InputError):
        ht.load(path.parent)


def test_two_hands_of_one_person(tmp_path, right):
    path = tmp_path / name(1)
    path.write_text(json.dumps(frame([{"id": 0, "right_hand": hand(right[0])}] * 2)))
    with pytest.raises(ht.InputError, match="two right hands of person 0 in one frame"):
        ht.load(path)


def test_archive_without_hands(tmp_path):
    (tmp_path / "a.txt").write_text("x")
    with tarfile.open(tmp_path / "a.tar", "w") as archive:
        archive.add(tmp_path / "a.txt", "a.txt")
    with pytest.raises(ht.InputError, match=r"no handRecon3D_hd\*\.json in the archive"):
        ht.load(tmp_path / "a.tar")


def test_other_unit_is_an_error(dataset):
    with pytest.raises(ht.InputError, match="unit cm would fit"):
        ht.load(dataset, unit="m")
