"""Which of our joints the names of one hand are: a name alone does not always say it."""

from __future__ import annotations

from collections.abc import Iterable

from handtrack.sequences.names import DISTAL, INTERMEDIATE, TIP, UNUSED, JointName


def settle(names: Iterable[JointName]) -> list[int | None]:
    """Which of our joints each name of one hand is; UNUSED: none of the 21, None: cannot tell.

    Joints that have only a number in the hand are for their reader.
    """
    given = list(names)
    wrist = any(n.finger is None and n.number is None and not n.extra and not n.weak for n in given)
    tips = any(n.part == TIP for n in given)
    numbers = {n.number for n in given if n.finger is not None and n.number is not None}
    thumb = {n.part for n in given if n.finger == 0 and n.part is not None and not n.extra}
    out: list[int | None] = []
    for n in given:
        if n.extra or (n.weak and wrist):
            out.append(UNUSED)
        elif n.finger is None:
            out.append(None if n.number is not None else 0)
        else:
            slot: int | None
            if n.number is not None:
                slot = _slot_of_number(n.number, {x for x in numbers if x is not None}, tips)
            elif n.finger == 0 and n.part is not None:
                slot = _slot_of_thumb(n.part, {p for p in thumb if p is not None})
            else:
                slot = n.part
            out.append(UNUSED if slot == 0 else None if slot is None else 4 * n.finger + slot)
    return out


def _slot_of_number(number: int, numbers: set[int], tips: bool) -> int | None:
    """1..4 in the finger (0: a metacarpal's base): the last number is the tip, or before it."""
    last = max(numbers)
    # fingers of three joints and no tip, as MANO's, begin at 1 or 0
    end = 3 if tips or len(numbers) == 3 else 4
    slot = number - last + end
    return slot if 0 <= slot <= 4 else None


def _slot_of_thumb(part: int, parts: set[int]) -> int:
    """The thumb has one bone less: whose names its joints borrow differs."""
    if INTERMEDIATE in parts and DISTAL in parts:
        return part  # five names (Leap's metacarpal has no length), or MCP, PIP, DIP and tip
    if part in (TIP, DISTAL):
        return part
    if part == INTERMEDIATE:  # IP, where nothing else is it
        return DISTAL
    return part + 1
