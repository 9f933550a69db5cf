"""An unknown detector without bias whose noise lasts: do the defaults come nearer to the truth?

    python -m tools.bench.lasting_study [CLIPS] [--every 6] [--json OUT]

Joints of the rendered clips' truth get noise that fades over a given time, shared along each
finger, and white noise on top; a detector that nothing is known of. Ratios to the noisy joints of
PA-MPJPE: the Savitzky-Golay window that suits the truth best, `track` as it is called without
options, and its smoothers.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.evaluation.metrics import pa_mpjpe
from tools.bench.laid_over import lasting
from tools.bench.oracles import nearer, savgols
from tools.bench.rendered.layout import Clip, read_folder

Array = NDArray[np.float64]

CLIPS = Path(__file__).parents[2] / "tests" / "data" / "rendered" / "tune"
KINDS = ((0.1, 4.0, 1.0), (0.4, 4.0, 1.0), (1.5, 4.0, 1.0), (0.4, 4.0, 0.3), (0.15, 7.0, 2.0))
"""How long noise lasts [s], its deviation, and that of white noise [mm per coordinate]."""
WINDOWS = (3, 5, 7, 9, 11, 15, 19, 25)
METHODS: dict[str, dict[str, Any]] = {
    "`track` without options": {},
    "`fixed-lag`": {"filter": "fixed-lag"},
    "`rts`": {"filter": "rts"},
}


def noisy(
    truth: Array, fps: float, kind: tuple[float, float, float], rng: np.random.Generator
) -> Array:
    """The joints (T, 21, 3) [m] as a detector of that kind sees them."""
    lasts_s, deviation_mm, white_mm = kind
    return lasting(truth, fps, rng, lasts_s=lasts_s, deviation_mm=deviation_mm, white_mm=white_mm)


def ratios(clip: Clip, kind: tuple[float, float, float], seed: int) -> dict[str, float]:
    """PA-MPJPE of each method over that of the noisy joints."""
    keep = np.isfinite(clip.truth_joints).all((1, 2))
    truth, time_ns = clip.truth_joints[keep], clip.time_ns[keep]
    fps = 1e9 / float(np.median(np.diff(time_ns)))
    joints = noisy(truth, fps, kind, np.random.default_rng(seed))

    def error(found: Array) -> float:
        return float(np.nanmean(pa_mpjpe(found, truth)))

    found = {"best window": min(error(one.joints) for one in savgols(joints, WINDOWS))}
    sequence = ht.Sequence(time_ns, joints, hand=clip.hand)
    for name, settings in METHODS.items():
        found[name] = error(ht.track(sequence, **settings).filtered_joints)
    raw = error(joints)
    return {name: value / raw for name, value in found.items()}


def study(clips: list[Clip]) -> dict[str, Any]:
    """A table as the site's pages show it: a row for each kind of noise."""
    names = ["best window", *METHODS]
    rows = []
    for kind in KINDS:
        found = [ratios(clip, kind, seed) for seed, clip in enumerate(clips)]
        cells = [f"{kind[0]:g} s, {kind[1]:g} mm, white {kind[2]:g} mm"]
        for name in names:
            cells.append(nearer([one[name] for one in found]))
        rows.append(cells)
        print(" | ".join(cells), flush=True)
    made_by = f"python -m tools.bench.lasting_study, {len(clips)} clips"
    return {"made by": made_by, "head": ["noise lasts", *names], "rows": rows}


def main(arguments: list[str] | None = None) -> None:
    """Measure, say and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("clips", type=Path, nargs="?", default=CLIPS)
    parser.add_argument("--every", type=int, default=6, help="one clip of so many")
    parser.add_argument("--json", type=Path, metavar="OUT")
    options = parser.parse_args(arguments)
    found = study(read_folder(options.clips)[:: options.every])
    if options.json:
        options.json.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
