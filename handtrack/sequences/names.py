"""What sources call joints, hands, times, units and confidences: one table for every reader.

Names are compared as words, whatever their case and style: "indexFingerKnuckle",
"INDEX_FINGER_MCP", "b_l_index1", "XR_HAND_JOINT_INDEX_PROXIMAL_EXT" and "Left Hand Index Tip.x".
A joint's name alone does not always say which joint it is (thumb_proximal is the second joint
where there is a metacarpal too, index1 the first or the second): `settled` decides over all
names of a hand.

Sources: MediaPipe hand landmarks; WebXR Hand Input; OpenXR XR_EXT_hand_tracking; Unity XR Hands
and humanoid bones; MRTK's TrackedHandJoint; Meta's OVRSkeleton; Ultraleap's bones; ARKit's
HandSkeleton; Vision's VNHumanHandPoseObservation; Manus; UmeTrack; Mixamo; MotionBuilder; Rokoko;
Xsens; SMPL-X.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from handtrack.hand.skeleton import FINGERS, Hand
from handtrack.hand.units import Unit

TimeUnit = Literal["s", "ms", "us", "ns"]
KEPT = 4096
"""So many names are remembered."""
UNUSED = -1
"""`settled.settle`'s answer for a joint that is known and is none of the 21: palm, forearm."""

METACARPAL, PROXIMAL, INTERMEDIATE, DISTAL, TIP = range(5)
"""Where a joint lies in its finger: the beginning of that bone."""

SIDES: dict[str, Hand] = {
    **dict.fromkeys(("left", "l", "lh", "lhand", "lefthand"), "left"),
    **dict.fromkeys(("right", "r", "rh", "rhand", "righthand"), "right"),
}
FINGER = {
    "thumb": 0,
    **dict.fromkeys(("index", "pointer", "forefinger", "pointing"), 1),
    **dict.fromkeys(("middle", "mid", "long"), 2),
    "ring": 3,
    **dict.fromkeys(("little", "pinky", "pinkie", "baby", "small"), 4),
}
PART = {
    **dict.fromkeys(("metacarpal", "carpometacarpal", "cmc", "carpal", "tmc"), METACARPAL),
    **dict.fromkeys(("proximal", "mcp", "mp", "knuckle", "base", "metacarpophalangeal"), PROXIMAL),
    **dict.fromkeys(("intermediate", "medial", "middle", "mid", "pip"), INTERMEDIATE),
    **dict.fromkeys(("distal", "dip", "ip"), DISTAL),
    **dict.fromkeys(("tip", "end", "null", "fingertip", "top"), TIP),
}
_PHRASES: dict[tuple[str, ...], int] = {
    # ARKit names joints by the bone's ends
    ("intermediate", "base"): INTERMEDIATE,
    ("intermediate", "tip"): DISTAL,
    ("tip", "marker"): TIP,
    ("finger", "tip"): TIP,
    # Ultraleap's bones begin at "prev" and end at "next", where the one after begins
    ("metacarpal", "prev"): METACARPAL,
    ("proximal", "prev"): PROXIMAL,
    ("intermediate", "prev"): INTERMEDIATE,
    ("distal", "prev"): DISTAL,
    ("distal", "next"): TIP,
}
_SAME_AS_NEXT = {("metacarpal", "next"), ("proximal", "next"), ("intermediate", "next")}
_VISION = {f"{f}{p}" for f in "imrp" for p in ("tip", "dip", "pip", "mcp")}
_VISION |= {"ttip", "tip", "tmp", "tcmc", "wri"}
_VISION_FINGER = dict(zip("timrp", FINGERS, strict=True))
_ORDINALS = {str(i): name for i, name in enumerate(FINGERS, 1)}
NOISE = {
    *("xr", "hand", "hands", "joint", "joints", "jnt", "ext", "finger", "phalanx", "phalanges"),
    *("position", "positions", "pos", "bone", "bones", "landmark", "landmarks", "kp", "kpt", "j"),
    *("keypoint", "keypoints", "point", "points", "b", "lm", "p", "pt", "global", "world"),
    *("location", "translation", "coord", "coordinate", "marker", "frame", "node", "device", "in"),
    *("transform", "pose", "tracked", "rig", "mixamorig", "skeleton", "human", "def", "name"),
}
WRIST = {"wrist", "carpus"}
EXTRA = {"palm", "forearm", "elbow", "arm", "none", "invalid"}
OTHER = {
    *("velocity", "vel", "speed", "acceleration", "acc", "rotation", "rot", "quat", "quaternion"),
    *("orientation", "angle", "angles", "flexion", "flex", "abduction", "radius", "radii", "curl"),
    *("strength", "pinch", "grab", "width", "length", "direction", "dir", "normal", "euler"),
    *("error", "std", "sigma", "cov", "qx", "qy", "qz", "qw", "nx", "ny", "nz", "rx", "ry", "rz"),
    *("vx", "vy", "vz", "ax", "ay", "az", "roll", "pitch", "yaw", "scale", "spread", "bend"),
    *("force", "pressure", "gesture", "gravity", "delta", "dt", "ecef", "angular", "linear"),
    *("parent", "twist", "basis", "size", "uid", "exposure", "px", "pixel", "pixels", "d", "ncams"),
}
"""Words of quantities that go with hands and are no positions: left out knowingly."""
BODY = {
    *("hip", "hips", "pelvis", "spine", "chest", "neck", "head", "shoulder", "elbow", "thigh"),
    *("shin", "leg", "knee", "ankle", "foot", "feet", "toe", "toes", "heel", "eye", "nose", "ear"),
    *("mouth", "jaw", "clavicle", "upleg", "torso", "headset", "hmd", "gaze", "camera", "forearm"),
}
"""Words of the rest of a body and of what it wears: left out knowingly."""
UNITS: dict[str, Unit] = {
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("cm", "centimeter", "centimeters", "centimetre", "centimetres"), "cm"),
    **dict.fromkeys(("mm", "millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
    **dict.fromkeys(("inch", "inches"), "in"),
}
AXES = {f"{before}{axis}": i for before in ("", "t", "pos") for i, axis in enumerate("xyz")}
TIME_UNITS: dict[str, TimeUnit] = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "usec", "usecs", "micros", "microsecond", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nsec", "nsecs", "nanosec", "nanosecs", "nanos"), "ns"),
    **dict.fromkeys(("nanosecond", "nanoseconds"), "ns"),
}
TIME = {"time", "times", "timestamp", "timestamps", "stamp", "stamps", "t", "ts", "elapsed"}
TIME |= {"datetime", "clock", "epoch", "timecode"}
ABOUT_TIME = {
    *("frame", "tracking", "capture", "captured", "sample", "log", "system", "device", "unix"),
    *("utc", "relative", "rel", "in", "header", "sensor", "video", "host", "server", "local"),
    *("date", "world", "since", "start", "recording", "camera", "image", "hand", "media"),
}
FRAME = {"frame", "frames", "image", "img", "fnum"}
FRAME_NUMBER = {"index", "idx", "id", "ids", "number", "num", "no", "nr", "count", "counter", "n"}
HAND_LABEL = {"handedness", "handness", "side", "chirality", "laterality", "hand", "hands"}
HAND_LABEL |= {"handednesses"}
MAYBE_HAND = {"label", "type", "category", "name", "which", "display", "lr", "class", "hand"}
HAND_NUMBER = FRAME_NUMBER | {"track"}
CONFIDENCES = {
    *("confidence", "conf", "confidences", "score", "scores", "visibility", "presence", "c"),
    *("probability", "prob", "likelihood", "certainty", "vis", "valid", "visible"),
}
JOINTS = {
    *("joint", "joints", "xyz", "keypoint", "keypoints", "landmark", "landmarks", "kp", "kps"),
    *("kpts", "jnts", "points", "positions", "coords", "coordinates", "skeleton", "kp3d", "pts"),
}
ABOUT_JOINTS = {"hand", "hands", "world", "multi", "pos", "position", "positions", "data", "bone"}
TRUTH = {"truth", "gt", "true", "groundtruth", "ground"}
ROW_TITLES = {"", "unnamed: 0", "index", "row", "id", "#", "no", "nr", "unnamed: 0.1"}
"""Titles of a column that counts rows, as pandas and spreadsheets write it."""

_WORD = re.compile(r"[A-Z]{2,}(?=[xyz](?![a-z]))|[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+")
_3D = re.compile(r"(?<![0-9])3[dD](?![a-z])")
_RIG = re.compile(r"^(?:CC_Base_|J_Bip_|(?:DEF|ORG|MCH)-)|(?<![a-z])f_(?=index|middle|ring|pinky)")
"""Beginnings of all names of a rig: iClone's, VRM's, Blender's Rigify's."""
_FINGERS_OF_BIPED = re.compile(r"^Bip\d* ([LR]) Finger([0-4])([12]?)(?=$|\W)|^Bip\d* (?=[LR] Hand)")
_STEP = re.compile(r"[/|]")
"""Between the steps of a path in a scene, whose last names the joint."""
_MOST_WORDS = 100
_VOCABULARY = {
    *(*FINGER, *PART, *WRIST, *EXTRA, "left", "right"),
    *("hand", "finger", "joint", "phalanx", "landmark", "keypoint", "time", "stamp", "frame"),
    *("index", "position", "confidence", "visibility", "pos"),
}


@lru_cache(KEPT)
def words(name: str) -> tuple[str, ...]:
    """A name's words and numbers in lower case: "LeftHandIndex1.x" -> left, hand, index, 1, x."""
    text = _3D.sub("", name[:400].replace("µ", "u").replace("μ", "u"))
    text = _FINGERS_OF_BIPED.sub(_of_biped, _RIG.sub("", text))
    steps = [_plain_words(step) for step in _STEP.split(text)]
    for n in range(1, len(steps)):
        last = [word for step in steps[-n:] for word in step]
        if _is_joint_at_end(last):
            above = (without_hand(tuple(step))[0] for step in reversed(steps[:-n]))
            side = next((s for s in above if s is not None), None)
            own = without_hand(tuple(last))[0]
            return tuple([side, *last] if side is not None and own is None else last)
    return tuple(word for step in steps for word in step)[:_MOST_WORDS]


def _of_biped(match: re.Match[str]) -> str:
    """3ds Max' "Bip01 R Finger21" as "R middle 2"."""
    if match[1] is None:
        return ""
    return f"{match[1]} {FINGERS[int(match[2])]} {int(match[3] or 0) + 1}"


def _plain_words(text: str) -> list[str]:
    return [word for part in _WORD.findall(text[:200]) for word in _split(part.lower())]


def _is_joint_at_end(last: list[str]) -> bool:
    """Whether the last steps of a path ("Hand_R/Index1/Index2") name a joint by themselves."""
    finger = any(w in FINGER for w in last)
    whose = sum(w in PART or w.isdigit() for w in last) > (last.count("middle") + last.count("mid"))
    hand = "hand" in last and all(w in NOISE or w in SIDES or w in AXES for w in last)
    return (finger and whose) or hand or any(w in WRIST for w in last)


def _split(word: str) -> list[str]:
    """A word run together ("thumbtipx", "indexmcp") as the words that it is made of."""
    run_on = word[-1] in "xyz" and (word[:-1] in PART or word[:-1] == "ext")
    if run_on and word not in AXES:  # IPX, EXTX
        return [word[:-1], word[-1]]
    if word in _VOCABULARY or word in _KNOWN or len(word) < 4 or word.isdigit():
        return [word]
    if word[0] in "lr" and (word[1:] in FINGER or word[1:] in WRIST):  # RTHUMB, Lwrist
        return [word[0], word[1:]]
    best: list[list[str] | None] = [[]] + [None] * len(word)
    for end in range(1, len(word) + 1):
        for start in range(max(0, end - 12), end):
            piece, before = word[start:end], best[start]
            axis = end == len(word) and piece in ("x", "y", "z")
            if before is None or not (piece in _VOCABULARY or axis):
                continue
            now, found = [*before, piece], best[end]
            if found is None or len(now) < len(found):
                best[end] = now
    return best[-1] or [word]


_KNOWN = NOISE | OTHER | CONFIDENCES | TIME | ABOUT_TIME | JOINTS | HAND_LABEL | {*TIME_UNITS}
_KNOWN |= {*UNITS} | {*SIDES} | MAYBE_HAND | TRUTH


@dataclass(frozen=True)
class JointName:
    """What a joint's name says.

    Attributes:
        hand: whose it is, where the name says so.
        finger: 0..4; None: the wrist, a numbered joint or none of the 21.
        part: METACARPAL .. TIP; None where the name gives a number.
        number: in the finger, or in the hand where there is no finger.
        extra: a known place that is none of the 21 joints.
        weak: "hand": the wrist, unless there is another.
    """

    hand: Hand | None = None
    finger: int | None = None
    part: int | None = None
    number: int | None = None
    extra: bool = False
    weak: bool = False


@lru_cache(KEPT)
def joint_name(given: tuple[str, ...]) -> JointName | None:
    """What the words of a joint's name say, None where they name no joint."""
    hand, rest = without_hand(given)
    if len(rest) == 1 and rest[0].startswith("vnhlk") and rest[0][5:] in _VISION:
        code = rest[0][5:]
        if code == "wri":
            return JointName(hand)
        # the thumb's IP is "TIP", its tip "TTIP"
        finger = FINGERS.index(_VISION_FINGER[code[0]])
        return JointName(hand, finger, PART[code[1:]])
    rest = _with_finger(rest)
    first = next((i for i, word in enumerate(rest) if word in FINGER), None)
    if first is None:
        return _no_finger(hand, given, rest)
    if _drop(list(given), ("in", "hand")) is not None:  # MotionBuilder's metacarpals
        return JointName(hand, FINGER[rest[first]], extra=True)
    finger = FINGER[rest[first]]
    left_over = [*rest[:first], *rest[first + 1 :]]
    for bone in _SAME_AS_NEXT:
        if _drop(left_over, bone) is not None:
            return JointName(hand, finger, extra=True)
    for phrase, part in _PHRASES.items():
        kept = _drop(left_over, phrase)
        if kept is not None:
            return JointName(hand, finger, part) if not kept else None
    plain = [w for w in left_over if w not in NOISE]
    parts = [w for w in plain if w in PART]
    numbers = [w for w in plain if w.isdigit()]
    if len(parts) + len(numbers) != len(plain) or len(plain) > 1:
        return None
    if numbers:
        number = int(numbers[0][:4])
        return JointName(hand, finger, number=number) if number <= 5 else None
    if finger == 0 and parts == ["base"]:
        return JointName(hand, finger, METACARPAL)
    return JointName(hand, finger, PART[parts[0]] if parts else TIP)


def _with_finger(given: list[str]) -> list[str]:
    """Words in which a finger has its name instead of its number: Rokoko's Finger2Proximal,
    Xsens' Digit2, the thumb being the first."""
    for i, (word, number, part) in enumerate(zip(given, given[1:], given[2:], strict=False)):
        if word in ("finger", "digit") and number in _ORDINALS and part in PART:
            return [*given[:i], _ORDINALS[number], *given[i + 2 :]]
    return given


def _no_finger(hand: Hand | None, given: tuple[str, ...], rest: list[str]) -> JointName | None:
    plain = [w for w in rest if w not in NOISE]
    numbers = [w for w in plain if w.isdigit()]
    others = [w for w in plain if not w.isdigit()]
    named = set(others) <= WRIST | {"root"} and others != []
    if named or others in (["palm", "base"], ["arm", "next"]):
        return JointName(hand)
    if others and (others[0] in EXTRA or others == ["start"]):
        return JointName(hand, extra=True)
    if others:
        return None
    if len(numbers) == 1:
        return JointName(hand, number=int(numbers[0][:4]))
    if not numbers and "hand" in given:
        return JointName(hand, weak=True)
    return None


def _drop(given: list[str], phrase: tuple[str, ...]) -> list[str] | None:
    """What is left of the words, but for noise, without a phrase; None where it is not there."""
    n = len(phrase)
    for i in range(len(given) - n + 1):
        if tuple(given[i : i + n]) == phrase:
            return [w for w in (*given[:i], *given[i + n :]) if w not in NOISE]
    return None


def without_hand(given: tuple[str, ...]) -> tuple[Hand | None, list[str]]:
    """The hand that words name, and the others; a single letter counts at either end only."""
    sides = {
        SIDES[w]
        for i, w in enumerate(given)
        if w in SIDES and (len(w) > 1 or i in (0, len(given) - 1) or given[i - 1] == "b")
    }
    if len(sides) != 1:
        return None, list(given)
    return sides.pop(), [w for w in given if w not in SIDES]


_ABOUT_SIDE = {"hand", "hands", "type", "side", "chirality", "handedness", "xr", "ext", "mirrored"}
"""Words beside a hand's: HandType.Right, XR_HAND_RIGHT_EXT, "Left (mirrored)"."""


def as_side(value: object) -> Hand | None:
    """A label such as "Left", "R" or "right_hand" as a hand, None where it is none."""
    if not isinstance(value, str) or len(value) > 30:
        return None
    side, rest = without_hand(words(value))
    return side if _ABOUT_SIDE.issuperset(rest) else None
