"""What steadies a hand best: smoothing its joints, or fitting a hand and filtering its angles.

    python -m tools.bench.stability_study [PATH ...] [--noise-mm 2 5 10] [--faults none all]

Clean joints (a file's truth where it has one, else its joints) get white noise and faults, and
are given to each method: the raw joints as they are; Savitzky-Golay and One-Euro filters on the raw
joints with the parameters that suit the truth best ("oracle"); the fit, with the hand calibrated
on the noisy joints, frame by frame and with every filter that there is. Without PATH: the sample,
and ../shared/data/leap where it is there.

Columns: error, the mean distance to the clean joints, mm, with its ratio to the two oracles';
PA-MPJPE, mean and standard deviation over frames, mm; jitter, in units of the clean motion's;
lag in frames; the part of the clean joints of which the method says something. Means over
the clips of a path.
"""

from __future__ import annotations

import argparse
import json
import zlib
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import handtrack as ht
from handtrack.evaluation.arrays import nan_mean
from handtrack.evaluation.metrics import errors, jitter, lag, pa_mpjpe
from handtrack.tracking.settings import FILTERS
from tools.bench.faults import KINDS, disturbed
from tools.bench.oracles import best_one_euro, best_savgol

Array = NDArray[np.float64]

ROOT = Path(__file__).resolve().parents[2]
DEFAULTS = (ROOT / "recordings" / "sample.npz", ROOT.parent / "shared" / "data" / "leap")
RAW, SAVGOL, ONE_EURO = "raw joints", "savitzky-golay oracle", "one-euro oracle"
NUMBERS = (
    "error_mm",
    "vs_savgol",
    "vs_one_euro",
    "pa_mpjpe_mean_mm",
    "pa_mpjpe_std_mm",
    "jitter_ratio",
    "lag_frames",
    "said",
)
COLUMNS = ("error", "/ s-g", "/ 1-euro", "PA-MPJPE", "std", "jitter", "lag", "said")


@dataclass(frozen=True, eq=False)
class Case:
    """One clip with one noise and one kind of faults.

    Attributes:
        on: what the clip is a part of.
        clip: the clean joints are its joints.
        settings: keyword arguments of `handtrack.track` by the method's name.
    """

    on: str
    clip: ht.Sequence
    noise_mm: float
    faults: str
    settings: dict[str, dict[str, Any]]


def clean_clips(path: Path, frames: int | None = None) -> list[ht.Sequence]:
    """The clips of a path with their clean joints as joints, the first frames of each."""
    clips = []
    for s in ht.load(path):
        clean = s.joints if s.truth is None else s.truth
        end = slice(None, frames)
        clips.append(
            ht.Sequence(s.time_ns[end], clean[end], hand=s.hand, name=s.name, source=s.source)
        )
    return clips


def noisy(case: Case) -> ht.Sequence:
    """The clip as a detector would give it; the noise depends on its name alone."""
    rng = np.random.default_rng(zlib.crc32(case.clip.name.encode()))
    faults = replace(KINDS[case.faults], noise_mm=case.noise_mm)
    joints = disturbed(case.clip.joints, faults, rng)
    return ht.Sequence(case.clip.time_ns, joints, hand=case.clip.hand, name=case.clip.name)


def measured(estimate: Array, clip: ht.Sequence) -> dict[str, float]:
    """The numbers of one method, without the ratios to the oracles."""
    clean = clip.joints
    off = errors(estimate, clean)
    pa = pa_mpjpe(estimate, clean)
    pa = pa[np.isfinite(pa)]
    # the clean joints' jitter where the estimate has one as well, and the other way round
    both = np.where(np.isnan(estimate) | np.isnan(clean), np.nan, 1.0)
    moves = nan_mean(jitter(both * estimate, time_ns=clip.time_ns))
    true_moves = nan_mean(jitter(both * clean, time_ns=clip.time_ns))
    known = ~np.isnan(clean[..., 0])
    return {
        "error_mm": 1e3 * float(nan_mean(off, None)),
        "pa_mpjpe_mean_mm": 1e3 * float(pa.mean()) if pa.size else np.nan,
        "pa_mpjpe_std_mm": 1e3 * float(pa.std()) if pa.size else np.nan,
        "jitter_ratio": float(moves / true_moves),
        "lag_frames": lag(both * estimate, both * clean, time_ns=clip.time_ns),
        "said": float((~np.isnan(off)).sum() / known.sum()),
    }


def study(case: Case) -> list[dict[str, Any]]:
    """One row per method."""
    seen = noisy(case)
    savgol = best_savgol(seen.joints, case.clip.joints)
    one_euro = best_one_euro(seen.joints, case.clip.joints, seen.time_ns)
    found = {
        RAW: (seen.joints, ""),
        SAVGOL: (savgol.joints, savgol.parameters),
        ONE_EURO: (one_euro.joints, one_euro.parameters),
    }
    for method, settings in case.settings.items():
        found[method] = (ht.track(seen, **settings).filtered_joints, "")
    rows: list[dict[str, Any]] = []
    for method, (joints, parameters) in found.items():
        row: dict[str, Any] = {"on": case.on, "clip": case.clip.name}
        row |= {"noise_mm": case.noise_mm, "faults": case.faults, "method": method}
        row |= measured(joints, case.clip) | {"parameters": parameters}
        rows.append(row)
    by_method = {row["method"]: row["error_mm"] for row in rows}
    for row in rows:
        row["vs_savgol"] = row["error_mm"] / by_method[SAVGOL]
        row["vs_one_euro"] = row["error_mm"] / by_method[ONE_EURO]
    return rows


def means(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows of each path's clips as one: means, and ratios of the mean errors."""
    keys = ("on", "noise_mm", "faults", "method")
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)
    out = []
    for key, group in groups.items():
        row = dict(zip(keys, key, strict=True)) | {"clips": len(group)}
        row |= {name: float(nan_mean([r[name] for r in group])) for name in NUMBERS}
        out.append(row)
    by_key = {tuple(row[key] for key in keys): row["error_mm"] for row in out}
    for row in out:
        for name, oracle in (("vs_savgol", SAVGOL), ("vs_one_euro", ONE_EURO)):
            case = (row["on"], row["noise_mm"], row["faults"])
            row[name] = row["error_mm"] / by_key[(*case, oracle)]
    return out


def table(title: str, rows: list[dict[str, Any]]) -> Table:
    """The rows of one path or clip; the least error of each noise and kind in bold."""
    out = Table(title=title)
    out.add_column("noise", justify="right")
    out.add_column("faults")
    out.add_column("method")
    for column in COLUMNS:
        out.add_column(column, justify="right")
    cases = dict.fromkeys((row["noise_mm"], row["faults"]) for row in rows)
    for noise, faults in cases:
        group = [row for row in rows if (row["noise_mm"], row["faults"]) == (noise, faults)]
        best = min(row["error_mm"] for row in group)
        for row in group:
            cells = [f"{row[name]:.2f}" for name in NUMBERS[:-1]]
            if row["error_mm"] == best:
                cells[0] = f"[bold]{cells[0]}[/bold]"
            first = row is group[0]
            out.add_row(
                f"{noise:g} mm" if first else "",
                faults if first else "",
                row["method"],
                *cells,
                f"{100 * row['said']:.0f} %",
                end_section=row is group[-1],
            )
    return out


def plot(rows: list[dict[str, Any]], path: Path) -> bool:
    """Draw error and jitter against noise; False where matplotlib is not installed."""
    try:
        import matplotlib
    except ModuleNotFoundError:
        return False
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    panels = list(dict.fromkeys((row["on"], row["faults"]) for row in rows))
    methods = list(dict.fromkeys(row["method"] for row in rows))
    figure, axes = plt.subplots(
        2, len(panels), figsize=(4.4 * len(panels), 7.4), sharex=True, squeeze=False
    )
    for j, (on, faults) in enumerate(panels):
        for method in methods:
            some = [r for r in rows if (r["on"], r["faults"], r["method"]) == (on, faults, method)]
            smoothed = method in (RAW, SAVGOL, ONE_EURO)
            for i, name in enumerate(("error_mm", "jitter_ratio")):
                axes[i, j].plot(
                    [row["noise_mm"] for row in some],
                    [row[name] for row in some],
                    "--" if smoothed else "-",
                    marker="o",
                    markersize=3.5,
                    linewidth=1.4,
                    color="0.55" if method == RAW else f"C{methods.index(method)}",
                    label=method,
                )
        axes[0, j].set_title(on if faults == "none" else f"{on}, faults: {faults}", fontsize=10)
        axes[1, j].set_xlabel("noise per coordinate [mm]")
        axes[1, j].set_yscale("log")
        axes[1, j].axhline(1.0, color="0.8", linewidth=0.8)
        axes[0, j].set_ylim(bottom=0)
        for i in range(2):
            axes[i, j].grid(alpha=0.25)
    axes[0, 0].set_ylabel("error to the clean joints [mm]")
    axes[1, 0].set_ylabel("jitter / clean jitter")
    axes[0, 0].legend(frameon=False, fontsize=8)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
    return True


def methods(filters: Iterable[str]) -> dict[str, dict[str, Any]]:
    """What our side of the table is made of: settings of `handtrack.track` by name."""
    return {("fit" if f == "none" else f"fit + {f}"): {"filter": f} for f in filters}


def main(arguments: list[str] | None = None) -> None:
    """Run the study and say what came out."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("paths", nargs="*", type=Path, metavar="PATH", help="clean joints")
    parser.add_argument("--noise-mm", nargs="+", type=float, default=[2.0, 5.0, 10.0])
    parser.add_argument("--faults", nargs="+", choices=list(KINDS), default=["none", "all"])
    parser.add_argument("--filters", nargs="+", choices=FILTERS, default=list(FILTERS))
    parser.add_argument("--frames", type=int, help="only so many frames of each clip")
    parser.add_argument("--processes", type=int, default=1, help="how many cases at a time")
    parser.add_argument("--each", action="store_true", help="a table for every clip as well")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write the rows")
    parser.add_argument("--plot", type=Path, metavar="OUT.png", help="draw them (matplotlib)")
    options = parser.parse_args(arguments)
    if min(options.noise_mm) < 0 or options.processes < 1:
        parser.error("noise must not be negative, and processes be at least 1")
    if options.frames is not None and options.frames < 30:
        parser.error("--frames must be at least 30")
    paths = options.paths or [path for path in DEFAULTS if path.exists()]
    try:
        clips = [(path, clip) for path in paths for clip in clean_clips(path, options.frames)]
    except ht.HandtrackError as error:
        parser.error(str(error))
    cases = [
        Case(path.stem or str(path), clip, noise, faults, methods(options.filters))
        for path, clip in clips
        for noise in options.noise_mm
        for faults in options.faults
    ]
    if options.processes == 1:
        rows = [row for case in cases for row in study(case)]
    else:
        with ProcessPoolExecutor(options.processes) as pool:
            rows = [row for some in pool.map(study, cases) for row in some]
    overall = means(rows)
    console = Console(width=None if Console().is_terminal else 130)
    for path in paths:
        on = path.stem or str(path)
        names = list(dict.fromkeys(row["clip"] for row in rows if row["on"] == on))
        several = f"{on}: {len(names)} clips, means"
        some = [row for row in overall if row["on"] == on]
        console.print(table(several if len(names) > 1 else on, some))
        for name in names if options.each and len(names) > 1 else ():
            one = [row for row in rows if (row["on"], row["clip"]) == (on, name)]
            console.print(table(name, one))
    if options.json:
        text = json.dumps(finite({"overall": overall, "rows": rows}), indent=1, allow_nan=False)
        options.json.write_text(text + "\n")
    if options.plot and not plot(overall, options.plot):
        console.print("no plot: matplotlib is not installed (pip install 'handtrack[plot]')")


def finite(value: Any) -> Any:
    """The same with null for numbers that are none."""
    if isinstance(value, dict):
        return {key: finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [finite(inner) for inner in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


if __name__ == "__main__":
    main()
