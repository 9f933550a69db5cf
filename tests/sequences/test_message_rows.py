"""Messages of one layout read at once hold what each of them holds, whatever lies between them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from robot_messages import FRAMES, LEFT, MARKERS, POSE_ARRAY, RIGHT, TF, chain, ros

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.sequences.readers.message_rows import NoMessageError, Rows, by_layout
from tools.make.robot_logs import (
    HUMBLE,
    START,
    STEP,
    foxglove_frames,
    marker_array,
    pose_array,
    protobuf,
    tf_message,
    write_log,
)

TIMES = 4
"""Each frame so often, one after the other."""
N = TIMES * FRAMES
FOXGLOVE = "foxglove.FrameTransforms"


def seen(i: int) -> list[int]:
    """Joints of a moment in their order: it changes in the middle, then some are not seen."""
    order = np.arange(21) if i < N // 3 else np.roll(np.arange(21), 5)
    return [j for j in order.tolist() if i < N // 2 or (i + j) % 7]


def expected(joints: np.ndarray, i: int) -> np.ndarray:
    out = np.full((21, 3), np.nan)
    out[seen(i)] = joints[i % FRAMES][seen(i)]
    return out


def frames_of(i: int, chained: bool) -> list[tuple[str, str, Any, Any]]:
    frames: list[tuple[str, str, Any, Any]] = []
    for side, joints in (("left", LEFT), ("right", RIGHT)):
        own = chain(joints[i % FRAMES], side)
        if not chained:
            own = [("world", f[1], joints[i % FRAMES, j], f[3]) for j, f in enumerate(own)]
            own = [own[j] for j in seen(i)]
        frames += own
    return frames[:: -1 if i % 5 == 3 else 1]


@pytest.mark.parametrize("kind", ["tf", "foxglove"])
@pytest.mark.parametrize("chained", [True, False])
def test_frames_whose_order_and_number_change(tmp_path: Path, kind: str, chained: bool) -> None:
    if kind == "tf":
        topic = ros(TF, lambda time, i: tf_message(time, frames_of(i, chained)))
    else:
        topic = (  # their nanoseconds take three to five bytes
            *(FOXGLOVE, "protobuf", "protobuf", protobuf(FOXGLOVE)),
            lambda time, i: foxglove_frames(time + i * i, frames_of(i, chained)),
        )
    found = ht.load(write_log(tmp_path / "x.mcap", {"/tf": topic}, N))
    for sequence, joints in zip(found, (LEFT, RIGHT), strict=True):
        assert len(sequence) == N
        for i in range(N):
            wanted = joints[i % FRAMES] if chained else expected(joints, i)
            np.testing.assert_allclose(sequence.joints[i], wanted, atol=1e-9)


@pytest.mark.parametrize("named", [True, False])
def test_markers_whose_order_and_number_change(tmp_path: Path, named: bool) -> None:
    def message(time: int, i: int) -> bytes:
        spheres = [
            (f"{side}_{JOINT_NAMES[j]}" if named else side, 0 if named else j, joints[i % 12, j])
            for side, joints in (("left", LEFT), ("right", RIGHT))
            for j in seen(i)
        ]
        return marker_array(time, spheres)

    found = ht.load(write_log(tmp_path / "x.mcap", {"/m": ros(MARKERS, message, HUMBLE)}, N))
    for sequence, joints in zip(found, (LEFT, RIGHT), strict=True):
        for i in range(N):
            np.testing.assert_allclose(sequence.joints[i], expected(joints, i))


def test_frames_that_change_what_they_are_in(tmp_path: Path) -> None:
    """A hand that stands in the room, then on a cart; the last to say it of one time is right."""
    turned = (0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5))

    def message(time: int, i: int) -> bytes:
        hand = chain(RIGHT[0], "right")
        hand[0] = ("cart" if i >= N // 2 else "room", *hand[0][1:])
        cart = ("room", "cart", [0.5, 0.0, 0.01 * i], turned)
        return tf_message(time, [("room", "cart", [9.0, 9.0, 9.0], turned), cart, *hand])

    (found,) = ht.load(write_log(tmp_path / "x.mcap", {"/tf": ros(TF, message)}, N))
    for i in range(N):
        x, y, z = RIGHT[0].T
        wanted = [x, y, z] if i < N // 2 else [0.5 - y, x, 0.01 * i + z]
        np.testing.assert_allclose(found.joints[i], np.stack(wanted, -1), atol=1e-9)


def test_a_broken_message_between_others_is_told_with_its_number(tmp_path: Path) -> None:
    def message(time: int, i: int) -> bytes:
        whole = pose_array(time, RIGHT[i % FRAMES])
        return whole[:-300] + bytes(300 if i != 31 else 3)

    with pytest.raises(HandtrackError, match="/right, message 31 is no geometry_msgs"):
        ht.load(write_log(tmp_path / "x.mcap", {"/right": ros(POSE_ARRAY, message)}, N))


def test_layouts() -> None:
    # a letter, a number that may differ, and a byte that may; in an order of no kind
    rng = np.random.default_rng(0)
    letters = rng.choice(list("abc"), 500, p=[0.6, 0.3, 0.1])
    letters[250:] = [chr(200 + i % 50) for i in range(250)]
    numbers = rng.normal(size=500)
    sizes = rng.integers(0, 3, 500)
    messages = [
        letter.encode("latin-1") + number.tobytes() + bytes([7, *[i % 256] * size])
        for i, (letter, number, size) in enumerate(zip(letters, numbers, sizes, strict=True))
    ]

    def read(rows: Rows) -> tuple[str, np.ndarray]:
        rows.free(10, len(rows.first))
        if rows.first[9] != 7:
            raise ValueError("no seven")
        return rows.first[:1].decode("latin-1"), rows.numbers(1, "<f8")[:, 0]

    seen_at: list[int] = []
    for at, (letter, found) in by_layout(messages, read):
        assert (np.diff(at) > 0).all()
        assert (letters[at] == letter).all()
        np.testing.assert_array_equal(found, numbers[at])
        seen_at += at.tolist()
    assert sorted(seen_at) == list(range(500))
    messages[123] = messages[123][:9] + b"\x08" + messages[123][10:]
    with pytest.raises(NoMessageError, match="no seven") as error:
        list(by_layout(messages, read))
    assert error.value.number == 123


def test_takes_whose_stamps_begin_anew_are_not_laid_over_each_other(tmp_path: Path) -> None:
    half = 2 * FRAMES

    def message(time: int, i: int) -> bytes:
        stamp = START + (i % half) * 100 * STEP
        joints = RIGHT[i % FRAMES] + [0.0, 0.0, 0.3 * (i >= half)]
        places = zip(JOINT_NAMES, joints, strict=True)
        return tf_message(stamp, [("w", f"right_{n}", p, (0, 0, 0, 1)) for n, p in places])

    (found,) = ht.load(write_log(tmp_path / "x.mcap", {"/tf": ros(TF, message)}, N))
    assert len(found) == N
    assert any("begin anew" in note for note in found.notes)
    for i in range(N):
        wanted = RIGHT[i % FRAMES] + [0.0, 0.0, 0.3 * (i >= half)]
        np.testing.assert_allclose(found.joints[i], wanted, atol=1e-12)


@pytest.mark.parametrize("first", [0, 1])
def test_frames_of_a_hand_and_a_number(tmp_path: Path, first: int) -> None:
    def message(time: int, i: int) -> bytes:
        return tf_message(
            time,
            [
                ("camera", f"{side}_hand_{j + first}", joints[i, j], (0, 0, 0, 1))
                for side, joints in (("left", LEFT), ("right", RIGHT))
                for j in range(21)
            ],
        )

    left, right = ht.load(write_log(tmp_path / "x.mcap", {"/tf": ros(TF, message)}, FRAMES))
    np.testing.assert_allclose(left.joints, LEFT)
    np.testing.assert_allclose(right.joints, RIGHT)
