"""Rows: missing marks, and records without content before the first that has some."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from made_files import (
    bare,
    csv,
    dexycb,
    frame_object,
    interhand,
    json_frames,
    json_list,
    json_object,
    jsonl,
    leap,
    long,
    mcap,
    mediapipe_tasks,
    npy,
    npz,
    panoptic,
    sides,
)
from made_hands import both, brought, finger_missing, late, missing, ordered, scaled, timed, unsure
from made_names import NAMES
from rows import DOUBT, Table

ROWS = Table()
right = brought().but(label="right")
left = brought("left").but(label="left")

# ---- marks: 0 0 0, -1, NaN, null, nothing, in single joints and in whole frames ----

for mark in (None, 0.0, -1.0):
    word = "NaN" if mark is None else f"{mark:g}"
    b = missing(right, mark)
    ROWS.add("marks", f"npy {word}", b.but(label=None), npy, "a.npy")
    ROWS.add("marks", f"npz {word}", b, npz, "a.npz")
    ROWS.add("marks", f"csv {word}", b, csv)
    ROWS.add("marks", f"csv without header {word}", b.but(label=None), bare)
    ROWS.add("marks", f"json list {word}", b.but(label=None), json_list, "a.json", whole=False)
    ROWS.add("marks", f"json object {word}", b, json_object, "a.json")
    ROWS.add("marks", f"jsonl {word}", b, jsonl, "a.jsonl")
    ROWS.add("marks", f"jsonl named {word}", b, jsonl, "a.jsonl", names=NAMES["webxr"])
    ROWS.add("marks", f"mcap joints {word}", b, mcap, "a.mcap")
    ROWS.add("marks", f"mcap bones {word}", b, mcap, "a.mcap", how="bones")
    ROWS.add("marks", f"long table {word}", b, long)
    ROWS.add("marks", f"panoptic {word}", scaled(missing(both(), mark), 100), panoptic, "")
    ROWS.add(
        "marks",
        f"interhand {word}",
        scaled(ordered(missing(both(), mark), "interhand"), 1e3),
        interhand,
        "j.json",
    )
    ROWS.add("marks", f"dexycb {word}", missing(left, mark), dexycb, "")
    no_wrist = scaled(missing(left, mark), 1e3)
    expected = no_wrist.expected.copy()
    expected[:, 0] = np.nan
    ROWS.add("marks", f"leap {word}", no_wrist.but(expected=expected), leap, "a.json")
    ROWS.add("marks", f"both hands {word}", missing(both(), mark), csv)
    ROWS.add("marks", f"both hands npz {word}", missing(both(), mark), npz, "a.npz")
    ROWS.add(
        "marks",
        f"millimetres {word}",
        scaled(missing(right, mark), 1e3).but(options={"unit": "mm"}),
        npz,
        "a.npz",
    )

# a wrist at the origin in every frame is one; so is it beside true marks
centred = right.but(joints=right.joints - right.joints[:, :1])
centred = centred.but(expected=centred.joints)
ROWS.add("marks", "wrist at the origin npz", centred, npz, "a.npz")
ROWS.add("marks", "wrist at the origin csv", centred, csv)
ROWS.add("marks", "wrist at the origin jsonl", centred, jsonl, "a.jsonl")
for mark in (-1.0, None):
    ROWS.add(
        "marks",
        f"wrist at the origin, marks {mark}",
        _m := missing(centred, mark, part=0.05),
        npz,
        "a.npz",
    )

for mark in (0.0, -1.0, None):
    ROWS.add("marks", f"a finger never seen {mark}", finger_missing(right, 4, mark), npz, "a.npz")
    ROWS.add("marks", f"a finger never seen csv {mark}", finger_missing(right, 2, mark), csv)
lone = right.joints.copy()
lone[7, 12] = 0.0
alone = right.expected.copy()
alone[7, 12] = np.nan
ROWS.add("marks", "one joint once 0 0 0", right.but(joints=lone, expected=alone), npz, "a.npz")
lone = lone.copy()
lone[7, 12] = -1.0
ROWS.add("marks", "one joint once -1", right.but(joints=lone, expected=alone), csv)

doubtful = unsure(right)
ROWS.add("marks", "confidence 0 npz", doubtful, npz, "a.npz")
ROWS.add("marks", "confidence 0 json", doubtful, json_object, "a.json")
ROWS.add("marks", "confidence 0 jsonl", doubtful, jsonl, "a.jsonl")
ROWS.add("marks", "confidence 0 csv", doubtful, csv, names="handtrack", column="name_x")

for cells in ("NaN", "nan", "NA", "N/A", "#N/A", "null", "None", "-", "NULL", "--", "n.a."):

    def into(text: str, word: str = cells) -> str:
        lines = text.strip().split("\n")
        return "\n".join(",".join(c or word for c in line.split(",")) for line in lines) + "\n"

    ROWS.text("marks", f"csv cells {cells}", missing(right, None), into, csv)
ROWS.text(
    "marks",
    "json NaN",
    missing(right, None),
    lambda t: t.replace("null", "[NaN,NaN,NaN]"),
    json_object,
    "a.json",
)
ROWS.text(
    "marks",
    "json list of null",
    missing(right, None),
    lambda t: t.replace("null", "[null, null, null]"),
    json_object,
    "a.json",
)
ROWS.text(
    "marks",
    "json empty list",
    missing(right, None),
    lambda t: t.replace("null", "[]"),
    json_object,
    "a.json",
)
ROWS.text(
    "marks",
    "jsonl empty list frame",
    missing(right, None),
    lambda t: t.replace('"joints": null', '"joints": []'),
    jsonl,
    "a.jsonl",
)
ROWS.text(
    "marks",
    "objects of null",
    missing(right, None),
    lambda t: t.replace("null", '{"x": null, "y": null, "z": null}'),
    json_object,
    "a.json",
    point="xyz",
)
for other in (-999.0, -1000.0, 999.0):
    ROWS.add(
        "marks",
        f"another mark {other:g}",
        missing(right, other),
        npz,
        "a.npz",
        DOUBT,
        r"missing|-?999|-?1000",
    )


# ---- the first record never decides ----

TIMES = ("time_ms", 1e3)
begins = late(timed(left, *TIMES))
begins_both = late(timed(both(), *TIMES))
webxr = NAMES["webxr"]
ROWS.add("first", "jsonl null joints", begins, jsonl, "a.jsonl")
ROWS.add("first", "jsonl named", begins, jsonl, "a.jsonl", names=webxr)
ROWS.add("first", "jsonl {x, y, z}", begins, jsonl, "a.jsonl", point="xyz", key="landmarks")
ROWS.add("first", "jsonl sides", begins_both, sides, "a.jsonl")
ROWS.add("first", "jsonl sides named", begins_both, sides, "a.jsonl", names=webxr)
ROWS.add(
    "first", "jsonl sides named joints", begins_both, sides, "a.jsonl", names=webxr, under="joints"
)
ROWS.add("first", "json list", begins, json_frames, "a.json", hand_key="handedness")
ROWS.add("first", "json frames", begins, json_frames, "a.json", wrap="frames")
ROWS.add("first", "json list of null", late(right.but(label=None)), json_list, "a.json")
ROWS.add("first", "npz", late(right, 12), npz, "a.npz")
ROWS.add("first", "csv empty cells", begins, csv)
ROWS.add("first", "csv both", begins_both, csv)
ROWS.add("first", "bare csv", late(right.but(label=None)), bare)
ROWS.add("first", "mcap", late(right), mcap, "a.mcap")
ROWS.add("first", "mcap bones", late(both()), mcap, "a.mcap", how="bones")
ROWS.add("first", "panoptic", scaled(late(both()), 100), panoptic, "")
ROWS.add("first", "mediapipe tasks", begins_both, mediapipe_tasks, "a.jsonl")
ROWS.add("first", "mediapipe solutions", begins_both, mediapipe_tasks, "a.jsonl", style="solutions")


def without_wrist(joints: np.ndarray) -> np.ndarray:
    return np.where(np.arange(21)[:, None] == 0, np.nan, joints)


ROWS.add(
    "first",
    "leap",
    late(
        scaled(left, 1e3).but(expected=np.where(np.arange(21)[:, None] == 0, np.nan, left.expected))
    ),
    leap,
    "a.json",
)


def blank_lines(text: str) -> str:
    """The first records without anything, as loggers write them before a hand is there."""
    return "null\n{}\n\n" + text


ROWS.text(
    "first",
    "jsonl null, {} and blank lines",
    begins.but(joints=begins.joints),
    blank_lines,
    jsonl,
    "a.jsonl",
    DOUBT,
    "time|line",
)
plain = late(left, 0)
ROWS.text(
    "first",
    "jsonl of no time, null before",
    plain.but(
        joints=np.concatenate([plain.joints[:1] * np.nan, plain.joints]),
        expected=np.concatenate([plain.expected[:1] * np.nan, plain.expected]),
    ),
    lambda t: t,
    jsonl,
    "a.jsonl",
)
ROWS.add(
    "first",
    "jsonl a header record",
    left,
    jsonl,
    "a.jsonl",
    before=[{"device": "Quest 3", "subject": "A"}],
)


def empty_label(text: str) -> str:
    """Rows in which nothing was seen name no hand."""
    out = []
    for line in text.split("\n"):
        cells = line.split(",")
        if cells[-1] == "" and len(cells) > 9:
            cells[1] = ""
        out.append(",".join(cells))
    return "\n".join(out)


ROWS.text("first", "csv rows of nothing name no hand", begins, empty_label, csv)
for name, front in {
    "comments": "# made by a script\n# unit: m\n\n",
    "sep=": "sep=,\n",
    "BOM": "\ufeff",
}.items():
    ROWS.text("first", f"csv after {name}", right, lambda t, f=front: f + t, csv)
ROWS.text(
    "first",
    "csv a row of units",
    right,
    lambda t: t.replace("\n", "\n" + ",".join(["", *["m"] * 63]) + "\n", 1),
    csv,
)
ROWS.text(
    "first",
    "csv a title before the header",
    right,
    lambda t: "Hand recording 12" + "," * 63 + "\n" + t,
    csv,
    "a.csv",
    DOUBT,
    "line|header",
)


def jsonl_key_in_later_frames(path: Path, b, **_) -> Path:
    """The hand's name stands only where a hand is seen."""
    lines = [frame_object(b, t, hand_key="handedness") for t in range(len(b.joints))]
    for line in lines:
        if line["joints"] is None:
            line.pop("handedness")
    path.write_text("\n".join(map(json.dumps, lines)) + "\n")
    return path


ROWS.add("first", "jsonl the hand named later", begins, jsonl_key_in_later_frames, "a.jsonl")
