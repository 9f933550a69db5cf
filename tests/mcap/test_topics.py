from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from handtrack.mcap.hand import hand_topics


@pytest.mark.parametrize(
    ("hands", "expected"),
    [
        ([("x", "right")], ["right"]),
        ([("x", "left"), ("y", "right")], ["left", "right"]),
        (
            [("person0", "left"), ("person0", "right"), ("person1", "left")],
            ["person0_left", "person0_right", "person1_left"],
        ),
        ([("a left", "left"), ("b", "left")], ["a_left", "b_left"]),
        ([("a", "left")] * 3, ["a_left", "a_left_2", "a_left_3"]),
        ([("手", "left"), ("", "left")], ["hand_left", "hand_left_2"]),
    ],
)
def test_names(hands: list[tuple[str, str]], expected: list[str]) -> None:
    assert hand_topics(hands) == expected


@given(st.lists(st.tuples(st.text(), st.sampled_from(["left", "right"])), max_size=6))
def test_always_different_and_plain(hands: list[tuple[str, str]]) -> None:
    topics = hand_topics(hands)
    assert len(set(topics)) == len(hands)
    assert all(re.fullmatch("[a-z0-9_]+", topic) for topic in topics)
