"""Clocks of whole files: every way of writing time in every format, with its right value."""

import json
from datetime import datetime, timedelta

import numpy as np
import pytest

import handtrack as ht
from handtrack.cli import run

N, FPS = 40, 50.0
TIME = np.arange(N) / FPS
NOW = 1_700_000_000
MS = [round(t * 1000) for t in TIME]
DAY = datetime(2026, 11, 27, 9, 0, 0, 33_000)
ISO = [f"{(DAY + timedelta(seconds=t)).isoformat(timespec='milliseconds')}Z" for t in TIME]
TWICE = [MS[i - i % 2] for i in range(N)]
STRAY = [*MS[:20], 0, *MS[21:]]


@pytest.fixture(scope="module")
def joints(sample):
    return sample.joints[:N].copy()


def titles():
    return [f"{axis}{joint}" for joint in range(21) for axis in "xyz"]


def table(path, joints, name, column, separator=","):
    lines = [separator.join([name, *titles()])]
    for stamp, frame in zip(column, joints.reshape(N, -1), strict=True):
        cells = ["" if np.isnan(v) else f"{v:.6f}" for v in frame]
        lines.append(separator.join([str(stamp), *cells]))
    path.write_text("\n".join(lines) + "\n")
    return path


def lines(path, joints, name, column):
    plain = np.where(np.isnan(joints), None, joints).tolist()
    frames = [{name: stamp, "joints": frame} for stamp, frame in zip(column, plain, strict=True)]
    path.write_text("\n".join(map(json.dumps, frames)))
    return path


def arrays(path, joints, name, column):
    np.savez(path, joints_m=joints, hand="right", **{name: column})
    return path


# name of the column, what stands in it, what must be said
COLUMNS = {
    "time in s": ("time", TIME.tolist(), None),
    "time in ms": ("time", MS, "read as ms"),
    "time_ms": ("time_ms", MS, None),
    "time_us": ("time_us", [1000 * m for m in MS], None),
    "time_ns": ("time_ns", [10**6 * m for m in MS], None),
    "timestamp, epoch s": ("timestamp", [NOW + t for t in TIME.tolist()], None),
    "timestamp, epoch ms": ("timestamp", [NOW * 1000 + m for m in MS], "read as ms, by its date"),
    "timestamp, epoch us": ("timestamp", [(NOW * 1000 + m) * 1000 for m in MS], "read as us"),
    "timestamp, epoch ns": ("timestamp", [(NOW * 1000 + m) * 10**6 for m in MS], "read as ns"),
    "t": ("t", TIME.tolist(), None),
    "seconds under time_ms": ("time_ms", TIME.tolist(), "read as s"),
    "milliseconds under time_ns": ("time_ns", MS, "read as ms"),
    "each stamp twice": ("time_ms", TWICE, "repeated in 20 frames"),
    "one stamp at 0": ("time_ms", STRAY, "1 frame does not fit"),
    "one set back": ("time_ms", [m - 5000 * (m > 300) for m in MS], "goes back by 4.98 s"),
    "set forward": ("time_s", [t + 1.7e9 * (t > 0.05) for t in TIME], "the clock was set"),
    "ISO 8601": ("timestamp", ISO, None),
    "time of day": ("time", [f"09:{40 + m // 60000:02d}:{m / 1000:06.3f}" for m in MS], None),
    "timecode": ("timecode", [f"00:00:{i // 50:02d}:{i % 50:02d}" for i in range(N)], None),
}


@pytest.mark.parametrize("case", COLUMNS)
@pytest.mark.parametrize("make", [table, lines, arrays])
def test_every_format_has_the_clock(tmp_path, joints, case, make):
    name, column, said = COLUMNS[case]
    path = tmp_path / {table: "a.csv", lines: "a.jsonl", arrays: "a.npz"}[make]
    (found,) = ht.load(make(path, joints, name, column), hand="right")
    since = (found.time_ns - found.time_ns[0]) * 1e-9
    if case == "timecode":  # a clip of less than a second: the frames of a second are a guess
        assert np.ptp(np.diff(since)) < 1e-6
        return
    np.testing.assert_allclose(since, TIME, atol=2e-6)
    assert found.timed
    assert not found.numbered
    about_time = [n for n in found.notes if "no hand named" not in n and "order" not in n]
    if said is None:
        assert about_time == []
    else:
        assert said in " | ".join(about_time)


@pytest.mark.parametrize(
    "stamps",
    [
        [{"sec": NOW + i // 50, "nanosec": i % 50 * 20_000_000} for i in range(N)],
        [{"secs": NOW + i // 50, "nsecs": i % 50 * 20_000_000} for i in range(N)],
    ],
)
def test_stamps_of_ros(tmp_path, joints, stamps):
    (found,) = ht.load(lines(tmp_path / "a.jsonl", joints, "stamp", stamps), hand="right")
    assert found.time_ns[0] == NOW * 10**9
    np.testing.assert_array_equal(np.diff(found.time_ns), 20_000_000)


@pytest.mark.parametrize("kind", ["M8[ns]", "M8[us]", "m8[ms]"])
def test_arrays_of_dates(tmp_path, joints, kind):
    start = np.datetime64("2026-11-27T09:00") if kind[0] == "M" else np.timedelta64(5, "s")
    stamps = (start + np.array(MS).astype("m8[ms]")).astype(kind)
    (found,) = ht.load(arrays(tmp_path / "a.npz", joints, "time", stamps))
    np.testing.assert_array_equal(np.diff(found.time_ns), 20_000_000)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"fps": 0.0}, r"fps is 0, expected .* \(--fps N says it\)"),
        ({"fps": -25.0}, "fps is -25"),
        ({"fps": np.nan}, "fps is nan"),
        ({"fps": np.inf}, "fps is inf"),
        ({"fps": 1e9}, r"fps is 1e\+09"),
        ({"time": TIME[:-1]}, r"time has 39 stamps for 40 frames \(--fps"),
        ({"time": np.zeros((N, 3))}, r"time has shape \(40, 3\)"),
        ({"time_ns": np.zeros((2, N, 2))}, "time_ns has shape"),
    ],
)
def test_times_that_are_none_are_refused_and_fps_cures(tmp_path, joints, fields, message):
    path = tmp_path / "a.npz"
    np.savez(path, joints_m=joints, hand="right", **fields)
    with pytest.raises(ht.InputError, match=message):
        ht.load(path)
    (found,) = ht.load(path, fps=FPS)
    np.testing.assert_allclose(found.time_ns * 1e-9, TIME, atol=1e-9)


def test_the_unit_of_time_is_an_option(tmp_path, joints, capsys):
    path = arrays(tmp_path / "a.npz", joints, "time_s", np.arange(N) * 60.0)
    (guessed,) = ht.load(path)
    assert "(--time-unit s takes it at its word)" in guessed.notes[0]
    (found,) = ht.load(path, time_unit="s")
    assert found.time_ns[-1] == 39 * 60 * 10**9
    with pytest.raises(ht.SettingsError, match="unknown unit of time 'h', expected one of s, ms"):
        ht.load(path, time_unit="h")
    out = tmp_path / "a.mcap"
    assert run(["track", str(path), "-o", str(out), "--time-unit", "s", "-q"]) == 0
    assert ht.read_mcap(out)[0].time_ns[1] == 60 * 10**9


def test_frames_out_of_order_take_all_that_is_theirs_along(tmp_path, joints):
    order = np.arange(N)
    order[[10, 11]] = [11, 10]
    np.savez(
        tmp_path / "a.npz",
        joints_m=joints[order],
        truth_m=joints[order] + 0.001,
        confidence=np.linspace(0.5, 1, N)[order],
        time=TIME[order],
        frame=np.arange(100, 100 + N)[order],
        hand="right",
    )
    (found,) = ht.load(tmp_path / "a.npz")
    np.testing.assert_array_equal(found.joints, joints)
    np.testing.assert_array_equal(found.truth, np.where(np.isnan(joints), np.nan, found.truth))
    np.testing.assert_allclose(np.nanmax(np.abs(found.truth - joints - 0.001)), 0, atol=1e-12)
    assert found.frame_index.tolist() == list(range(100, 100 + N))
    assert (np.diff(found.confidence.max(1)) > 0).all()
    assert "2 frames of 40 were not in order of time: sorted" in found.notes


def test_frames_of_a_file_without_numbers_are_counted_from_0(tmp_path, joints):
    path = arrays(tmp_path / "a.npz", joints, "time", TIME)
    (part,) = ht.load(path, frames=(10, 19))
    assert part.frame_index.tolist() == list(range(10, 20))
    assert "no frame numbers in the file: counted from 0" in part.notes
    with pytest.raises(ht.InputError, match="no joint in frames 100:200, there are 0:39"):
        ht.load(path, frames=(100, 200))
