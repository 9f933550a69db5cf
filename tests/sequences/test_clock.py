"""Times in every unit and quality, each with its right value: 90 frames at 30 frames/s."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.sequences.clock import Stamps, read_clock

N, FPS, NOW = 90, 30.0, 1_700_000_000
COUNT = np.arange(N)
TIME = COUNT / FPS
NS = np.round(TIME * 1e9).astype(np.int64)
RNG = np.random.default_rng(0)


def changed(change, values=TIME):
    out = np.array(values, dtype=np.float64)
    change(out)
    return out


def put(rows, value):
    return changed(lambda t: t.__setitem__(rows, value))


def moved(first, by):
    return np.where(first > COUNT, TIME, TIME + by)


def written(form, start=datetime(2026, 11, 27, 9, 0, 58, 500_000)):
    return [(start + timedelta(seconds=s)).strftime(form) for s in TIME.tolist()]


def timecodes(nominal, mark=":", first=0):
    """Timecodes of frames first ..., numbers dropped where the mark is ";"."""
    out = []
    for i in range(first, first + N):
        number = i
        if mark == ";":  # the definition: two numbers a minute are passed over, not every tenth
            number = 0
            for _ in range(i):
                number += 1
                if number % 1800 == 0 and number % 18000 != 0:
                    number += 2
        second, frame = divmod(number, nominal)
        out.append(f"01:{second // 60:02d}:{second % 60:02d}{mark}{frame:02d}")
    return out


# values, unit, error allowed [s], what must be said
RIGHT = {
    # units that are stated
    "time_s": (TIME, "s", 1e-9, None),
    "time_ms": (TIME * 1e3, "ms", 1e-9, None),
    "time_us": (TIME * 1e6, "us", 1e-9, None),
    "time_ns": (NS, "ns", 0, None),
    "today's nanoseconds keep their digits": (NOW * 10**9 + NS, "ns", 0, None),
    "unsigned nanoseconds": ((NOW * 10**9 + NS).astype(np.uint64), "ns", 0, None),
    # units that are not stated
    "seconds": (TIME, None, 1e-9, None),
    "milliseconds": (TIME * 1e3, None, 1e-9, "read as ms, by the step between frames: 30 frames"),
    "whole milliseconds": (np.round(TIME * 1e3).astype(int), None, 1e-3, "read as ms"),
    "microseconds": (TIME * 1e6, None, 1e-9, "read as us"),
    "nanoseconds": (NS, None, 0, "read as ns"),
    "epoch seconds": (NOW + TIME, None, 1e-6, None),
    "epoch milliseconds": (np.round((NOW + TIME) * 1e3), None, 1e-3, "read as ms, by its date"),
    "epoch microseconds": (np.round((NOW + TIME) * 1e6), None, 1e-6, "read as us, by its date"),
    "epoch nanoseconds": (NOW * 10**9 + NS, None, 0, "read as ns, by its date"),
    "epoch nanoseconds as float64": ((NOW * 10**9 + NS).astype(float), None, 1e-6, "ns"),
    "half precision": (TIME.astype(np.float16), None, 1e-3, None),
    "frame numbers": (COUNT, None, 1e-9, "counts frames: 30 frames/s assumed"),
    "frame numbers as float": (COUNT * 1.0, None, 1e-9, "counts frames: 30 frames/s assumed"),
    "frame numbers of a longer clip": (COUNT + 5000, None, 1e-9, "counts frames"),
    "frame numbers under time_ns": (COUNT, "ns", 1e-9, "counts frames"),
    # stated, and not so
    "ms under time_s": (TIME * 1e3, "s", 1e-9, "would make 0.03 frames/s: read as ms"),
    "s under time_ms": (TIME, "ms", 1e-9, "read as s, 30 frames/s (--time-unit ms"),
    "ms under time_ns": (TIME * 1e3, "ns", 1e-9, "read as ms"),
    "s under time_ns": (TIME, "ns", 1e-9, "read as s"),
    "us under time_ms": (TIME * 1e6, "ms", 1e-9, "read as us"),
    # missing
    "one NaN": (put(40, np.nan), None, 1e-9, "missing in 1 frame of 90"),
    "None": ([*TIME[:40], None, *TIME[41:]], None, 1e-9, "missing in 1 frame"),
    "infinite": (put(40, np.inf), None, 1e-9, "missing in 1 frame"),
    "NaN first and last": (put([0, 1, 88, 89], np.nan), None, 1e-9, "missing in 4 frames"),
    "every other NaN": (put(slice(1, None, 2), np.nan), None, 1e-9, "missing in 45 frames"),
    "all NaN": (np.full(N, np.nan), None, 1e-9, "missing in every frame"),
    "largest unsigned": (
        np.where(COUNT == 3, 2**64 - 1, (NOW * 10**9 + NS).astype(np.uint64)),
        *("ns", 0, "missing in 1 frame"),
    ),
    # repeated and rounded
    "one repeat": (put(40, TIME[39]), None, 1e-9, "repeated in 1 frame of 90: spread"),
    "three repeats": (put(slice(40, 43), TIME[39]), None, 1e-9, "repeated in 3 frames"),
    "first repeated": (put(1, 0), None, 1e-9, "repeated in 1 frame"),
    "last repeated": (put(89, TIME[88]), None, 1e-9, "repeated in 1 frame"),
    "each twice": (np.repeat(TIME[::2], 2), None, 1e-9, "repeated in 45 frames"),
    "tenths of a second": (np.round(TIME, 1), None, 2e-3, "repeated in 59 frames"),
    "whole seconds, rounded": (np.round(TIME), None, 5e-3, "repeated in 86 frames"),
    "whole seconds, cut": (np.floor(NOW + 0.4 + TIME), None, 5e-3, "repeated in 86 frames"),
    "whole epoch milliseconds": (np.floor((NOW + TIME) * 1e3).astype(int), "ms", 2e-3, None),
    "all the same": (np.full(N, 7.0), None, 1e-9, "the same in every frame (7)"),
    "epoch as float32": ((NOW + TIME).astype(np.float32), None, 1e-9, "same in every frame"),
    # out of order, stray
    "two exchanged": (
        put([40, 41], TIME[[41, 40]]),
        None,
        1e-9,
        "2 frames of 90 were not",
    ),
    "backwards": (TIME[::-1], None, 1e-9, "not in order of time: sorted"),
    "shuffled": (RNG.permutation(TIME), None, 1e-9, "not in order of time: sorted"),
    "one far ahead": (
        put(40, 5000),
        None,
        1e-9,
        "(the first is frame 40): replaced",
    ),
    "one at 0": (changed(lambda t: t.__setitem__(40, 0), NOW + TIME), None, 1e-6, "does not fit"),
    "one at -1": (put(40, -1), None, 1e-9, "1 frame does not fit"),
    "three stray": (put([40, 41, 42], [9, 8, 7]), None, 1e-9, "3 frames does not fit"),
    "first stray": (put(0, 99), None, 1e-9, "frame 0"),
    "last stray": (put(89, -1), None, 1e-9, "frame 89"),
    # a clock that was set
    "set back a second": (moved(50, -1), None, 1e-9, "goes back by 0.9667 s at frame 50"),
    "set back an hour": (moved(50, -3600), None, 1e-9, "goes back by 60 min at frame 50"),
    "set back a tenth": (moved(50, -0.1), None, 1e-9, "goes back by 0.06667 s at frame 50"),
    "set forward by years": (moved(3, 1.7e9), None, 1e-6, "leaps by 53.87 years at frame 3"),
    "set twice": (
        np.where((COUNT > 30) & (COUNT < 60), TIME - 100, TIME),
        *(None, 1e-9, "goes back by 99.97 s at frame 31"),
    ),
    "32 bits of microseconds pass over": (
        (np.round(TIME * 1e6).astype(np.int64) + 2**32 - 1_500_000) % 2**32,
        *("us", 2e-6, "goes back by 71.58 min"),
    ),
    # written out
    "ISO 8601": (written("%Y-%m-%dT%H:%M:%S.%fZ"), None, 1e-6, None),
    "ISO 8601 with an offset": (written("%Y-%m-%dT%H:%M:%S.%f+05:30"), None, 1e-6, None),
    "ISO 8601 of whole seconds": (written("%Y-%m-%dT%H:%M:%SZ"), None, 0.02, "repeated in"),
    "a log's date": (written("%Y-%m-%d %H:%M:%S,%f"), None, 1e-6, None),
    "an American date": (written("%m/%d/%Y %I:%M:%S.%f %p"), None, 1e-6, None),
    "a German date": (written("%d.%m.%Y %H:%M:%S.%f"), None, 1e-6, None),
    "time of day": (written("%H:%M:%S.%f"), None, 1e-6, None),
    "minutes and seconds": (written("%M:%S.%f"), None, 1e-6, None),
    "over midnight": (
        written("%H:%M:%S.%f", datetime(2026, 1, 1, 23, 59, 58)),
        *(None, 1e-6, "passes midnight at frame 60"),
    ),
    "numbers as text": ([f"{s:.6f}" for s in TIME], None, 1e-6, None),
    "numbers as bytes": (np.array([f"{s:.6f}" for s in TIME], "S"), None, 1e-6, None),
    "decimal commas": ([f"{s:.6f}".replace(".", ",") for s in TIME], None, 1e-6, None),
    "numbers with a unit": ([f"{s * 1e3:.3f} ms" for s in TIME], None, 1e-6, None),
    "nanoseconds as text": ([str(v) for v in NOW * 10**9 + NS], "ns", 0, None),
    "empty cells": (["", *[f"{s:.6f}" for s in TIME[1:]]], None, 1e-6, "missing in 1 frame"),
    "timecode": (timecodes(30), None, 1e-9, None),
    "datetime64": (np.datetime64("2026-01-01") + NS.astype("m8[ns]"), None, 0, None),
    "datetime64 of ms": (
        (np.datetime64("2026-01-01") + NS.astype("m8[ns]")).astype("M8[ms]"),
        *(None, 1e-3, None),
    ),
    "timedelta64": (NS.astype("m8[ns]"), None, 0, None),
    "datetime64 with NaT": (
        np.where(COUNT == 9, np.datetime64("NaT"), np.datetime64("2026-01-01", "ns") + NS),
        *(None, 1e-9, "missing in 1 frame"),
    ),
    "datetime": (
        [datetime(2026, 1, 1, tzinfo=UTC) + timedelta(seconds=s) for s in TIME.tolist()],
        *(None, 1e-6, None),
    ),
    "ROS 2": (
        [{"sec": NOW + i // 30, "nanosec": int(NS[i % 30])} for i in range(N)],
        *(None, 1e-9, None),
    ),
    "ROS 1": (
        [{"secs": NOW + i // 30, "nsecs": int(NS[i % 30])} for i in range(N)],
        *(None, 1e-9, None),
    ),
    "pairs": (np.stack([NOW + COUNT // 30, NS[COUNT % 30]], 1), None, 1e-9, None),
    "a column": (TIME[:, None], None, 1e-9, None),
    "one for all": (NOW * 1.0, None, 1e-9, "one time for 90 frames"),
}


@pytest.mark.parametrize("case", RIGHT)
def test_right(case):
    values, unit, error, said = RIGHT[case]
    clock = read_clock(N, Path("a.csv"), Stamps(values, "time", unit))
    assert sorted(clock.rows) == COUNT.tolist()
    assert (np.diff(clock.time_ns) > 0).all()
    since = (clock.time_ns - clock.time_ns[0]) * 1e-9
    np.testing.assert_allclose(since, TIME, rtol=0, atol=error + 1.1e-9)
    if said is None:
        assert clock.notes == ()
    else:
        assert said in " | ".join(clock.notes)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (TIME[:-1], "time has 89 stamps for 90 frames (--fps N"),
        (np.zeros((N, 3)), "time has shape (90, 3) for 90 frames"),
        (["noon"] * N, "frame 0: time is 'noon', expected a time"),
        (["1", "2", "x", *["3"] * 87], "frame 2: time is 'x', expected a number"),
        (COUNT > 3, "frame 0: time is 'False', expected a time"),
        ([[1, 2, 3]] * N, "frame 0: time is [1, 2, 3], expected sec and nanosec"),
        (TIME / 60, "goes up by 0.0005556 a frame, in no unit 1 to 1000 frames/s (--fps N"),
        (TIME * 1e30, "goes up by 3.333e+28 a frame"),
        (["1 s", "2 ms", *["3 s"] * 88], "has a unit in some frames and another"),
        (["00:00:00:00", *["5"] * 89], "frame 1: time is '5', expected a timecode HH:MM:SS:FF"),
        (TIME + np.random.default_rng(1).normal(0, 0.1, N), "it is no clock (--fps N"),
    ],
)
def test_refused_with_the_cure(values, message):
    with pytest.raises(ht.InputError) as caught:
        read_clock(N, Path("a.csv"), Stamps(values))
    assert message in str(caught.value)
    assert "--fps" in str(caught.value)
    clock = read_clock(N, Path("a.csv"), Stamps(values), given_fps=60)
    np.testing.assert_allclose(clock.time_ns * 1e-9, COUNT / 60, atol=1e-9)


def test_several_clips_follow_one_another_with_a_pause():
    clock = read_clock(N, Path("a"), Stamps(np.tile(TIME[:45], 2)))
    assert "starts again at frame 45: several clips in one file?" in clock.notes[0]
    steps = np.diff(clock.time_ns) * 1e-9
    assert steps[44] == pytest.approx(1.0)
    np.testing.assert_allclose(np.delete(steps, 44), 1 / 30, rtol=1e-6)


@pytest.mark.parametrize(("gap", "said"), [(600, "10 min"), (3600, "60 min"), (20, "20.03 s")])
def test_a_gap_is_kept_and_said(gap, said):
    clock = read_clock(N, Path("a"), Stamps(moved(45, gap)))
    np.testing.assert_allclose(clock.time_ns * 1e-9, moved(45, gap), atol=1e-9)
    assert clock.notes == (f"no frames for {said} after frame 44",)


def test_repeats_before_a_gap_stay_before_it():
    times = moved(45, 600)
    times[44] = times[43]
    clock = read_clock(N, Path("a"), Stamps(times))
    np.testing.assert_allclose(clock.time_ns * 1e-9, moved(45, 600), atol=1e-3)


def test_numbers_that_contradict_are_not_sorted():
    times = put([40, 41], TIME[[41, 40]])
    clock = read_clock(N, Path("a"), Stamps(times), numbers=COUNT)
    assert clock.rows.tolist() == COUNT.tolist()
    assert np.abs(clock.time_ns * 1e-9 - TIME).max() < 0.04
    assert clock.notes


@pytest.mark.parametrize("nominal", [24, 25, 30, 50, 60])
def test_timecodes_know_their_rate(nominal):
    clock = read_clock(N, Path("a"), Stamps(timecodes(nominal)))
    np.testing.assert_allclose(np.diff(clock.time_ns) * 1e-9, 1 / nominal, rtol=1e-6)


def test_dropped_timecodes_keep_pace():
    clock = read_clock(N, Path("a"), Stamps(timecodes(30, ";", 1760)))
    np.testing.assert_allclose(np.diff(clock.time_ns) * 1e-9, 1.001 / 30, rtol=1e-6)
    # within a minute nothing is dropped; the rate is said by the file
    clock = read_clock(N, Path("a"), Stamps(timecodes(30)), fps=30 / 1.001)
    np.testing.assert_allclose(np.diff(clock.time_ns) * 1e-9, 1.001 / 30, rtol=1e-6)


def test_a_stated_rate_tells_the_unit():
    clock = read_clock(N, Path("a"), Stamps(COUNT * 2.0), fps=500)
    assert clock.time_ns[1] == 2_000_000
    clock = read_clock(N, Path("a"), Stamps(COUNT), fps=60)
    np.testing.assert_allclose(clock.time_ns * 1e-9, COUNT / 60, atol=1e-9)
    assert clock.stated
    assert not read_clock(N, Path("a"), Stamps(COUNT)).stated
    clock = read_clock(N, Path("a"), Stamps(TIME), fps=60)
    assert "fps is 60 in the file, time makes 30 frames/s: taken as time says" in clock.notes[0]


def test_the_callers_unit_beats_all():
    clock = read_clock(N, Path("a"), Stamps(COUNT * 60.0, "time_s", "s"), given_unit="s")
    assert clock.time_ns[-1] == 89 * 60 * 10**9
    clock = read_clock(N, Path("a"), Stamps(COUNT), given_unit="ms")
    assert clock.time_ns[-1] == 89 * 10**6


@pytest.mark.parametrize("fps", [0, -30, float("nan"), float("inf"), 1e9, 1e-9])
def test_rates_that_are_none(fps):
    with pytest.raises(ht.InputError, match=r"fps is .* \(--fps N says it\)"):
        read_clock(N, Path("a"), fps=fps)
    assert "not used" in read_clock(N, Path("a"), Stamps(TIME), fps=fps).notes[0]
    assert read_clock(N, Path("a"), fps=fps, given_fps=30).time_ns[30] == 10**9
    with pytest.raises(ht.SettingsError, match="fps is"):
        ht.load("recordings/sample.npz", fps=fps)


@pytest.mark.parametrize("numbers", [[5, 5, 6], [5, 7, 6], [7, 6, 5], [0, 10**15, 10**15 + 1]])
def test_any_frame_numbers_make_a_clock(numbers):
    clock = read_clock(3, Path("a"), numbers=np.array(numbers), fps=30)
    assert (np.diff(clock.time_ns) > 0).all()
    assert clock.notes
    assert sorted(clock.rows) == [0, 1, 2]


@pytest.mark.parametrize("n", [1, 2])
def test_one_frame_and_two(n):
    clock = read_clock(n, Path("a"), Stamps((NOW + TIME[:n]) * 1e3))
    assert clock.time_ns[0] == NOW * 10**9
    assert len(clock.time_ns) == n
    assert read_clock(n, Path("a"), Stamps([None] * n)).time_ns[0] == 0


def test_random_damage_never_leaves_time_that_stands_still():
    rng = np.random.default_rng(5)
    refused = 0
    for _ in range(300):
        times = TIME * rng.choice([1, 1e3, 1e6, 1e9]) + rng.choice([0, NOW])
        for _ in range(rng.integers(1, 5)):
            at, length = rng.integers(0, N), rng.integers(1, 30)
            rows = slice(at, at + length)
            times[rows] = rng.choice([np.nan, 0, times[at], -times[at], times[at] * 1e3])
        try:
            clock = read_clock(N, Path("a"), Stamps(times))
        except ht.InputError:
            refused += 1
            continue
        assert (np.diff(clock.time_ns) > 0).all()
        assert clock.notes or (np.diff(times) > 0).all()
    assert refused < 150


def test_pictures_minutes_apart_are_as_far_apart_as_their_stamps_say():
    apart = np.array([0, 27 * 10**9, 90 * 10**9])
    clock = read_clock(3, Path("a.npz"), Stamps(apart, "time_ns", "ns"))
    np.testing.assert_array_equal(clock.time_ns, apart)
    assert any("frames/s" in note for note in clock.notes)
