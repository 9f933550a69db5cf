"""Hands that move, written by tests in the formats of the sources."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.hand.model import HandModel
from handtrack.hand.rotations import about_axis

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The real recordings, which are not part of the project."""
    if not SHARED.is_dir():
        pytest.skip(f"real data not there: {SHARED}")
    return SHARED


@pytest.fixture
def refused() -> Callable[[Path, str, str], None]:
    """refused(path, text, match): a file of that text is refused in one line that names it."""

    def check(path: Path, text: str, match: str) -> None:
        path.write_text(text)
        with pytest.raises(HandtrackError, match=match) as caught:
            ht.load(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)

    return check


@pytest.fixture(scope="session")
def motion() -> Callable[..., np.ndarray]:
    """motion(hand, frames): (T, 21, 3) joints [m] of a hand that opens, closes and turns."""

    def make(hand: str = "right", frames: int = 12) -> np.ndarray:
        model = HandModel.default(hand)
        t = np.linspace(0, 1, frames)[:, None]
        angles = np.zeros((frames, 20))
        for finger in range(1, 5):
            angles[:, [4 * finger, 4 * finger + 2, 4 * finger + 3]] = 0.3 + 0.6 * t
        angles[:, 2:4] = 0.3
        axis = np.array([0.6, 0.0, 0.8])
        turn = np.stack([about_axis(axis, np.array(a)) for a in 0.8 * t[:, 0]])
        place = np.array([0.1, 0.2, 1.0]) + 0.2 * t * np.array([1.0, 0.5, 0.0])
        return model.joints(angles, turn, place)

    return make


@pytest.fixture
def right(motion) -> np.ndarray:
    return motion("right")


@pytest.fixture
def left(motion) -> np.ndarray:
    return motion("left")


@pytest.fixture
def read(tmp_path: Path) -> Callable[..., Any]:
    """read(content, name, **choices): the sequences of a file with this text, or these records."""

    def of(content: Any, name: str = "", **choices: Any) -> Any:
        if not isinstance(content, str | bytes):
            name = name or "a.jsonl"
            each = content if name.endswith("l") else [content]
            content = "\n".join(map(json.dumps, each))
        path = tmp_path / (name or "a.csv")
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return ht.load(path, **choices)

    return of
