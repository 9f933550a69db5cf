"""Lines of text such as `Right landmarks:, 63 numbers`, from a stream, a socket and a file."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.rotations import matrix_to_quaternion, quaternion_to_matrix, vector_to_matrix
from handtrack.live.lines import from_lines
from handtrack.live.sources import Newest, datagrams

TO_UNITY = np.array([1.0, 1.0, -1.0])


def moving(hand: str, frames: int = 6) -> np.ndarray:
    """(T, 21, 3) of a hand that bends, in a right-handed world [m]."""
    model = ht.HandModel.default(hand)
    bend = np.linspace(0.1, 0.9, frames)[:, None] * np.tile([0.8, 0.05, 0.9, 0.6], 5)
    turn = vector_to_matrix([0.3, -0.8, 0.4])
    return model.joints(model.limits.clamp(bend), turn, [0.1, 1.2, -0.5])


def sent(hand: str, joints: np.ndarray, about: str = "") -> str:
    """The two lines of a frame as Unity has it: joints in the frame of a wrist that is turned."""
    unity = joints * TO_UNITY
    turn = quaternion_to_matrix(matrix_to_quaternion(vector_to_matrix([0.5, 1.0, -0.2])))
    quaternion = np.roll(matrix_to_quaternion(turn), -1)
    own = (unity - unity[0]) @ turn
    wrist = ", ".join(f"{x:.7f}" for x in [*unity[0], *quaternion])
    marks = ", ".join(f"{x:.7f}" for x in own.ravel())
    side = hand.capitalize()
    return f"{side} wrist{about}:, {wrist}\n{side} landmarks{about}:, {marks}"


def queue(*chunks: str) -> Newest[bytes]:
    made: Newest[bytes] = Newest(999)
    for chunk in chunks:
        made.put(chunk.encode())
    made.end()
    return made


def test_one_hand_comes_at_once() -> None:
    joints = moving("right")
    # a datagram has both lines, a stream has one after the other
    for cut in (False, True):
        chunks = [sent("right", x) for x in joints]
        if cut:
            chunks = [line for chunk in chunks for line in chunk.split("\n")]
        found = list(from_lines(queue("Head pose:, 1, 2, 3, 0, 0, 0, 1", *chunks), "test"))
        assert [list(f.joints) for f in found] == [["right"]] * 6
        for frame, expected in zip(found, joints, strict=True):
            np.testing.assert_allclose(frame.joints["right"], expected, atol=2e-6)
        times = [f.time_ns for f in found]
        assert times == sorted(set(times))


def test_two_hands_in_turn_are_one_frame() -> None:
    left, right = moving("left"), moving("right")
    chunks = []
    for i in range(6):
        about = f" | f = {i} | t = {5_000_000_000 + i * 20_000_000}"
        chunks += [sent("left", left[i], about), sent("right", right[i], about)]
    found = list(from_lines(queue(*chunks), "test"))
    # until the other hand is met the first is alone
    assert [sorted(f.joints) for f in found] == [["left"], *[["left", "right"]] * 5]
    np.testing.assert_allclose(found[4].joints["left"], left[4], atol=2e-6)
    np.testing.assert_allclose(found[4].joints["right"], right[4], atol=2e-6)
    assert found[4].time_ns == 5_000_000_000 + 4 * 20_000_000
    unstamped = [sent(*h) for i in range(6) for h in (("left", left[i]), ("right", right[i]))]
    plain = list(from_lines(queue(*unstamped), "test"))
    np.testing.assert_allclose(plain[4].joints["left"], left[4], atol=2e-6)
    np.testing.assert_allclose(plain[4].joints["right"], right[4], atol=2e-6)
    # a hand that is gone is not waited for for long
    alone = list(from_lines(queue(*chunks, *(sent("left", left[0]) for _ in range(20))), "test"))
    assert [sorted(f.joints) for f in alone[-5:]] == [["left"]] * 5
    assert sum("left" in f.joints for f in alone) == 26


def test_a_file_of_lines(tmp_path: Path) -> None:
    left, right = moving("left"), moving("right")
    lines = []
    for i in range(6):
        about = f" | f = {i} | t = {i * 20_000_000}"
        lines += [sent("left", left[i], about), sent("right", right[i], about)]
    (tmp_path / "log.txt").write_text("\n".join(lines) + "\n")
    found = {s.hand: s for s in ht.load(tmp_path / "log.txt")}
    np.testing.assert_allclose(found["left"].joints, left, atol=2e-6)
    np.testing.assert_allclose(found["right"].joints, right, atol=2e-6)
    assert found["right"].fps == pytest.approx(50)


def test_datagrams_with_two_lines() -> None:
    joints = moving("right")
    received, (host, port) = datagrams("0")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        for frame in joints:
            out.sendto(sent("right", frame).encode(), (host, port))
    found = []
    for frame in from_lines(received, "test"):
        found.append(frame)
        if len(found) == len(joints):
            received.end()
            break
    np.testing.assert_allclose(found[-1].joints["right"], joints[-1], atol=2e-6)


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("Right landmarks:, 1, 2, 3", "line 2: a line has 3 values, expected 63 numbers"),
        ("Right wrist:, 0, 0, 0, 0, 0, 0, 0", "no rotation"),
        ("Left landmarks:, " + ", ".join(["nan"] * 63), "expected 63 numbers"),
        ("something else", "is no line such as"),
    ],
)
def test_lines_that_are_wrong_are_named(line: str, text: str) -> None:
    with pytest.raises(InputError, match=text):
        list(from_lines(queue(sent("right", moving("right")[0]), line), "test"))


def test_the_fist_of_some_senders_is_passed_over() -> None:
    chunk = sent("right", moving("right")[0])
    wrist, marks = chunk.split("\n")
    found = list(from_lines(queue(f"{wrist}, leftFist: open", marks), "test"))
    np.testing.assert_allclose(found[0].joints["right"], moving("right")[0], atol=2e-6)
