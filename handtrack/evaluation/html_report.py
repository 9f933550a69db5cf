"""A report as one web page: plots that need nothing but the file itself.

Long series are reduced to the least, mean and greatest value of short spans of time, so that a
page stays small and nothing that stands out is lost.
"""

from __future__ import annotations

import json
import shlex
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from handtrack import __version__
from handtrack.evaluation.alignment import align
from handtrack.evaluation.arrays import Array, nan_mean
from handtrack.evaluation.bootstrap import Uncertain
from handtrack.evaluation.compare import Comparison
from handtrack.evaluation.metrics import errors, pck_of_errors
from handtrack.evaluation.report import MEANING
from handtrack.evaluation.results import Material, Stability, StabilityReport
from handtrack.evaluation.tables import Report, panoptic_rows
from handtrack.hand.skeleton import ANGLE_NAMES, BONES, JOINT_NAMES, N_ANGLES

ERROR_BINS = 900
ANGLE_BINS = 320
_ANGLE_NUMBERS = 400_000
"""Numbers of angle traces on a page, in all."""
WORST = 6
"""Frames drawn for each sequence and method."""
_APART_S = 0.4
"""Worst frames are not neighbours."""
PCK_MM = np.linspace(0.0, 50.0, 101)


class About(NamedTuple):
    """Where a report comes from.

    Attributes:
        date: when it was made, as it is to be written.
        files: what each method was measured from; the name is "" of an only one.
        command: how it was made.
    """

    date: str = ""
    files: Mapping[str, Sequence[str]] = MappingProxyType({})
    command: str = ""


def to_html(report: Report, about: About = About()) -> str:  # noqa: B008 - it cannot change
    """The report as a page: errors over time, PCK, joints, angles, worst frames, numbers."""
    page = files("handtrack.evaluation").joinpath("page.html").read_text(encoding="utf-8")
    # "<" inside text must not end the script that holds the data
    data = json.dumps(page_data(report, about), allow_nan=False, separators=(",", ":"))
    return page.replace("/*DATA*/", data.replace("<", "\\u003c"))


def page_data(report: Report, about: About = About()) -> dict[str, Any]:  # noqa: B008
    """What the page draws, as JSON values; null for what is not there."""
    if isinstance(report, Comparison):
        methods: Mapping[str, StabilityReport] = report.methods
        overall = dict(report.common)
        sentences = [{"text": d.sentence, "clear": d.verdict} for d in report.differences]
        scope = f"{report.frames:,} frames that all methods have"
        notes = list(report.notes)
    else:
        only = report.sequences[0].name if len(report.sequences) == 1 else "all sequences"
        methods, overall, sentences = {only: report}, {only: report.overall}, []
        scope = f"{report.overall.frames:,} frames"
        notes = []
    notes += [f"{r.name}: {n}" for m in methods.values() for r in m.sequences for n in r.notes]
    few = {n: overall[n].intervals.get("pa_mpjpe_mm") for n in methods}
    notes += [
        f"{n + ': ' if len(methods) > 1 else ''}no interval of PA-MPJPE: {i.few}"
        for n, i in few.items()
        if i is not None and i.few
    ]
    first = next(iter(methods.values()))
    paper = panoptic_rows(first.sequences)
    count = sum(len(m.sequences) for m in methods.values())
    bins = int(np.clip(_ANGLE_NUMBERS / (3 * N_ANGLES * count), 40, ANGLE_BINS))
    with_angles = max(1, _ANGLE_NUMBERS // (3 * N_ANGLES * bins * len(methods)))
    return {
        "version": __version__,
        "date": about.date,
        "command": about.command,
        "files": [[name, list(paths)] for name, paths in about.files.items()],
        "settings": [[n if len(methods) > 1 else "", _settings(m)] for n, m in methods.items()],
        "scope": scope,
        "against": first.overall.against,
        "meaning": MEANING[first.overall.against],
        "sentences": sentences,
        "notes": notes,
        "paper": None if paper is None else paper.to_dict(),
        "methods": [_method(name, methods[name], overall[name]) for name in methods],
        "sequences": [
            _sequence(row, methods, bins if i < with_angles else 0, about)
            for i, row in enumerate(first.sequences)
        ],
        "thresholds": PCK_MM.tolist(),
        "pck_end": _pck_end([overall[name].pa_mpjpe_mm.p95 for name in methods]),
        "joints": list(JOINT_NAMES),
        "angles": list(ANGLE_NAMES),
        "bones": [list(b) for b in BONES],
    }


def _settings(report: StabilityReport) -> list[str]:
    """How its hands were tracked, each way once."""
    told = []
    for row in report.sequences:
        values = {} if row.material is None else row.material.settings
        plain = {n: v for n, v in values.items() if isinstance(v, str | int | float) and v != ""}
        written = (f"{v:.4g}" if isinstance(v, float) else str(v) for v in plain.values())
        told.append(", ".join(map(" ".join, zip(plain, written, strict=True))))
    return [text for text in dict.fromkeys(told) if text]


def _method(name: str, report: StabilityReport, row: Stability) -> dict[str, Any]:
    own = report.overall
    sure, shaky = row.intervals.get("pa_mpjpe_mm"), row.intervals.get("jitter_m_s3")
    materials = [r.material for r in report.sequences if r.material is not None]
    aligned = np.concatenate([m.joint_errors_mm for m in materials])
    plain = np.concatenate([errors(m.estimate, m.reference) for m in materials]) * 1e3
    return {
        "name": name,
        "frames": own.frames,
        "lost": own.lost,
        "predicted": own.predicted,
        "mean": _interval(sure.mean if sure else None, row.pa_mpjpe_mm.mean),
        "std": _interval(sure.std if sure else None, row.pa_mpjpe_mm.std),
        "jitter": _interval(shaky.mean if shaky else None, row.jitter_m_s3),
        "input": _number(None if row.input_pa_mpjpe_mm is None else row.input_pa_mpjpe_mm.mean),
        "input_jitter": _number(row.input_jitter_m_s3),
        "truth_jitter": _number(row.truth_jitter_m_s3),
        "median": _number(row.pa_mpjpe_mm.median),
        "p95": _number(row.pa_mpjpe_mm.p95),
        "max": _number(row.pa_mpjpe_mm.max),
        "mpjpe": _number(row.mpjpe_mm.mean),
        "auc": _number(row.pa_auc),
        "drift": _number(own.bone_drift_percent),
        "outside": _number(own.outside_limits_percent),
        "joint": _list(row.joint_pa_mm, 2),
        "pck": _list(nan_mean(pck_of_errors(aligned, PCK_MM), 0), 4),
        "pck_plain": _list(nan_mean(pck_of_errors(plain, PCK_MM), 0), 4),
    }


def _sequence(
    row: Stability, methods: Mapping[str, StabilityReport], angle_bins: int, about: About
) -> dict[str, Any]:
    """One sequence as every method has it."""
    rows, opened = [], []
    for name, report in methods.items():
        same = [r for r in report.sequences if (r.name, r.hand) == (row.name, row.hand)]
        if not same and len(report.sequences) == 1:
            same = [r for r in report.sequences if r.hand == row.hand]
        rows.append(same[0] if same else None)
        paths = about.files.get(name, about.files.get("", ()))
        # which of several files a sequence is from is not known
        opened.append(paths[0] if len(paths) == 1 else "")
    known = [r.material for r in rows if r is not None and r.material is not None]
    start = min(int(m.time_ns[0]) for m in known)
    measure = "jitter_m_s3" if row.against == "nothing" else "pa_mpjpe_mm"
    limits = next((m.limits for m in known if m.limits is not None), None)
    return {
        "name": row.name,
        "hand": row.hand,
        "measure": measure,
        "mean": [None if r is None else _number(r.pa_mpjpe_mm.mean) for r in rows],
        "std": [None if r is None else _number(r.pa_mpjpe_mm.std) for r in rows],
        "error": [_trace(r, r.frame_values[measure][:, None], start) if r else None for r in rows],
        "angles": [
            _trace(r, np.rad2deg(r.material.angles), start, angle_bins)
            if r and angle_bins and r.material and r.material.angles is not None
            else None
            for r in rows
        ],
        "limits_name": "" if limits is None else limits.name,
        "limits": None
        if limits is None
        else np.rad2deg(np.stack([limits.lower, limits.upper], 1)).round(1).tolist(),
        "worst": [
            _worst(r, start, path) if r else [] for r, path in zip(rows, opened, strict=True)
        ],
    }


def _trace(
    row: Stability, values: Array, start: int, bins: int = ERROR_BINS
) -> dict[str, Any] | None:
    """Least, mean and greatest of (T, n) in spans of time; values as they are if there are few.

    {"t": [s], "mean": n lists, "low": n lists or null, "high": n lists or null}
    """
    material = row.material
    if material is None:
        return None
    seconds = (material.time_ns - start) * 1e-9
    if len(seconds) <= bins:
        return {
            "t": _list(seconds, 3),
            "mean": [_list(v, 2) for v in values.T],
            "low": None,
            "high": None,
        }
    edges = np.linspace(0, len(seconds), bins + 1).astype(int)[:-1]
    missing = np.isnan(values)
    count = np.add.reduceat(~missing, edges, 0)
    total = np.add.reduceat(np.where(missing, 0.0, values), edges, 0)
    low = np.minimum.reduceat(np.where(missing, np.inf, values), edges, 0)
    high = np.maximum.reduceat(np.where(missing, -np.inf, values), edges, 0)
    none = count == 0
    mean = np.where(none, np.nan, total / np.maximum(count, 1))
    return {
        "t": _list(seconds[edges], 2),
        "mean": [_list(v, 2) for v in mean.T],
        "low": [_list(v, 2) for v in np.where(none, np.nan, low).T],
        "high": [_list(v, 2) for v in np.where(none, np.nan, high).T],
    }


def _pck_end(p95: Sequence[float]) -> float:
    """Up to which distance [mm] PCK is drawn: twice what 95 % of the frames stay below."""
    known = [value for value in p95 if np.isfinite(value)]
    wanted = 2 * max(known, default=25.0)
    return next((end for end in (2.0, 5.0, 10.0, 20.0, 30.0, 40.0) if end >= wanted), 50.0)


def _worst(row: Stability, start: int, path: str = "") -> list[dict[str, Any]]:
    """The frames with the greatest errors, as skeletons in the palm's frame [mm]; and, of a
    recording at path, the command that opens a second about each."""
    material = row.material
    error = row.frame_values["pa_mpjpe_mm"]
    if material is None or np.isnan(error).all():
        return []
    chosen: list[int] = []
    for t in np.argsort(np.where(np.isnan(error), -np.inf, error))[::-1]:
        if len(chosen) == WORST or np.isnan(error[t]):
            break
        apart = [abs(int(material.time_ns[t] - material.time_ns[c])) * 1e-9 for c in chosen]
        if all(a >= _APART_S for a in apart):
            chosen.append(int(t))
    out = [_skeleton(material, t, float(error[t]), start) for t in chosen]
    for frame, t in zip(out, chosen, strict=True):
        frame["opens"] = ""
        if path.endswith(".mcap"):
            own = (int(material.time_ns[t]) - int(material.time_ns[0])) * 1e-9
            part = f"--start {max(0.0, own - 0.5):.2f} --end {own + 0.5:.2f}"
            frame["opens"] = f"handtrack replay {shlex.quote(path)} --hand {row.hand} {part}"
    return out


def _skeleton(material: Material, t: int, error: float, start: int) -> dict[str, Any]:
    reference = material.reference[t]
    estimate = align(material.estimate[t : t + 1], reference[None])[0]
    turn, middle = _palm_frame(reference)
    worst = int(np.nanargmax(material.joint_errors_mm[t]))
    return {
        "frame": int(material.frame_index[t]),
        "time": round((int(material.time_ns[t]) - start) * 1e-9, 2),
        "error": _number(error),
        "joint": JOINT_NAMES[worst],
        "errors": _list(material.joint_errors_mm[t], 1),
        "joint_error": _number(float(material.joint_errors_mm[t, worst])),
        "estimate": [_list(p, 1) for p in (estimate - middle) @ turn.T * 1e3],
        "reference": [_list(p, 1) for p in (reference - middle) @ turn.T * 1e3],
    }


def _palm_frame(joints: Array) -> tuple[Array, Array]:
    """Rotation (3, 3) to x across the palm, y to the fingertips, and the hand's middle."""
    middle = nan_mean(joints, 0)
    up, across = joints[9] - joints[0], joints[5] - joints[17]
    if np.isnan([up, across]).any():
        _, _, axes = np.linalg.svd(np.nan_to_num(joints - middle))
        up, across = axes[0], axes[1]
    y = up / max(float(np.linalg.norm(up)), 1e-12)
    x = across - (across @ y) * y
    x = x / max(float(np.linalg.norm(x)), 1e-12)
    return np.stack([x, y, np.cross(x, y)]), middle


def _interval(of: Uncertain | None, value: float) -> list[float | None]:
    low, high = (of.low, of.high) if of is not None else (float("nan"), float("nan"))
    return [_number(v, 6) for v in (value, low, high)]


def _number(value: float | None, digits: int = 5) -> float | None:
    return None if value is None or not np.isfinite(value) else round(float(value), digits)


def _list(values: Iterable[float], digits: int) -> list[float | None]:
    array = np.asarray(values, dtype=np.float64)
    rounded: list[float | None] = array.round(digits).tolist()
    if np.isfinite(array).all():
        return rounded
    return [v if v is not None and np.isfinite(v) else None for v in rounded]
