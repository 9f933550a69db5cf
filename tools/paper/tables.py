"""The experiments of Li et al. 2021, on the data they need as soon as you have it.

    python -m tools.paper.tables mano [--mano DIR]         Tables 2 and 3: MANO's registrations
    python -m tools.paper.tables noise [--mano DIR]        Figures 6 and 7: noise of 2 to 20 mm
    python -m tools.paper.tables freihand XYZ DETECTED     Table 4, Figure 9: joints of a detector
    python -m tools.paper.tables panoptic [FOLDER]         the sequence 171204_pose6

Without your MANO the first two use poses of the free hand whose joints also turn about axes that
ours have not (7 degrees, standard deviation), as MANO's registrations do. Without a FOLDER the
last one makes a Panoptic folder from known motion. Real data of which we may pass on nothing:
MANO and FreiHAND from their authors, the sequence from the CMU Panoptic Studio (README).
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from scipy.spatial.transform import Rotation

import handtrack as ht
from handtrack.evaluation import metrics
from handtrack.evaluation.compare import compare
from handtrack.evaluation.report import print_comparison
from handtrack.hand.mano import MANO, MANO_JOINT, mano_axes
from handtrack.hand.mano_file import find_mano
from handtrack.hand.mano_pose import decode
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import vector_to_matrix
from handtrack.hand.skeleton import N_ANGLES
from handtrack.hand.unpickle import plain, unpickle
from tools.paper.fits import METHODS, NAMES, Poses, Row, measure, run, table
from tools.paper.free_pose import free_fit

Array = NDArray[np.float64]

PUBLISHED_MANO = {
    "paper: GDC": ("7.10 (3.01)", "6.18 (2.33)", "7.32 (3.05)", "6.53 (2.50)", "1477"),
    "paper: MLP": ("9.19 (3.89)", "7.55 (3.13)", "12.0 (5.75)", "8.02 (3.11)", "15"),
    "paper: BCD": ("5.35 (1.91)", "4.77 (1.80)", "5.84 (1.96)", "5.24 (1.83)", "34"),
}
_COLUMNS = ("MPJPE", "PA-MPJPE", "MPVPE", "PA-MPVPE", "ms")
PUBLISHED = {name: dict(zip(_COLUMNS, v, strict=True)) for name, v in PUBLISHED_MANO.items()}
SIGMAS_MM = (2.0, 5.0, 10.0, 20.0)
OFF_AXIS = np.deg2rad(7.0)


def free_hands(count: int, limits: str) -> Poses:
    """Poses of the free hand that turn a little about every axis, with its skin."""
    model = HandModel.default(limits=limits)
    rng = np.random.default_rng(1)
    # poses reach as far as the paper's limits; whichever are fitted, the hands are the same
    wide = HandModel.default(limits="li2021").limits
    angles = wide.clamp(rng.uniform(wide.lower, wide.upper, (count, N_ANGLES)))
    local = model.local_rotations(model.rotations(angles))
    local = local @ vector_to_matrix(rng.normal(0, OFF_AXIS, (count, 15, 3)))
    turns = Rotation.random(count, random_state=1).as_matrix()
    hands = free_fit(model, np.zeros((count, 21, 3)), local, turns, rng.normal(0, 0.3, (count, 3)))
    return Poses("free hand, off-axis poses", hands.joints, hands.vertices(model), model)


def mano_hands(folder: Path, count: int, limits: str) -> Poses:
    """The registrations in the user's MANO, as joints and vertices of the mean shape."""
    mano = MANO.load(folder, "right")
    coefficients = _coefficients(find_mano(folder, "right"))[:count]
    values = np.zeros((len(coefficients), 48))
    values[:, :3] = Rotation.random(len(values), random_state=1).as_rotvec()
    values[:, 3:] = mano.hand_pose(coefficients, flat_hand_mean=False)
    joints, vertices = decode(mano, values)
    turn = mano_axes("right")
    order = MANO_JOINT[1:] - 1

    def ours(vectors: Array) -> Array:
        return np.asarray((vectors.reshape(-1, 15, 3) @ turn.T)[:, order].reshape(-1, 45))

    components = ours(mano.hands_mean)[0], ours(mano.hands_components)
    name = f"MANO's {len(joints)} registrations"
    return Poses(name, joints, vertices, mano.model(limits=limits), components)


def _coefficients(path: Path) -> Array:
    """(1554, 45) hands_coeffs of a MANO file."""
    if path.suffix == ".npz":
        with np.load(path, allow_pickle=False) as archive:
            stored: Any = archive["hands_coeffs"]
    else:
        stored = unpickle(path.read_bytes(), path)["hands_coeffs"]
    return np.asarray(plain(stored), dtype=np.float64)


def hands(options: argparse.Namespace) -> Poses:
    """What the first two experiments pose."""
    if options.mano is None:
        return free_hands(options.poses, options.limits)
    return mano_hands(options.mano, options.poses, options.limits)


def tables_2_and_3(options: argparse.Namespace, console: Console) -> list[Row]:
    """Clean joints of poses that no hand of 20 angles makes exactly."""
    poses = hands(options)
    rows = [measure(method, poses) for method in METHODS]
    console.print(table(f"{poses.name}, {options.limits} limits; mm", rows, PUBLISHED))
    return rows


def figures_6_and_7(options: argparse.Namespace, console: Console) -> dict[float, list[Row]]:
    """White noise on every coordinate."""
    poses = hands(options)
    rng = np.random.default_rng(2)
    out: dict[float, list[Row]] = {}
    grid = Table(title=f"{poses.name}, {options.limits} limits: MPJPE to the truth (std), mm")
    grid.add_column("noise")
    for method in METHODS:
        grid.add_column(NAMES[method], justify="right")
    for sigma in SIGMAS_MM:
        seen = poses.joints + rng.normal(0.0, 1e-3 * sigma, poses.joints.shape)
        out[sigma] = [measure(method, poses, seen, timed=False) for method in METHODS]
        cells = ["{:.2f} ({:.2f})".format(*row.values["MPJPE"]) for row in out[sigma]]
        grid.add_row(f"{sigma:g} mm", *cells)
    console.print(grid)
    return out


def table_4(options: argparse.Namespace, console: Console) -> dict[str, dict[str, float]]:
    """Joints that a detector estimated, before and after each fit, against FreiHAND's."""
    if options.xyz is None:
        truth, seen = _detector(options.poses)
    else:
        (of_truth,), (of_seen,) = (
            ht.load(path, hand="right", unit=options.unit if path == options.detected else None)
            for path in (options.xyz, options.detected)
        )
        truth, seen = of_truth.joints, of_seen.joints
        if truth.shape != seen.shape:
            raise SystemExit(
                f"{options.detected}: {len(seen)} frames, {options.xyz} has {len(truth)}"
            )
    model = HandModel.default(limits=options.limits)
    # every picture shows another hand: its size is taken from its own joints
    size = np.linalg.norm(seen[:, [5, 9, 13, 17]] - seen[:, :1], axis=-1).mean(1) / model.size
    scale = size[:, None, None]
    poses = Poses("FreiHAND", truth / scale, None, model)
    results = {"detector": seen}
    for method in ("mlp", "li2021", "exact"):
        results[NAMES[method]] = run(method, poses, seen / scale).joints * scale
    out: dict[str, dict[str, float]] = {}
    grid = Table(title=f"{len(truth)} hands, after alignment")
    for heading in ("", "AUC 0-50 mm", "error, cm", "AUC as given"):
        grid.add_column(heading, justify="right" if heading else "left")
    for name, joints in results.items():
        aligned = metrics.align(joints, truth)
        row = {
            "auc": metrics.auc(aligned, truth),
            "error_cm": 100 * float(np.nanmean(metrics.mpjpe(aligned, truth))),
            "plain_auc": metrics.auc(joints, truth),
        }
        out[name] = row
        grid.add_row(name, *(f"{v:.3f}" for v in row.values()))
    grid.add_row("paper (image to joints to hand)", "0.799", "1.01", "", style="dim")
    console.print(grid)
    return out


def _detector(count: int) -> tuple[Array, Array]:
    """Hands of many sizes, and joints of a detector that errs by about a centimetre."""
    poses = free_hands(count, "li2021")
    rng = np.random.default_rng(3)
    truth = poses.joints * rng.uniform(0.9, 1.1, (count, 1, 1))
    # errors of one hand's joints go together
    common = rng.normal(0, 0.004, (count, 1, 3))
    return truth, truth + common + rng.normal(0, 0.006, truth.shape)


def panoptic(options: argparse.Namespace, console: Console) -> Any:
    """The paper's sequence by its method, and by ours."""
    with tempfile.TemporaryDirectory() as made:
        folder = options.folder
        if folder is None:
            from tools.make import panoptic as make_panoptic

            _, joints = make_panoptic.make(100, 2.0, 1)
            folder = make_panoptic.write(Path(made) / "171204_pose6", joints)
            console.print("No folder given: a Panoptic folder made from known motion.", style="dim")
        first, last = (int(v) for v in options.frames.split(":"))
        sequences = ht.load(folder, hand=options.hand, frames=(first, last))
    settings: dict[str, dict[str, Any]] = {
        "exact": {},
        "li2021": {"calibrate": False, "update": "li2021"},
        "rts": {"filter": "rts"},
    }
    reports = {}
    for name, more in settings.items():
        limits = "li2021" if name == "li2021" else "anatomical"
        tracks = [ht.track(s, HandModel.default(s.hand, limits), **more) for s in sequences]
        reports[name] = ht.stability(tracks)
    comparison = compare(reports)
    print_comparison(comparison, console)
    return comparison


def main(arguments: list[str] | None = None) -> Any:
    """Run one experiment and print its table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(dest="command", required=True)
    for name, count in (("mano", 1554), ("noise", 300), ("freihand", 400)):
        command = commands.add_parser(name)
        command.add_argument("--poses", type=int, default=count, help="at most so many")
        command.add_argument("--limits", default="li2021", help="default: %(default)s")
        if name == "freihand":
            command.add_argument("xyz", nargs="?", type=Path, help="evaluation_xyz.json")
            command.add_argument("detected", nargs="?", type=Path, help="joints, same pictures")
            command.add_argument("--unit", help="of the detected joints, if not said there")
        else:
            command.add_argument("--mano", type=Path, help="your MANO: a file or a folder")
    command = commands.add_parser("panoptic")
    command.add_argument("folder", nargs="?", type=Path)
    command.add_argument("--frames", default="20701:20800")
    command.add_argument("--hand", default="right")
    options = parser.parse_args(arguments)
    if options.command == "freihand" and (options.xyz is None) != (options.detected is None):
        parser.error("give both XYZ and DETECTED, or neither")
    console = Console() if Console().is_terminal else Console(width=150)
    run_one = {
        "mano": tables_2_and_3,
        "noise": figures_6_and_7,
        "freihand": table_4,
        "panoptic": panoptic,
    }
    return run_one[options.command](options, console)


if __name__ == "__main__":
    main()
