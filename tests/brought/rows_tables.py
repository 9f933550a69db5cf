"""Rows: what programs and scripts write, what is stated beats what is implied, and what is not
known."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from made_files import (
    bare,
    csv,
    json_object,
    long,
    mediapipe_tasks,
    nested,
    npy,
    npz,
)
from made_hands import Brought, both, brought, scaled, timed, unsure
from made_names import NAMES
from rows import DOUBT, REFUSED, Table

ROWS = Table()
plain = brought()
right = plain.but(label="right")
left = brought("left").but(label="left")

# ---- MediaPipe's results as scripts dump them: the world's landmarks, not the picture's ----

for style in ("tasks", "web", "solutions"):
    ROWS.add(
        "names",
        f"mediapipe {style}",
        timed(both(), "timestamp_ms", per_second=1e3),
        mediapipe_tasks,
        "a.jsonl",
        style=style,
    )
    ROWS.add(
        "names",
        f"mediapipe {style} one hand",
        timed(right, "timestamp_ms", per_second=1e3),
        mediapipe_tasks,
        "a.jsonl",
        style=style,
    )

# ---- tables as programs write them ----

ROWS.add("names", "pandas index", right, csv, index=True)
ROWS.text("names", "pandas Unnamed: 0", right, lambda t: "Unnamed: 0" + t, csv, index=True)
ROWS.add("names", "pandas header 0..62", plain, bare, head=[str(i) for i in range(63)])
ROWS.add(
    "names", "pandas header and index", plain, bare, head=["", *map(str, range(63))], first="index0"
)
ROWS.add("names", "MATLAB Var1", plain, bare, head=[f"Var{i}" for i in range(1, 64)])
ROWS.add("names", "R V1", plain, bare, head=[f"V{i}" for i in range(1, 64)])
ROWS.add("names", "numpy.savetxt comment", plain, bare, comment="# 45 frames\n")
for sep, word in ((";", "semicolons"), ("\t", "tabs"), (" ", "spaces"), (", ", "comma and blank")):
    ROWS.add("names", f"csv between {word}", right.but(label=None), csv, sep=sep)
    ROWS.add("names", f"bare between {word}", plain, bare, sep=sep)
ROWS.add("names", "csv decimal commas", right, csv, sep=";", comma=True)
ROWS.add("names", "csv decimal commas, tabs", right, csv, sep="\t", comma=True)
ROWS.text("names", "csv CRLF", right, lambda t: t.replace("\n", "\r\n"), csv)
ROWS.add("names", "csv UTF-16", right, csv, encoding="utf-16")
ROWS.text("names", "csv a comma at the end", right, lambda t: t.replace("\n", ",\n"), csv)
ROWS.text(
    "names",
    "csv quoted",
    right,
    lambda t: "\n".join(
        ",".join(f'"{c}"' for c in line.split(",")) for line in t.strip().split("\n")
    ),
    csv,
)
ROWS.add("names", "csv named .txt", right, csv, "a.txt")
ROWS.add("names", "csv named .CSV", right, csv, "HAND.CSV")
ROWS.add(
    "names",
    "csv of exponents",
    plain,
    lambda p, b: (np.savetxt(p, b.joints.reshape(-1, 63), delimiter=","), p)[1],
)
ROWS.add("names", "long table", right, long)
ROWS.add("names", "long table both", both(), long)
ROWS.add("names", "long table names", right, long, joint="landmark", names=NAMES["mediapipe"])
ROWS.add("names", "long table landmark_index", right, long, joint="landmark_index")

# ---- stated beats implied ----

for first in ("index0", "index1"):
    ROWS.add("stated", f"{first} and 63 numbers", plain, bare, first=first)
    ROWS.add(
        "stated",
        f"{first} and 63 numbers, mm",
        scaled(plain, 1e3),
        bare,
        "a.csv",
        DOUBT,
        "mm",
        first=first,
        digits=3,
    )
    ROWS.add(
        "stated",
        f"{first} and 63 numbers, mm, left",
        scaled(left.but(label=None), 1e3),
        bare,
        "a.csv",
        DOUBT,
        "mm",
        first=first,
        digits=3,
    )
ROWS.add(
    "stated",
    "time and 63 numbers",
    timed(plain, "t"),
    bare,
    "a.csv",
    DOUBT,
    "time|fps|column",
    first="time",
)
ROWS.add("stated", "millimetres without a word", scaled(right, 1e3), csv, "a.csv", REFUSED, "mm")
ROWS.add("stated", "centimetres without a word", scaled(right, 1e2), npz, "a.npz", REFUSED, "cm")
ROWS.add("stated", "unit in the key", scaled(right, 1e3), npz, "a.npz", key="joints_mm")
ROWS.add("stated", "unit as a field", scaled(right, 1e2).but(extra={"unit": "cm"}), npz, "a.npz")
ROWS.add(
    "stated",
    "units as a field",
    scaled(right, 1e3).but(extra={"units": "millimeters"}),
    npz,
    "a.npz",
)
ROWS.add("stated", "fps as a field", right.but(extra={"fps": 60.0}, fps=60.0), npz, "a.npz")
ROWS.add(
    "stated",
    "frame_rate as a field",
    right.but(extra={"frame_rate": 60.0}, fps=60.0),
    json_object,
    "a.json",
)
ROWS.add(
    "stated",
    "an unknown word for the hand",
    left.but(label="sinistra"),
    npz,
    "a.npz",
    REFUSED,
    "left or right",
)

# ---- what looks like a joint, a hand or a time and is not known ----

for old, new in (
    ("wrist_x", "wirst_x"),
    ("little_tip_z", "little_wurst_z"),
    ("ring_pip", "ring_pop"),
):
    ROWS.text(
        "names",
        f"csv column {new}",
        right,
        lambda t, o=old, n=new: t.replace(o, n),
        csv,
        "a.csv",
        REFUSED,
        new,
        names="handtrack",
        column="name_x",
    )
ROWS.text(
    "names",
    "csv a 22nd joint",
    right,
    lambda t: "\n".join(
        line + (",finger_6_x,finger_6_y,finger_6_z" if i == 0 else ",0.1,0.2,0.3" if line else "")
        for i, line in enumerate(t.split("\n"))
    ),
    csv,
    "a.csv",
    REFUSED,
    "finger_6",
)
ROWS.text(
    "names",
    "csv a column of temperature",
    right,
    lambda t: "\n".join(
        line + (",temperature" if i == 0 else ",21.5" if line else "")
        for i, line in enumerate(t.split("\n"))
    ),
    csv,
    says="temperature",
)
ROWS.add(
    "names",
    "csv a hand under chirality",
    both(),
    csv,
    "a.csv",
    DOUBT,
    "chirality",
    hand_name="chirality",
)


def frames_by_number(path: Path, b: Brought) -> Path:
    path.write_text(json.dumps({str(t): nested(f) for t, f in enumerate(b.joints)}))
    return path


def split(path: Path, b: Brought) -> Path:
    """`DataFrame.to_json(orient="split")`."""
    columns = [f"{a}{i}" for i in range(21) for a in "xyz"]
    rows = b.joints.reshape(-1, 63).tolist()
    path.write_text(json.dumps({"columns": columns, "index": list(range(len(rows))), "data": rows}))
    return path


def records(path: Path, b: Brought) -> Path:
    """`DataFrame.to_json(orient="records")`."""
    columns = [f"{a}{i}" for i in range(21) for a in "xyz"]
    rows = [dict(zip(columns, row, strict=True)) for row in b.joints.reshape(-1, 63).tolist()]
    path.write_text(json.dumps(rows))
    return path


ROWS.add("names", "json frames by number", plain, frames_by_number, "a.json", DOUBT, "joints")
ROWS.add("names", "json pandas split", plain, split, "a.json", DOUBT, "joints|columns")
ROWS.add("names", "json pandas records", plain, records, "a.json", DOUBT, "joints|x0")
four = plain.but(joints=np.concatenate([plain.joints, np.ones((45, 21, 1))], 2))
ROWS.add("names", "npy x y z visibility", four, npy, "a.npy", DOUBT, r"\(45, 21, 4\)|fourth|4th")


# ---- a hand's name for each frame, numbers of points, what was seen as true and false ----


def in_turn(path: Path, b: Brought, key: str, words: tuple[object, object]) -> Path:
    """Frames of left and right in turn in one array, as detectors of pictures give them."""
    assert b.other is not None
    joints = np.stack([b.joints, b.other.joints], 1).reshape(-1, 21, 3)
    frame = np.repeat(np.arange(len(b.joints)), 2)
    np.savez(path, joints=joints, frame=frame, **{key: np.array(list(words) * len(b.joints))})
    return path


for key, pair in (("hand", ("left", "right")), ("is_right", (0, 1)), ("handedness", ("L", "R"))):
    ROWS.add("names", f"npz {key} of each frame", both(), in_turn, "a.npz", key=key, words=pair)
sure = unsure(right)


def seen(path: Path, b: Brought, key: str) -> Path:
    assert b.confidence is not None
    np.savez(path, joints=b.joints, **{key: b.confidence > 0})
    return path


ROWS.add("marks", "npz valid, true and false", sure, seen, "a.npz", key="valid")
ROWS.add("marks", "npz visible, true and false", sure, seen, "a.npz", key="visible")
ROWS.add("marks", "npz mask, true and false", sure, seen, "a.npz", REFUSED, "valid", key="mask")


def by_id(path: Path, b: Brought, begin: int) -> Path:
    """Points in any order, each with its number."""
    order = np.random.default_rng(1).permutation(21)
    lines = []
    for frame in b.joints:
        points = [
            {"id": int(i) + begin} | dict(zip("xyz", map(float, frame[i]), strict=True))
            for i in order
        ]
        lines.append(json.dumps({"hand": "left", "joints": points}))
    path.write_text("\n".join(lines))
    return path


for begin in (0, 1):
    ROWS.add("stated", f"points by id from {begin}", left, by_id, "a.jsonl", begin=begin)


def openpose(path: Path, b: Brought) -> Path:
    flat = np.concatenate([b.joints[0, :, :2] * 500, np.ones((21, 1))], 1).ravel().tolist()
    path.write_text(json.dumps({"version": 1.3, "people": [{"hand_right_keypoints_2d": flat}]}))
    return path


ROWS.add("skeleton", "OpenPose's picture", right, openpose, "a.json", REFUSED, "picture")
