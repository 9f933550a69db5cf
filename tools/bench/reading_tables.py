"""Made tables and lines of text of every kind that is read, of one moving hand."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.hand.skeleton import JOINT_NAMES
from tools.bench.reading_files import (
    OPENXR,
    RATE,
    XYZ,
    Array,
    frames,
    motion,
    numbers,
    openxr,
    pixels,
    texts,
)


def _wide(titles: list[str], form: Callable[[Array], list[str]], mark: str = ",") -> Any:
    def make(path: Path, mb: float) -> Path:
        head = mark.join(["time", *titles]) + "\n"
        return texts(path, mb, head, lambda i, t, x: mark.join([f"{t:.6f}", *form(x)]) + "\n")

    return make


def _holes(x: Array) -> list[str]:
    cells = numbers(x)
    if x[0, 0] > 0:
        cells[9:12] = ["", "", ""]
    return cells


def _xyz(names: list[str] | tuple[str, ...], form: str = "{name}_{axis}") -> list[str]:
    return [form.format(name=name, axis=axis) for name in names for axis in XYZ]


def _cells(form: str) -> Any:
    return _wide(
        list(JOINT_NAMES), lambda x: [f'"{form.format(*p)}"' for p in np.round(x, 9).tolist()]
    )


def long_csv(path: Path, mb: float) -> Path:
    """A row for each joint."""

    def line(i: int, time: float, x: Array) -> str:
        begin = f"{i},{time:.6f},Right,"
        return "".join(
            f"{begin}{name},{a:.9f},{b:.9f},{c:.9f}\n"
            for name, (a, b, c) in zip(JOINT_NAMES, x.tolist(), strict=True)
        )

    return texts(path, mb, "frame,timestamp,hand,landmark,x,y,z\n", line)


def openxr_long(path: Path, mb: float) -> Path:
    """OpenXR's joints, a row each, with rotations."""

    def line(i: int, time: float, x: Array) -> str:
        return "".join(
            f"{time:.6f},right,{name},{a:.7f},{b:.7f},{c:.7f},0.0,0.0,0.0,1.0\n"
            for name, (a, b, c) in zip(OPENXR, openxr(x).tolist(), strict=True)
        )

    return texts(path, mb, "time,hand,joint,x,y,z,qx,qy,qz,qw\n", line)


def manus(path: Path, mb: float) -> Path:
    """Manus Core's table: semicolons, decimal commas, cm, rotations under the same names."""
    parts = dict.fromkeys(("Index", "Middle", "Ring", "Pinky"), ("CMC", "MCP", "PIP", "DIP", "TIP"))
    names = ["Hand", *(f"Thumb_{p}" for p in ("CMC", "MCP", "DIP", "TIP"))]
    names += [f"{f}_{p}" for f, of in parts.items() for p in of]
    titles = [f"{name}_{axis}" for name in names for axis in "XYZ"]
    head = ["Frame", "Elapsed_Time_In_Milliseconds", "Time", *titles, *titles]
    of = [
        0,
        1,
        2,
        3,
        4,
        *(j for f in range(1, 5) for j in (4 * f + 1, *range(4 * f + 1, 4 * f + 5))),
    ]
    lift = np.ones((25, 1))
    lift[[5, 10, 15, 20]] = 0.2

    def line(i: int, time: float, x: Array) -> str:
        cells = [str(i), f"{1e3 * time:.5f}", f"00:00:{time:.3f}"]
        cells += numbers(100 * (x - x[0])[of] * lift, 6) + ["170.000000"] * 75
        return ";".join(cells).replace(".", ",") + "\n"

    return texts(path, mb, ";".join(head) + "\n", line)


def rokoko(path: Path, mb: float) -> Path:
    """Rokoko's table of positions and rotations."""
    names = [
        "RightHand",
        *(f"RightFinger1{p}" for p in ("Metacarpal", "Proximal", "Distal", "Tip")),
    ]
    for f in range(2, 6):
        names += [f"RightFinger{f}{p}" for p in ("Proximal", "Medial", "Distal", "Tip")]
    titles = [f"{n}_{k}_{a}" for n in names for k in ("position", "rotation") for a in XYZ]

    def form(x: Array) -> list[str]:
        return [c for point in x for c in (*numbers(point), "30.0", "30.0", "30.0")]

    return _wide(titles, form)(path, mb)  # type: ignore[no-any-return]


_ARIA = (5, -1, 6, 7, 0, 8, 9, 10, 1, 11, 12, 13, 2, 14, 15, 16, 3, 17, 18, 19, 4)


def aria(path: Path, mb: float) -> Path:
    """Project Aria's results: 21 landmarks of each hand, the left one lost."""
    titles = ["tracking_timestamp_us"]
    for side in ("left", "right"):
        titles.append(f"{side}_tracking_confidence")
        titles += [f"t{a}_{side}_landmark_{i}_device" for i in range(21) for a in XYZ]
    lost = ",".join(["-1", *["0"] * 63])

    def line(i: int, time: float, x: Array) -> str:
        marks = np.empty((21, 3))
        for joint, mark in enumerate(_ARIA):
            marks[mark] = x[joint]
        marks[20] = x[[0, 9]].mean(0)
        return f"{10**9 + 16_667 * i},{lost},1,{','.join(numbers(marks))}\n"

    return texts(path, mb, ",".join(titles) + "\n", line)


def deeplabcut(path: Path, mb: float) -> Path:
    """DeepLabCut's three lines of titles, cm."""
    head = [
        ",".join(["scorer", *["DLC_3D"] * 63]),
        ",".join(["bodyparts", *(n for n in JOINT_NAMES for _ in XYZ)]),
        ",".join(["coords", *(a for _ in JOINT_NAMES for a in XYZ)]),
    ]
    text = "\n".join(head) + "\n"
    return texts(path, mb, text, lambda i, t, x: f"{i},{','.join(numbers(100 * x, 6))}\n")


def anipose(path: Path, mb: float) -> Path:
    """anipose's table with errors and scores, mm."""
    titles = [f"{n}_{a}" for n in JOINT_NAMES for a in (*XYZ, "error", "ncams", "score")]
    titles += [
        *(f"M_{i}{j}" for i in range(3) for j in range(3)),
        *(f"center_{i}" for i in range(3)),
    ]
    end = ",1.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0,1.0,0.0,0.0,0.0"

    def line(i: int, time: float, x: Array) -> str:
        cells = [c for p in 1e3 * x for c in (*numbers(p, 6), "1.500000", "3.0", "0.900000")]
        return f"{','.join(cells)}{end},{i}\n"

    return texts(path, mb, ",".join([*titles, "fnum"]) + "\n", line)


def trc(path: Path, mb: float) -> Path:
    """Markers by name, mm."""
    head = "PathFileType\t4\t(X/Y/Z)\ta.trc\nDataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\n"
    n = int(mb * 1e6 / 840)
    head += f"60\t60\t{n}\t21\tmm\nFrame#\tTime\t" + "\t\t\t".join(JOINT_NAMES) + "\n\t\t"
    head += "\t".join(f"X{i}\tY{i}\tZ{i}" for i in range(1, 22)) + "\n"
    with path.open("w") as file:
        file.write(head)
        for i, time, x in itertools.islice(frames(), n):
            file.write(f"{i + 1}\t{time:.5f}\t" + "\t".join(numbers(1e3 * x, 6)) + "\n")
    return path


def bvh(path: Path, mb: float) -> Path:
    """Mixamo's names, cm; the hand bends in all its joints."""
    rest = 100 * motion()[0]
    turns = "Zrotation Xrotation Yrotation"
    out = ["HIERARCHY", "ROOT RightHand", "{", "OFFSET 0 0 0"]
    out.append(f"CHANNELS 6 Xposition Yposition Zposition {turns}")
    for f, finger in enumerate(("Thumb", "Index", "Middle", "Ring", "Pinky")):
        for k in range(3):
            here = rest[4 * f + 1 + k]
            offset = here - rest[0 if k == 0 else 4 * f + k]
            out += [f"JOINT RightHand{finger}{k + 1}", "{", f"OFFSET {' '.join(numbers(offset))}"]
            out.append(f"CHANNELS 3 {turns}")
        end = rest[4 * f + 4] - rest[4 * f + 3]
        out += ["End Site {", f"OFFSET {' '.join(numbers(end))}", "}", *["}"] * 3]
    n = int(mb * 1e6 / 480)
    out += ["}", "MOTION", f"Frames: {n}", f"Frame Time: {1 / RATE:.8f}"]
    with path.open("w") as file:
        file.write("\n".join(out) + "\n")
        for _, time, x in itertools.islice(frames(), n):
            bends = 20 * np.sin(time + 0.1 * np.arange(48))
            file.write(" ".join([*numbers(100 * x[0], 6), *numbers(bends, 6)]) + "\n")
    return path


def hand_lines(path: Path, mb: float) -> Path:
    """Hand Tracking Streamer's lines, with wrists."""

    def line(i: int, time: float, x: Array) -> str:
        about = f"| f = {i} | t = {round(time * 1e9)}"
        wrist = ", ".join([*numbers(x[0], 6), "0.000000", "0.000000", "0.000000", "1.000000"])
        marks = ", ".join(numbers(x - x[0], 6))
        return f"Right wrist {about}:, {wrist}\nRight landmarks {about}:, {marks}\n"

    return texts(path, mb, "", line)


def pixels_csv(path: Path, mb: float) -> Path:
    """Landmarks in pixels, x and y."""
    titles = [f"{a}_{j}" for j in range(21) for a in "xy"]
    return _wide(titles, lambda x: numbers(pixels(x), 3))(path, mb)  # type: ignore[no-any-return]


_NORMALISED = "NormalizedLandmark(x={0}, y={1}, z={2}, visibility=0.0, presence=0.0)"


def normalised(path: Path, mb: float) -> Path:
    """MediaPipe's landmarks in the picture as Python prints them."""

    def form(x: Array) -> list[str]:
        xy = pixels(x) / 1280
        points = np.column_stack([xy, 2 * (x[:, 2] - x[0, 2])])
        return [f'"{_NORMALISED.format(*p)}"' for p in np.round(points, 9).tolist()]

    return _wide(list(JOINT_NAMES), form)(path, mb)  # type: ignore[no-any-return]


TABLES: dict[str, tuple[str, Any]] = {
    "CSV, a row for each frame": ("wide.csv", _wide(_xyz(JOINT_NAMES), numbers)),
    "CSV, semicolons, decimal commas": (
        "semicolons.csv",
        _wide(_xyz(JOINT_NAMES), lambda x: [c.replace(".", ",") for c in numbers(x)], ";"),
    ),
    "CSV with empty cells": ("holes.csv", _wide(_xyz(JOINT_NAMES), _holes)),
    "CSV, a row for each joint": ("long.csv", long_csv),
    'CSV, cells of "(x, y, z)"': ("cells.csv", _cells("({0}, {1}, {2})")),
    "CSV, cells of NumPy's arrays": ("numpy_cells.csv", _cells("[{0:.9f}  {1:.9f} {2:.9f}]")),
    "CSV, cells of Landmark(x=...)": (
        "landmark_cells.csv",
        _cells("Landmark(x={0}, y={1}, z={2})"),
    ),
    "CSV, a hand in a cell": (
        "hand_cells.csv",
        _wide(["joints"], lambda x: [f'"{np.round(x, 9).tolist()}"']),
    ),
    "63 numbers a line": (
        "bare.txt",
        lambda p, mb: texts(p, mb, "", lambda i, t, x: " ".join(numbers(x)) + "\n"),
    ),
    "OpenXR CSV, wide": (
        "openxr.csv",
        _wide(_xyz(OPENXR, "{name}_{axis}"), lambda x: numbers(openxr(x), 7)),
    ),
    "OpenXR CSV, long": ("openxr_long.csv", openxr_long),
    "Manus Core CSV": ("take_R.csv", manus),
    "Rokoko CSV": ("rokoko.csv", rokoko),
    "Aria MPS CSV": ("hand_tracking_results.csv", aria),
    "DeepLabCut CSV": ("deeplabcut.csv", deeplabcut),
    "anipose CSV": ("anipose.csv", anipose),
    ".trc": ("a.trc", trc),
    "BVH": ("a.bvh", bvh),
    "Hand Tracking Streamer's lines": ("lines.txt", hand_lines),
}
"""Name, file's name and maker of each table."""

PICTURES: dict[str, tuple[str, Any]] = {
    "pixels, CSV": ("pixels.csv", pixels_csv),
    "NormalizedLandmark(...) cells": ("normalised.csv", normalised),
}
"""The same of landmarks in pictures."""
