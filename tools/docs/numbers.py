"""Measure the sample that ships with the project, for the README's table of numbers.

python -m tools.docs.numbers [OUT.json]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.evaluation.results import Spread

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).resolve().parent / "numbers" / "sample.json"
FILTERS: dict[str, tuple[dict[str, Any], str]] = {
    "fit, frame by frame": ({"filter": "none"}, "–"),
    "fit + `kalman`": ({"filter": "kalman"}, "–"),
    "fit + `fixed-lag`": ({"filter": "fixed-lag"}, "2 frames"),
    "fit + `rts`": ({"filter": "rts"}, "the whole clip"),
}
"""What is measured: settings of track(), and how much later a frame comes out."""


def measure() -> dict[str, Any]:
    """The sample's input and output against its truth, by each filter."""
    (sequence,) = ht.load(ROOT / "recordings" / "sample.npz")
    rows: list[dict[str, Any]] = []
    for what, (settings, later) in FILTERS.items():
        row = ht.stability(ht.track(sequence, **settings)).overall
        if not rows:
            unseen = int((~sequence.present).all(1).sum())
            error, jitter = row.input_pa_mpjpe_mm, row.input_jitter_m_s3
            if error is None or jitter is None:
                raise HandtrackError("the sample has no truth to measure its joints against")
            rows.append(_row("joints as detected", error, jitter, "–", unseen))
        rows.append(_row(what, row.pa_mpjpe_mm, row.jitter_m_s3, later, row.lost))
    return {"made by": "python -m tools.docs.numbers", "rows": rows}


def _row(what: str, error: Spread, jitter: float, later: str, lost: int) -> dict[str, Any]:
    return {
        "what": what,
        "pa_mpjpe_mm": round(error.mean, 4),
        "std_mm": round(error.std, 4),
        "jitter_m_s3": round(jitter, 2),
        "later": later,
        "lost": lost,
    }


def main(arguments: list[str] | None = None) -> None:
    """Measure, and keep the numbers."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("out", type=Path, nargs="?", default=KEPT)
    options = parser.parse_args(arguments)
    options.out.write_text(json.dumps(measure(), indent=1, ensure_ascii=False) + "\n")
    print(options.out)


if __name__ == "__main__":
    main()
