"""The arrays of a Track that a handtrack.State holds, for the writer and for the readers.

To record another array: give it a field in `handtrack.proto`, compile that (see `schema.py`),
and add it here, with the format version that has it first.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class ArrayField(NamedTuple):
    """A field of State that is an array of doubles.

    Attributes:
        number: of the field in the protobuf message.
        name: of the field, and of the attribute of Track and TrackedFrame.
        shape: of one frame.
        since: the format version that has it first.
        before: what readers put in where an older file doesn't have it.
    """

    number: int
    name: str
    shape: tuple[int, ...]
    since: int = 1
    before: float = math.nan

    @property
    def size(self) -> int:
        """Numbers in a frame."""
        return math.prod(self.shape)


ARRAYS = (
    ArrayField(3, "observed", (21, 3)),
    ArrayField(4, "confidence", (21,)),
    ArrayField(5, "truth", (21, 3)),
    ArrayField(6, "angles_raw", (20,)),
    ArrayField(7, "angles", (20,)),
    ArrayField(8, "quaternion_raw", (4,)),
    ArrayField(9, "quaternion", (4,)),
    ArrayField(10, "translation_raw", (3,)),
    ArrayField(11, "translation", (3,)),
    ArrayField(12, "fitted_joints", (21, 3)),
    ArrayField(13, "filtered_joints", (21, 3)),
    ArrayField(14, "angle_variance", (20,)),
    ArrayField(21, "rejected", (21,), since=2, before=0.0),
    ArrayField(22, "restart", (), since=2, before=0.0),
)
"""`truth` is the only one that may be absent from all frames of a hand."""
