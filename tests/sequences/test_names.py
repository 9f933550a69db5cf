"""One table of names: a test per source, in the source's own spelling."""

import pytest

from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.names import UNUSED, joint_name, words
from handtrack.sequences.settled import settle
from handtrack.sequences.titles import (
    column,
    is_frame_number,
    is_hand_label,
    is_hand_number,
    joints_key,
    looks_meant,
    side_key,
    time_unit,
)

F = ("thumb", "index", "middle", "ring", "pinky")


def fingers(thumb, others, names=F, join="{finger}{part}"):
    """A source's names in our order: the thumb's four, then four of each other finger."""
    out = [join.format(finger=names[0], part=p) for p in thumb]
    return out + [join.format(finger=f, part=p) for f in names[1:] for p in others]


CAPITAL = tuple(f.capitalize() for f in F)
LITTLE = (*F[:4], "little")
LEAP = ("proximal_prev", "intermediate_prev", "distal_prev", "distal_next")
SOURCES = {
    "handtrack": list(JOINT_NAMES),
    "mediapipe": [
        "WRIST",
        *fingers(
            ("CMC", "MCP", "IP", "TIP"),
            ("MCP", "PIP", "DIP", "TIP"),
            ("THUMB", *(f"{f.upper()}_FINGER" for f in F[1:4]), "PINKY"),
            "{finger}_{part}",
        ),
    ],
    "webxr": [
        "wrist",
        *fingers(
            ("metacarpal", "phalanx-proximal", "phalanx-distal", "tip"),
            ("phalanx-proximal", "phalanx-intermediate", "phalanx-distal", "tip"),
            ("thumb", *(f"{f}-finger" for f in F[1:])),
            "{finger}-{part}",
        ),
    ],
    "openxr": [
        "XR_HAND_JOINT_WRIST_EXT",
        *fingers(
            ("METACARPAL", "PROXIMAL", "DISTAL", "TIP"),
            ("PROXIMAL", "INTERMEDIATE", "DISTAL", "TIP"),
            tuple(f.upper() for f in LITTLE),
            "XR_HAND_JOINT_{finger}_{part}_EXT",
        ),
    ],
    "unity xr hands": [
        "Wrist",
        *fingers(
            ("Metacarpal", "Proximal", "Distal", "Tip"),
            ("Proximal", "Intermediate", "Distal", "Tip"),
            (*CAPITAL[:4], "Little"),
        ),
    ],
    "unity humanoid": [
        "LeftHand",
        *fingers(
            ("Proximal", "Intermediate", "Distal", "Tip"),
            ("Proximal", "Intermediate", "Distal", "Tip"),
            tuple(f"Left {f.capitalize()} " for f in LITTLE),
        ),
    ],
    "mrtk": [
        "Wrist",
        *fingers(
            ("MetacarpalJoint", "ProximalJoint", "DistalJoint", "Tip"),
            ("Knuckle", "MiddleJoint", "DistalJoint", "Tip"),
            CAPITAL,
        ),
    ],
    "ovr": [
        "Hand_WristRoot",
        *fingers("123", "123", CAPITAL, "Hand_{finger}{part}"),
    ],
    "ovr bones": [
        "b_l_wrist",
        *fingers(("1", "2", "3", "_null"), ("1", "2", "3", "_null"), F, "b_l_{finger}{part}"),
    ],
    "ultraleap": ["arm_next_joint", *fingers(LEAP, LEAP, F, "{finger}_{part}_joint")],
    "arkit": [
        "wrist",
        *fingers(
            ("Knuckle", "IntermediateBase", "IntermediateTip", "Tip"),
            ("FingerKnuckle", "FingerIntermediateBase", "FingerIntermediateTip", "FingerTip"),
            LITTLE,
        ),
    ],
    "vision": [
        "wrist",
        *fingers(
            ("CMC", "MP", "IP", "Tip"),
            ("MCP", "PIP", "DIP", "Tip"),
            LITTLE,
        ),
    ],
    "vision codes": [
        "VNHLKWRI",
        *fingers(
            ("CMC", "MP", "IP", "TIP"), ("MCP", "PIP", "DIP", "TIP"), "TIMRP", "VNHLK{finger}{part}"
        ),
    ],
    "mixamo": [
        "mixamorig:RightHand",
        *fingers("1234", "1234", CAPITAL, "mixamorig:RightHand{finger}{part}"),
    ],
    "unreal": [
        "hand_l",
        *fingers(("01", "02", "03", "tip"), ("01", "02", "03", "tip"), F, "{finger}_{part}_l"),
    ],
    "smpl-x": [
        "left_wrist",
        *fingers(("1", "2", "3", ""), ("1", "2", "3", ""), F, "left_{finger}{part}"),
    ],
    "manus": [
        "Hand",
        *fingers(
            ("CMC", "MCP", "IP", "TIP"),
            ("MCP", "PIP", "DIP", "TIP"),
            CAPITAL,
            "{finger}_{part}",
        ),
    ],
    "fingerpose": ["palmBase", *fingers("0123", "0123", ("thumb", "indexFinger", *F[2:]))],
    "run together": [
        "wrist",
        *fingers(("cmc", "mcp", "ip", "tip"), ("mcp", "pip", "dip", "tip")),
    ],
    "other words": [
        "carpus",
        *fingers(
            ("base", "proximal", "distal", "end"),
            ("base", "mid", "distal", "end"),
            ("thumb", "pointer", "middle finger", "ring finger", "baby finger"),
            "{finger} {part}",
        ),
    ],
}
SOURCES["ovr"] = SOURCES["ovr"][:1] + [
    name
    for i, f in enumerate(CAPITAL)
    for name in (*SOURCES["ovr"][1 + 3 * i : 4 + 3 * i], f"Hand_{f}Tip")
]


def joints_of(names):
    said = [joint_name(words(name)) for name in names]
    unread = [n for n, s in zip(names, said, strict=True) if s is None]
    assert not unread
    return settle(said)


@pytest.mark.parametrize("source", SOURCES)
def test_joints_of_every_source(source):
    assert joints_of(SOURCES[source]) == list(range(21))


@pytest.mark.parametrize("style", [str.lower, str.upper, str.title])
@pytest.mark.parametrize("source", ["handtrack", "mediapipe", "webxr", "openxr", "ultraleap"])
def test_any_case(source, style):
    assert joints_of([style(name) for name in SOURCES[source]]) == list(range(21))


@pytest.mark.parametrize(
    ("source", "extras"),
    [
        ("webxr", ["index-finger-metacarpal", "pinky-finger-metacarpal"]),
        ("openxr", ["XR_HAND_JOINT_PALM_EXT", "XR_HAND_JOINT_RING_METACARPAL_EXT"]),
        ("mrtk", ["None", "Palm", "IndexMetacarpal", "PinkyMetacarpal"]),
        ("ovr", ["Hand_Start", "Hand_ForearmStub", "Hand_Thumb0", "Hand_Pinky0"]),
        ("arkit", ["forearmWrist", "forearmArm", "indexFingerMetacarpal"]),
        (
            "ultraleap",
            ["thumb_metacarpal_prev_joint", "index_metacarpal_next_joint", "palm_position"],
        ),
        ("unreal", ["index_metacarpal_l"]),
    ],
)
def test_places_that_are_none_of_the_21(source, extras):
    expected = list(range(21)) + [UNUSED] * len(extras)
    assert joints_of([*SOURCES[source], *extras]) == expected


def test_the_thumb_as_a_finger_like_the_others():
    parts = ("mcp", "pip", "dip", "tip")
    names = ["wrist", *fingers(parts, parts, F, "{finger}_{part}")]
    assert joints_of(names) == list(range(21))


@pytest.mark.parametrize(
    ("title", "hand", "axis", "unit"),
    [
        ("wrist_x", None, 0, None),
        ("Wrist.Y", None, 1, None),
        ("Left Hand Wrist Z", "left", 2, None),
        ("wrist_pos_x", None, 0, None),
        ("r_wrist_position.x (m)", "right", 0, "m"),
        ("wristX [mm]", None, 0, "mm"),
        ("WRIST_Z_cm", None, 2, "cm"),
        ("x_wrist", None, 0, None),
        ("wrist visibility", None, None, None),
    ],
)
def test_titles_of_columns(title, hand, axis, unit):
    found = column(title)
    assert found is not None
    assert (found.joint.hand, found.axis, found.unit) == (hand, axis, unit)
    assert settle([found.joint]) == [0]


@pytest.mark.parametrize(
    "title",
    ["x7", "X_7", "7_x", "joint7_x", "landmark_7_x", "lm7x", "x7_mm", "kp_7.x", "hand_left_7_x"],
)
def test_numbered_columns(title):
    found = column(title)
    assert found is not None
    assert (found.joint.number, found.joint.finger, found.axis) == (7, None, 0)


@pytest.mark.parametrize(
    ("title", "unit"),
    [
        ("time", ""),
        ("timestamp", ""),
        ("t", ""),
        ("stamp", ""),
        ("elapsed", ""),
        ("frame_time", ""),
        ("Time (s)", "s"),
        ("time [ms]", "ms"),
        ("timestamp_ns", "ns"),
        ("timestampMs", "ms"),
        ("tracking_timestamp_us", "us"),
        ("time (µs)", "us"),
        ("seconds", "s"),
        ("ms", "ms"),
        ("frame", None),
        ("thumb_tip_x", None),
        ("t_x", None),
    ],
)
def test_times(title, unit):
    assert time_unit(title) == unit


def test_frames_hands_and_containers():
    assert all(map(is_frame_number, ("frame", "Frame_ID", "frameNumber", "frame idx", "image_id")))
    assert not any(map(is_frame_number, ("frame_time", "hand_id", "index", "id")))
    assert all(map(is_hand_label, ("hand", "handedness", "Side", "hand_label", "handType")))
    assert not any(map(is_hand_label, ("label", "hand_score", "hand_id")))
    assert all(map(is_hand_number, ("hand_number", "hand_id", "handIndex", "person")[:3]))
    assert (side_key("leftHand"), side_key("R"), side_key("left_joints")) == ("left", "right", None)
    key = joints_key("left_keypoints3d_mm")
    assert key is not None
    assert (key.hand, key.unit, key.truth) == ("left", "mm", False)
    truth = joints_key("gt_joints")
    assert truth is not None
    assert truth.truth
    world = joints_key("multiHandWorldLandmarks")
    assert world is not None
    assert world.world


@pytest.mark.parametrize(
    ("title", "kind"),
    [
        ("thumb_tpi_x", "a joint"),
        ("pinky_foo_x", "a joint"),
        ("joint_extra_x", "a joint"),
        ("capture_time_of_day", "a time"),
        ("handedness_guess", "a hand"),
        ("thumb_velocity_x", None),
        ("mood", None),
        ("temperature", None),
    ],
)
def test_what_looks_meant(title, kind):
    assert looks_meant(title) == kind
