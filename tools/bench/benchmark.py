"""Measure handtrack: the fit against other solvers, motions, optima, and the whole tool.

    python -m tools.bench.benchmark [--quick] [--only PART ...] [--limits NAME] [--json OUT]

What is compared runs in one process on the same frames from the same starts, after a warm-up.
Single frames are timed as calls of the compiled loop less an empty call, each frame the best of
several rounds; medians and percentiles are over frames, means the best of several rounds.
Objectives are sums of squared distances (eq. 6) in mm^2.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from handtrack.calibration.calibrate import calibrate
from handtrack.fitting import fit, solver
from handtrack.fitting.fit import fit_batch
from handtrack.fitting.settings import FitSettings
from handtrack.hand.limits import DEFAULT_LIMITS, PRESETS
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.kernels import frame_loop as frames
from handtrack.kernels.workspace import FITTED, NEW
from handtrack.recording.write import write_mcap
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.track import Track
from handtrack.tracking.tracker import Tracker
from handtrack.video.pictured import track
from handtrack.viewer.rerun_log import log_rerun
from tools.bench.noise_study import fitted, noisy_motion, noisy_poses, random_angles
from tools.bench.peers import peers
from tools.bench.starting import start_part
from tools.bench.timed import Array, Rows, each, machine, show
from tools.make.mano_like import make_mano_like, write_pickle

FIT_NOISE_MM = 2.0
MOTION_NOISE_MM = (0.0, 2.0, 5.0, 10.0)
POSE_NOISE_MM = (0.0, 2.0, 5.0, 10.0, 20.0)
GROWTH = (1000, 10_000, 100_000)
ORACLE_STARTS, NEAR = 20, 1e-5
"""Starts of the oracle; how near to its objective counts as the same optimum."""
NOTHING_M2 = 1e-12
"""An objective below this is rounding: a micrometre on one joint."""
PEERS = ("mink", "pymomentum")
"""Solvers of the extra `bench` (pymomentum: Python >= 3.12)."""
OURS, SCIPY = "ours: BCD and Newton, compiled", "scipy trf, box for ellipses"


def compiled(
    program: solver.Program,
    model: HandModel,
    joints: Array,
    start: solver.Results | None,
    rounds: int,
) -> tuple[Array, solver.Results]:
    """Times of frames in the compiled loop [s], without the call into it, and their fits.

    Args:
        start: frame t starts from pose t in here; every frame from the mean pose if left out.
    """
    n = len(joints)
    results = solver.Results(n, full=False)
    hand = solver.constants(model), program.contacts(model)
    given = (*hand, tuple(program.solvers), tuple(program.settings), model.mean_angles)
    keep = solver.start_at(model)
    times = np.empty((2, rounds, n))
    for r in range(rounds):
        for t in range(n):
            for count in (0, 1):
                if start is not None:
                    keep["angles"], keep["root"] = start.angles[t], start.roots[t]
                keep["memory"] = NEW if start is None else FITTED
                targets, out = np.array(joints[t : t + count]), results.rows[t : t + count]
                every = (*given, keep, targets, np.ones((count, 21)), out, results.covariance)
                before = time.perf_counter_ns()
                frames.fit_frames(*every)
                times[count, r, t] = time.perf_counter_ns() - before
    empty, one = times.min(1)
    return 1e-9 * (one - np.median(empty)), results


# ---- parts ----


def scipy_fit(model: HandModel, joints: Array, angles: Array, root: Array) -> tuple[Array, float]:
    """Angles and objective [m^2] by scipy; the box of the limits stands for the ellipses.

    Residuals in mm, so that the default gtol does not end it early; our relative tolerance; the
    26 forward differences of the Jacobian in one vectorised evaluation.
    """
    turn, place, step = root[:9].reshape(3, 3), root[9:], 1e-7
    low, high, free = model.limits.lower, model.limits.upper, np.full(6, np.inf)

    def residuals(x: Array) -> Array:
        rotation = Rotation.from_rotvec(x[..., 20:23]).as_matrix() @ turn
        found = model.joints(x[..., :20], rotation, place + 0.1 * x[..., 23:])
        return np.asarray(1e3 * (found - joints).reshape(*x.shape[:-1], 63))

    def jacobian(x: Array) -> Array:
        # backwards at the upper limits: no angle leaves the box
        h = np.where(x + step > np.concatenate([high, free]), -step, step)
        moved = residuals(np.concatenate([x[None], x + np.diag(h)]))
        return np.asarray((moved[1:] - moved[0]).T / h)

    first = np.concatenate([np.clip(angles, low, high), np.zeros(6)])
    bounds = (np.concatenate([low, -free]), np.concatenate([high, free]))
    found = least_squares(residuals, first, jacobian, bounds, "trf", ftol=FitSettings().tolerance)
    return found.x[:20], 2e-6 * float(found.cost)


def mean_pose(model: HandModel, joints: Array) -> tuple[Array, Array]:
    """The mean pose and the root (12,) that brings it nearest to the joints."""
    rest = model.joints(model.mean_angles)
    middle, goal = rest.mean(0), joints.mean(0)
    rotation = Rotation.align_vectors(joints - goal, rest - middle)[0].as_matrix()
    return model.mean_angles, np.concatenate([rotation.ravel(), goal - rotation @ middle])


def fit_part(quick: bool, limits: str) -> dict[str, Rows]:
    """Solvers side by side on frames of the motion, from the mean pose and the frame before."""
    sequence = noisy_motion(300, FIT_NOISE_MM)
    model = calibrate(HandModel.default(limits=limits), sequence).model
    chosen = np.linspace(1, len(sequence) - 1, 10 if quick else 30).astype(int)
    n, joints = len(chosen), np.array(sequence.joints[chosen])
    before = fitted(solver.Program(), model, np.array(sequence.joints[chosen - 1]), True, full=True)
    programs = {
        OURS: solver.Program(),
        "plain BCD, exact": solver.Program(method="bcd"),
        "plain BCD, exact, to 1e-9": solver.Program(method="bcd", tolerance=1e-9, max_sweeps=10000),
        "li2021 update": solver.Program(update="li2021"),
    }
    others = {f"{name}, box for ellipses": make(model) for name, make in peers().items()}
    rows: Rows = []
    for begin, start in (("mean pose", None), ("frame before", before)):
        found: dict[str, tuple[Array, Array, Array]] = {}
        for name, program in programs.items():
            seconds, fits = compiled(program, model, joints, start, 200 if name == OURS else 5)
            found[name] = seconds, fits.objective, fits.angles
        first = [(model, y, start and start.fit(t)) for t, y in enumerate(joints)]
        found["ours: fit() from Python"] = each(fit.fit, first, 20), *found[OURS][1:]
        poses = [(model, y, *mean_pose(model, y)) for y in joints]
        if start is not None:
            poses = [(model, y, start.angles[t], start.roots[t]) for t, y in enumerate(joints)]
        angles, objective = zip(*(scipy_fit(*pose) for pose in poses), strict=True)
        found[SCIPY] = each(scipy_fit, poses, 3), np.array(objective), np.array(angles)
        for name, peer in others.items():
            cases = [pose[1:] for pose in poses]
            ends = [peer.read(peer.solve(*case), case[2]) for case in cases]
            placed = np.array([model.joints(*end) for end in ends])
            least = np.square(placed - joints).sum((1, 2))
            found[name] = each(peer.solve, cases, 20), least, np.array([end[0] for end in ends])
        us, ours = np.median(found[OURS][0]), found[OURS][1]
        for name, (seconds, least, pose) in found.items():
            row = {"start": begin, "solver": name, "median us": 1e6 * np.median(seconds)}
            row |= {"x ours": np.median(seconds) / us, "objective": 1e6 * least.mean()}
            row |= {"of ours": least.mean() / ours.mean(), "worst frame": (least / ours).max()}
            rows.append(row | {"in limits %": 100 * model.limits.contains(pose, 1e-6).mean()})
    for name in PEERS:
        if f"{name}, box for ellipses" not in others:
            rows.append({"start": "-", "solver": f"{name}: not installed"})
    return {f"{n} frames of the motion, {FIT_NOISE_MM:g} mm noise": rows}


def motion_part(quick: bool, limits: str) -> dict[str, Rows]:
    """Time per frame: a 30 fps motion frame after frame, and unrelated poses."""
    program, default = solver.Program(), HandModel.default(limits=limits)
    rounds, moving, cold = 3 if quick else 7, [], []
    for sigma in MOTION_NOISE_MM:
        sequence = noisy_motion(150 if quick else 900, sigma)
        model, joints = calibrate(default, sequence).model, np.array(sequence.joints)
        fits = fitted(program, model, joints, False)
        us = 1e6 * compiled(program, model, joints[1:], fits, rounds)[0]
        whole = each(fitted, [(program, model, joints, False)], rounds)[0]
        row = {"noise mm": sigma, "median us": np.median(us), "p99 us": np.percentile(us, 99)}
        row |= {"loop, mean us": 1e6 * whole / len(joints)}
        cases = list(zip(joints, sequence.time_ns.tolist(), strict=True))
        us = 1e6 * np.min([each(Tracker(model).step, cases, 1) for _ in range(rounds)], 0)
        row |= {"step() median us": np.median(us), "step() p99 us": np.percentile(us, 99)}
        moving.append({**row, "Newton steps": fits.rows["steps"][1:].mean()})
    for sigma in POSE_NOISE_MM:
        joints = noisy_poses(default, 100 if quick else 400, sigma)
        us = 1e6 * compiled(program, default, joints, None, rounds)[0]
        row = {"noise mm": sigma, "median us": np.median(us), "p99 us": np.percentile(us, 99)}
        call = each(fit.fit, [(default, y) for y in joints], 3)
        row |= {"fit() median us": 1e6 * np.median(call)}
        many = np.tile(joints, (10, 1, 1))
        for k in (1, 2):
            whole = each(partial(fit_batch, threads=k), [(default, many)], rounds)[0]
            row[f"fit_batch {k} thr. us"] = 1e6 * whole / len(many)
        cold.append(row)
    return {"30 fps motion, calibrated hand, warm": moving, "random poses, known hand, cold": cold}


def quality_part(quick: bool, limits: str) -> dict[str, Rows]:
    """How often a cold fit finds what the best of the mean pose and 20 random starts finds."""
    model, rng, rows = HandModel.default(limits=limits), np.random.default_rng(3), []
    n, group, tight = 200 if quick else 2000, 40, solver.Program(tolerance=1e-10)
    for sigma in POSE_NOISE_MM:
        joints = noisy_poses(model, n, sigma)
        ours = fitted(solver.Program(), model, joints, True).objective
        oracle = np.empty((ORACLE_STARTS + 1, n))
        oracle[0] = fitted(tight, model, joints, True).objective
        for part in (slice(i, i + group) for i in range(0, n, group)):
            for i, angles in enumerate(random_angles(model, ORACLE_STARTS, rng)):
                found = fitted(tight, model, joints[part], True, start=angles)
                oracle[i + 1, part] = found.objective
        few = np.minimum(ours, oracle[1:5].min(0))
        above, few = (np.stack([ours, few]) + NOTHING_M2) / (oracle.min(0) + NOTHING_M2) - 1
        row = {"noise mm": sigma, "poses": n, "optimum %": 100 * (above <= NEAR).mean()}
        row |= {"p99.5 above": np.percentile(above, 99.5), "worst above": above.max()}
        row |= {"> 0.1 % above, %": 100 * (above > 1e-3).mean()}
        rows.append({**row, "best of 5 starts: optimum %": 100 * (few <= NEAR).mean()})
    return {f"against the best of {ORACLE_STARTS} random starts and the mean pose": rows}


def tool_part(quick: bool, limits: str) -> dict[str, Rows]:
    """Track, MCAP, Rerun; memory as the number of frames grows."""
    model, n = HandModel.default(limits=limits), 300 if quick else 1000
    sequence, rows = noisy_motion(n, FIT_NOISE_MM), []
    tracked = track(sequence, model, filter="kalman")
    with tempfile.TemporaryDirectory() as folder:
        mcap, rrd = Path(folder) / "track.mcap", Path(folder) / "track.rrd"
        follow = partial(track, sequence, model, calibrate=False)
        whole: dict[str, tuple[Callable[[], Any], Path | None]] = {
            "calibrate, once": (partial(calibrate, model, sequence), None),
            "track, no filter": (follow, None),
            "track, kalman": (partial(follow, filter="kalman"), None),
            "skin, default hand": (partial(skin, model, tracked), None),
            "skin, blend shapes": (partial(skin, mano_like(Path(folder)), tracked), None),
            "write_mcap, no mesh": (partial(write_mcap, tracked, mcap, mesh=False), mcap),
            "write_mcap, mesh": (partial(write_mcap, tracked, mcap), mcap),
            "log_rerun, no mesh": (partial(log_rerun, tracked, save=rrd, mesh=False), rrd),
            "log_rerun, mesh": (partial(log_rerun, tracked, save=rrd), rrd),
        }
        for name, (work, path) in whole.items():
            us = 1e6 * each(work, [()], 3 if quick else 4)[0] / n
            row = {"what": name, "us/frame": us, "frames/s": 1e6 / us}
            rows.append(row | ({"kB/frame": 1e-3 * path.stat().st_size / n} if path else {}))
    grown = []
    for what in ("step", "track"):
        for count in GROWTH[:2] if quick else GROWTH:
            command = [
                sys.executable,
                "-m",
                "tools.bench.benchmark",
                "--child",
                what,
                str(count),
                "--limits",
                limits,
            ]
            said = subprocess.run(command, check=True, capture_output=True, text=True).stdout
            grown.append({"what": what, "frames": count, **json.loads(said)})
    return {f"the whole tool, {n} frames": rows, "memory, one process each": grown}


def skin(model: HandModel, tracked: Track) -> None:
    """The skin of every frame, 64 at a time as the recorders ask for it."""
    turns = quaternion_to_matrix(tracked.quaternion)
    for start in range(0, len(tracked), 64):
        rows = slice(start, start + 64)
        model.vertices(tracked.angles[rows], turns[rows], tracked.translation[rows])


def mano_like(folder: Path) -> HandModel:
    """A free stand-in for MANO: 778 vertices, 135 pose blend shapes."""
    with (folder / "MANO_RIGHT.pkl").open("wb") as file:
        write_pickle(make_mano_like("right"), file)
    return HandModel.from_mano(folder, "right")


def child(what: str, count: int, limits: str) -> dict[str, float]:
    """Memory [MB] before and after `count` frames of Tracker.step or track, and time a frame."""
    clip, model = noisy_motion(300, FIT_NOISE_MM), HandModel.default(limits=limits)
    stamps = np.arange(count + 1000) * 33_333_333
    tracker = Tracker(model)
    for t in range(1000):
        tracker.step(clip.joints[t % 300], int(stamps[t]))
    joints = np.resize(clip.joints, (count, 21, 3)) if what == "track" else clip.joints
    before, start = _memory_mb("VmRSS"), time.perf_counter()
    if what == "track":
        track(Sequence(stamps[:count], joints), model, calibrate=False)
    else:
        for t in range(1000, count + 1000):
            tracker.step(joints[t % 300], int(stamps[t]))
    us, after = 1e6 * (time.perf_counter() - start) / count, _memory_mb("VmRSS")
    return {"before MB": before, "after MB": after, "peak MB": _memory_mb("VmHWM"), "us/frame": us}


def _memory_mb(field: str) -> float:
    # from Linux itself: getrusage's peak would hold that of the parent
    lines = Path("/proc/self/status").read_text().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith(field))) / 1024


# ---- reports ----

PARTS = {
    "start": start_part,
    "fit": fit_part,
    "motion": motion_part,
    "quality": quality_part,
    "tool": tool_part,
}


def main(arguments: list[str] | None = None) -> None:
    """Run the parts that are asked for, and print what was measured."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="fewer frames and rounds")
    parser.add_argument("--only", action="append", choices=list(PARTS), help="may be repeated")
    parser.add_argument("--limits", choices=sorted(PRESETS), default=DEFAULT_LIMITS)
    parser.add_argument("--json", type=Path, metavar="OUT", help="write all numbers")
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.child:
        print(json.dumps(child(options.child[0], int(options.child[1]), options.limits)))
        return
    console, head = Console(width=None if sys.stdout.isatty() else 130), machine()
    console.print(f"{head['cpu']}, {head['cores']} cores, load {head['load']}, {options.limits}")
    console.print(", ".join(f"{name} {number}" for name, number in head["versions"].items()))
    fit.warm_up()
    parts = {}
    for name in options.only or PARTS:
        parts[name] = PARTS[name](options.quick, options.limits)
        for title, rows in parts[name].items():
            show(console, title, rows)
    if options.json:
        document = {"machine": head, "quick": options.quick, "limits": options.limits, **parts}
        options.json.write_text(json.dumps(document, indent=1, default=float) + "\n")


if __name__ == "__main__":
    main()
