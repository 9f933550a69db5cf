"""The hand's skeleton: 21 joints in five chains, 20 angles, and their names.

Joint 0 is the wrist; joints 1-4 are the thumb, 5-8 the index, 9-12 the middle, 13-16 the
ring and 17-20 the little finger, from the base to the tip (Li et al. 2021, section 3).
Each finger has four angles, in this order: flexion and abduction of its base (a saddle),
then flexion of its two hinges.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

Hand = Literal["left", "right"]
HANDS: tuple[Hand, Hand] = ("left", "right")

N_JOINTS = 21
N_ANGLES = 20
N_PARTS = 16
"""Moving parts: the palm (moved by the wrist) and three bones in each finger."""

FINGERS = ("thumb", "index", "middle", "ring", "little")

JOINT_NAMES: tuple[str, ...] = (
    "wrist",
    *(f"thumb_{j}" for j in ("cmc", "mcp", "ip", "tip")),
    *(f"{f}_{j}" for f in FINGERS[1:] for j in ("mcp", "pip", "dip", "tip")),
)

ANGLE_NAMES: tuple[str, ...] = (
    *(f"thumb_{a}" for a in ("cmc_flexion", "cmc_abduction", "mcp_flexion", "ip_flexion")),
    *(
        f"{f}_{a}"
        for f in FINGERS[1:]
        for a in ("mcp_flexion", "mcp_abduction", "pip_flexion", "dip_flexion")
    ),
)

PARENTS = np.array([-1] + [0 if j % 4 == 1 else j - 1 for j in range(1, N_JOINTS)])
"""Parent of each joint; -1 for the wrist."""

BONES: tuple[tuple[int, int], ...] = tuple((int(PARENTS[j]), j) for j in range(1, N_JOINTS))
"""The 20 bones as (parent joint, child joint)."""

BASES = np.array([1, 5, 9, 13, 17])
"""First joint of each finger; with the wrist they make up the palm."""
TIPS = BASES + 3
PALM = np.concatenate([[0], BASES])

ANGLE_JOINT = np.array([4 * f + j for f in range(5) for j in (1, 1, 2, 3)])
"""The joint that each angle turns."""

PART_JOINT = np.array([0] + [4 * f + j for f in range(5) for j in (1, 2, 3)])
"""The joint that each of the 16 moving parts turns about."""
PART_PARENT = np.array([0] + [0 if i == 0 else 3 * f + i for f in range(5) for i in range(3)])
"""The part that each moving part hangs on; the palm on itself."""
ARRIVING = np.array([0] + [0 if j == 0 else 3 * f + j for f in range(5) for j in range(4)])
"""The moving part that arrives at each joint: the palm at the wrist and the fingers' bases."""
PART_NAMES: tuple[str, ...] = ("palm", *(JOINT_NAMES[j] for j in PART_JOINT[1:]))

# our joint i is the source's joint ORDERS[name][i], -1 where it has none; the layouts are in the
# sources' documents and code
ORDERS: dict[str, tuple[int, ...]] = {
    "handtrack": tuple(range(21)),
    # CMU Panoptic / OpenPose, FreiHAND, DexYCB and MediaPipe use the same order as we do
    "openpose": tuple(range(21)),
    "mediapipe": tuple(range(21)),
    "freihand": tuple(range(21)),
    # 16 MANO joints (index, middle, little, ring, thumb) and then the tips, thumb first
    "mano": (0, 13, 14, 15, 16, 1, 2, 3, 17, 4, 5, 6, 18, 10, 11, 12, 19, 7, 8, 9, 20),
    # the same with the tips in MANO's order of fingers, as Minimal-IK has them
    "frankmocap18": (0, 13, 14, 15, 20, 1, 2, 3, 16, 4, 5, 6, 17, 10, 11, 12, 19, 7, 8, 9, 18),
    # MANO's own joints, which end before the tips
    "mano16": (0, 13, 14, 15, -1, 1, 2, 3, -1, 4, 5, 6, -1, 10, 11, 12, -1, 7, 8, 9, -1),
    # tip to base in each finger, wrist last
    "interhand": (20, 3, 2, 1, 0, 7, 6, 5, 4, 11, 10, 9, 8, 15, 14, 13, 12, 19, 18, 17, 16),
    # wrist, the five bases, then PIP, DIP, tip of each finger
    "fpha": (0, 1, 6, 7, 8, 2, 9, 10, 11, 3, 12, 13, 14, 4, 15, 16, 17, 5, 18, 19, 20),
    # UmeTrack, HOT3D and Project Aria: tips, wrist, then each finger's joints, and the palm's
    # centre; the thumb has no CMC joint
    "umetrack": (5, -1, 6, 7, 0, 8, 9, 10, 1, 11, 12, 13, 2, 14, 15, 16, 3, 17, 18, 19, 4),
    # 26 OpenXR joints with palm and metacarpals; WebXR has no palm
    "openxr": (1, 2, 3, 4, 5, 7, 8, 9, 10, 12, 13, 14, 15, 17, 18, 19, 20, 22, 23, 24, 25),
    "webxr": (0, 1, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 24),
    # Unity's XR Hands and MRTK: OpenXR's joints, but the wrist before the palm
    "unity": (0, 2, 3, 4, 5, 7, 8, 9, 10, 12, 13, 14, 15, 17, 18, 19, 20, 22, 23, 24, 25),
    # visionOS: WebXR's joints, then two of the forearm
    "arkit": (0, 1, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 24),
    # Ultraleap's VectorHand: five ends of bones in each finger, no wrist; the thumb's first two
    # are at one place
    "ultraleap": (-1, 1, 2, 3, 4, 6, 7, 8, 9, 11, 12, 13, 14, 16, 17, 18, 19, 21, 22, 23, 24),
    # Manus Core's raw skeleton: wrist, fingers with metacarpals, the thumb last
    "manus": (0, 21, 22, 23, 24, 2, 3, 4, 5, 7, 8, 9, 10, 12, 13, 14, 15, 17, 18, 19, 20),
    # found in people's files, after no one
    "little-first": (0, *(b + i for b in (17, 13, 9, 5, 1) for i in range(4))),
    "thumb-last": (0, 17, 18, 19, 20, *range(1, 17)),
    "tip-to-base": (0, *(b - i for b in (4, 8, 12, 16, 20) for i in range(4))),
    "wrist-last": (20, *range(20)),
    "no-wrist": (-1, *range(20)),
}
ORDER_JOINTS: dict[str, int] = dict.fromkeys(ORDERS, 21) | {
    "mano16": 16,
    "no-wrist": 20,
    "webxr": 25,
    "ultraleap": 25,
    "manus": 25,
    "openxr": 26,
    "unity": 26,
    "arkit": 27,
}
"""How many joints a frame has in each order."""
