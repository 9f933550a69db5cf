"""What sources call the 21 joints and their columns."""

from __future__ import annotations

FINGERS = ("thumb", "index", "middle", "ring", "little")
PINKY = ("thumb", "index", "middle", "ring", "pinky")


def _names(wrist: str, thumb: str, finger: str, thumb_parts: str, parts: str, little: str) -> list:
    """Names from patterns with {f} (finger) and {p} (part)."""
    out = [wrist, *(thumb.format(f="thumb", p=p) for p in thumb_parts.split())]
    for f in ("index", "middle", "ring", little):
        out += [finger.format(f=f, F=f.capitalize(), U=f.upper(), p=p) for p in parts.split()]
    return out


NAMES: dict[str, list[str]] = {
    "handtrack": _names(
        "wrist", "{f}_{p}", "{f}_{p}", "cmc mcp ip tip", "mcp pip dip tip", "little"
    ),
    "pinky": _names("wrist", "{f}_{p}", "{f}_{p}", "cmc mcp ip tip", "mcp pip dip tip", "pinky"),
    "mediapipe": _names(
        "WRIST", "THUMB_{p}", "{U}_FINGER_{p}", "CMC MCP IP TIP", "MCP PIP DIP TIP", "pinky"
    ),
    "mediapipe_py": [],  # filled below: PINKY_MCP, not PINKY_FINGER_MCP
    "openxr": _names(
        "XR_HAND_JOINT_WRIST_EXT",
        "XR_HAND_JOINT_THUMB_{p}_EXT",
        "XR_HAND_JOINT_{U}_{p}_EXT",
        "METACARPAL PROXIMAL DISTAL TIP",
        "PROXIMAL INTERMEDIATE DISTAL TIP",
        "little",
    ),
    "webxr": [],
    "unity_xr": _names(
        "Wrist",
        "Thumb{p}",
        "{F}{p}",
        "Metacarpal Proximal Distal Tip",
        "Proximal Intermediate Distal Tip",
        "little",
    ),
    "ovr": [
        "Hand_WristRoot",
        "Hand_Thumb1",
        "Hand_Thumb2",
        "Hand_Thumb3",
        "Hand_ThumbTip",
        *(
            f"Hand_{f}{p}"
            for f in ("Index", "Middle", "Ring", "Pinky")
            for p in ("1", "2", "3", "Tip")
        ),
    ],
    "mrtk": [
        "Wrist",
        "ThumbMetacarpalJoint",
        "ThumbProximalJoint",
        "ThumbDistalJoint",
        "ThumbTip",
        *(
            f"{f}{p}"
            for f in ("Index", "Middle", "Ring", "Pinky")
            for p in ("Knuckle", "MiddleJoint", "DistalJoint", "Tip")
        ),
    ],
    "visionos": [
        "wrist",
        "thumbKnuckle",
        "thumbIntermediateBase",
        "thumbIntermediateTip",
        "thumbTip",
        *(
            f"{f}Finger{p}"
            for f in ("index", "middle", "ring", "little")
            for p in ("Knuckle", "IntermediateBase", "IntermediateTip", "Tip")
        ),
    ],
    "vision": [
        "wrist",
        "thumbCMC",
        "thumbMP",
        "thumbIP",
        "thumbTip",
        *(
            f"{f}{p}"
            for f in ("index", "middle", "ring", "little")
            for p in ("MCP", "PIP", "DIP", "Tip")
        ),
    ],
    "ultraleap": [
        "wrist",
        "thumb_proximal",
        "thumb_intermediate",
        "thumb_distal",
        "thumb_tip",
        *(
            f"{f}_{p}"
            for f in ("index", "middle", "ring", "pinky")
            for p in ("proximal", "intermediate", "distal", "tip")
        ),
    ],
    "thumb_finger": [
        "wrist",
        "thumb_finger_cmc",
        "thumb_finger_mcp",
        "thumb_finger_ip",
        "thumb_finger_tip",
        *(
            f"{f}_finger_{p}"
            for f in ("index", "middle", "ring", "pinky")
            for p in ("mcp", "pip", "dip", "tip")
        ),
    ],
    "spaces": [
        "Wrist",
        "Thumb CMC",
        "Thumb MCP",
        "Thumb IP",
        "Thumb Tip",
        *(
            f"{f} {p}"
            for f in ("Index", "Middle", "Ring", "Little")
            for p in ("MCP", "PIP", "DIP", "Tip")
        ),
    ],
    "numbers": [str(i) for i in range(21)],
    "joint0": [f"joint{i}" for i in range(21)],
    "joint1": [f"joint{i}" for i in range(1, 22)],
    "landmark_00": [f"landmark_{i:02d}" for i in range(21)],
    "kp1": [f"kp_{i}" for i in range(1, 22)],
}
NAMES["mediapipe"] = [n.replace("PINKY_FINGER", "PINKY") for n in NAMES["mediapipe"]]
NAMES["mediapipe_py"] = [n.lower() for n in NAMES["mediapipe"]]
NAMES["webxr"] = [
    "wrist",
    *(f"thumb-{p}" for p in ("metacarpal", "phalanx-proximal", "phalanx-distal", "tip")),
    *(
        f"{f}-finger-{p}"
        for f in ("index", "middle", "ring", "pinky")
        for p in ("phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip")
    ),
]

COLUMNS: dict[str, str] = {
    "name_x": "{n}_{a}",
    "name.x": "{n}.{a}",
    "x_name": "{a}_{n}",
    "nameX": "{n}{A}",
    "name_X": "{n}_{A}",
    "name X": "{n} {A}",
    "name_pos_x": "{n}_pos_{a}",
    "name_x_mm": "{n}_{a}_{u}",
    "name_x (mm)": "{n}_{a} ({u})",
    "name_x [mm]": "{n}_{a} [{u}]",
    "name/x": "{n}/{a}",
    "name[x]": "{n}[{a}]",
    "name.position.x": "{n}.position.{a}",
}
"""Patterns of a column's title: name, axis, AXIS and unit."""


def titles(names: str = "handtrack", column: str = "name_x", unit: str = "m") -> list[str]:
    """63 titles, x y z of each joint."""
    pattern = COLUMNS[column]
    return [
        pattern.format(n=n, a=axis, A=axis.upper(), u=unit) for n in NAMES[names] for axis in "xyz"
    ]
