"""The table of a data set: a row for each clip and hand."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from handtrack import __version__
from handtrack.batching.clip import Clip
from handtrack.evaluation.results import Stability
from handtrack.tracking.track import Track

if TYPE_CHECKING:
    import pyarrow

DONE, FAILED, PASSED = "done", "failed", "passed over"
"""What became of a clip: tracked; not, with the reason in `error`; it holds no hand joints."""

SAME = "same"
"""In the journal: the clip's file has another time, but holds what it held when it was tracked."""

TEXTS = ("clip", "path", "subject", "sequence", "hand", "state", "error", "error_kind")
NUMBERS = (
    *("pa_mpjpe_mean_mm", "pa_mpjpe_std_mm", "pa_mpjpe_median_mm", "pa_mpjpe_p95_mm"),
    *("mpjpe_mean_mm", "mpjpe_std_mm"),
    *("jitter_m_s3", "input_jitter_m_s3", "truth_jitter_m_s3"),
    *("acceleration_m_s2", "input_acceleration_m_s2"),
    *("input_pa_mpjpe_mean_mm", "lag_frames", "pa_auc", "outside_limits_percent"),
    *("bound_mm", "residual_mm", "scale", "noise_mm", "drift_mm", "fps"),
)
COUNTS = ("frames", "fitted", "predicted", "lost", "compared")
MADE = (
    *("against", "notes", "hand_from", "recording", "frames_file", "exports"),
    *("settings_digest", "task_digest", "input_digest", "input_stamp", "version", "worker"),
)
_TIMES = ("seconds", "finished")
KNOWN = (*TEXTS, *COUNTS, *NUMBERS, *MADE, *_TIMES)
"""All columns but the user's own."""
RESULTS = ("clip", "sequence", "hand", "state", *COUNTS, *NUMBERS, "against")
"""Columns that are the same however often, wherever and in whatever order clips are tracked."""

_AS_MEASURED = (
    *("jitter_m_s3", "input_jitter_m_s3", "truth_jitter_m_s3", "acceleration_m_s2"),
    *("input_acceleration_m_s2", "lag_frames", "pa_auc", "outside_limits_percent"),
)

Row = dict[str, Any]


def row_of(clip: Clip, track: Track, measured: Stability, extra: Mapping[str, Any]) -> Row:
    """The row of a tracked hand.

    Args:
        clip: what it was read from.
        track, measured: what came of it.
        extra: further columns.
    """
    aligned, plain, before = measured.pa_mpjpe_mm, measured.mpjpe_mm, measured.input_pa_mpjpe_mm
    found = track.settings.get("calibration")
    found = found if isinstance(found, Mapping) else {}
    seconds = np.diff(track.time_ns)
    values = {
        "sequence": track.name,
        "hand": track.hand,
        "state": DONE,
        "frames": measured.frames,
        "fitted": measured.fitted,
        "predicted": measured.predicted,
        "lost": measured.lost,
        "compared": measured.compared,
        "pa_mpjpe_mean_mm": aligned.mean,
        "pa_mpjpe_std_mm": aligned.std,
        "pa_mpjpe_median_mm": aligned.median,
        "pa_mpjpe_p95_mm": aligned.p95,
        "mpjpe_mean_mm": plain.mean,
        "mpjpe_std_mm": plain.std,
        "input_pa_mpjpe_mean_mm": None if before is None else before.mean,
        "bound_mm": found.get("bound_mean_mm"),
        "residual_mm": found.get("residual_mean_mm"),
        "scale": found.get("scale"),
        "noise_mm": found.get("noise_mm"),
        "fps": float(1e9 / np.median(seconds)) if len(seconds) else None,
        "against": measured.against,
        "notes": "; ".join(measured.notes),
    }
    values |= {name: getattr(measured, name) for name in _AS_MEASURED}
    return _row(clip, values | {"subject": track.subject} | dict(extra))


def row_without(clip: Clip, state: str, error: str, kind: str, extra: Mapping[str, Any]) -> Row:
    """The row of a clip of which nothing was tracked.

    Args:
        clip: it.
        state: `FAILED` or `PASSED`.
        error: why, in one line.
        kind: "input", "store" or "worker".
        extra: further columns.
    """
    values = {"state": state, "error": error, "error_kind": kind, "subject": clip.subject}
    return _row(clip, values | dict(extra))


def _row(clip: Clip, values: Mapping[str, Any]) -> Row:
    texts = dict.fromkeys((*TEXTS, *MADE), "")
    row: Row = texts | dict.fromkeys(COUNTS, 0) | dict.fromkeys((*NUMBERS, *_TIMES))
    own = {name: value for name, value in clip.own if name not in row}
    row |= own | {"clip": clip.name, "path": clip.path, "input_stamp": clip.stamp}
    row |= {"version": __version__} | dict(values)
    return {name: _known(value) for name, value in row.items()}


def _known(value: Any) -> Any:
    return None if isinstance(value, float) and not math.isfinite(value) else value


def own_columns(names: Iterable[str]) -> list[str]:
    """Those of a table's columns that are the user's."""
    known = set(KNOWN)
    return [name for name in names if name not in known]


def schema(own: Sequence[str]) -> pyarrow.Schema:
    """Types of the table's columns; the user's are text."""
    import pyarrow as pa

    return pa.schema(
        [
            *((name, pa.string()) for name in TEXTS),
            *((name, pa.int64()) for name in COUNTS),
            *((name, pa.float64()) for name in NUMBERS),
            *((name, pa.string()) for name in MADE),
            *((name, pa.float64()) for name in _TIMES),
            *((name, pa.string()) for name in own),
        ]
    )


def table_of(rows: Sequence[Row]) -> pyarrow.Table:
    """The rows as a table, sorted by clip, sequence and hand."""
    import pyarrow as pa

    own = sorted({name for row in rows for name in own_columns(row)})
    table = pa.Table.from_pylist(list(rows), schema=schema(own))
    return table.sort_by([(name, "ascending") for name in ("clip", "sequence", "hand")])
