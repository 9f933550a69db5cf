"""The noise study of Li et al. 2021: what each update makes of noisy joints.

    python -m tools.bench.noise_study [--quick] [--limits NAME] [--json OUT] [--plot OUT.png]

Joints of random valid poses, and of the sample's motion, get white noise of 2, 5, 10 and 20 mm
on every coordinate and are fitted with the hand that made them: random poses each from the mean
pose, the motion frame after frame. The paper's update ("li2021") stands beside the exact
constrained optimum and two robust losses. A second run moves 5 % of the joints 10 cm away as
well. All errors are MPJPE in millimetres, over all joints, means and standard deviations over
frames.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

from handtrack.fitting import settings as fit_settings
from handtrack.fitting import solver
from handtrack.fitting.settings import FitSettings
from handtrack.hand.limits import PRESETS
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_ANGLES
from handtrack.sequences.sequence import Sequence
from tools.make.sample import make, motion, subject_hand

Array = NDArray[np.float64]

SIGMAS_MM = (2.0, 5.0, 10.0, 20.0)
OUTLIERS, OUTLIER_M = 0.05, 0.10
"""Part of the joints that are moved, and how far [m]."""
POSES = 300
SPREAD_MM = FitSettings().spread_mm
METHODS: dict[str, tuple[fit_settings.Update, fit_settings.Robust]] = {
    "li2021": ("li2021", "none"),
    "exact": ("exact", "none"),
    "huber": ("exact", "huber"),
    "geman-mcclure": ("exact", "geman-mcclure"),
}


@dataclass(frozen=True)
class Truth:
    """Clean joints (T, 21, 3) [m] and the hand that made them.

    Attributes:
        alone: the frames have nothing to do with each other.
    """

    name: str
    model: HandModel
    joints: Array
    alone: bool


def random_poses(model: HandModel, n: int, rng: np.random.Generator) -> Array:
    """(n, 21, 3) joints of random valid poses, anywhere within about a metre [m]."""
    angles = random_angles(model, n, rng)
    rotation = Rotation.random(n, random_state=rng).as_matrix()
    return model.joints(angles, rotation, rng.normal(0.0, 0.3, (n, 3)))


def random_angles(model: HandModel, n: int, rng: np.random.Generator) -> Array:
    """(n, 20) angles all over the limits [rad]; outside an ellipse: its nearest point."""
    limits = model.limits
    return limits.clamp(rng.uniform(limits.lower, limits.upper, (n, N_ANGLES)))


def noisy_poses(model: HandModel, n: int, sigma_mm: float) -> Array:
    """(n, 21, 3) noisy joints of random valid poses [m]; the same poses for every noise."""
    rng = np.random.default_rng(11)
    truth = random_poses(model, n, rng)
    return truth + rng.normal(0.0, 1e-3 * sigma_mm, truth.shape)


def noisy_motion(frames: int, sigma_mm: float, fps: float = 30.0) -> Sequence:
    """The sample's motion, longer, by another hand; the same motion for every noise."""
    rng = np.random.default_rng(7)
    truth = subject_hand(rng).joints(*motion(frames / fps, fps, rng))
    joints = truth + rng.normal(0.0, 1e-3 * sigma_mm, truth.shape)
    return Sequence(np.rint(np.arange(len(truth)) * 1e9 / fps).astype(np.int64), joints)


def truths(limits: str, poses: int, frames: int) -> list[Truth]:
    """The random poses of the default hand and the sample's motion with the sample's hand."""
    model = HandModel.default(limits=limits)
    sample = make()
    return [
        Truth("random poses", model, random_poses(model, poses, np.random.default_rng(1)), True),
        Truth("sample motion", sample.model.with_limits(limits), sample.truth[:frames], False),
    ]


def with_outliers(joints: Array, rng: np.random.Generator) -> Array:
    """The joints, some of them moved 10 cm in any direction."""
    moved = rng.random(joints.shape[:2]) < OUTLIERS
    away = rng.normal(size=joints.shape)
    away *= OUTLIER_M / np.linalg.norm(away, axis=-1, keepdims=True)
    return joints + away * moved[..., None]


def fitted(
    program: solver.Program,
    model: HandModel,
    joints: Array,
    alone: bool,
    full: bool = False,
    start: Array | None = None,
) -> solver.Results:
    """Fits by one call of the compiled loop.

    Args:
        joints: (T, 21, 3) [m].
        alone: every frame starts cold; else each one at the fit before.
        full: whether covariances are wanted.
        start: (20,) angles of a cold start; the mean pose if left out.
    """
    results = solver.Results(len(joints), full)
    start = model.mean_angles if start is None else start
    weights = np.ones(joints.shape[:2])
    results.run(program, model, joints.copy(), weights, solver.start_at(model), start, 1, alone)
    return results


def mpjpe_mm(a: Array, b: Array) -> tuple[float, float]:
    """Mean and standard deviation over frames of the mean joint distance [mm]."""
    error = 1e3 * np.linalg.norm(a - b, axis=-1).mean(1)
    return float(error.mean()), float(error.std())


def study(
    truth: Truth,
    sigmas_mm: tuple[float, ...] = SIGMAS_MM,
    spread_mm: float = SPREAD_MM,
) -> list[dict[str, Any]]:
    """One row per noise and method; the first method is the noisy input itself.

    Args:
        sigmas_mm: standard deviations of the noise on each coordinate [mm].
        spread_mm: where the robust losses bend, the same for every noise [mm].
    """
    rng = np.random.default_rng(2)
    rows: list[dict[str, Any]] = []
    for sigma in sigmas_mm:
        noisy = truth.joints + rng.normal(0.0, 1e-3 * sigma, truth.joints.shape)
        outliers = with_outliers(noisy, rng)
        found = {"input": (noisy, outliers)}
        for method, (update, robust) in METHODS.items():
            program = solver.Program(update=update, robust=robust, spread_mm=spread_mm)
            clean, dirty = (
                fitted(program, truth.model, joints, truth.alone).joints
                for joints in (noisy, outliers)
            )
            found[method] = clean, dirty
        for method, (clean, dirty) in found.items():
            row: dict[str, Any] = {"on": truth.name, "sigma_mm": sigma, "method": method}
            row["truth_mean_mm"], row["truth_std_mm"] = mpjpe_mm(clean, truth.joints)
            row["input_mean_mm"], row["input_std_mm"] = mpjpe_mm(clean, noisy)
            row["outliers_mean_mm"], row["outliers_std_mm"] = mpjpe_mm(dirty, truth.joints)
            rows.append(row)
    return rows


def table(name: str, rows: list[dict[str, Any]]) -> Table:
    """The rows of one set of frames; the best of each column in bold."""
    share = f"{100 * OUTLIERS:.0f} % of joints {1e2 * OUTLIER_M:.0f} cm off"
    out = Table(title=f"{name}: MPJPE, mm, mean (std)")
    out.add_column("noise", justify="right")
    for column in ("method", "to the truth", "to the input", f"to the truth, {share}"):
        out.add_column(column, justify="left" if column == "method" else "right")
    keys = ("truth", "input", "outliers")
    for sigma in dict.fromkeys(row["sigma_mm"] for row in rows):
        group = [row for row in rows if row["sigma_mm"] == sigma]
        best = {key: min(row[f"{key}_mean_mm"] for row in group[1:]) for key in keys}
        for row in group:
            cells = []
            for key in keys:
                mean = row[f"{key}_mean_mm"]
                cell = f"{mean:.2f} ({row[f'{key}_std_mm']:.2f})"
                cells.append(f"[bold]{cell}[/bold]" if mean == best[key] else cell)
            first = row is group[0]
            label = f"{sigma:g} mm" if first else ""
            out.add_row(label, row["method"], *cells, end_section=row is group[-1])
    return out


def plot(rows: list[dict[str, Any]], path: Path) -> bool:
    """Draw error against noise; False where matplotlib is not installed."""
    try:
        import matplotlib
    except ModuleNotFoundError:
        return False
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    colours = {"input": "0.55", "li2021": "#d55e00", "exact": "#0072b2"}
    colours |= {"huber": "#009e73", "geman-mcclure": "#aa4499"}
    names = list(dict.fromkeys(row["on"] for row in rows))
    figure, panels = plt.subplots(
        2, len(names), figsize=(5.2 * len(names), 7.6), sharex=True, squeeze=False
    )
    share = f"{100 * OUTLIERS:.0f} % of joints {1e2 * OUTLIER_M:.0f} cm off"
    for j, name in enumerate(names):
        for i, (key, what) in enumerate((("truth", "white noise"), ("outliers", share))):
            axes = panels[i, j]
            for k, (method, colour) in enumerate(colours.items()):
                some = [row for row in rows if (row["on"], row["method"]) == (name, method)]
                axes.errorbar(
                    [row["sigma_mm"] + 0.16 * (k - 2) for row in some],
                    [row[f"{key}_mean_mm"] for row in some],
                    [row[f"{key}_std_mm"] for row in some],
                    color=colour,
                    label=method,
                    linestyle="--" if method == "input" else "-",
                    marker="o",
                    markersize=3.5,
                    linewidth=1.4,
                    elinewidth=0.8,
                    capsize=2,
                )
            axes.set_title(f"{name}, {what}", fontsize=10)
            axes.set_ylabel("MPJPE to the truth [mm]")
            axes.set_ylim(bottom=0)
            axes.grid(alpha=0.25)
    for axes in panels[-1]:
        axes.set_xlabel("noise per coordinate [mm]")
        axes.set_xticks(sorted({row["sigma_mm"] for row in rows}))
    panels[0, 0].legend(frameon=False, fontsize=9)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    plt.close(figure)
    return True


def main(arguments: list[str] | None = None) -> None:
    """Run the study and say what came out."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="40 poses and 40 frames")
    parser.add_argument(
        "--limits", choices=sorted(PRESETS), default="li2021", help="default: %(default)s"
    )
    parser.add_argument(
        "--spread-mm",
        type=float,
        default=SPREAD_MM,
        help="of the robust losses: %(default)g",
    )
    parser.add_argument("--json", type=Path, metavar="OUT", help="write the rows")
    parser.add_argument("--plot", type=Path, metavar="OUT.png", help="draw them (matplotlib)")
    options = parser.parse_args(arguments)
    console = Console(width=None if Console().is_terminal else 110)
    sizes = (40, 40) if options.quick else (POSES, 300)
    rows: list[dict[str, Any]] = []
    for truth in truths(options.limits, *sizes):
        some = study(truth, spread_mm=options.spread_mm)
        rows += some
        console.print(table(f"{truth.name} ({len(truth.joints)}), {options.limits} limits", some))
    if options.json:
        document = {
            "limits": options.limits,
            "spread_mm": options.spread_mm,
            "outliers": OUTLIERS,
            "rows": rows,
        }
        options.json.write_text(json.dumps(document, indent=1) + "\n")
    if options.plot and not plot(rows, options.plot):
        console.print("no plot: matplotlib is not installed (pip install matplotlib)")


if __name__ == "__main__":
    main()
