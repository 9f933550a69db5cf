"""Which constants of a hand a calibration may move, and how far it expects them to move.

The zero of every angle stays the prior's: at rest a bone keeps its direction in the plane that
its joint turns it in, since turning it there would be the same as adding to the angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from handtrack.calibration.chains import AXES, SIZE, Chains
from handtrack.hand.model import HandModel

Array = NDArray[np.float64]

# Standard deviations of people from the prior hand at their size. Bones have 8 to 12 % one by one
# (Buryanov and Kotiuk 2010); the size takes 6.3 of them (Gordon et al. 1989), the length of all
# fingers together 3.7 (Chatzioglou et al. 2024). Of the palm's breadth, 8 %, the size leaves 4.9.
LENGTH = 0.06  # of the bone
FINGERS, BREADTH = 0.037, 0.049
# Of these nobody has told: our own estimates.
BASE = 2.5e-3  # m, each coordinate of a finger's base
CONE = np.deg2rad(3.0)  # of a bone towards the hinge that turns it
AXIS = np.deg2rad(5.0)  # of an axis, against the axis before it in the finger
AXIS_OF_FEW = np.deg2rad(4.0)
SADDLE = np.deg2rad(3.0)  # of a saddle's second axis against its first
DRIFT = 1e-3  # m, a length or base of one clip against the subject's
FEW = 20
"""Frames below which axes are held more tightly."""


@dataclass(frozen=True, eq=False)
class Freedoms:
    """Directions in which the constants may move, and the prior of the moves.

    Attributes:
        basis: (100, n).
        precision: (n, n) [1/unit^2].
        twists, tilts: (5, 4) column of each axis's two moves, -1 where it has none of its own.
    """

    basis: Array
    precision: Array
    twists: NDArray[np.int64]
    tilts: NDArray[np.int64]

    @property
    def n(self) -> int:
        """How many moves."""
        return len(self.precision)


class _Builder:
    def __init__(self) -> None:
        self.columns: list[Array] = []
        self.rows: list[dict[int, float]] = []
        self.blocks: list[tuple[NDArray[np.int64], Array]] = []

    def column(self, finger: int, at: int, values: Array) -> int:
        c = np.zeros(5 * SIZE)
        c[finger * SIZE + at : finger * SIZE + at + len(values)] = values
        self.columns.append(c)
        return len(self.columns) - 1

    def expect(self, deviation: float, column: int, same_as: int = -1) -> None:
        """A move is small, or near another one."""
        row = {column: 1.0 / deviation}
        if same_as >= 0:
            row[same_as] = -1.0 / deviation
        self.rows.append(row)

    def related(self, columns: NDArray[np.int64], covariance: Array) -> None:
        """Moves that go together are small."""
        self.blocks.append((columns, np.asarray(np.linalg.inv(covariance), np.float64)))

    def built(self) -> tuple[Array, Array]:
        basis = np.array(self.columns).reshape(-1, 5 * SIZE).T
        rows = np.zeros((len(self.rows), basis.shape[1]))
        for i, row in enumerate(self.rows):
            for column, value in row.items():
                rows[i, column] = value
        precision = rows.T @ rows
        for columns, inverse in self.blocks:
            precision[np.ix_(columns, columns)] += inverse
        return basis, precision


def shape(chains: Chains) -> tuple[Array, Array]:
    """Moves of bases and bones alone: basis (100, n) and precision (n, n)."""
    build = _Builder()
    _shape(build, chains)
    return build.built()


def freedoms(
    chains: Chains, informed: NDArray[np.bool_] | None = None, few: bool = False
) -> Freedoms:
    """All moves: bases, bone lengths and cones, and the axes that frames inform.

    Args:
        chains: the prior hand.
        informed: (5, 4) which axes may move; an axis that may not keeps its place, and turns
            about the finger with the axis before it. All by default.
        few: there are few frames.
    """
    build = _Builder()
    _shape(build, chains)
    twists = np.full((5, 4), -1)
    tilts = np.full((5, 4), -1)
    axis = AXIS_OF_FEW if few else AXIS
    for f in range(5):
        before = -1
        for a in range(4):
            if informed is not None and not informed[f, a]:
                if before >= 0:
                    build.columns[before][f * SIZE + AXES + 2 * a] = 1.0
                continue
            deviation = min(SADDLE, axis) if a == 1 else axis
            twists[f, a] = build.column(f, AXES + 2 * a, np.ones(1))
            tilts[f, a] = build.column(f, AXES + 2 * a + 1, np.ones(1))
            build.expect(deviation, twists[f, a], before)
            build.expect(deviation, tilts[f, a])
            # the hinges follow the saddle's flexion axis, not its abduction axis
            before = before if a == 1 and before >= 0 else int(twists[f, a])
    basis, precision = build.built()
    return Freedoms(basis, precision, twists, tilts)


def _shape(build: _Builder, chains: Chains) -> None:
    moves = np.zeros((5, 6), np.int64)
    for f in range(5):
        for i in range(3):
            moves[f, i] = build.column(f, 0, np.eye(3)[i])
        for i in range(3):
            bone = chains.bones[f, i]
            length = float(np.linalg.norm(bone))
            along = bone / length
            moves[f, 3 + i] = build.column(f, 3 + 3 * i, along)
            if i > 0:
                hinge = chains.axes[f, i + 1]
                across = hinge - along * (along @ hinge)
                across /= np.linalg.norm(across)
                build.expect(CONE * length, build.column(f, 3 + 3 * i, across))
    build.related(moves.ravel(), people(chains))


def people(chains: Chains) -> Array:
    """(30, 30) covariance of bases (3) and bone lengths (3) of five fingers among people [m^2]."""
    lengths = np.linalg.norm(chains.bones, axis=-1)
    alone = np.concatenate([np.full((5, 3), BASE), LENGTH * lengths], 1)
    fingers, breadth = np.zeros((5, 6)), np.zeros((5, 6))
    fingers[:, 3:] = FINGERS * lengths
    # the root frame's y is across the palm
    breadth[:, 1] = BREADTH * chains.base[:, 1]
    covariance = np.diag(np.square(alone.ravel()))
    for together in (fingers.ravel(), breadth.ravel()):
        covariance += np.outer(together, together)
    return covariance


def by_constants() -> Array:
    """(63, 100) how rest joints move with the constants; axes do not move them."""
    out = np.zeros((5, 4, 3, 5, SIZE))
    for f in range(5):
        for j in range(4):
            for part in range(j + 1):
                out[f, j, :, f, 3 * part : 3 * part + 3] = np.eye(3)
    return np.vstack([np.zeros((3, 5 * SIZE)), out.reshape(60, 5 * SIZE)])


def unknown(model: HandModel) -> Array:
    """(63, 63) covariance of rest joints of a hand of which only the size is known [m^2]."""
    basis, precision = shape(Chains.of(model, np.ones(4), 1.0))
    moves = by_constants() @ basis
    return np.asarray(moves @ np.linalg.inv(precision) @ moves.T)
