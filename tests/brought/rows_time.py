"""Rows: clocks in every unit, with what clocks do."""

from __future__ import annotations

import numpy as np
from made_files import csv, json_object, jsonl, leap, mcap, npz, sides
from made_hands import FPS, Brought, both, brought, scaled, seconds, timed
from rows import DOUBT, RIGHT, Table

ROWS = Table()
right = brought().but(label="right")
EPOCH = 1_700_000_000.0

STATED = {
    "time": 1.0,
    "time_s": 1.0,
    "Time (s)": 1.0,
    "time [s]": 1.0,
    "Time(s)": 1.0,
    "seconds": 1.0,
    "time_ms": 1e3,
    "timestamp_ms": 1e3,
    "Time (ms)": 1e3,
    "Timestamp [ms]": 1e3,
    "time_us": 1e6,
    "timestamp_us": 1e6,
    "time_ns": 1e9,
    "timestamp_ns": 1e9,
    "stamp_ns": 1e9,
    "time_sec": 1.0,
}
"""Names that say their unit, and how many of it make a second."""
for name, per_second in STATED.items():
    b = timed(right, name, per_second=per_second)
    ROWS.add("time", f"csv {name}", b, csv)
    ROWS.add("time", f"jsonl {name}", b, jsonl, "a.jsonl")
    ROWS.add("time", f"npz {name}", b, npz, "a.npz")

UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}
for name in ("time", "timestamp", "t", "Timestamp", "stamp", "ts"):
    for unit, per_second in UNITS.items():
        for start in (0.0, EPOCH):
            b = timed(right, name, start, per_second)
            said = unit if unit != "s" else ""
            where = "epoch " if start else ""
            ROWS.add("time", f"csv {name} in {where}{unit}", b, csv, says=said)
            if name in ("time", "timestamp"):
                ROWS.add("time", f"jsonl {name} in {where}{unit}", b, jsonl, "a.jsonl", says=said)
                ROWS.add("time", f"npz {name} in {where}{unit}", b, npz, "a.npz", says=said)
                ROWS.add(
                    "time",
                    f"sides {name} in {where}{unit}",
                    timed(both(), name, start, per_second),
                    sides,
                    "a.jsonl",
                    says=said,
                )
ROWS.add("time", "json object timestamps", timed(right, "timestamps"), json_object, "a.json")
ROWS.add(
    "time",
    "leap microseconds",
    scaled(timed(right, "timestamp", 12.0, 1e6), 1e3).but(
        expected=np.where(np.arange(21)[:, None] == 0, np.nan, right.expected)
    ),
    leap,
    "a.json",
)
ROWS.add("time", "mcap of 1970", right.but(fps=FPS), mcap, "a.mcap", start=0)


def moved(change, name: str = "time", b: Brought = right) -> Brought:
    """Times [s] as a clock gives them that is not right."""
    return b.but(times=[float(v) for v in change(seconds(b))], time_name=name, fps=FPS)


def set_back(t: np.ndarray) -> np.ndarray:
    out = t.copy()
    out[20:] -= 0.5
    return out


def repeated(t: np.ndarray) -> np.ndarray:
    out = t.copy()
    out[9], out[30] = out[8], out[29]
    return out


def jump(t: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(t)) >= 20, t + 3.2e7, t)


def gap(t: np.ndarray) -> np.ndarray:
    return np.where(np.arange(len(t)) >= 20, t + 600.0, t)


def hole(t: np.ndarray) -> np.ndarray:
    out = t.copy()
    out[7] = np.nan
    return out


CLOCKS = {
    "set back": (set_back, DOUBT, "back|time"),
    "repeated": (repeated, RIGHT, "repeat|same"),
    "rounded to 10 ms": (lambda t: np.round(t, 2), RIGHT, ""),
    "rounded to 100 ms": (lambda t: np.round(t, 1), DOUBT, "repeat|same|round"),
    "rounded to seconds": (lambda t: np.floor(t), DOUBT, "repeat|same|round|fps"),
    "all the same": (lambda t: t * 0 + 5, DOUBT, "same|fps"),
    "a jump of a year": (jump, RIGHT, "jump|gap|clock|no frames"),
    "a gap of ten minutes": (gap, RIGHT, "gap|jump|no frames"),
    "one missing": (hole, DOUBT, "time"),
    "frame numbers": (lambda t: np.arange(len(t)), DOUBT, "frame|fps"),
    "negative": (lambda t: t - 100.0, RIGHT, ""),
    "one frame a minute": (lambda t: t * 1800, DOUBT, "fps|frames/s"),
    "turned round": (lambda t: t[::-1], DOUBT, "back|time|order"),
}
for word, (change, expect, says) in CLOCKS.items():
    b = moved(change)
    if word in ("frame numbers", "rounded to 10 ms"):
        b = b.but(fps=None)
    ROWS.add("time", f"csv {word}", b, csv, "a.csv", expect, says)
    ROWS.add("time", f"npz {word}", b, npz, "a.npz", expect, says)
    if word != "one missing":
        ROWS.add("time", f"jsonl {word}", b, jsonl, "a.jsonl", expect, says)

# frame numbers where the file gives them
numbers = right.but(times=[2 * i for i in range(45)], time_name="frame", fps=15.0)
# of 30 frames/s, as assumed
ROWS.add("time", "csv every second frame number", numbers, csv)
ROWS.add("time", "csv frame numbers from 1", numbers.but(times=list(range(1, 46)), fps=30.0), csv)
ROWS.add(
    "time", "csv frame_id", numbers.but(times=list(range(45)), time_name="frame_id", fps=30.0), csv
)

# times as text
ISO = [f"2024-05-01T12:00:{v:06.3f}" for v in seconds(right)]
CLOCK = [f"12:00:{v:06.3f}" for v in seconds(right)]
for word, texts in {
    "ISO": ISO,
    "ISO with Z": [v + "Z" for v in ISO],
    "ISO with a blank": [v.replace("T", " ") for v in ISO],
    "of the day": CLOCK,
}.items():
    ROWS.add(
        "time",
        f"csv text {word}",
        right.but(times=texts, time_name="timestamp", fps=FPS),
        csv,
    )
ros = [{"sec": int(v), "nanosec": int(v % 1 * 1e9)} for v in seconds(right) + 1.7e9]
ROWS.add(
    "time",
    "jsonl ROS stamp",
    right.but(times=ros, time_name="stamp", fps=FPS),
    jsonl,
    "a.jsonl",
)
words = [str(v) for v in seconds(right)]
ROWS.add(
    "time",
    "jsonl numbers as text",
    right.but(times=words, time_name="time", fps=FPS),
    jsonl,
    "a.jsonl",
)
