"""OpenXR's 26 joints a hand as JSON lines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.converting.complete import METACARPAL_SD, PALM_SD, Whole, bone_frames
from handtrack.converting.source import Source
from handtrack.hand.rotations import matrix_to_quaternion
from handtrack.hand.skeleton import FINGERS, ORDERS, TIPS

Array = NDArray[np.float64]

_BONES = ("metacarpal", "proximal", "intermediate", "distal", "tip")
XR_JOINTS: tuple[str, ...] = (
    *("palm", "wrist"),
    *(f"thumb_{bone}" for bone in ("metacarpal", "proximal", "distal", "tip")),
    *(f"{finger}_{bone}" for finger in FINGERS[1:] for bone in _BONES),
)
"""XrHandJointEXT in its order."""
_METACARPALS = tuple(i for i, n in enumerate(XR_JOINTS) if n.endswith("metacarpal") and i > 2)


class Places(msgspec.Struct):
    """26 joints of T frames.

    Attributes:
        positions: (T, 26, 3) [m].
        orientations: (T, 26, 3, 3): -z along the bone to the tip, y out of the back of the hand.
        sd: (T, 26) of joints that the source lacks [m], else NaN.
    """

    positions: Array
    orientations: Array
    sd: Array


def places(source: Source, whole: Whole) -> Places:
    """OpenXR's joints of a hand (XR_EXT_hand_tracking, "Conventions of hand joints")."""
    n = len(whole.joints)
    positions, sd = np.full((n, 26, 3), np.nan), np.full((n, 26), np.nan)
    ours = np.array(ORDERS["openxr"])
    positions[:, ours], sd[:, ours] = whole.joints, whole.sd
    positions[:, 0], positions[:, _METACARPALS] = whole.palm, whole.bases
    sd[:, 0], sd[:, _METACARPALS] = PALM_SD * whole.size, METACARPAL_SD * whole.size
    turned = whole.parts @ bone_frames(source.track.model)
    part = np.zeros(26, np.int64)
    for joint in range(1, 21):
        place = joint - 1 if joint in TIPS else joint  # a tip turns with the bone before it
        part[ours[joint]] = 3 * ((place - 1) // 4) + (place - 1) % 4 + 1
    return Places(positions, turned[:, part], sd)


def write_openxr(sources: list[Source], path: Path) -> None:
    """Lines of `{"time_ns", "frame", "hand", "joints": {NAME: {"position", "orientation"}}}`.

    Positions [m] and orientations (quaternions x y z w, in the input's world) as XrPosef has
    them; `sd_m` with joints that the source lacks. A hand that is lost has null for joints.
    """
    encoder = msgspec.json.Encoder()
    rows = []
    for source in sources:
        found = places(source, source.whole)
        quaternions = np.roll(matrix_to_quaternion(np.nan_to_num(found.orientations)), -1, -1)
        turned = np.asarray(np.isfinite(found.orientations).all((-1, -2)))
        for t, time in enumerate(source.time_ns.tolist()):
            joints = {
                name: _joint(
                    found.positions[t, j],
                    quaternions[t, j] if turned[t, j] else None,
                    found.sd[t, j],
                )
                for j, name in enumerate(XR_JOINTS)
                if np.isfinite(found.positions[t, j]).all()
            }
            row = {"time_ns": time, "frame": int(source.frame_index[t]), "hand": source.hand}
            rows.append((time, encoder.encode({**row, "joints": joints or None})))
    rows.sort(key=lambda row: row[0])
    path.write_bytes(b"\n".join(line for _, line in rows) + b"\n")


def _joint(position: Array, quaternion: Array | None, sd: float) -> dict[str, Any]:
    made: dict[str, Any] = {"position": dict(zip("xyz", position.tolist(), strict=True))}
    if quaternion is not None:
        made["orientation"] = dict(zip("xyzw", quaternion.tolist(), strict=True))
    if np.isfinite(sd):
        made["sd_m"] = round(float(sd), 5)
    return made
