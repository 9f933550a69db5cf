"""Rows: joint orders, worlds and shapes that are not a hand, and hands that hardly are one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from made_files import bare, csv, fpha, json_list, jsonl, mcap, npy, npz
from made_hands import (
    OTHER_ORDERS,
    Brought,
    both,
    brought,
    every,
    finger_missing,
    joined,
    mirrored,
    ordered,
    scaled,
)
from rows import DOUBT, REFUSED, Table

ROWS = Table()
plain = brought()
right = plain.but(label="right")
NAMED = ("mano", "interhand", "fpha")

# ---- orders ----

for order in NAMED:
    b = ordered(right, order)
    ROWS.add("skeleton", f"npz {order}", b, npz, "a.npz", DOUBT, f"{order}|order")
    ROWS.add("skeleton", f"npz {order}, told", b.but(options={"order": order}), npz, "a.npz")
    ROWS.add("skeleton", f"csv {order}", b.but(label=None), bare, "a.csv", DOUBT, "order")
    ROWS.add(
        "skeleton",
        f"jsonl {order}, mm",
        scaled(b, 1e3).but(options={"unit": "mm"}),
        jsonl,
        "a.jsonl",
        DOUBT,
        "order",
    )
    ROWS.add(
        "skeleton", f"both hands {order}", ordered(both(), order), csv, "a.csv", DOUBT, "order"
    )
for order in OTHER_ORDERS:
    b = ordered(right, order)
    ROWS.add("skeleton", f"npz {order}", b, npz, "a.npz", DOUBT, "order")
    ROWS.add(
        "skeleton",
        f"left {order}",
        ordered(brought("left").but(label="left"), order),
        csv,
        "a.csv",
        DOUBT,
        "order",
    )
    ROWS.add("skeleton", f"mcap {order}", b, mcap, "a.mcap", DOUBT, "order")
shuffled = np.random.default_rng(8).permutation(21)
ROWS.add(
    "skeleton",
    "joints shuffled",
    right.but(joints=right.joints[:, shuffled]),
    npz,
    "a.npz",
    DOUBT,
    "order|hand",
)
ROWS.add(
    "skeleton",
    "told a wrong order",
    right.but(options={"order": "mano"}),
    npz,
    "a.npz",
    DOUBT,
    "order",
)
ROWS.add("skeleton", "fpha's own file", scaled(ordered(plain, "fpha"), 1e3), fpha, "skeleton.txt")
for n, pick in {
    16: [0, *(4 * f + j for f in range(5) for j in (1, 2, 3))],
    20: list(range(1, 21)),
    5: [4, 8, 12, 16, 20],
    18: list(range(18)),
}.items():
    few = right.but(joints=right.joints[:, pick])
    ROWS.add("skeleton", f"{n} joints npy", few, npy, "a.npy", REFUSED, f"{n}.*(21|order)")
    ROWS.add("skeleton", f"{n} joints json", few, json_list, "a.json", REFUSED, "21|order")

# ---- worlds and pictures ----

for axis in range(3):
    b = mirrored(right, axis)
    ROWS.add("mirror", f"npz {'xyz'[axis]}", b, npz, "a.npz", DOUBT, "mirror|--hand")
    told = b.but(options={"mirror": "xyz"[axis]})
    ROWS.add("mirror", f"npz {'xyz'[axis]}, told", told, npz, "a.npz")
    ROWS.add(
        "mirror", f"csv both {'xyz'[axis]}", mirrored(both(), axis), csv, "a.csv", DOUBT, "mirror"
    )
    ROWS.add(
        "mirror",
        f"jsonl both {'xyz'[axis]}, told",
        mirrored(both(), axis).but(options={"mirror": "xyz"[axis]}),
        jsonl,
        "a.jsonl",
    )


def picture(one: Brought) -> Brought:
    """x and y of 0..1 in a picture of 16:9, z about the wrist, as MediaPipe's landmarks."""
    x, y, z = np.moveaxis(one.joints, -1, 0)
    seen = np.stack([0.5 + 1.0 * x / z, 0.5 + 16 / 9 * y / z, (z - z[:, :1]) / z[:, :1]], -1)
    return one.but(joints=seen)


def pixels(one: Brought) -> Brought:
    x, y, z = np.moveaxis(one.joints, -1, 0)
    return one.but(joints=np.stack([320 + 600 * x / z, 240 + 600 * y / z, z * 1e3], -1))


def flat(one: Brought) -> Brought:
    return one.but(joints=one.joints * [1.0, 1.0, 0.0])


def drifts(one: Brought) -> Brought:
    growth = np.linspace(1.0, 1.6, len(one.joints))[:, None, None]
    return one.but(joints=one.joints * growth)


def unevenly(one: Brought) -> Brought:
    return one.but(joints=one.joints * [1.0, 1.0, 3.0])


def breathing(one: Brought) -> Brought:
    """Each frame in its own scale, as detectors of one picture give it."""
    t = np.arange(len(one.joints))[:, None, None]
    return one.but(joints=one.joints * (1 + 0.3 * np.sin(t / 3)))


NOT_METRES = "picture|pixel|plane|scale|rigid|length|bone|z|unit|hand"
for word, change in {
    "picture": picture,
    "pixels": pixels,
    "flat": flat,
    "drifting scale": drifts,
    "an axis of another scale": unevenly,
    "a scale for each frame": breathing,
}.items():
    ROWS.add("skeleton", f"npz {word}", every(right, change), npz, "a.npz", DOUBT, NOT_METRES)
    ROWS.add("skeleton", f"csv {word}", every(both(), change), csv, "a.csv", DOUBT, NOT_METRES)
axis_major = plain.but(joints=np.moveaxis(plain.joints, 2, 1).reshape(45, 21, 3))
ROWS.add("skeleton", "npy x row, y row, z row", axis_major, npy, "a.npy", DOUBT, "axis|order|row|x")
ROWS.add(
    "skeleton", "csv x row, y row, z row", axis_major, bare, "a.csv", DOUBT, "axis|order|row|x"
)


def as_shape(path: Path, b: Brought, *axes: int) -> Path:
    np.save(path, b.joints.transpose(*axes))
    return path


ROWS.add(
    "skeleton",
    "npy (T, 3, 21)",
    plain,
    lambda p, b: as_shape(p, b, 0, 2, 1),
    "a.npy",
    DOUBT,
    "45, 3, 21",
)
ROWS.add(
    "skeleton",
    "npy (21, 3, T) of MATLAB",
    plain,
    lambda p, b: as_shape(p, b, 1, 2, 0),
    "a.npy",
    DOUBT,
    "21, 3, 45",
)
noise = np.random.default_rng(1).normal(0, 0.05, plain.joints.shape)
ROWS.add("skeleton", "noise", right.but(joints=noise), npz, "a.npz", DOUBT, "hand|rigid|order|unit")
ROWS.add("skeleton", "inches", scaled(right, 39.37), npz, "a.npz", DOUBT, "unit|hand|mm|cm")
ROWS.add(
    "skeleton",
    "a hand of another label",
    brought("left").but(hand="right", label="right"),
    npz,
    "a.npz",
    DOUBT,
    "--hand left",
)

# ---- hands that hardly are one ----


for child, parent in ((4, 3), (1, 0), (12, 11), (17, 0), (20, 19)):
    b = joined(right, child, parent)
    ROWS.add(
        "degenerate",
        f"no length {parent} to {child}",
        b,
        npz,
        "a.npz",
        DOUBT,
        "length|bone|at one place",
    )
one_gone = right.joints.copy()
one_gone[:, 14] = np.nan
seen = right.but(joints=one_gone, expected=one_gone)
ROWS.add("degenerate", "a joint never seen", seen, npz, "a.npz")
ROWS.add("degenerate", "a finger never seen", finger_missing(right, 3), csv)
for frames in (1, 2):
    ROWS.add(
        "degenerate",
        f"{frames} frames npz",
        brought(frames=frames).but(label="right"),
        npz,
        "a.npz",
    )
    ROWS.add("degenerate", f"{frames} frames csv", brought(frames=frames).but(label="right"), csv)
still = np.repeat(right.joints[:1], 45, 0)
ROWS.add(
    "degenerate", "a hand that never moves", right.but(joints=still, expected=still), npz, "a.npz"
)
ROWS.add(
    "degenerate",
    "nothing at all",
    right.but(joints=right.joints * np.nan),
    npz,
    "a.npz",
    REFUSED,
    "missing|seen|no joint",
)
ROWS.add(
    "degenerate",
    "all at the origin",
    right.but(joints=right.joints * 0),
    npz,
    "a.npz",
    REFUSED,
    "missing|seen|no joint",
)
ROWS.add(
    "degenerate",
    "all at one place",
    right.but(joints=right.joints * 0 + 0.3),
    npz,
    "a.npz",
    DOUBT,
    "length|bone|hand|same|missing|one place",
)
