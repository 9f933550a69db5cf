"""The numbers of many text lines of hands together, in a fifth of the time of each alone."""

from __future__ import annotations

import re
from collections.abc import Sequence as Items

import numpy as np

from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.readers.columns_at_once import AtOnce
from handtrack.sequences.readers.raw import Array

_POSE = 7


def joints_of_lines(found: Items[re.Match[bytes] | None]) -> list[Array] | None:
    """(21, 3) joints of each line of landmarks, placed by its hand's wrist before it.

    Args:
        found: each line's beginning: the hand, "wrist" or "landmarks", and what stands after.

    Returns:
        An empty array for other lines; None where a line is not as usual, which must be looked at.
    """
    kind = np.array([_kind(match) for match in found])
    wrists, landmarks = np.flatnonzero(kind % 10 == 1), np.flatnonzero(kind % 10 == 2)
    values = _numbers([found[i] for i in landmarks.tolist()], 3 * N_JOINTS)
    poses = _numbers([found[i] for i in wrists.tolist()], _POSE)
    if values is None or poses is None:
        return None
    if len(poses) and not (np.abs(poses[:, 3:]).max(1) > 1e-6).all():
        return None
    if len(poses) and np.abs(poses[:, 3:]).max() >= 1e6:
        return None
    joints = values.reshape(-1, N_JOINTS, 3)
    turns = quaternion_to_matrix(np.roll(poses[:, 3:], 1, axis=1))
    for hand in (10, 20):
        own, of = wrists[kind[wrists] // 10 * 10 == hand], kind[landmarks] // 10 * 10 == hand
        before = np.searchsorted(own, landmarks[of]) - 1
        with_wrist = np.flatnonzero(of)[before >= 0]
        at = np.searchsorted(wrists, own[before[before >= 0]])
        turned = joints[with_wrist] @ turns[at].transpose(0, 2, 1)
        joints[with_wrist] = turned + poses[at, None, :3]
    out = [np.empty(0)] * len(found)
    for i, row in zip(landmarks.tolist(), joints, strict=True):
        out[i] = row
    return out


def _kind(match: re.Match[bytes] | None) -> int:
    """10 for a left, 20 for a right hand's line, and 1 for its wrist, 2 for landmarks."""
    if match is None:
        return 0
    hand = 10 if match[1].lower() == b"left" else 20
    return hand + (1 if match[2].lower() == b"wrist" else 2)


def _numbers(found: Items[re.Match[bytes] | None], count: int) -> Array | None:
    """(lines, count) numbers; None where one has others."""
    texts = []
    for match in found:
        if match is None:
            return None
        text = match.string[match.end() :]
        if text.count(b",") != count:
            cells = text.split(b",", count + 1)
            if count != _POSE or len(cells) < count + 2 or not _is_state(cells[-1]):
                return None
            text = b",".join(cells[:-1])
        if text[:1] != b",":
            return None
        texts.append(text)
    if not texts:
        return np.empty((0, count))
    values = AtOnce(b"\n".join(texts), ",", count + 1, len(texts)).floats(range(1, count + 1))
    return values if values is not None and np.isfinite(values).all() else None


def _is_state(rest: bytes) -> bool:
    """Whether what follows a pose is a fist's state."""
    return all(b":" in cell or cell.strip().isalpha() for cell in rest.split(b","))
