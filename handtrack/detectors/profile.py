"""Detector profiles: where a detector's landmarks lie about the joints, and how it errs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.hand.bone_frames import rest_frames
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import N_JOINTS

Array = NDArray[np.float64]

ONE_CAMERA, IN_SPACE = "one camera", "in space"
INPUTS = (ONE_CAMERA, IN_SPACE)
"""What joints a profile is of: one camera's, about the hand's middle and of its own size in each
frame; or in space, triangulated or a 3D detector's."""


@dataclass(frozen=True, eq=False)
class Noise:
    """How landmarks err about where the offsets expect them.

    Each coordinate's error is a sum of three: one that lasts the whole sequence (the subject's own
    offset), one that fades (an AR(1) process whose correlation is exp(-dt / `fades_s`)), and one
    that is new in every frame.

    Attributes:
        constant, fading, white: (21,) standard deviations per coordinate, root mean square over
            directions [m].
        fades_s: time after which the fading error is correlated by 1/e [s].
        bone: (21, 3) what the deviation is along the bone, towards the thumb's side and along
            their normal, over its root mean square.
        view: deviation along the viewing direction over that across it; 1 where there is no one
            direction.
        finger: correlation of the errors of neighbouring joints of a finger.
        outliers: share of landmarks beyond four deviations of the rest.
        scale: deviation of the logarithm of the hand's size from frame to frame in a sequence.
        scale_fades_s: as `fades_s`, of the size [s].
    """

    constant: Array
    fading: Array
    white: Array
    fades_s: float
    bone: Array = field(default_factory=lambda: np.ones((N_JOINTS, 3)))
    view: float = 1.0
    finger: float = 0.0
    outliers: float = 0.0
    scale: float = 0.0
    scale_fades_s: float = 0.5

    def __post_init__(self) -> None:
        for name, shape in {
            "constant": (N_JOINTS,),
            "fading": (N_JOINTS,),
            "white": (N_JOINTS,),
            "bone": (N_JOINTS, 3),
            "fades_s": (),
            "view": (),
            "finger": (),
            "outliers": (),
            "scale": (),
            "scale_fades_s": (),
        }.items():
            value = np.array(getattr(self, name), dtype=np.float64)
            if value.shape != shape:
                raise InputError(f"noise.{name} has shape {value.shape}, expected {shape}")
            if not np.isfinite(value).all() or (name != "finger" and (value < 0).any()):
                raise InputError(f"noise.{name} holds a number that is negative or not finite")
            if shape:
                value.flags.writeable = False
            object.__setattr__(self, name, value if shape else float(value))

    @property
    def lasting(self) -> Array:
        """(21,) deviation of all that is not new in every frame [m]."""
        return np.asarray(np.hypot(self.constant, self.fading))

    @property
    def total(self) -> Array:
        """(21,) deviation of a landmark [m]."""
        return np.asarray(np.hypot(self.lasting, self.white))

    def correlation(self, dt_s: float) -> float:
        """Of the fading error after a time [s]."""
        return float(np.exp(-dt_s / self.fades_s)) if self.fades_s > 0 else 0.0


@dataclass(frozen=True, eq=False)
class Profile:
    """A detector's landmarks against joint centres.

    Attributes:
        name: of the profile.
        detector: which program's landmarks.
        input: one of `INPUTS`.
        offsets: (21, 3) from joint centre to landmark, in the frame of the bone that arrives at
            the joint (`bone_frames.rest_frames`: along it, towards the thumb's side, out of the
            back), in palm lengths (`HandModel.size`). For left hands alike.
        noise: what is left.
        evidence: what it was estimated from, and what it gained: plain JSON values by name.
    """

    name: str
    detector: str
    input: str
    offsets: Array
    noise: Noise
    evidence: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.input not in INPUTS:
            raise InputError(f"input is {self.input!r}, expected one of {', '.join(INPUTS)}")
        offsets = np.array(self.offsets, dtype=np.float64)
        if offsets.shape != (N_JOINTS, 3) or not np.isfinite(offsets).all():
            raise InputError(f"offsets have shape {offsets.shape}, expected (21, 3) finite numbers")
        offsets.flags.writeable = False
        object.__setattr__(self, "offsets", offsets)

    def on(self, model: HandModel) -> HandModel:
        """The hand with this detector's landmarks: fits bring those onto the joints observed."""
        frames = rest_frames(model.rest_joints, model.hand)
        moved = np.einsum("jik,jk->ji", frames, self.offsets) * model.size
        return replace(model, landmark_offsets=moved)
