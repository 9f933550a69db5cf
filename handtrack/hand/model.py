"""HandModel: a hand's rest skeleton, joint axes, limits and skin, and its kinematics."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from handtrack.errors import ModelError
from handtrack.hand.axes import palm_length
from handtrack.hand.limits import DEFAULT_LIMITS, Limits, preset
from handtrack.hand.rotations import moved
from handtrack.hand.skeleton import (
    ARRIVING,
    HANDS,
    N_ANGLES,
    N_JOINTS,
    N_PARTS,
    PARENTS,
    PART_JOINT,
    PART_PARENT,
    Hand,
)
from handtrack.hand.skinning import Skinning
from handtrack.read_only import read_only

if TYPE_CHECKING:
    from handtrack.kernels.kinematics import Placed

Array = NDArray[np.float64]

# the fingers of a hand at rest are slightly bent
_RELAXED = np.deg2rad([0, 0, 15, 10] + [20, 0, 25, 15] * 4)


@dataclass(frozen=True, eq=False, repr=False)
class HandModel:
    """A hand that 20 angles and a rigid transform bring into any pose.

    The rest pose (all angles zero) is the flat hand, in the root frame: right-handed, in
    metres, the wrist at `rest_joints[0]`. For the hand that ships with the project the
    wrist is the origin, x points to the fingertips and z out of the back of the hand.

    Joint k turns by R_k = exp(n_z phi_z) exp(n_y phi_y) (a saddle, Li et al. 2021 eq. 2) or
    R_k = exp(n_z phi_z) (a hinge, eq. 1); rotations accumulate along the chain (eq. 4, 5),
    so a child rests at t_c = t_k + A_k (p_c - p_k) with A_k = A_parent(k) R_k.
    Flexion (n_z) is positive towards the palm; abduction (n_y) is positive towards the
    thumb's side (for the thumb: away from the index finger), for right and left hands.

    Attributes:
        name: what the model is, for people ("default", "mano", ...).
        hand: "left" or "right".
        rest_joints: (21, 3) [m].
        axes: (20, 3) unit rotation axis of each angle at rest, in the root frame.
        limits: limits of the angles.
        rest_vertices: (V, 3) skin at rest [m]; V = 0 for a skeleton without a skin.
        faces: (F, 3) triangles, counter-clockwise from outside.
        weights: (V, 16) skinning weights of the moving parts; rows sum to one.
        thumb_twist: how far the thumb turns about its own first bone for each radian of its
            abduction (the paper's internal rotation R_in, with its constant alpha). 0 by default:
            with bone lengths alone from a sequence, 0.5 to 1 takes 3 to 5 % off real thumbs'
            errors (median of ten); with joint axes calibrated too it takes off nothing.
        licensed: the skin comes from files that may not be passed on.
        shape: (S,) coefficients that made this hand in its source's own shape space (MANO's
            betas), none where it has no such space or the hand was changed since.
        pose_blend: (V, 3, 135) how far each vertex moves at rest for each entry of R_k - I, row
            by row, of parts 1..15 (pose blend shapes, Romero et al. 2017) [m]; None without.
        landmark_offsets: (21, 3) from each joint to the landmark that a detector gives for it, at
            rest, in the root frame [m]; a landmark moves with the bone that arrives at its joint.
            Zeros by default.

    Raises:
        ModelError: shapes do not fit, values are not finite, a bone has no length, an axis
            is not of unit length, or weights do not sum to one.
    """

    name: str
    hand: Hand
    rest_joints: Array
    axes: Array
    limits: Limits
    rest_vertices: Array
    faces: NDArray[np.int32]
    weights: Array
    thumb_twist: float = 0.0
    licensed: bool = False
    shape: Array = field(default_factory=lambda: np.zeros(0))
    pose_blend: Array | None = None
    landmark_offsets: Array = field(default_factory=lambda: np.zeros((N_JOINTS, 3)))

    def __post_init__(self) -> None:
        if self.hand not in HANDS:
            raise ModelError(f"model {self.name}: hand is {self.hand!r}, expected left or right")
        n = len(self.rest_vertices)
        expected = {
            "rest_joints": (N_JOINTS, 3),
            "axes": (N_ANGLES, 3),
            "rest_vertices": (n, 3),
            "faces": (len(self.faces), 3),
            "weights": (n, N_PARTS),
            "shape": (np.size(self.shape),),
            "landmark_offsets": (N_JOINTS, 3),
        }
        if self.pose_blend is not None:
            expected["pose_blend"] = (n, 3, 9 * (N_PARTS - 1))
        for name, shape in expected.items():
            dtype = np.int32 if name == "faces" else np.float64
            value = np.array(getattr(self, name), dtype=dtype, order="C")
            if value.shape != shape:
                raise ModelError(
                    f"model {self.name}: {name} has shape {value.shape}, expected {shape}"
                )
            if not np.isfinite(value).all():
                raise ModelError(f"model {self.name}: {name} holds values that are not finite")
            value.flags.writeable = False
            object.__setattr__(self, name, value)
        short = np.flatnonzero(self.bone_lengths < 1e-6)
        if short.size:
            raise ModelError(f"model {self.name}: the bone to joint {short[0] + 1} has no length")
        if np.abs(np.linalg.norm(self.axes, axis=1) - 1).max() > 1e-6:
            raise ModelError(f"model {self.name}: axes must be of unit length")
        if not np.isfinite(self.thumb_twist):
            raise ModelError(f"model {self.name}: thumb_twist must be finite")
        if n and np.abs(self.weights.sum(1) - 1).max() > 1e-4:
            raise ModelError(f"model {self.name}: skinning weights must sum to one per vertex")
        if len(self.faces) and not 0 <= self.faces.min() <= self.faces.max() < n:
            raise ModelError(f"model {self.name}: faces name vertices that do not exist")

    def __repr__(self) -> str:
        skin, palm = len(self.rest_vertices), 1e3 * self.size
        said = f"{self.name!r}, {self.hand} hand, palm {palm:.1f} mm, {self.limits.name} limits"
        return f"<HandModel {said}, skin of {skin:,} vertices>"

    @staticmethod
    def default(
        hand: Hand = "right", limits: str = DEFAULT_LIMITS, shape: ArrayLike | None = None
    ) -> HandModel:
        """The free hand that ships with the project.

        Args:
            hand: "left" or "right".
            limits: name of the limits.
            shape: coefficients of `handtrack.hand.default.SHAPES` (size, finger length, palm
                width, thickness) in standard deviations; the mean hand by default.

        Raises:
            SettingsError: a setting has no such value.
        """
        from handtrack.hand.default import default_hand

        return default_hand(hand, preset(limits), shape)

    @staticmethod
    def from_mano(
        path: str | Path,
        hand: Hand | None = None,
        *,
        betas: ArrayLike | None = None,
        tips: str = "smplx",
        limits: str = DEFAULT_LIMITS,
    ) -> HandModel:
        """A hand from the user's MANO files: `MANO.load(...).model(...)`, which see.

        All angles zero is MANO's flat hand, the zero pose of flat_hand_mean=True.

        Args:
            path: MANO_RIGHT.pkl, MANO_LEFT.pkl, an .npz conversion, or a folder that has them.
            hand: "left" or "right"; needed where neither path nor file name says.
            betas: (10,) shape coefficients, or fewer; the mean hand by default.
            tips: whose vertices are the fingertips: "manopth", "smplx", "freihand" or
                "minimal-hand".
            limits: name of the limits.

        Raises:
            InputError: the file is not there, or is no MANO file.
            SettingsError: a setting has no such value.
        """
        from handtrack.hand.mano import MANO

        return MANO.load(path, hand, tips=tips).model(betas, limits)

    @staticmethod
    def from_gltf(
        path: str | Path,
        hand: Hand | None = None,
        *,
        limits: str = DEFAULT_LIMITS,
        licensed: bool = True,
    ) -> HandModel:
        """A skinned hand of a glTF 2.0 file on the 25 joints of WebXR, as browsers show.

        The pose that the file shows becomes the rest pose, all angles zero. The four
        metacarpals of index to little finger are part of the palm.

        Args:
            path: .glb or .gltf, or a folder with left.glb and right.glb.
            hand: "left" or "right"; by default as the file's name, or else its joints, say.
            limits: name of the limits.
            licensed: whether recordings leave the skin out. True unless you know better.

        Raises:
            InputError: the file is not there, is no glTF, has no skin or not those joints, or
                shows the other hand.
            SettingsError: a setting has no such value.
        """
        from handtrack.hand.gltf import gltf_hand

        return gltf_hand(path, hand, preset(limits), licensed)

    @property
    def bone_lengths(self) -> Array:
        """(20,) lengths of the bones to joints 1..20 [m]."""
        return np.asarray(
            np.linalg.norm(self.rest_joints[1:] - self.rest_joints[PARENTS[1:]], axis=1)
        )

    @property
    def size(self) -> float:
        """Mean distance from the wrist to the four finger bases [m], the palm's length."""
        return palm_length(self.rest_joints)

    @cached_property
    def mean_angles(self) -> Array:
        """(20,) a relaxed hand inside the limits [rad], where a fit without a start begins."""
        return read_only(self.limits.clamp(_RELAXED))

    def with_limits(self, limits: Limits | str) -> HandModel:
        """The same hand under other limits, given or named."""
        return replace(self, limits=preset(limits) if isinstance(limits, str) else limits)

    def scaled(self, factor: float) -> HandModel:
        """The same hand, `factor` times as large."""
        return replace(
            self,
            rest_joints=self.rest_joints * factor,
            rest_vertices=self.rest_vertices * factor,
            pose_blend=None if self.pose_blend is None else self.pose_blend * factor,
            landmark_offsets=self.landmark_offsets * factor,
            shape=np.zeros(0),
        )

    def rotations(self, angles: ArrayLike) -> Array:
        """Accumulated rotations A_k of the 16 moving parts, (..., 16, 3, 3), root frame.

        Args:
            angles: (..., 20) [rad].
        """
        return self._placed(angles).parts

    def _placed(self, angles: ArrayLike) -> Placed:
        from handtrack.kernels.kinematics import place_poses

        angles = np.asarray(angles, dtype=np.float64)
        if angles.shape[-1:] != (N_ANGLES,):
            raise ModelError(f"angles have shape {angles.shape}, expected (..., 20)")
        return place_poses(self.rest_joints, self.axes, self.thumb_twist, angles)

    @staticmethod
    def local_rotations(rotations: Array) -> Array:
        """R_k of parts 1..15, each against its parent, (..., 15, 3, 3), root frame.

        Args:
            rotations: (..., 16, 3, 3) accumulated, of `rotations`.
        """
        parents = rotations[..., PART_PARENT[1:], :, :]
        return np.asarray(parents.swapaxes(-1, -2) @ rotations[..., 1:, :, :])

    def parts(self, angles: ArrayLike) -> tuple[Array, Array]:
        """Where the 16 moving parts are, in the root frame.

        Args:
            angles: (..., 20) [rad].

        Returns:
            rotations (..., 16, 3, 3) and positions (..., 16, 3) of the parts' joints [m].
        """
        placed = self._placed(angles)
        return placed.parts, placed.joints[..., PART_JOINT, :]

    def joints(
        self, angles: ArrayLike, rotation: ArrayLike | None = None, translation: ArrayLike = 0.0
    ) -> Array:
        """Joint positions of poses (forward kinematics, Li et al. 2021 eq. 4 and 5).

        Args:
            angles: (..., 20) [rad].
            rotation: (..., 3, 3) from the root frame to the world; identity by default.
            translation: (..., 3) of the root frame's origin in the world [m].

        Returns:
            (..., 21, 3) [m], world frame.
        """
        return moved(self._placed(angles).joints, rotation, translation)

    @property
    def has_landmarks(self) -> bool:
        """Whether landmarks lie elsewhere than joints."""
        return bool(self.landmark_offsets.any())

    def landmarks(
        self, angles: ArrayLike, rotation: ArrayLike | None = None, translation: ArrayLike = 0.0
    ) -> Array:
        """Where a detector sees the joints of poses: `joints` and their `landmark_offsets`.

        Args, frames and result as of `joints`.
        """
        placed = self._placed(angles)
        turn = placed.parts[..., ARRIVING, :, :]
        points = placed.joints + (turn @ self.landmark_offsets[:, :, None])[..., 0]
        return moved(points, rotation, translation)

    def landmarks_from_joints(self, angles: ArrayLike, rotation: ArrayLike) -> Array:
        """(..., 21, 3) from each joint of poses to its landmark, in the world [m]; as `joints`."""
        angles = np.asarray(angles, dtype=np.float64)
        if not self.has_landmarks:
            return np.zeros((*angles.shape[:-1], N_JOINTS, 3))
        turn = np.asarray(rotation)[..., None, :, :] @ self.rotations(angles)[..., ARRIVING, :, :]
        return np.asarray((turn @ self.landmark_offsets[:, :, None])[..., 0])

    def vertices(
        self, angles: ArrayLike, rotation: ArrayLike | None = None, translation: ArrayLike = 0.0
    ) -> Array:
        """Skin vertices of poses by linear-blend skinning, with pose blend shapes if it has any.

        Args and frames as `joints`; one call does all poses.

        Returns:
            (..., V, 3) [m], world frame.

        Raises:
            ModelError: the model has no skin.
        """
        if not len(self.rest_vertices):
            raise ModelError(f"model {self.name} has no skin")
        rotations, positions = self.parts(angles)
        local = None if self.pose_blend is None else self.local_rotations(rotations)
        offsets = positions - np.einsum("...pij,pj->...pi", rotations, self.rest_joints[PART_JOINT])
        if rotation is not None:
            rotations = np.asarray(rotation, dtype=np.float64)[..., None, :, :] @ rotations
        return self._skinning(rotations, moved(offsets, rotation, translation), local)

    @cached_property
    def _skinning(self) -> Skinning:
        return Skinning(self.rest_vertices, self.weights, self.pose_blend)
