"""Real motion under the errors of a detector that nothing is known of: do defaults bring it nearer?

    python -m tools.bench.real_motion_study [--half hold] [--kinds 3] [--data ../shared/data]

The truth is what recordings say (Leap Motion, BVH) or, where they are a camera's, what `track` with
rts makes of them: steady, and on a hand. `tools.bench.laid_over` lays errors over it. Ratios to
these joints of PA-MPJPE, joints that are seen, with the share of clips that are nearer: the
Savitzky-Golay window that suits the truth best, `track` without options and its filters; and the
angles' error of each against the truth's own fit [degrees]. Recordings of the one half were looked
at when defaults were chosen ("tune"), those of the other ("hold") were not.
"""

from __future__ import annotations

import argparse
import json
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import handtrack as ht
from handtrack.evaluation.metrics import pa_mpjpe
from tools.bench.laid_over import KINDS
from tools.bench.oracles import nearer, savgols

Array = NDArray[np.float64]

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
FRAMES = 300
WINDOWS = (3, 5, 7, 9, 11, 15, 19, 25, 31)
LABELLED, TRACKED = "as labelled", "as tracked"
SOURCES: dict[str, tuple[tuple[str, str, str], ...]] = {
    "tune": (
        ("leap", "grab", LABELLED),
        ("leap", "wave", LABELLED),
        ("dex/joints.npz", "joints", TRACKED),
        ("mediapipe_samples", "gesture_recognizer_joints", TRACKED),
        ("formats/bvh/mixamo.bvh", "mixamo left", LABELLED),
        ("ego_mcap", "hand_keypoints_3d left", TRACKED),
    ),
    "hold": (
        ("leap", "three-claps left", LABELLED),
        ("leap", "three-claps right", LABELLED),
        ("stereo/joints.npz", "joints", TRACKED),
        ("mediapipe_samples", "hand_landmarker_joints", TRACKED),
        ("formats/bvh/mixamo.bvh", "mixamo right", LABELLED),
        ("ego_mcap", "hand_keypoints_3d right", TRACKED),
    ),
}
"""Of each half: path, the recording's name there, and what of it is the truth."""
FILTERS = {"`track`": "none", "kalman": "kalman", "fixed-lag": "fixed-lag", "rts": "rts"}


@dataclass(frozen=True, eq=False)
class Clip:
    """True joints, and the angles that fit them."""

    sequence: ht.Sequence
    angles: Array


def clips_of(data: Path, half: str) -> list[Clip]:
    """The clips of a half, of no more than `FRAMES` frames; two of a long recording."""
    out = []
    for path, name, truth in SOURCES[half]:
        (whole,) = [s for s in ht.load(data / path) if s.name == name]
        for start in range(0, min(len(whole.time_ns), 2 * FRAMES), FRAMES):
            part = slice(start, start + FRAMES)
            if len(whole.time_ns[part]) < 60:
                continue
            s = ht.Sequence(
                whole.time_ns[part], whole.joints[part], hand=whole.hand, name=f"{name} {start}"
            )
            track = ht.track(s, filter="rts", detector="none")
            if truth == TRACKED:
                s = ht.Sequence(s.time_ns, track.filtered_joints, hand=s.hand, name=s.name)
            out.append(Clip(s, track.angles))
    return out


def ratios(clip: Clip, kind: str) -> tuple[dict[str, float], dict[str, float]]:
    """PA-MPJPE of each method over that of the joints as seen, `raw` in mm; and the angles' errors
    [degrees]."""
    truth, time_ns = clip.sequence.joints, clip.sequence.time_ns
    fps = 1e9 / float(np.median(np.diff(time_ns)))
    rng = np.random.default_rng(zlib.crc32(f"{clip.sequence.name}{kind}".encode()))
    joints = KINDS[kind](truth, fps, rng)
    seen = np.isfinite(joints)

    def error(found: Array) -> float:
        return 1e3 * float(np.nanmean(pa_mpjpe(np.where(seen, found, np.nan), truth)))

    raw = error(joints)
    found = {"best window": min(error(one.joints) for one in savgols(joints, WINDOWS)) / raw}
    angles = {}
    sequence = ht.Sequence(time_ns, joints, hand=clip.sequence.hand)
    hand = ht.track(sequence).model
    for name, how in FILTERS.items():
        track = ht.track(sequence, model=hand, calibrate=False, filter=how)
        found[name] = error(track.filtered_joints) / raw
        angles[name] = float(np.rad2deg(np.nanmean(np.abs(track.angles - clip.angles))))
    return found | {"raw": raw}, angles


def study(clips: list[Clip], kinds: list[str], half: str) -> dict[str, Any]:
    """A table as the site's pages show it: a row for each kind of error."""
    names = ["best window", *FILTERS]
    rows = []
    for kind in kinds:
        found, turned = zip(*[ratios(clip, kind) for clip in clips], strict=True)
        cells = [kind, f"{np.mean([one['raw'] for one in found]):.1f}"]
        for name in names:
            cells.append(nearer([one[name] for one in found]))
        cells += [f"{np.mean([one[name] for one in turned]):.1f}" for name in FILTERS]
        rows.append(cells)
        print(" | ".join(cells), flush=True)
    made_by = f"python -m tools.bench.real_motion_study --half {half}, {len(clips)} clips"
    head = ["laid over", "raw [mm]", *names, *(f"angles, {name} [deg]" for name in FILTERS)]
    return {"made by": made_by, "head": head, "rows": rows}


def main(arguments: list[str] | None = None) -> None:
    """Measure, say and write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--data", type=Path, default=DATA, help="where the recordings are")
    parser.add_argument("--half", choices=list(SOURCES), default="hold", help="of the recordings")
    parser.add_argument("--kinds", nargs="+", type=int, help="numbers of kinds, from 0")
    parser.add_argument("--json", type=Path, metavar="OUT")
    options = parser.parse_args(arguments)
    names = list(KINDS)
    kinds = [names[k] for k in options.kinds] if options.kinds else names
    found = study(clips_of(options.data, options.half), kinds, options.half)
    if options.json:
        options.json.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main()
