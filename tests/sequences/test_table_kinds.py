"""Tables as people bring them: titles of every style, one hand or two, guesses said and checked."""

import numpy as np
import pytest
from wide_rows import text, titles

from handtrack.hand.skeleton import JOINT_NAMES

MEDIAPIPE = [
    n.upper() if n.startswith(("wrist", "thumb")) else n.upper().replace("_", "_FINGER_", 1)
    for n in JOINT_NAMES
]


PINKY = [n.replace("little", "pinky") for n in JOINT_NAMES]


UNITY = [n.replace("_", " ").title().replace(" ", "") for n in PINKY]


HEADS = {
    "mediapipe": titles(MEDIAPIPE),
    "mediapipe lower": [t.lower() for t in titles(MEDIAPIPE)],
    "pinky": titles(PINKY),
    "little": titles(JOINT_NAMES, "{n}.{a}"),
    "camel": titles(UNITY, "{n}{A}"),
    "spaces": titles([n.replace("_", " ") for n in JOINT_NAMES], "{n} {A}"),
    "kebab": titles([n.replace("_", "-") for n in JOINT_NAMES], "{n}-{a}"),
    "pos": titles(JOINT_NAMES, "{n}_pos_{a}"),
    "position": titles(JOINT_NAMES, "{n}_position.{a}"),
    "brackets": titles(JOINT_NAMES, "{n}_{a} (m)"),
    "right": titles(JOINT_NAMES, "right_{n}_{a}"),
    "right hand": titles(JOINT_NAMES, "Right Hand {n} {a}"),
    "r": titles(JOINT_NAMES, "r_{n}_{a}"),
    "axis first": titles(JOINT_NAMES, "{a}_{n}"),
    "x0": titles(range(21), "{a}{n}"),
    "x1": titles(range(1, 22), "{a}{n}"),
    "x_0": titles(range(21), "{a}_{n}"),
    "0_x": titles(range(21), "{n}_{a}"),
    "landmark_0_x": titles(range(21), "landmark_{n}_{a}"),
    "landmark_1_x": titles(range(1, 22), "landmark_{n}_{a}"),
    "lm0x": titles(range(21), "lm{n}{a}"),
    "joint_01.x": titles([f"{i:02d}" for i in range(1, 22)], "joint_{n}.{a}"),
    "hand_right_0_x": titles(range(21), "hand_right_{n}_{a}"),
    "0..62": [str(i) for i in range(63)],
    "1..63": [str(i) for i in range(1, 64)],
}


@pytest.mark.parametrize("style", HEADS)
def test_titles(read, right, style):
    (sequence,) = read(text(HEADS[style], right))
    assert len(sequence) == len(right)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)
    assert sequence.hand == "right"


def test_all_x_then_all_y_then_all_z(read, right):
    head = [f"{a}{i}" for a in "xyz" for i in range(21)]
    (sequence,) = read(text(head, right.transpose(0, 2, 1)))
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)


@pytest.mark.parametrize(
    ("encode", "separator", "end"),
    [
        ("utf-8-sig", ",", "\n"),
        ("utf-8", ",", "\r\n"),
        ("utf-16", ",", "\n"),
        ("utf-16", "\t", "\r\n"),
        ("utf-8", ";", "\n"),
        ("utf-8", "\t", "\r"),
        ("utf-8", " ", "\n"),
        ("utf-8", ", ", "\n"),
    ],
)
def test_how_text_is_written(read, right, encode, separator, end):
    if separator != " ":
        right[3, 4] = np.nan
    (sequence,) = read(text(titles(JOINT_NAMES), right, separator, end).encode(encode))
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)


@pytest.mark.parametrize("separator", [";", "\t"])
@pytest.mark.parametrize("head", [titles(JOINT_NAMES), None])
def test_decimal_commas(read, right, separator, head):
    content = text(head, right, separator).replace(".", ",") if head is None else None
    if content is None:
        content = separator.join(head) + "\n" + text(None, right, separator).replace(".", ",")
    (sequence,) = read(content)
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)


def test_quotes_comments_and_a_separator_too_much(read, right):
    head = titles(JOINT_NAMES)
    quoted = ",".join(f'"{t}"' for t in head) + "\n" + text(None, right)
    (a,) = read(quoted)
    commented = "# made by hand\n" + text(head, right).replace("\n", "\n# again\n", 1)
    (b,) = read(commented)
    trailing = text(head, right).replace("\n", ",\n")
    (c,) = read(trailing)
    first, rest = trailing.split("\n", 1)
    (d,) = read(first[:-1] + "\n" + rest)
    cells = ",".join(f'"{v:.6f}"'.replace(".", ",") for v in right[0].ravel())
    (e,) = read(",".join(head) + "\n" + cells + "\n")
    for sequence in (a, b, c, d):
        np.testing.assert_allclose(sequence.joints, right, atol=1e-6)
    np.testing.assert_allclose(e.joints[0], right[0], atol=1e-6)


def test_a_header_behind_a_comment_sign(read, right):
    (sequence,) = read("# " + text(titles(JOINT_NAMES, "{n}_{a}_mm"), right * 1e3))
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)


def test_pandas(read, right):
    rows = text(None, right).splitlines()
    named = text(titles(JOINT_NAMES), right).splitlines()
    for head, lines in (
        ("Unnamed: 0," + named[0], rows),
        ("," + named[0], rows),
        ("," + ",".join(map(str, range(63))), rows),
    ):
        numbered = [f"{i},{line}" for i, line in enumerate(lines)]
        (sequence,) = read("\n".join([head, *numbered]))
        np.testing.assert_allclose(sequence.joints, right, atol=1e-6)
        assert not any("not used" in note for note in sequence.notes)


def test_titles_of_two_lines(read, right):
    joints = ",".join(n for n in JOINT_NAMES for _ in "xyz")
    merged = ",".join(f"{n},," for n in JOINT_NAMES)
    axes = ",".join(a for _ in JOINT_NAMES for a in "xyz")
    scorer = ",".join(["net50"] * 63)
    for head in (f"{joints}\n{axes}", f"{merged}\n{axes}", f"{scorer}\n{joints}\n{axes}"):
        (sequence,) = read(head + "\n" + text(None, right))
        np.testing.assert_allclose(sequence.joints, right, atol=1e-6)
    lines = [f"{i},{row}" for i, row in enumerate(text(None, right).splitlines())]
    head = [f",{joints}", f",{axes}", "frame" + "," * 63]
    (sequence,) = read("\n".join([*head, *lines]))
    np.testing.assert_allclose(sequence.joints, right, atol=1e-6)
    assert sequence.frame_index.tolist() == list(range(12))
    assert sequence.numbered


@pytest.mark.parametrize("form", ["{h}_{n}_{a}", "{h}Hand.{n}.{a}", "{n}_{a}_{h}"])
@pytest.mark.parametrize(("one", "other"), [("left", "right"), ("L", "R")])
def test_columns_of_both_hands(read, left, right, form, one, other):
    names = JOINT_NAMES
    if len(one) == 1 and "Hand" in form:
        form = "{h}_Hand.{n}.{a}"
    head = titles(names, form, one) + titles(names, form, other)
    (a, b) = read(text(head, np.concatenate([left, right], axis=1)))
    assert (a.hand, b.hand) == ("left", "right")
    np.testing.assert_allclose(a.joints, left, atol=1e-6)
    np.testing.assert_allclose(b.joints, right, atol=1e-6)


def test_126_columns(read, left, right):
    both = np.concatenate([right, left], axis=1)
    for content in (text(None, both), text([str(i) for i in range(126)], both)):
        a, b = read(content)
        assert {a.hand: 0, b.hand: 0}.keys() == {"left", "right"}
        of = {s.hand: s for s in (a, b)}
        np.testing.assert_allclose(of["left"].joints, left, atol=1e-6)
        np.testing.assert_allclose(of["right"].joints, right, atol=1e-6)
        assert any("two hands" in note for s in (a, b) for note in s.notes)


@pytest.mark.parametrize("title", ["handedness", "Side", "hand_label", "label", "hand"])
@pytest.mark.parametrize("words", [("Left", "Right"), ("L", "R"), ("left_hand", "right_hand")])
def test_lines_of_both_hands(read, left, right, title, words):
    lines = [",".join(["frame", title, *titles(range(21), "{a}{n}")])]
    for i, pair in enumerate(zip(left, right, strict=True)):
        for word, frame in zip(words, pair, strict=True):
            lines.append(f"{i},{word}," + text(None, frame[None]).strip())
    a, b = read("\n".join(lines))
    assert (a.hand, b.hand, len(a), len(b)) == ("left", "right", 12, 12)
    np.testing.assert_allclose(b.joints, right, atol=1e-6)


@pytest.mark.parametrize("title", ["handedness", "hand_id", "hand_number"])
def test_hands_by_number_are_told_by_their_fingers(read, left, right, title):
    lines = [",".join(["frame", title, *titles(range(21), "{a}{n}")])]
    for i, pair in enumerate(zip(right, left, strict=True)):
        for k, frame in enumerate(pair):
            lines.append(f"{i},{k}," + text(None, frame[None]).strip())
    found = {s.hand: s for s in read("\n".join(lines))}
    np.testing.assert_allclose(found["left"].joints, left, atol=1e-6)
    np.testing.assert_allclose(found["right"].joints, right, atol=1e-6)


def test_a_label_of_something_else(read, right):
    lines = text(["label", *titles(JOINT_NAMES)], right).splitlines()
    lines[1:] = [f"fist,{line}" for line in lines[1:]]
    (sequence,) = read("\n".join(lines))
    assert "columns not used: label" in sequence.notes


def test_lines_in_which_nothing_was_seen_come_first(read, right):
    head = ["time", "handedness", *titles(MEDIAPIPE)]
    blank = ",".join([""] * 64)
    lines = [",".join(head), *(f"{i / 60:.6f},{blank}" for i in range(4))]
    lines += [
        f"{(i + 4) / 60:.6f},Right,{text(None, f[None]).strip()}" for i, f in enumerate(right)
    ]
    (sequence,) = read("\n".join(lines))
    assert (len(sequence), sequence.hand) == (16, "right")
    assert not sequence.present[:4].any()
    assert sequence.fps == pytest.approx(60, rel=1e-3)
    wholly = [",".join(titles(MEDIAPIPE)), *[",".join([""] * 63)] * 3, text(None, right)]
    (sequence,) = read("\n".join(wholly))
    assert len(sequence) == 15
    np.testing.assert_allclose(sequence.joints[3:], right, atol=1e-6)
