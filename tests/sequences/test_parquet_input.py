"""Parquet: LeRobot's episodes and tables, beside what was written; and what is refused."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.readers import parquet_file


@pytest.fixture(scope="module")
def joints() -> np.ndarray:
    """(30, 21, 3) of a hand that bends [m]."""
    model = ht.HandModel.default("right")
    bend = np.linspace(0, 1, 30)[:, None] * np.tile([0.8, 0.0, 0.9, 0.6], 5)
    return model.joints(model.limits.clamp(bend), None, [0.1, 0.2, 0.5])


def write(path: Path, **columns: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    parquet.write_table(pa.table(columns), path)
    return path


def lists(values: np.ndarray, size: int | None = None) -> pa.Array:
    flat = pa.array(values.astype(np.float32).ravel())
    width = size or values.reshape(len(values), -1).shape[1]
    return pa.FixedSizeListArray.from_arrays(flat, width)


def test_episodes_of_lerobot_are_sequences(joints: np.ndarray, tmp_path: Path) -> None:
    two = np.concatenate([joints, joints + 0.3])
    time = np.tile(np.arange(30, dtype=np.float32) / 50, 2)
    write(
        tmp_path / "hands" / "data" / "chunk-000" / "file-000.parquet",
        **{"observation.state": lists(two), "action": lists(two * 2)},
        timestamp=time,
        frame_index=np.tile(np.arange(30), 2),
        episode_index=np.repeat([4, 7], 30),
        task_index=np.zeros(60, np.int64),
    )
    info = tmp_path / "hands" / "meta" / "info.json"
    info.parent.mkdir()
    info.write_text(json.dumps({"fps": 50, "features": {"observation.state": {"names": None}}}))
    first, second = ht.load(tmp_path / "hands" / "data" / "chunk-000" / "file-000.parquet")
    assert [first.name, second.name] == ["hands episode 4 right", "hands episode 7 right"]
    np.testing.assert_allclose(first.joints, joints, atol=1e-6)
    np.testing.assert_allclose(second.joints, joints + 0.3, atol=1e-6)
    assert first.fps == pytest.approx(50, rel=1e-4)
    assert second.frame_index[3] == 3


@pytest.mark.parametrize("nested", [False, True])
def test_both_hands_in_columns_of_lists(joints: np.ndarray, nested: bool, tmp_path: Path) -> None:
    mirrored = joints * [1, -1, 1]
    values = {"left_hand": mirrored, "right_hand": joints}
    columns: dict[str, Any] = {
        n: pa.array(v.tolist() if nested else v.reshape(30, 63).tolist()) for n, v in values.items()
    }
    path = write(tmp_path / "x.parquet", **columns, timestamp=np.arange(30) / 30)
    left, right = ht.load(path)
    assert (left.hand, right.hand) == ("left", "right")
    np.testing.assert_allclose(left.joints, mirrored)
    np.testing.assert_allclose(right.joints, joints)


def test_126_numbers_are_two_hands(joints: np.ndarray, tmp_path: Path) -> None:
    both = np.concatenate([joints * [1, -1, 1], joints], 1).reshape(30, 126)
    found = ht.load(write(tmp_path / "x.parquet", state=lists(both), timestamp=np.arange(30) / 30))
    assert len(found) == 2
    np.testing.assert_allclose(found[1].joints, joints, atol=1e-6)


def test_a_state_whose_numbers_are_named(joints: np.ndarray, tmp_path: Path) -> None:
    names = [f"{n}_{c}" for n in JOINT_NAMES for c in "xyz"]
    state = np.concatenate([np.zeros((30, 2)), joints.reshape(30, 63)], 1)
    path = write(
        tmp_path / "set" / "data" / "x.parquet",
        **{"observation.state": lists(state)},
        timestamp=np.arange(30) / 20,
    )
    (tmp_path / "set" / "meta").mkdir()
    feature = {"names": {"axes": ["gripper", "lift", *names]}}
    features = {"features": {"observation.state": feature}}
    (tmp_path / "set" / "meta" / "info.json").write_text(json.dumps(features))
    (found,) = ht.load(path)
    np.testing.assert_allclose(found.joints, joints, atol=1e-6)
    assert found.fps == pytest.approx(20)


def test_missing_rows_and_columns_by_name(joints: np.ndarray, tmp_path: Path) -> None:
    rows = [None if i == 5 else v.ravel().tolist() for i, v in enumerate(joints)]
    path = write(tmp_path / "x.parquet", joints=pa.array(rows), timestamp=np.arange(30) / 30)
    (found,) = ht.load(path)
    assert np.isnan(found.joints[5]).all()
    np.testing.assert_allclose(found.joints[6], joints[6])
    named = {
        f"{name}_{c}_mm": 1e3 * joints[:, j, i]
        for j, name in enumerate(JOINT_NAMES)
        for i, c in enumerate("xyz")
    }
    (found,) = ht.load(write(tmp_path / "y.parquet", time_s=np.arange(30) / 30, **named))
    np.testing.assert_allclose(found.joints, joints, atol=1e-12)


def test_exports_are_read_again(sample: ht.Sequence, tmp_path: Path) -> None:
    track = ht.track(sample.frames(0, 20), ht.HandModel.default(), calibrate="none")
    ht.export(track, tmp_path / "x.parquet")
    (found,) = ht.load(tmp_path / "x.parquet")
    np.testing.assert_allclose(found.joints, track.observed, atol=1e-12)
    np.testing.assert_array_equal(found.time_ns, track.time_ns)


def test_what_is_refused_says_why(joints: np.ndarray, tmp_path: Path) -> None:
    whole = write(tmp_path / "x.parquet", state=lists(joints), timestamp=np.arange(30) / 30)
    data = whole.read_bytes()
    for cut in (5, len(data) // 2, len(data) - 3):
        (tmp_path / "cut.parquet").write_bytes(data[:cut])
        with pytest.raises(HandtrackError, match="Parquet file is damaged or cut short"):
            ht.load(tmp_path / "cut.parquet")
    robot = write(tmp_path / "robot.parquet", state=lists(np.zeros((5, 14))))
    with pytest.raises(HandtrackError, match=r"no column of 63 or 21 x 3 .* state \(14\)"):
        ht.load(robot)
    empty = write(tmp_path / "empty.parquet", state=pa.array([], pa.list_(pa.float32())))
    with pytest.raises(HandtrackError, match="without rows"):
        ht.load(empty)
    uneven = write(tmp_path / "uneven.parquet", state=pa.array([[1.0] * 63, [2.0] * 60]))
    with pytest.raises(HandtrackError, match="no column of 63"):
        ht.load(uneven)


@pytest.mark.parametrize("kind", ["lists", "lists of lists", "fixed", "uneven", "a row missing"])
def test_long_lists_are_read_in_batches(
    joints: np.ndarray, kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = joints if kind == "lists of lists" else joints.reshape(len(joints), 63)
    given: list[Any] = rows.tolist()
    if kind == "uneven":
        given[-1] = given[-1][:60]
    if kind == "a row missing":
        given[-2] = None
    column = pa.array(given, pa.list_(pa.float64(), 63)) if kind == "fixed" else pa.array(given)
    table = pa.table({"state": column, "timestamp": np.arange(len(given)) / 30})
    path = tmp_path / "a.parquet"
    parquet.write_table(table, path, row_group_size=7)
    read: list[Any] = []
    for batch in (5, 10**6):
        monkeypatch.setattr(parquet_file, "_BATCH", batch)
        try:
            (one,) = ht.load(path)
            read.append((one.joints.tobytes(), one.time_ns.tobytes(), one.notes))
        except HandtrackError as error:
            read.append(str(error))
    assert read[0] == read[1]
    assert isinstance(read[0], str) == (kind == "uneven")
    if kind not in ("uneven", "a row missing"):
        assert read[0][0] == joints.tobytes()
