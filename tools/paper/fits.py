"""The methods of the paper on unrelated poses: what `paper.py` runs and measures."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

import handtrack as ht
from handtrack.evaluation import metrics
from handtrack.fitting.fit import fit_batch
from handtrack.fitting.result import Fit
from handtrack.fitting.settings import UPDATES
from handtrack.hand.model import HandModel
from tools.paper import baselines
from tools.paper.free_pose import FreeFit

Array = NDArray[np.float64]
Components = tuple[Array, Array]

METHODS = ("gdc-pca", "gdc", "mlp", "li2021", "exact")
NAMES = {
    "gdc": "GDC, 45 angles",
    "gdc-pca": "GDC, PCA",
    "mlp": "MLP",
    "li2021": "li2021 (the paper's updates)",
    "exact": "exact",
}
SINGLE = {"gdc": 3, "gdc-pca": 3, "mlp": 60, "li2021": 100, "exact": 200}
"""How many single frames are timed."""


@dataclass(frozen=True, eq=False)
class Poses:
    """True hands.

    Attributes:
        name: what they are.
        joints: (N, 21, 3) [m]; vertices: (N, V, 3) [m] or None.
        model: the hand to fit, of the same shape.
        components: pose mean (45,) and components (n, 45) for "gdc-pca", in the order of our
            parts, or None.
    """

    name: str
    joints: Array
    vertices: Array | None
    model: HandModel
    components: Components | None = None


@dataclass
class Row:
    """One method's numbers: name -> (mean, standard deviation) over poses [mm], and its time."""

    method: str
    values: dict[str, tuple[float, float]] = field(default_factory=dict)
    ms: float = float("nan")


def run(method: str, poses: Poses, joints: Array) -> Fit:
    """Every frame by itself, from the mean pose.

    Args:
        method: one of `METHODS`.
        poses: whose hand is fitted.
        joints: (N, 21, 3) what is seen [m].
    """
    if method in baselines.BASELINES:
        which = next(b for b in baselines.BASELINES if b == method)
        return baselines.fit_batch(poses.model, joints, which, components=poses.components)
    return fit_batch(poses.model, joints, update="li2021" if method == "li2021" else "exact")


def vertices(fit: Fit, model: HandModel) -> Array:
    """(N, V, 3) skin of a result [m]."""
    if isinstance(fit, FreeFit):
        return fit.vertices(model)
    return model.vertices(fit.angles, fit.rotation, fit.translation)


def measure(method: str, poses: Poses, observed: Array | None = None, timed: bool = True) -> Row:
    """A method's errors to the true hands, given what is seen of them."""
    seen = poses.joints if observed is None else observed
    fit = run(method, poses, seen)
    row = Row(method)
    pairs: list[tuple[str, Array, Array]] = [("MPJPE", fit.joints, poses.joints)]
    if poses.vertices is not None:
        pairs.append(("MPVPE", vertices(fit, poses.model), poses.vertices))
    for name, a, b in pairs:
        plain, aligned = metrics.mpjpe(a, b), metrics.pa_mpjpe(a, b)
        for label, error in ((name, plain), (f"PA-{name}", aligned)):
            row.values[label] = 1e3 * float(np.nanmean(error)), 1e3 * float(np.nanstd(error))
    if timed:
        row.ms = _time(method, poses, seen)
    return row


def _time(method: str, poses: Poses, joints: Array) -> float:
    """Median time of one frame alone [ms]."""
    fit: Callable[[Array], object]
    if method in baselines.BASELINES:
        which = next(b for b in baselines.BASELINES if b == method)
        fit = lambda x: baselines.fit(poses.model, x, which)  # noqa: E731
    else:
        update = next(u for u in UPDATES if u == ("li2021" if method == "li2021" else "exact"))
        fit = lambda x: ht.fit(poses.model, x, update=update)  # noqa: E731
    fit(joints[0])
    spent = []
    for x in joints[: SINGLE[method]]:
        start = time.perf_counter()
        fit(x)
        spent.append(time.perf_counter() - start)
    return 1e3 * float(np.median(spent))


def table(title: str, rows: list[Row], published: dict[str, dict[str, str]]) -> Table:
    """Rows of ours, and the paper's below."""
    columns = list(rows[0].values)
    out = Table(title=title)
    out.add_column("method")
    for column in columns:
        out.add_column(f"{column} (std)", justify="right")
    out.add_column("ms a frame", justify="right")
    best = {c: min(row.values[c][0] for row in rows) for c in columns}
    for row in rows:
        cells = []
        for c in columns:
            mean, std = row.values[c]
            cell = f"{mean:.2f} ({std:.2f})"
            cells.append(f"[bold]{cell}[/bold]" if mean == best[c] else cell)
        time_cell = f"{row.ms:.3g}" if np.isfinite(row.ms) else ""
        out.add_row(NAMES[row.method], *cells, time_cell, end_section=row is rows[-1])
    for name, values in published.items():
        out.add_row(name, *(values.get(c, "") for c in columns), values.get("ms", ""), style="dim")
    return out
