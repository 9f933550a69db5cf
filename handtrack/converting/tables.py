"""Joints as tables and arrays: CSV, Parquet, LeRobot's columns, NumPy, .trc."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from handtrack.converting.source import Source, time_s
from handtrack.hand.skeleton import JOINT_NAMES, N_JOINTS

Array = NDArray[np.float64]

_DIGITS = 6  # of millimetres in text
STATE = "observation.state"


def write_npz(source: Source, path: Path) -> None:
    """`joints_m` (T, 21, 3), `confidence`, `time_ns`, `frame_index`, `hand`, `name`, `subject`."""
    with path.open("wb") as stream:
        np.savez_compressed(
            stream,
            joints_m=source.joints,
            confidence=source.confidence,
            time_ns=source.time_ns,
            frame_index=source.frame_index,
            hand=source.hand,
            name=source.title,
            subject=source.subject,
            joint_names=np.array(JOINT_NAMES),
        )


def write_csv(source: Source, path: Path) -> None:
    """`frame`, `time_ns`, `wrist_x_mm` ... `little_tip_z_mm`; empty where a joint is missing."""
    from pyarrow import csv

    options = csv.WriteOptions(quoting_style="needed")
    csv.write_csv(_table(source, _DIGITS), path, options)


def write_parquet(source: Source, path: Path) -> None:
    """The same columns in full precision."""
    from pyarrow import parquet

    table = _table(source).replace_schema_metadata({"hand": source.hand, "name": source.title})
    parquet.write_table(table, path, compression="zstd")


def _table(source: Source, digits: int | None = None):  # type: ignore[no-untyped-def]
    import pyarrow

    columns = {
        "frame": pyarrow.array(source.frame_index),
        "time_ns": pyarrow.array(source.time_ns),
        "hand": pyarrow.array([source.hand] * len(source)),
    }
    mm = source.joints * 1e3
    if digits is not None:
        mm = np.round(mm, digits)
    for joint, name in enumerate(JOINT_NAMES):
        for i, axis in enumerate("xyz"):
            values = mm[:, joint, i]
            columns[f"{name}_{axis}_mm"] = pyarrow.array(values, mask=~np.isfinite(values))
    return pyarrow.table(columns)


def write_lerobot(source: Source, path: Path, joints: Array) -> None:
    """A LeRobot episode: `observation.state` of 63 float32 (21 joints x 3 [m]), `timestamp` [s],
    `frame_index`, `episode_index`, `index`, `task_index`.

    Args:
        source: gives times.
        path: the file.
        joints: (T, 21, 3) to write [m].
    """
    import pyarrow
    from pyarrow import parquet

    n = len(source)
    flat = pyarrow.array(joints.astype(np.float32).reshape(-1))
    counted = np.arange(n, dtype=np.int64)
    table = pyarrow.table(
        {
            STATE: pyarrow.FixedSizeListArray.from_arrays(flat, 3 * N_JOINTS),
            "timestamp": pyarrow.array(time_s(source).astype(np.float32)),
            "frame_index": pyarrow.array(counted),
            "episode_index": pyarrow.array(np.zeros(n, np.int64)),
            "index": pyarrow.array(counted),
            "task_index": pyarrow.array(np.zeros(n, np.int64)),
        }
    )
    table = table.replace_schema_metadata({"hand": source.hand, "unit": "m"})
    parquet.write_table(table, path, compression="zstd")


def write_trc(source: Source, path: Path, title: str) -> None:
    """OpenSim's marker trajectories [mm]: a marker for each joint, by its name; empty cells where
    one is missing."""
    n, time = len(source), time_s(source)
    rate = (n - 1) / (time[-1] - time[0]) if n > 1 else 30.0
    sizes = "DataRate CameraRate NumFrames NumMarkers Units OrigDataRate OrigDataStartFrame"
    head = [
        f"PathFileType\t4\t(X/Y/Z)\t{title}",
        "\t".join([*sizes.split(), "OrigNumFrames"]),
        f"{rate:.6f}\t{rate:.6f}\t{n}\t{N_JOINTS}\tmm\t{rate:.6f}\t1\t{n}",
        "Frame#\tTime\t" + "\t\t\t".join(f"{source.hand}_{name}" for name in JOINT_NAMES) + "\t\t",
        "\t\t" + "\t".join(f"{axis}{j + 1}" for j in range(N_JOINTS) for axis in "XYZ"),
        "",
    ]
    cells = np.round(source.joints * 1e3, _DIGITS).reshape(n, -1) + 0.0
    with path.open("w", encoding="ascii", newline="\n") as file:
        file.write("\n".join(head) + "\n")
        for t in range(n):
            row = [f"{x:.{_DIGITS}f}" if np.isfinite(x) else "" for x in cells[t]]
            file.write("\t".join([str(t + 1), f"{time[t]:.9f}", *row]) + "\n")
