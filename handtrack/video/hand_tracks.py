"""Which detection is which hand: by where the hands were, and by all labels of each together.

Detectors now and then call both hands the same, or take one for the other for some frames.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from handtrack.hand.skeleton import Hand
from handtrack.video.detector import Detection

# a hand seen again within so many pictures, and so many palms away, is the same one
_MEMORY = 15
_REACH = 1.5


@dataclass
class _Track:
    last: Detection
    frame: int
    votes: float = 0.0  # scores of "right" less those of "left"


class HandTracks:
    """Detections of one person linked over time, frame by frame."""

    def __init__(self, linked: bool = True) -> None:
        """Args:
        linked: False for pictures that have nothing to do with each other.
        """
        self._memory = _MEMORY if linked else 0
        self._tracks: list[_Track] = []
        self._frame = 0

    def add(self, found: list[Detection]) -> list[tuple[int, Detection]]:
        """The next frame's detections, each with the number of the track that it belongs to."""
        alive = [
            (i, t) for i, t in enumerate(self._tracks) if self._frame - t.frame <= self._memory
        ]
        pairs = sorted(
            (distance, i, k)
            for i, track in alive
            for k, one in enumerate(found)
            if (distance := _palms_apart(track.last, one)) < _REACH
        )
        of: dict[int, int] = {}
        for _, i, k in pairs:
            if k not in of and i not in of.values():
                of[k] = i
        out = []
        for k, one in enumerate(found):
            if k not in of:
                of[k] = len(self._tracks)
                self._tracks.append(_Track(one, self._frame))
            track = self._tracks[of[k]]
            track.last, track.frame = one, self._frame
            # a score of one half says nothing
            track.votes += (2 * one.score - 1) * (1 if one.hand == "right" else -1)
            out.append((of[k], one))
        self._frame += 1
        return out

    def named(self, row: list[tuple[int, Detection]]) -> dict[Hand, Detection]:
        """A frame's left and right hand, by the votes of their tracks so far."""
        votes = [self._tracks[i].votes for i, _ in row]
        if len(row) < 2:
            rightmost = [(0, votes[0] >= 0)] if row else []
        else:
            # of more than two the surest two; one of them is left and one is right
            a, b = sorted(range(len(row)), key=lambda k: -abs(votes[k]))[:2]
            rightmost = [(a, votes[a] >= votes[b]), (b, votes[a] < votes[b])]
        out: dict[Hand, Detection] = {}
        for k, right in rightmost:
            hand: Hand = "right" if right else "left"
            out[hand] = replace(row[k][1], hand=hand)
        return out


def _palms_apart(a: Detection, b: Detection) -> float:
    palm = max(float(np.linalg.norm(a.image[9] - a.image[0])), 1.0)
    return float(np.linalg.norm(a.image.mean(0) - b.image.mean(0))) / palm
