"""Conversions, read back by a few independent lines: the same joints, and what they say of loss."""

from __future__ import annotations

import csv
import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from converted_clips import FPS, exact, holed, moving, poses
from screens import lacking

import handtrack as ht
from handtrack.converting.complete import METACARPAL_SD
from handtrack.converting.egodex import NAMES
from handtrack.converting.openxr import XR_JOINTS
from handtrack.converting.source import Source
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import ORDERS


@pytest.fixture(scope="module")
def h5py() -> Any:
    try:
        import h5py
    except ImportError:
        lacking("h5py", "it reads the HDF5 that is written")
    return h5py


def test_csv_and_npz_keep_what_there_is(tmp_path: Path) -> None:
    sequence = holed(moving())
    for ending in ("csv", "npz", "parquet"):
        (made,) = ht.convert([sequence], tmp_path / f"x.{ending}")
        assert (made.loss.joints, made.made) == (0, {})
        assert made.loss.max_mm < 1e-5
        (back,) = ht.load(made.path)
        assert back.hand == "right"
        np.testing.assert_array_equal(back.time_ns, sequence.time_ns)
        np.testing.assert_array_equal(back.frame_index, sequence.frame_index)
        np.testing.assert_allclose(back.joints, sequence.joints, atol=1e-8)
    with (tmp_path / "x.csv").open() as text:
        rows = list(csv.DictReader(text))
    assert rows[11]["middle_tip_x_mm"] == rows[11]["thumb_cmc_z_mm"] == ""
    found = [[float(row[f"index_dip_{c}_mm"]) for c in "xyz"] for row in rows]
    np.testing.assert_allclose(found, sequence.joints[:, 7] * 1e3, atol=1e-6)


@pytest.mark.parametrize("hand", ["right", "left"])
def test_openxr_has_26_joints_and_says_which_are_made(hand: str, tmp_path: Path) -> None:
    whole = moving(hand)
    sequence = holed(whole)
    (made,) = ht.convert([sequence], tmp_path / "x.jsonl", models=exact)
    lines = [json.loads(line) for line in (tmp_path / "x.jsonl").read_text().splitlines()]
    assert [line["time_ns"] for line in lines] == sequence.time_ns.tolist()
    assert all(tuple(line["joints"]) == XR_JOINTS for line in lines)
    place = np.array(
        [[[line["joints"][n]["position"][c] for c in "xyz"] for n in XR_JOINTS] for line in lines]
    )
    ours = place[:, list(ORDERS["openxr"])]
    kept = np.isfinite(sequence.joints)
    np.testing.assert_array_equal(ours[kept], sequence.joints[kept])
    assert np.linalg.norm(ours - whole.joints, axis=-1).max() < 0.004  # the fit knows the hand
    assert made.loss.max_mm == 0
    never = {name for name, of in made.made.items() if of.never}
    metacarpals = {f"{f}_metacarpal" for f in ("index", "middle", "ring", "little")}
    assert never == {"palm", "thumb_metacarpal"} | metacarpals
    assert made.made["middle_tip"].frames == 3
    assert "sd_m" in lines[11]["joints"]["middle_tip"]
    assert "sd_m" not in lines[20]["joints"]["middle_tip"]
    xyzw = np.array(
        [
            [[line["joints"][n]["orientation"][c] for c in "wxyz"] for n in XR_JOINTS]
            for line in lines
        ]
    )
    turn = quaternion_to_matrix(xyzw)
    # -z points along the bone, y out of the back of the hand
    bones = [
        (a, a + 1) for a, n in enumerate(XR_JOINTS[:-1]) if not n.endswith(("tip", "palm", "wrist"))
    ]
    for a, b in bones:
        if XR_JOINTS[a].endswith("metacarpal") and not XR_JOINTS[a].startswith("thumb"):
            continue  # rigid in the palm, whose direction they have
        along = place[:, b] - place[:, a]
        along /= np.linalg.norm(along, axis=-1, keepdims=True)
        assert (-(turn[:, a, :, 2] * along).sum(-1)).min() > 0.98
    root = poses(len(lines))[1]
    for name in ("palm", "index_proximal", "little_proximal"):
        j = XR_JOINTS.index(name)
        if name == "palm":
            assert (turn[:, j, :, 1] * root[:, :, 2]).sum(-1).min() > 0.95
        # a finger that bends turns its back away from the wrist, about x
        assert np.linalg.det(turn[:, j]).min() > 0.99
    flat = ht.HandModel.default(hand)
    base = place[:, XR_JOINTS.index("index_metacarpal")] - place[:, 1]
    assert np.linalg.norm(base, axis=-1).mean() == pytest.approx(0.28 * flat.size, rel=0.2)
    assert made.made["index_metacarpal"].sd_mm == pytest.approx(1e3 * METACARPAL_SD * flat.size)


def test_what_the_fitted_hand_gives_is_as_good_as_it_says(sample: ht.Sequence) -> None:
    assert sample.truth is not None
    rng = np.random.default_rng(0)
    for gone in ([1], [9], [3, 7, 11, 15, 19], None):
        joints = sample.joints.copy()
        if gone is None:
            joints[rng.random(joints.shape[:2]) < 0.15] = np.nan
        else:
            joints[:, gone] = np.nan
        source = Source.of(dataclasses.replace(sample, joints=joints, confidence=None), "right")
        whole = source.whole
        off = np.linalg.norm(whole.joints - sample.truth, axis=-1)[whole.made]
        share = np.sqrt(np.nanmean((off / whole.sd[whole.made]) ** 2))
        assert 0.4 < share < 1.3, (gone, share)


def test_lerobot_has_a_state_of_63_numbers(tmp_path: Path) -> None:
    from pyarrow import parquet

    whole = moving()
    (made,) = ht.convert([holed(whole)], tmp_path / "x.parquet", "lerobot", models=exact)
    table = parquet.read_table(made.path)
    state = np.array(table.column("observation.state").to_pylist())
    assert state.shape == (40, 63)
    assert np.linalg.norm(state.reshape(-1, 21, 3) - whole.joints, axis=-1).max() < 0.004
    assert table.column("timestamp").to_pylist()[3] == pytest.approx(0.1)
    assert made.made["thumb_cmc"].never
    assert made.loss.max_mm < 1e-4  # float32
    (back,) = ht.load(made.path)
    assert back.hand == "right"


def test_egodex_of_both_hands(h5py: Any, tmp_path: Path) -> None:
    right, left = moving("right"), moving("left", 30, 5_000_000_000 + 5 * 10**9 // FPS)
    made = ht.convert([left, right], tmp_path / "x.hdf5", models=exact)
    assert [m.hand for m in made] == ["left", "right"]
    with h5py.File(tmp_path / "x.hdf5") as file:
        assert len(file["transforms"]) == 2 * len(NAMES) == 50
        tip = file["transforms/rightIndexFingerTip"][:]
        late = file["transforms/leftHand"][:]
        sure = file["confidences/leftHand"][:]
        wrist = file["transforms/rightHand"][:]
    np.testing.assert_allclose(tip[:, :3, 3], right.joints[:, 8], atol=1e-6)
    np.testing.assert_allclose(late[5:35, :3, 3], left.joints[:, 0], atol=1e-6)
    assert np.isnan(late[:5, :3, 3]).all()
    assert not sure[:5].any()
    assert sure[6] == 1
    middle = right.joints[:, 9] - right.joints[:, 0]
    middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
    assert (wrist[:, :3, 0] * middle).sum(-1).min() > 0.99  # x along the hand
    assert max(m.loss.max_mm for m in made) < 1e-3


def test_egodex_of_another_rate_is_30_frames_a_second(h5py: Any, tmp_path: Path) -> None:
    fast = moving(frames=120)
    fast = dataclasses.replace(fast, time_ns=fast.time_ns[0] + np.arange(120) * 10**9 // 90)
    (made,) = ht.convert([fast], tmp_path / "x.hdf5", models=exact)
    assert made.notes == ("brought onto 30 frames/s (40 frames)",)
    with h5py.File(made.path) as file:
        tip = file["transforms/rightIndexFingerTip"][:, :3, 3]
    np.testing.assert_allclose(tip, fast.joints[::3, 8], atol=1e-5)
    assert 0.01 < made.loss.max_mm < 10  # what lies between is lost
