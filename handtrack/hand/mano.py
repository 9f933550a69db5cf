"""MANO (Romero, Tzionas and Black 2017), from the user's own files, as hand models.

MANO's licence does not allow its files to be passed on: users get them from its authors.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import InputError, SettingsError
from handtrack.hand.axes import local_axes, palm_frame
from handtrack.hand.limits import DEFAULT_LIMITS, Limits, preset
from handtrack.hand.mano_file import find_mano, hand_named, read_mano
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS, N_PARTS, ORDERS, PART_JOINT, TIPS, Hand
from handtrack.read_only import make_read_only, read_only

Array = NDArray[np.float64]

MANO_JOINT = np.array([ORDERS["mano"][joint] for joint in PART_JOINT])
"""(16,) MANO's joint of each of our moving parts: palm, then thumb to little finger."""

# vertices that each library takes for the fingertips, thumb first: (right, left)
TIP_VERTICES: dict[str, tuple[tuple[int, ...], tuple[int, ...]]] = {
    "manopth": ((745, 317, 444, 556, 673), (745, 317, 445, 556, 673)),
    "smplx": ((744, 320, 443, 554, 671),) * 2,
    "freihand": ((744, 320, 443, 555, 672),) * 2,
    "minimal-hand": ((744, 333, 444, 555, 672),) * 2,
}

# left and right bases differ by twice their x offsets, [m] in sum; equal ones have one sign
_SAME_SIGN = 1.0

_AXES = {
    "right": np.array([[-1.0, 0, 0], [0, 0, 1], [0, 1, 0]]),
    "left": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
}


def mano_axes(hand: Hand) -> Array:
    """(3, 3) rotation from MANO's axes at rest to ours: x to the fingertips, z out of the back.

    In MANO the right hand's fingers point to -x, the left's to x, the backs of both to y.
    """
    return _AXES[hand]


@dataclass(frozen=True, eq=False)
class MANO:
    """MANO's template and bases, in our axes and order, from which it makes hand models.

    Only the axes are ours (`mano_axes`): the origin stays MANO's, so the wrist, about which
    MANO turns a hand, is at `rest_joints[0]` and moves a little with the shape.

    Attributes:
        hand: "left" or "right".
        template: (778, 3) vertices of the mean hand [m].
        shape_basis: (778, 3, S) offset for each unit of a shape coefficient [m].
        pose_blend: (778, 3, 135) pose blend shapes, as in HandModel [m].
        regressor: (21, 778) rest joints from vertices; the tips are single vertices.
        weights: (778, 16) skinning weights of our parts.
        faces: (1538, 3).
        hands_mean: (45,) mean pose, in MANO's order and axes [rad].
        hands_components: (45, 45) principal components of poses, one a row, likewise.
        source: the file.
    """

    hand: Hand
    template: Array
    shape_basis: Array
    pose_blend: Array
    regressor: Array
    weights: Array
    faces: NDArray[np.int32]
    hands_mean: Array
    hands_components: Array
    source: str

    def __post_init__(self) -> None:
        make_read_only(self)

    @staticmethod
    def load(path: str | Path, hand: Hand | None = None, *, tips: str = "smplx") -> MANO:
        """Read a MANO file; nothing that stands in it is run.

        A left hand's file whose shape basis has the signs of the right's, as some have, is put
        right, with a warning; that is seen by MANO_RIGHT in the same folder.

        Args:
            path: a file, or a folder (see `mano_file.find_mano`).
            hand: "left" or "right"; needed where neither path nor file name says.
            tips: whose vertices are the fingertips, a key of `TIP_VERTICES`. They differ by
                2 to 6 mm: take the set that the joints to be fitted were made with.

        Raises:
            InputError: the file is not there, or is no MANO file of that hand.
            SettingsError: unknown hand or set of tips, or no hand named.
        """
        path = Path(path)
        if tips not in TIP_VERTICES:
            raise SettingsError(f"tips {tips!r} are not known, expected {', '.join(TIP_VERTICES)}")
        if hand is None:
            hand = hand_named(path)
        if hand not in HANDS:
            given = "no hand is named" if hand is None else f"hand is {hand!r}"
            raise SettingsError(f"{path}: {given}, expected left or right")
        path = find_mano(path, hand)
        raw = read_mano(path)
        if hand == "left":
            _repair_left(raw, path)
        return _assembled(raw, hand, tips, path)

    @cached_property
    def joint_template(self) -> Array:
        """(21, 3) rest joints of the mean hand [m]."""
        return read_only(np.asarray(self.regressor @ self.template))

    @cached_property
    def joint_basis(self) -> Array:
        """(21, 3, S): rest joints are joint_template + joint_basis @ betas [m]."""
        return read_only(np.einsum("jv,vcs->jcs", self.regressor, self.shape_basis))

    def model(
        self, betas: ArrayLike | None = None, limits: Limits | str = DEFAULT_LIMITS
    ) -> HandModel:
        """The hand of some shape; all angles zero is MANO's flat hand.

        The model's tips move with the last bones alone; the skin there also with the pose
        blend shapes.

        Args:
            betas: (n,) the first n <= S shape coefficients; the mean hand by default.
            limits: of the angles, or their name.

        Raises:
            SettingsError: betas are too many or not finite, or no such limits.
        """
        betas = self._betas(betas)
        joints = self.joint_template + self.joint_basis @ betas
        return HandModel(
            name="mano",
            hand=self.hand,
            rest_joints=joints,
            axes=local_axes(joints, self.hand),
            limits=preset(limits) if isinstance(limits, str) else limits,
            rest_vertices=self.template + self.shape_basis @ betas,
            faces=self.faces,
            weights=self.weights,
            licensed=True,
            shape=betas,
            pose_blend=self.pose_blend,
        )

    def hand_pose(self, coefficients: ArrayLike, *, flat_hand_mean: bool) -> Array:
        """Joint rotations of principal components, as data sets store them.

        Args:
            coefficients: (..., n), n <= 45.
            flat_hand_mean: True if zero coefficients mean the flat hand, False if they mean
                the file's mean pose.

        Returns:
            (..., 45) rotation vectors from the flat hand, MANO's order and axes [rad].
        """
        c = np.asarray(coefficients, dtype=np.float64)
        if not 0 < c.shape[-1] <= 45:
            raise SettingsError(f"coefficients have shape {c.shape}, expected at most 45 a pose")
        pose = c @ self.hands_components[: c.shape[-1]]
        return np.asarray(pose if flat_hand_mean else pose + self.hands_mean)

    def _betas(self, betas: ArrayLike | None) -> Array:
        known = self.shape_basis.shape[-1]
        out = np.zeros(known)
        if betas is not None:
            given = np.asarray(betas, dtype=np.float64)
            if given.ndim != 1 or len(given) > known or not np.isfinite(given).all():
                raise SettingsError(
                    f"betas have shape {given.shape}, expected up to {known} finite numbers"
                )
            out[: len(given)] = given
        return out


def _assembled(raw: dict[str, NDArray[Any]], hand: Hand, tips: str, path: Path) -> MANO:
    """The arrays of a file in our axes and order."""
    turn = mano_axes(hand)
    regressor = np.zeros((21, len(raw["v_template"])))
    regressor[PART_JOINT] = raw["J_regressor"][MANO_JOINT]
    regressor[TIPS, list(TIP_VERTICES[tips][hand == "left"])] = 1.0
    palm = palm_frame(regressor @ raw["v_template"], hand)
    if (palm * turn).sum(1).min() < np.cos(np.deg2rad(45)):
        raise InputError(
            f"does not lie at rest as MANO's {hand} hand does (fingers to"
            f" {'-x' if hand == 'right' else 'x'}, back to y): is it the other hand's?",
            path,
        )
    # R - I in MANO's axes is turn' (R - I) turn in ours
    pose = raw["posedirs"].reshape(-1, 3, N_PARTS - 1, 3, 3)[:, :, MANO_JOINT[1:] - 1]
    pose = np.einsum("ia,vakbc,jb,lc->vikjl", turn, pose, turn, turn, optimize=True)
    return MANO(
        hand=hand,
        template=raw["v_template"] @ turn.T,
        shape_basis=np.einsum("ia,vas->vis", turn, raw["shapedirs"][..., :10]),
        pose_blend=np.ascontiguousarray(pose.reshape(len(pose), 3, -1)),
        regressor=regressor,
        weights=raw["weights"][:, MANO_JOINT],
        faces=raw["f"],
        hands_mean=raw["hands_mean"],
        hands_components=raw["hands_components"],
        source=str(path),
    )


def _repair_left(raw: dict[str, NDArray[Any]], path: Path) -> None:
    """Flip the shape basis of a left hand across the palm where it is the right hand's."""
    other = path.with_name(path.name.replace("LEFT", "RIGHT"))
    if other == path or not other.is_file():
        warnings.warn(
            f"{path}: some left MANO files have a shape basis of wrong sign; without"
            " MANO_RIGHT beside it that cannot be seen",
            stacklevel=3,
        )
        return
    right = read_mano(other)["shapedirs"]
    n = min(right.shape[-1], raw["shapedirs"].shape[-1])
    if np.abs(raw["shapedirs"][:, 0, :n] - right[:, 0, :n]).sum() < _SAME_SIGN:
        raw["shapedirs"][:, 0] *= -1
        warnings.warn(
            f"{path}: its shape basis has the signs of the right hand's along x: turned round",
            stacklevel=3,
        )
