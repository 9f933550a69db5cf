"""Which hand a sequence is: the source's label, what the caller says, how the fingers bend."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

from handtrack.errors import SettingsError
from handtrack.hand.skeleton import Hand
from handtrack.sequences.chirality import DECIDED, STRONG, chirality
from handtrack.sequences.sequence import Sequence

HandChoice = Literal["auto", "left", "right", "swap"]
CHOICES: tuple[HandChoice, ...] = ("auto", "left", "right", "swap")
OTHER: dict[Hand, Hand] = {"left": "right", "right": "left"}
_MIRROR = "pass --mirror z if its world is left-handed (Unity, Unreal), which keeps its name"
_IN_NAME = re.compile(r"(?<![a-z])(left|right)(?![a-z])")
_AT_END = re.compile(r"(?<=\S) (left|right)$")


def label_hands(
    sequences: list[Sequence],
    labels: list[Hand | None],
    tagged: list[bool],
    choice: HandChoice,
    both: bool,
) -> list[Sequence]:
    """The sequences of one source with their hands settled, named, and checked by chirality.

    Args:
        sequences: of one file (or one folder of numbered files).
        labels: what the source calls each.
        tagged: whether each name gets the hand appended even if there is only one.
        choice: "auto": the labels. "left" / "right": only the sequences of that label where the
            source labels both hands, else all of them are that hand. "swap": the labels
            exchanged.
        both: whether the source labels both hands, if only to say that one was never seen.

    Raises:
        SettingsError: "swap" for a source without labels.
    """
    if choice == "swap" and not any(labels):
        raise SettingsError(
            f"{sequences[0].source}: no hand is named there that could be swapped:"
            " choose left or right"
        )
    several = len(sequences) > 1
    out = []
    scores = [chirality(sequence.joints) for sequence in sequences]
    agree = any(
        label is not None and abs(score) > STRONG and (score > 0) == (label == "right")
        for label, score in zip(labels, scores, strict=True)
    )
    for sequence, label, tag in zip(sequences, labels, tagged, strict=True):
        if both and choice in ("left", "right") and label != choice:
            continue
        hand, note = _settle(sequence, label, choice, both, agree)
        name = sequence.name
        if several or tag:
            # the names in handtrack's own recordings have their hand already
            name = f"{_AT_END.sub('', name)} {hand}"
        notes = sequence.notes if note is None else (*sequence.notes, note)
        out.append(replace(sequence, hand=hand, name=name, notes=notes))
    return out


def _settle(
    sequence: Sequence, label: Hand | None, choice: HandChoice, both: bool, agree: bool
) -> tuple[Hand, str | None]:
    """The hand of one sequence, and what to tell the user of it.

    A left-handed world and exchanged labels cannot be told apart by a hand's joints: both are
    named. Where another hand of the source fits its label it is neither.
    """
    score = chirality(sequence.joints)
    bends: Hand = "right" if score > 0 else "left"
    if choice in ("left", "right") and not both:
        hand: Hand = "left" if choice == "left" else "right"
        if bends != hand and abs(score) > STRONG:
            return hand, (
                f"taken as {hand} as asked, but the fingers flex like a {bends} hand's: {_MIRROR}"
            )
        overridden = label is not None and label != hand
        return hand, f"labelled {label}, taken as {hand} as asked" if overridden else None
    if label is not None:
        hand = OTHER[label] if choice == "swap" else label
        if bends != hand and abs(score) > STRONG:
            cure = "swap" if both else bends
            text = f"but the fingers flex like a {bends} hand's"
            if choice == "swap":
                return hand, f"swapped to {hand}, {text}: {_MIRROR}"
            if both and agree:
                return hand, f"labelled {hand}, {text}, while the other hand fits its label"
            return hand, f"labelled {hand}, {text}: pass --hand {cure} to override, or {_MIRROR}"
        return hand, None
    if abs(score) > DECIDED:
        return bends, f"no hand named: taken as {bends} from the way the fingers flex"
    found = set(_IN_NAME.findall(Path(sequence.source).name.lower()))
    if len(found) == 1:
        hand = "left" if found == {"left"} else "right"
        return hand, f"no hand named: taken as {hand} from the file's name"
    return "right", "no hand named and the fingers hardly bend: taken as right (--hand left)"
