"""What the command line's tests share."""

from __future__ import annotations

from pathlib import Path

ROW = {
    *("name", "hand", "frames", "fitted", "predicted", "lost", "against"),
    *("pa_mpjpe_mm", "mpjpe_mm", "jitter_m_s3", "acceleration_m_s2"),
}


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}
