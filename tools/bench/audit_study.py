"""What an audit finds in clips that no threshold was set on, and what it marks of clean ones.

    python -m tools.bench.audit_study [--half hold] [--json FILE]

Clips are the true joints of the rendered ones (real motion, 120 frames), a made hand's of new
seeds, and recordings of `../shared/data` where they are there. "tune" are those that thresholds may
be set on, "hold" the others. A fault is found where its kind is named and all of its frames are
marked; clean are the same clips without any, with white noise of 0, 0.5, 1 and 1.5 mm.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.auditing.audit import audit
from tools.bench.audit_faults import FAULTS, SLIGHT, Fault, clean, with_joints
from tools.bench.real_motion_study import DATA, clips_of
from tools.bench.rendered.layout import read_folder

RENDERED = Path(__file__).resolve().parents[2] / "tests" / "data" / "rendered"
HALVES = {"tune": ("tune", "learn"), "hold": tuple(f"holdout{n}" for n in ("", *range(2, 7)))}
SEEDS = {"tune": range(20), "hold": range(300, 320)}
NOISE_MM = (0.0, 0.5, 1.0, 1.5)
_LEAST = 90


def clips(half: str, data: Path = DATA) -> list[ht.Sequence]:
    """The clean clips of a half: whole hands, with a little noise."""
    found = [
        ht.Sequence(c.time_ns, c.truth_joints, hand=c.hand, name=c.name)
        for folder in HALVES[half]
        for c in read_folder(RENDERED / folder)
    ]
    if data.is_dir():
        found += [clip.sequence for clip in clips_of(data, half)]
    whole = [s for s in found if len(s) >= _LEAST and np.isfinite(s.joints).all()]
    whole += [clean(seed, 0.0) for seed in SEEDS[half]]
    return [_noisy(s, i) for i, s in enumerate(whole)]


def _noisy(s: ht.Sequence, number: int) -> ht.Sequence:
    rng = np.random.default_rng(7000 + number)
    noise = rng.normal(0, 1e-3 * NOISE_MM[number % len(NOISE_MM)], s.joints.shape)
    return with_joints(s, s.joints + noise)


def caught(s: ht.Sequence, kind: str, fault: Fault, seed: int) -> bool:
    """Whether a fault put into a clip is named and marked where it is."""
    spoilt, frames = fault(s, np.random.default_rng(seed))
    (result,) = audit(spoilt, fit=False)
    finding = next((f for f in result.findings if f.kind == kind), None)
    return finding is not None and bool(finding.marks[frames].any(1).all())


def study(half: str, most: int | None = None) -> dict[str, Any]:
    """The share of each fault that is found, and of clean frames that are marked, by kind."""
    given = clips(half)[:most]
    faults = {kind: (kind, fault) for kind, fault in FAULTS.items()} | SLIGHT
    found = {
        name: [caught(s, kind, fault, 100 + i) for i, s in enumerate(given)]
        for name, (kind, fault) in faults.items()
    }
    marked: dict[str, int] = {}
    alarms, frames = 0, 0
    for s in given:
        (result,) = audit(s, fit=False)
        frames += len(s)
        alarms += int(np.any([f.marks.any(1) for f in result.findings], axis=0).sum())
        for f in result.findings:
            marked[f.kind] = marked.get(f.kind, 0) + f.frames
    return {
        "half": half,
        "clips": len(given),
        "found": {name: int(sum(hits)) for name, hits in found.items()},
        "found_by_noise": {
            name: {
                f"{mm:g}": f"{sum(found[name][k :: len(NOISE_MM)])} of"
                f" {len(found[name][k :: len(NOISE_MM)])}"
                for k, mm in enumerate(NOISE_MM)
            }
            for name in SLIGHT
        },
        "clean_frames": frames,
        "marked": alarms,
        "marked_by_kind": marked,
    }


def main() -> None:
    """Print the shares, or write them as JSON."""
    parser = argparse.ArgumentParser(description=str(__doc__).partition("\n")[0])
    parser.add_argument("--half", choices=tuple(HALVES), default="hold")
    parser.add_argument("--most", type=int, help="of so many clips only")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    result = study(options.half, options.most)
    if options.json is not None:
        options.json.write_text(json.dumps(result, indent=1) + "\n")
    for name, count in result["found"].items():
        by_noise = result["found_by_noise"].get(name, "")
        print(f"{count:4d} of {result['clips']}  {name} {by_noise}".rstrip())
    print(f"marked of clean: {result['marked']} of {result['clean_frames']} frames", end=" ")
    print(result["marked_by_kind"])


if __name__ == "__main__":
    main()
