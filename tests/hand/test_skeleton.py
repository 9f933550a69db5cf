"""The tables of the skeleton agree with each other, and with how the sources name joints."""

from __future__ import annotations

import pytest

from handtrack.hand.skeleton import (
    ANGLE_JOINT,
    ANGLE_NAMES,
    BASES,
    BONES,
    FINGERS,
    JOINT_NAMES,
    N_ANGLES,
    N_JOINTS,
    N_PARTS,
    ORDER_JOINTS,
    ORDERS,
    PALM,
    PARENTS,
    PART_JOINT,
    PART_NAMES,
    TIPS,
)

_THUMB = ("cmc", "mcp", "ip", "tip")
_OTHER = ("mcp", "pip", "dip", "tip")


def finger(name: str) -> list[str]:
    return [f"{name}_{j}" for j in (_THUMB if name == "thumb" else _OTHER)]


def fingers(*names: str) -> list[list[str]]:
    return [finger(name) for name in names]


def flat(rows: list[list[str]]) -> list[str]:
    return [name for row in rows for name in row]


def chains(*names: str) -> list[str]:
    """Fingers joint by joint."""
    return flat(fingers(*names))


def mano_joints() -> list[str]:
    return ["wrist", *flat([f[:3] for f in fingers("index", "middle", "little", "ring", "thumb")])]


def with_metacarpals() -> list[str]:
    """The joints of OpenXR after the wrist, in our names; metacarpals have none of ours."""
    return finger("thumb") + flat([[f"{f}_metacarpal", *finger(f)] for f in FINGERS[1:]])


# what each source's document says its joints are, in order
DOCUMENTED = {
    "handtrack": ["wrist", *flat(fingers(*FINGERS))],
    "openpose": ["wrist", *flat(fingers(*FINGERS))],
    "mediapipe": ["wrist", *flat(fingers(*FINGERS))],
    "freihand": ["wrist", *flat(fingers(*FINGERS))],
    "mano": [
        "wrist",
        *flat([f[:3] for f in fingers("index", "middle", "little", "ring", "thumb")]),
        *(f"{f}_tip" for f in FINGERS),
    ],
    "interhand": [*flat([f[::-1] for f in fingers(*FINGERS)]), "wrist"],
    "fpha": [
        "wrist",
        *(finger(f)[0] for f in FINGERS),
        *flat([f[1:] for f in fingers(*FINGERS)]),
    ],
    "openxr": ["palm", "wrist", *with_metacarpals()],
    "webxr": ["wrist", *with_metacarpals()],
    # the cases of issue 12; Minimal-IK's armatures.py
    "frankmocap18": [
        *mano_joints(),
        *(f"{f}_tip" for f in ("index", "middle", "little", "ring", "thumb")),
    ],
    "mano16": mano_joints(),
    # LANDMARK of UmeTrack's hand.py
    "umetrack": [
        *(f"{f}_tip" for f in FINGERS),
        "wrist",
        *("thumb_mcp", "thumb_ip"),
        *flat([f[:3] for f in fingers(*FINGERS[1:])]),
        "palm",
    ],
    # XRHandJointID, TrackedHandJoint
    "unity": ["wrist", "palm", *with_metacarpals()],
    # ar_hand_skeleton_joint_name_t
    "arkit": ["wrist", *with_metacarpals(), "forearm_wrist", "forearm_arm"],
    # VectorHand.jointPositions
    "ultraleap": ["thumb_none", *with_metacarpals()],
    # nodes of raw_skeleton
    "manus": ["wrist", *with_metacarpals()[4:], *finger("thumb")],
    "little-first": ["wrist", *chains(*FINGERS[::-1])],
    "thumb-last": ["wrist", *chains(*FINGERS[1:], "thumb")],
    "tip-to-base": ["wrist", *flat([f[::-1] for f in fingers(*FINGERS)])],
    "wrist-last": [*chains(*FINGERS), "wrist"],
    "no-wrist": chains(*FINGERS),
}


def test_names_are_as_many_as_there_are_and_differ():
    for names, n in ((JOINT_NAMES, 21), (ANGLE_NAMES, 20), (PART_NAMES, 16)):
        assert len(names) == len(set(names)) == n
    assert (N_JOINTS, N_ANGLES, N_PARTS) == (21, 20, 16)


def test_joints_are_named_as_in_the_paper():
    assert list(JOINT_NAMES) == ["wrist", *flat(fingers(*FINGERS))]
    assert [JOINT_NAMES[k] for k in (0, 1, 4, 5, 12, 13, 20)] == [
        "wrist", "thumb_cmc", "thumb_tip", "index_mcp", "middle_tip", "ring_mcp", "little_tip",
    ]  # fmt: skip


def test_parents_make_five_chains_from_the_wrist():
    assert PARENTS.tolist() == [
        -1, 0, 1, 2, 3, 0, 5, 6, 7, 0, 9, 10, 11, 0, 13, 14, 15, 0, 17, 18, 19,
    ]  # fmt: skip
    assert list(BONES) == [(PARENTS[k], k) for k in range(1, 21)]
    assert BASES.tolist() == [1, 5, 9, 13, 17]
    assert TIPS.tolist() == [4, 8, 12, 16, 20]
    assert PALM.tolist() == [0, 1, 5, 9, 13, 17]


def test_angles_turn_the_joints_they_are_named_after():
    # saddles at 1, 5, 9, 13, 17 have two angles, hinges one, tips none
    assert ANGLE_JOINT.tolist() == [1, 1, 2, 3, 5, 5, 6, 7, 9, 9, 10, 11, 13, 13, 14, 15, 17, 17,
                                    18, 19]  # fmt: skip
    for a, name in enumerate(ANGLE_NAMES):
        joint, kind = name.rsplit("_", 1)
        assert joint == JOINT_NAMES[ANGLE_JOINT[a]]
        assert kind == ("abduction" if a % 4 == 1 else "flexion")


def test_parts_are_the_palm_and_three_bones_a_finger():
    assert PART_JOINT.tolist() == [0, 1, 2, 3, 5, 6, 7, 9, 10, 11, 13, 14, 15, 17, 18, 19]
    assert PART_NAMES[0] == "palm"
    assert list(PART_NAMES[1:]) == [JOINT_NAMES[k] for k in PART_JOINT[1:]]


def test_every_order_has_a_document():
    assert set(DOCUMENTED) == set(ORDERS) == set(ORDER_JOINTS)


@pytest.mark.parametrize("order", ORDERS)
def test_order_selects_our_joints_from_the_documented_ones(order):
    picked = ORDERS[order]
    assert len(DOCUMENTED[order]) == ORDER_JOINTS[order]
    there = [j for j in range(21) if picked[j] >= 0]
    assert [DOCUMENTED[order][picked[j]] for j in there] == [JOINT_NAMES[j] for j in there]
    # what is not picked is not there
    assert not {JOINT_NAMES[j] for j in range(21) if picked[j] < 0} & set(DOCUMENTED[order])


def test_mano_order_is_the_known_list():
    # little before ring: the trap of this layout
    assert ORDERS["mano"] == (
        0, 13, 14, 15, 16, 1, 2, 3, 17, 4, 5, 6, 18, 10, 11, 12, 19, 7, 8, 9, 20,
    )  # fmt: skip
