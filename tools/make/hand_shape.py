"""The shape of the default hand's skin: an implicit surface made of anatomical primitives.

The surface is the zero set of a field that is negative inside and near it about the distance
[mm]. Each finger is one tube along its straight rest axis; the palm is the smooth union of
metacarpal tubes, the two pads of the palm, the wrist and the webs. The field of one finger with
the palm leaves out the other fingers, so fingers that lie side by side never merge.

Sizes are our own, chosen by eye around adult finger breadths; all lengths are in millimetres.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from tools.make.hand_fields import (
    Ellipsoid,
    Membrane,
    Profile,
    Tube,
    smooth_min,
)

Array = NDArray[np.float64]
# stations along a finger, (segment + fraction of it); half width, dorsal height, palmar depth
# [mm] of the middle finger: 0 = base joint, 1 = next joint, 2 = last joint, 3 = tip
FINGER_PROFILE = np.array(
    [
        # t     w     dorsal palmar
        (0.00, 9.9, 10.2, 11.5),
        (0.25, 9.9, 9.2, 11.6),
        (0.50, 9.3, 8.2, 10.8),
        (0.75, 9.2, 7.9, 9.6),
        (1.00, 9.8, 8.5, 8.5),
        (1.25, 9.0, 7.6, 9.0),
        (1.50, 8.5, 6.8, 9.0),
        (1.75, 8.4, 6.6, 8.1),
        (2.00, 8.7, 6.8, 7.1),
        (2.22, 8.4, 6.5, 7.9),
        (2.36, 8.2, 5.5, 8.3),
        (2.50, 8.0, 5.1, 8.4),
        (2.75, 7.3, 4.8, 7.8),
        (3.00, 6.5, 4.6, 6.6),
    ]
)
THUMB_PROFILE = np.array(
    [
        (0.00, 11.5, 10.5, 12.0),
        (0.40, 11.6, 10.8, 14.0),
        (0.70, 11.6, 10.8, 13.2),
        (1.00, 12.2, 11.2, 11.5),
        (1.30, 10.6, 9.4, 11.0),
        (1.60, 10.0, 8.5, 10.4),
        (2.00, 11.2, 8.8, 9.0),
        (2.22, 11.3, 8.3, 10.0),
        (2.36, 11.1, 6.9, 10.3),
        (2.50, 10.6, 6.3, 10.4),
        (2.75, 9.2, 5.6, 9.2),
        (3.00, 7.8, 5.0, 7.8),
    ]
)
FINGER_SCALE = (1.0, 0.98, 1.0, 0.95, 0.84)
"""Thickness of thumb..little against the profiles."""
TIP_CAP = (15.0, 11.5, 12.0, 11.5, 10.5)
"""Length of the rounded end of each finger [mm]."""
"""Beyond this distance [mm] a web no longer counts."""


def finger_tube(finger: int, joints: Array, axes: Array) -> Tube:
    """The tube of a finger from its base joint to its tip (joints (21, 3) mm, axes (20, 3))."""
    chain = joints[1 + 4 * finger : 5 + 4 * finger]
    lengths = np.linalg.norm(np.diff(chain, axis=0), axis=-1)
    along = np.concatenate([[0], np.cumsum(lengths)])
    profile = THUMB_PROFILE if finger == 0 else FINGER_PROFILE
    t = np.interp(profile[:, 0], np.arange(4), along)
    axis = (chain[1] - chain[0]) / lengths[0]
    side = axes[4 * finger]
    cap = TIP_CAP[finger]
    return Tube(
        origin=chain[0],
        frame=np.stack([axis, side, np.cross(axis, side)]),
        start=0.0,
        end=float(along[-1] - cap),
        caps=(10.0, cap),
        radii=Profile(t, profile[:, 1:] * FINGER_SCALE[finger]),
        power=2.25,
    )


@dataclass
class HandShape:
    """The fields of palm and fingers of a right hand at rest (joints (21, 3) in mm)."""

    joints: Array
    axes: Array
    metacarpal_bases: Array
    """(4, 3) of index..little."""
    fingers: list[Tube] = field(init=False)

    def __post_init__(self) -> None:
        self.fingers = [finger_tube(f, self.joints, self.axes) for f in range(5)]
        self._rays = [self._metacarpal(f) for f in range(1, 5)]
        self._pads = self._make_pads()
        self._webs = self._make_webs()
        self._thumb_web = self._make_thumb_web()
        self._wrist = Tube(
            np.zeros(3),
            np.eye(3),
            -13.0,
            6.0,
            (10.0, 24.0),
            Profile(
                np.array([-25.0, -8, 4, 20]),
                np.array([(27.5, 16, 17), (27.5, 16.5, 18), (28.5, 17, 19), (30, 16, 18)]),
            ),
            2.4,
        )
        self._body = self._make_body()

    def _metacarpal(self, f: int) -> Tube:
        base, head = self.metacarpal_bases[f - 1], self.joints[1 + 4 * f]
        length = float(np.linalg.norm(head - base))
        axis = (head - base) / length
        dorsal = self.axes[4 * f + 1] - axis * (self.axes[4 * f + 1] @ axis)
        dorsal /= np.linalg.norm(dorsal)
        s = (1.0, 1.0, 0.96, 0.88)[f - 1]
        radii = Profile(
            np.array([-20.0, 0, 0.5 * length, 0.85 * length, length]),
            s * np.array([(9, 9, 9), (10, 9, 9), (10, 8, 9), (10.8, 8.8, 13.5), (10.6, 10, 14)]),
        )
        frame = np.stack([axis, np.cross(dorsal, axis), dorsal])
        return Tube(base, frame, -20.0, length, (12.0, 11.0), radii)

    def _make_pads(self) -> list[tuple[Ellipsoid, float]]:
        """Thenar and hypothenar pads, each with its blending."""
        thumb = self.fingers[0].frame
        mcp, cmc = self.joints[2], self.joints[1]
        thenar = Ellipsoid(
            cmc + 0.48 * (mcp - cmc) + np.array([3.0, -10.0, -1.0]),
            thumb,
            np.array([32.0, 17.0, 14.0]),
        )
        little = self._rays[3].frame
        hypothenar = Ellipsoid(np.array([38.0, -28.0, -7.0]), little, np.array([38.0, 12.5, 14.0]))
        return [(thenar, 20.0), (hypothenar, 14.0)]

    def _make_body(self) -> list[Membrane]:
        """The flesh between the metacarpals, as two triangles of one slab."""
        radial, ulnar = np.array([16.0, 16.0, -2.0]), np.array([16.0, -18.0, -2.0])
        index = self.joints[5] + np.array([-6.0, 0, -4.5])
        little = self.joints[17] + np.array([-6.0, 2.0, -4.5])
        return [
            Membrane(np.stack([radial, ulnar, little]), np.array([11.0, 11.0, 9.0])),
            Membrane(np.stack([radial, little, index]), np.array([11.0, 9.0, 9.0])),
        ]

    def _make_webs(self) -> list[Membrane]:
        """Webs between the fingers, from between two knuckles to about half the proximal bone."""
        out = []
        for f in (1, 2, 3):
            a, b = self.fingers[f], self.fingers[f + 1]
            reach = 14.5 if f < 3 else 13.0
            left = a.origin + reach * a.frame[0] - 3.5 * a.frame[2]
            right = b.origin + reach * b.frame[0] - 3.5 * b.frame[2]
            back = 0.5 * (a.origin + b.origin) - np.array([4.0, 0, 2.0])
            out.append(Membrane(np.stack([left, right, back]), np.array([4.5, 4.5, 8.0])))
        return out

    def _make_thumb_web(self) -> Membrane:
        mcp, cmc = self.joints[2], self.joints[1]
        index = self.joints[5]
        ulnar = -self.axes[0]
        corners = np.stack(
            [
                cmc + np.array([0, -4.0, 0]),
                cmc + 0.92 * (mcp - cmc) + 3 * ulnar,
                index + np.array([-13.0, 3.0, -3.0]),
            ]
        )
        return Membrane(corners, np.array([9.0, 5.0, 6.0]))

    def palm(self, points: Array) -> Array:
        """Field of everything but the fingers (N, 3) -> (N,)."""
        out = self._rays[0](points)
        for ray in self._rays[1:]:
            out = smooth_min(out, ray(points), 11.0)
        body = np.minimum(self._body[0](points), self._body[1](points))
        out = smooth_min(out, body, 12.0)
        out = smooth_min(out, self._wrist(points), 22.0)
        for pad, k in self._pads:
            out = smooth_min(out, pad(points), k)
        for web in self._webs:
            out = smooth_min(out, web(points), 7.0)
        return smooth_min(out, self._thumb_web(points), 14.0)

    def __call__(self, points: Array, owner: NDArray[np.int_]) -> Array:
        """Field (N,) at points (N, 3), each seen from its owner.

        Args:
            points: (N, 3) [mm].
            owner: (N,) finger 0..4 whose surface (with the palm) is meant; -1 for all of them.
        """
        out = self.palm(points)
        for f, tube in enumerate(self.fingers):
            seen = (owner == f) | (owner == -1)
            if seen.any():
                k = 14.0 if f == 0 else 6.0
                out[seen] = smooth_min(out[seen], tube(points[seen]), k)
        return out

    def linear(self, points: Array, owner: NDArray[np.int_]) -> tuple[Array, Array, Array]:
        """The field (N,) at points, its unit normals (N, 3) and its slope (N,) there."""
        h = 1e-4
        value = self(points, owner)
        g = np.stack([(self(points + h * e, owner) - value) / h for e in np.eye(3)], -1)
        slope = np.maximum(np.linalg.norm(g, axis=-1), 0.2)
        return value, g / slope[:, None], slope

    def project(self, points: Array, owner: NDArray[np.int_], steps: int = 4) -> Array:
        """Points moved onto the surface along the field's gradient (damped Newton)."""
        for _ in range(steps):
            value, normal, slope = self.linear(points, owner)
            points = points - np.clip(value / slope, -6, 6)[:, None] * normal
        return points
