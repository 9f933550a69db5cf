"""Short unique names of the hands in one recording, for MCAP topics and viewer paths."""

from __future__ import annotations

import re
from collections.abc import Iterable


def hand_topics(hands: Iterable[tuple[str, str]]) -> list[str]:
    """One name for each hand: "right" where that is enough, else "person0_left".

    Args:
        hands: (name of the sequence, "left" or "right") of every hand in the recording.

    Returns:
        As many names, all different, of the characters a-z, 0-9 and "_".
    """
    hands = list(hands)
    sides = [side for _, side in hands]
    if len(set(sides)) == len(sides):
        return sides
    topics: list[str] = []
    for name, side in hands:
        slug = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "hand"
        wanted = slug if slug.split("_")[-1] == side else f"{slug}_{side}"
        topic, n = wanted, 2
        while topic in topics:
            topic, n = f"{wanted}_{n}", n + 1
        topics.append(topic)
    return topics
