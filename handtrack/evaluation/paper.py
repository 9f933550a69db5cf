"""Numbers that Li et al. 2021 publish, to stand beside ours.

The Visual Computer, doi 10.1007/s00371-021-02250-y. All in mm, mean and standard deviation over
frames or poses.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from handtrack.evaluation.results import Stability

PANOPTIC_SEQUENCE = "171204_pose6"
PANOPTIC_FRAMES = (20701, 20800)


@dataclass(frozen=True)
class Published:
    """A row of the paper.

    Attributes:
        name: the method.
        mean_mm, std_mm: PA-MPJPE over frames.
    """

    name: str
    mean_mm: float
    std_mm: float


PANOPTIC = (
    Published("FrankMocap, as in the paper", 5.3442, 0.5151),
    Published("Li et al. 2021, as in the paper", 5.3302, 0.4320),
)
"""Section on sequences: CMU Panoptic 171204_pose6, frames 20701..20800."""


@dataclass(frozen=True)
class PaperRows:
    """The paper's rows and what must be known to read them beside ours.

    Attributes:
        published: the paper's.
        caution: how ours differ from them.
    """

    published: tuple[Published, ...]
    caution: str

    def to_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "published": [vars(p) for p in self.published],
            "caution": self.caution,
        }


def panoptic_rows(rows: Iterable[Stability]) -> PaperRows | None:
    """The paper's rows for its Panoptic sequence; None if these are other sequences."""
    found = [r for r in rows if PANOPTIC_SEQUENCE in r.name]
    if not found:
        return None
    first, last = PANOPTIC_FRAMES
    caution = "The paper's estimates come from images"
    if found[0].against == "observed":
        caution += "; here the hand is fitted to the annotated joints themselves"
    caution += "."
    numbers = [r.material.frame_index for r in found if r.material is not None]
    if any((n[0], n[-1]) != (first, last) for n in numbers):
        here = f"{numbers[0][0]}:{numbers[0][-1]}"
        caution += f" The paper's frames are {first}:{last}, these are {here}."
    return PaperRows(PANOPTIC, caution)
