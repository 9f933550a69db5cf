"""Tables that `handtrack export` wrote: of their many columns what was observed, and the truth."""

from __future__ import annotations

from handtrack.hand.skeleton import JOINT_NAMES

_ALL = [f"{name}_{axis}_mm" for name in JOINT_NAMES for axis in "xyz"]
OBSERVED, TRUTH = "observed_", "truth_"
_KEPT = ("frame", "time_ns", "hand")


def exported(titles: list[str]) -> tuple[list[str], list[str] | None] | None:
    """The titles of what was observed and of the truth, others left empty; None of another table.

    The second is None where no truth is in it.
    """
    there = set(titles)
    if not there.issuperset(OBSERVED + name for name in _ALL):
        return None
    observed = [_bare(t, OBSERVED) or (t if t in _KEPT else "") for t in titles]
    if not there.issuperset(TRUTH + name for name in _ALL):
        return observed, None
    return observed, [_bare(t, TRUTH) for t in titles]


def _bare(title: str, kind: str) -> str:
    name = title.removeprefix(kind)
    return name if name != title and name in _ALL else ""
