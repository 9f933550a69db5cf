"""Rows: what joints, hands, times and columns are called; what is stated beats what is implied."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from made_files import (
    csv,
    json_frames,
    json_object,
    jsonl,
    mcap,
    npz,
    sides,
)
from made_hands import Brought, both, brought, scaled
from made_names import COLUMNS, NAMES
from rows import DOUBT, Table

ROWS = Table()
plain = brought()
right = plain.but(label="right")
left = brought("left").but(label="left")

# ---- joints: names and columns ----

for names in NAMES:
    column = "x_name" if names == "numbers" else "name_x"
    ROWS.add("names", f"csv {names}", right, csv, names=names, column=column)
    if names != "numbers":
        ROWS.add("names", f"jsonl {names}", right, jsonl, "a.jsonl", names=NAMES[names])
ROWS.add("names", "jsonl numbers", right, jsonl, "a.jsonl", names=NAMES["numbers"])
ROWS.add(
    "names", "jsonl numbers from 1", right, jsonl, "a.jsonl", names=[str(i) for i in range(1, 22)]
)
ROWS.add("names", "csv x1", right, csv, names="kp1", column="x_name")
for column in COLUMNS:
    unit = "mm" if "{u}" in COLUMNS[column] else "m"
    b = scaled(right, 1e3) if unit == "mm" else right
    ROWS.add("names", f"columns {column}", b, csv, names="handtrack", column=column, unit=unit)
    ROWS.add(
        "names", f"columns {column} mediapipe", b, csv, names="mediapipe", column=column, unit=unit
    )
for key in (
    "landmarks",
    "keypoints",
    "positions",
    "points",
    "world_landmarks",
    "joints3d",
    "joints_3d",
    "keypoints3d",
    "hand_joints",
    "pred_joints",
    "j3d",
):
    ROWS.add("names", f"npz {key}", right, npz, "a.npz", DOUBT, key, key=key)
    ROWS.add("names", f"jsonl {key}", right, jsonl, "a.jsonl", DOUBT, key, key=key)
ROWS.add("names", "npz arr_0", plain, lambda p, b: (np.savez(p, b.joints), p)[1], "a.npz")
for key in ("joints", "landmarks", "keypoints"):
    ROWS.add("names", f"json objects {key}", right, json_frames, "a.json", key=key, point="xyz")
    ROWS.add("names", f"json 63 numbers {key}", right, json_frames, "a.json", key=key, point="flat")
for wrap in ("frames", "data", "hands", "results"):
    ROWS.add("names", f"json under {wrap}", right, json_frames, "a.json", DOUBT, wrap, wrap=wrap)
ROWS.add("names", "json objects, all frames", right, json_object, "a.json", point="xyz")
ROWS.add("names", "mcap objects", right, mcap, "a.mcap", how="xyz")

# ---- hands ----

for key in ("hand", "handedness", "side", "label", "Hand", "Handedness"):
    ROWS.add("names", f"csv hand under {key}", both(), csv, hand_name=key)
    ROWS.add("names", f"jsonl hand under {key}", both(), jsonl, "a.jsonl", hand_key=key)
    ROWS.add("names", f"npz hand under {key}", left, npz, "a.npz", hand_key=key)
    ROWS.add("names", f"json hand under {key}", left, json_frames, "a.json", hand_key=key)


def called(left_word: Any, right_word: Any) -> Brought:
    pair = both()
    assert pair.other is not None
    return pair.but(label=left_word, other=pair.other.but(label=right_word))


for words in (
    ("Left", "Right"),
    ("L", "R"),
    ("LEFT", "RIGHT"),
    ("left_hand", "right_hand"),
    ("LeftHand", "RightHand"),
    ("Left Hand", "Right Hand"),
    ("l", "r"),
):
    ROWS.add("names", f"csv hands {words[0]}", called(*words), csv)
    ROWS.add("names", f"jsonl hands {words[0]}", called(*words), jsonl, "a.jsonl")
for words in ((0, 1), ("hand_0", "hand_1")):
    ROWS.add("names", f"csv hands {words[0]}", called(*words), csv, "a.csv", DOUBT, "hand")
ROWS.add(
    "names", "is_right", left.but(label=0), npz, "a.npz", DOUBT, "is_right", hand_key="is_right"
)
ROWS.add(
    "names",
    "csv no hand column, rows in turn",
    both().but(label=None),
    csv,
    "a.csv",
    DOUBT,
    "hand|rigid|bone|length",
)

SIDES = ("{side}_{title}", "{title}_{side}", "{side}.{title}", "{side} {title}")
for names, column in (("handtrack", "name_x"), ("numbers", "x_name"), ("mediapipe", "name_x")):
    for pattern in SIDES:
        ROWS.add(
            "names",
            f"blocks {pattern} {names}",
            both(),
            csv,
            hand_name="",
            side=pattern,
            names=names,
            column=column,
        )
for words in (("L", "R"), ("Left", "Right"), ("lh", "rh"), ("LeftHand", "RightHand"), ("l", "r")):
    ROWS.add(
        "names",
        f"blocks of {words[0]}",
        called(*words),
        csv,
        hand_name="",
        names="handtrack",
        column="name_x",
    )
ROWS.add("names", "jsonl sides", both(), sides, "a.jsonl")
ROWS.add("names", "jsonl sides Left Right", called("Left", "Right"), sides, "a.jsonl")
ROWS.add("names", "jsonl sides left_hand", called("left_hand", "right_hand"), sides, "a.jsonl")
ROWS.add("names", "jsonl sides named", both(), sides, "a.jsonl", names=NAMES["mediapipe_py"])
ROWS.add(
    "names",
    "npz left right arrays",
    both(),
    lambda p, b: (np.savez(p, left=b.joints, right=b.other.joints), p)[1],
    "a.npz",
)
ROWS.add(
    "names",
    "npz left_hand right_hand",
    both(),
    lambda p, b: (np.savez(p, left_hand=b.joints, right_hand=b.other.joints), p)[1],
    "a.npz",
)


def of_two(path: Path, b: Brought, axis: int = 1) -> Path:
    """(T, 2, 21, 3), or (T, 42, 3) where axis is 0: left, then right."""
    assert b.other is not None
    join = np.stack if axis else np.concatenate
    np.save(path, join([b.joints, b.other.joints], axis=1))
    return path


ROWS.add("names", "npy of two hands", both(), of_two, "a.npy", DOUBT, "hands|shape")
ROWS.add("names", "npy of 42 joints", both(), of_two, "a.npy", DOUBT, "hands|42", axis=0)


def bare_of_two(path: Path, b: Brought, head: bool = False) -> Path:
    """126 columns: left, then right."""
    assert b.other is not None
    rows = np.concatenate([b.joints, b.other.joints], 1).reshape(len(b.joints), -1)
    names = [f"{a}{i}" for i in range(42) for a in "xyz"]
    header = ",".join(names) if head else ""
    np.savetxt(path, rows, fmt="%.6f", delimiter=",", header=header, comments="")
    return path


ROWS.add("names", "126 numbers a line", both(), bare_of_two, "a.csv", DOUBT, "hands|126")
ROWS.add(
    "names", "126 columns x0 to z41", both(), bare_of_two, "a.csv", DOUBT, "hands|x21|21", head=True
)
