"""What a method is given: one clip's detections in 3D, from one camera or from several."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

import handtrack as ht
from handtrack.cameras.triangulate import triangulate
from handtrack.errors import SettingsError
from tools.bench.rendered.layout import Array, Clip

ONE_CAMERA, TRIANGULATED, GIVEN = "one camera", "triangulated", "3D as given"
LEAST_SEEN = 0.5
"""A clip of which less is seen is left out."""


@dataclass(frozen=True, eq=False)
class Case:
    """One clip through one kind of input.

    Attributes:
        clip: with the truth.
        input: which kind.
        joints: (T, 21, 3) as handtrack has them [m]; of one camera about the hand's middle, of
            several triangulated as today.
        angles: (T, 20) true angles of today's default hand [rad], or None.
        model: the true hand, or None where it is not known.
        remark: what was done to the truth, one line, or "".
        camera: which one, of one camera.
        stored: (T, 21, 3) triangulated by the linear solution of the views within 15 px, as clips
            were made with; None of other inputs.
    """

    clip: Clip
    input: str
    joints: Array
    angles: Array | None
    model: ht.HandModel | None
    remark: str
    camera: int = 0
    stored: Array | None = None

    @property
    def raw(self) -> Array:
        """(T, 21, 3): what estimates are compared with, the same in all versions."""
        return self.joints if self.stored is None else self.stored

    @property
    def sequence(self) -> ht.Sequence:
        """The input as handtrack takes it; without the truth."""
        clip = self.clip
        return ht.Sequence(
            clip.time_ns, self.joints, hand=clip.hand, name=clip.name, subject=clip.subject
        )

    @property
    def centred(self) -> bool:
        """Whether where the hand is in the room is not in the input."""
        return self.input == ONE_CAMERA


def cases(clip: Clip, camera: int = 0) -> list[Case]:
    """The inputs of a clip that are seen in at least half of its frames.

    Args:
        clip: the detections.
        camera: whose world landmarks are taken for one camera's.

    Raises:
        SettingsError: there is no such camera.
    """
    if clip.world is not None and not 0 <= camera < len(clip.world):
        raise SettingsError(f"{clip.name} has {len(clip.world)} cameras, there is no {camera}")
    given: list[tuple[str, Array, Array | None]] = []
    if clip.world is not None:
        seen = clip.seen(camera)[:, None, None]
        given.append((ONE_CAMERA, np.where(seen, clip.world[camera], np.nan), None))
    if clip.joints is not None and clip.cameras and clip.image is not None:
        given.append((TRIANGULATED, _triangulated(clip, clip.image), clip.joints))
    elif clip.joints is not None:
        given.append((TRIANGULATED if clip.cameras else GIVEN, clip.joints, None))
    angles, model, remark = _true_hand(clip)
    return [
        Case(clip, name, joints, angles, model, remark, camera, stored)
        for name, joints, stored in given
        if np.isfinite(joints).all(-1).any(-1).mean() >= LEAST_SEEN
    ]


def _triangulated(clip: Clip, image: Array) -> Array:
    """(T, 21, 3): as handtrack triangulates what the clip's cameras saw of its hand."""
    seen = np.stack([clip.seen(c) for c in range(len(image))])[..., None, None]
    return triangulate(clip.cameras, np.where(seen, image, np.nan))[0]


def _true_hand(clip: Clip) -> tuple[Array | None, ht.HandModel | None, str]:
    """True angles and hand by today's definition of the angles.

    The true hand keeps the axes that it moved about. Where the default hand's axes have changed
    since the clip was made, its true angles are those of today's axes on the clip's true
    skeleton, fitted to the true joints.
    """
    if clip.truth_rest_joints is None or clip.truth_axes is None:
        return None, None, ""
    default = ht.HandModel.default(clip.hand)
    shaped = replace(
        default,
        name="truth",
        rest_joints=clip.truth_rest_joints,
        rest_vertices=np.zeros((0, 3)),
        faces=np.zeros((0, 3), np.int32),
        weights=np.zeros((0, 16)),
        shape=np.zeros(0),
    )
    model = replace(shaped, axes=_unit(clip.truth_axes))
    defined = clip.truth_axes if clip.default_axes is None else clip.default_axes
    if np.allclose(defined, default.axes, atol=1e-4):
        return clip.truth_angles, model, ""
    fits = [ht.fit(shaped, joints) for joints in clip.truth_joints]
    left = np.array([fit.joints for fit in fits]) - clip.truth_joints
    off = 1e3 * float(np.linalg.norm(left, axis=-1).mean())
    remark = f"true angles fitted anew: the default hand's axes have changed ({off:.2f} mm left)"
    return np.array([fit.angles for fit in fits]), model, remark


def _unit(axes: Array) -> Array:
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))
