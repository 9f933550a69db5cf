"""Project Aria's hands brought into the world by the device's trajectory."""

from __future__ import annotations

import csv

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import handtrack as ht
from handtrack.errors import HandtrackError

MARKS = (5, -1, 6, 7, 0, 8, 9, 10, 1, 11, 12, 13, 2, 14, 15, 16, 3, 17, 18, 19, 4)


def write_hands(path, right, times, lost=()):
    titles, rows = ["tracking_timestamp_us"], [[str(t)] for t in times]
    for side in ("left", "right"):
        titles.append(f"{side}_tracking_confidence")
        titles += [f"t{a}_{side}_landmark_{i}_device" for i in range(21) for a in "xyz"]
        for t, row in enumerate(rows):
            seen = side == "right" and t not in lost
            marks = np.zeros((21, 3))
            for joint, mark in enumerate(MARKS):
                if mark >= 0 and seen:
                    marks[mark] = right[t, joint]
            if seen:
                marks[20] = right[t, [0, 9]].mean(0)
            row += ["1" if seen else "-1", *(f"{x:.9f}" for x in marks.ravel())]
    path.write_text("\n".join(",".join(r) for r in [titles, *rows]) + "\n")
    return path


def write_way(path, times):
    titles = "graph_uid,tracking_timestamp_us,utc_timestamp_ns,tx_world_device,ty_world_device,"
    titles += "tz_world_device,qx_world_device,qy_world_device,qz_world_device,qw_world_device"
    lines = [titles]
    for t in times:
        s = (t - 10**9) * 1e-6
        q = Rotation.from_rotvec([0.3 * s, 1.0 + 0.5 * s, 0.1]).as_quat()
        cells = [f"{x:.12g}" for x in (0.5 * s, 1.0, -0.2 * s, *q)]
        lines.append(f"ea72-01,{t},168{t},{','.join(cells)}")
    path.write_text("\n".join(lines) + "\n")
    return path


def pose(t):
    s = (t - 10**9) * 1e-6
    turn = Rotation.from_rotvec([0.3 * s, 1.0 + 0.5 * s, 0.1]).as_matrix()
    return turn, np.array([0.5 * s, 1.0, -0.2 * s])


def test_hands_in_the_world(tmp_path, right):
    times = 10**9 + 33_333 * np.arange(len(right)) + 411
    path = write_hands(tmp_path / "hand_tracking_results.csv", right, times, lost=(4,))
    way = write_way(tmp_path / "closed_loop_trajectory.csv", 10**9 + 1000 * np.arange(300))
    (device,) = ht.load(path, hand="right")
    assert any("--trajectory" in note and str(way) in note for note in device.notes)
    (world,) = ht.load(path, hand="right", trajectory=way)
    last = (times <= 10**9 + 299_000).sum()
    for t in range(last):
        turn, place = pose(times[t])
        for joint in range(21):
            got = world.joints[t, joint]
            if joint == 1 or t == 4:
                assert np.isnan(got).all()
            else:
                np.testing.assert_allclose(got, turn @ right[t, joint] + place, atol=2e-6)
    assert len(world) == len(right)
    assert not world.present[last:].any()
    assert any("outside of the trajectory" in note for note in world.notes)


def test_what_is_no_trajectory(tmp_path, right):
    times = 10**9 + 33_333 * np.arange(len(right))
    path = write_hands(tmp_path / "hands.csv", right, times)
    other = write_way(tmp_path / "way.csv", 10**6 + 1000 * np.arange(30))
    with pytest.raises(HandtrackError, match="of another session"):
        ht.load(path, trajectory=other)
    with pytest.raises(HandtrackError, match="is no closed_loop"):
        ht.load(path, trajectory=path.with_name("hands.csv"))
    with pytest.raises(HandtrackError, match="no such file"):
        ht.load(path, trajectory=tmp_path / "nothing.csv")
    np.savez(tmp_path / "a.npz", joints_m=right, hand="right")
    with pytest.raises(HandtrackError, match="nothing in it takes --trajectory"):
        ht.load(tmp_path / "a.npz", trajectory=other)


def test_real_trajectory_by_slerp(shared_data):
    folder = shared_data / "formats" / "aria"
    if not folder.is_dir():
        pytest.skip(f"real data not there: {folder}")
    from handtrack.sequences.readers.aria import between, read_trajectory

    path = folder / "closed_loop_trajectory.csv"
    at, turn, place = read_trajectory(path)
    rows = list(csv.DictReader(path.open()))
    own = np.array([[float(r[f"q{a}_world_device"]) for a in "xyzw"] for r in rows])
    stamps = np.array([float(r["tracking_timestamp_us"]) for r in rows])
    asked = np.linspace(stamps[0], stamps[-1], 57)
    rotation, move, known = between(asked, at, turn, place)
    truth = Slerp(stamps, Rotation.from_quat(own))(asked).as_matrix()
    np.testing.assert_allclose(rotation, truth, atol=1e-9)
    x = np.interp(asked, stamps, [float(r["tx_world_device"]) for r in rows])
    np.testing.assert_allclose(move[:, 0], x, atol=1e-12)
    assert known.all()
    with pytest.raises(HandtrackError, match="of another session"):
        ht.load(folder / "hand_tracking_results_v2.csv", trajectory=path)
