"""A subject's hand pooled from some clips against a hand for each clip, on the clips not pooled.

    python -m tools.bench.pooled_hands WORK [--clips 240] [--frames 300] [--subjects 6] [--leap DIR]

On a made data set the truth judges: both ways run through `handtrack batch`, and the differences
are told with intervals over subjects, then clips. On recordings of one person (--leap: the other
clips' hand on each clip in turn) only the observed joints can.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

import handtrack as ht
from handtrack.batching.data_set import report
from handtrack.batching.hands import Pooled, file_digest, hand_for
from handtrack.batching.page import TITLES, shown
from handtrack.batching.settings import BatchSettings
from handtrack.batching.two_runs import compare_runs
from handtrack.calibration.explain import explain
from handtrack.tracking.settings import TrackSettings
from tools.make.data_set import Size, write


def made(work: Path, size: Size, filter: str) -> None:
    """The comparison on a made data set."""
    manifest = write(work / "data", size)
    for name, pool in (("own", False), ("pooled", True)):
        settings = BatchSettings(TrackSettings.of(None, {"filter": filter}), pool=pool)
        ht.batch(manifest, work / name, settings=settings, columns=["action"])
    used = {
        source
        for file in (work / "pooled" / "hands").rglob("hand.json")
        for source in json.loads(file.read_text())["calibration"]["sources"]
    }
    for name in ("own", "pooled"):
        table = parquet.read_table(work / name / "clips.parquet")
        keep = pa.array([path not in used for path in table["path"].to_pylist()])
        (work / f"{name}_rest").mkdir(exist_ok=True)
        parquet.write_table(table.filter(keep), work / f"{name}_rest" / "clips.parquet")
    both = compare_runs(
        ("own", "pooled"), (report(str(work / "own_rest")), report(str(work / "pooled_rest")))
    )
    print(f"{filter}: {both.clips} clips not pooled, of {both.subjects} subjects, {len(used)} were")
    for name, (title, unit) in TITLES.items():
        own, pooled = (group.values[name] for group in both.common)
        print(
            f"  {title:14} own {shown(own)} pooled {shown(pooled)} difference"
            f" {shown(both.differences[name])} {unit}"
        )


def leap(folder: Path) -> None:
    """Each clip with the hand of the others."""
    sequences = [s for file in sorted(folder.glob("*.json")) for s in ht.load(file)]
    for sequence in sequences:
        mine = [s for s in sequences if s.hand == sequence.hand and s.source != sequence.source]
        if not mine:
            continue
        model = ht.HandModel.default(sequence.hand)
        hands = {
            "own": ht.calibrate(model, sequence).model,
            "others'": ht.calibrate(model, mine).model,
        }
        with tempfile.TemporaryDirectory() as place:
            data = ht.save_hand(hands["others'"], Path(place) / "hand.json").read_bytes()
            pooled: dict[str, Pooled] = {sequence.hand: Pooled("hand.json", file_digest(data))}
            chosen = hand_for(sequence, BatchSettings(), pooled, place)
        hands[f"batch ({chosen.source})"] = chosen.model
        for name, hand in hands.items():
            track = ht.track(sequence, hand, calibrate="none")
            found = explain(hand, sequence)
            of = ht.stability(track).overall
            print(
                f"  {sequence.name} {sequence.hand}, {name}: PA-MPJPE {of.pa_mpjpe_mm.mean:.2f}"
                f" (std {of.pa_mpjpe_mm.std:.2f}), residual {1e3 * found.fitted.mean:.2f},"
                f" bound {1e3 * found.bound.mean:.2f} mm, jitter {of.jitter_m_s3:.1f} m/s^3,"
                f" {np.mean(track.status == 'fitted'):.0%} fitted"
            )


def main() -> None:
    """Both."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("work", type=Path)
    parser.add_argument("--clips", type=int, default=240)
    parser.add_argument("--frames", type=int, default=300)
    parser.add_argument("--subjects", type=int, default=6)
    parser.add_argument("--leap", type=Path)
    given = parser.parse_args()
    if given.leap is not None:
        leap(given.leap)
        return
    size = Size(given.clips, given.frames, given.subjects)
    for filter in ("none", "kalman"):
        made(given.work / filter, size, filter)


if __name__ == "__main__":
    main()
