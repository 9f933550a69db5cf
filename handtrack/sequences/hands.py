"""Which hand a sequence is: the source's label, what the caller says, how the fingers bend."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Literal

from handtrack.errors import InputError, SettingsError
from handtrack.hand.skeleton import Hand
from handtrack.sequences.chirality import DECIDED, STRONG, bending
from handtrack.sequences.names import without_hand, words
from handtrack.sequences.readers.raw import stem
from handtrack.sequences.sequence import Sequence
from handtrack.sequences.titles import side_key

HandChoice = Literal["auto", "left", "right", "swap"]
CHOICES: tuple[HandChoice, ...] = ("auto", "left", "right", "swap")
OTHER: dict[Hand, Hand] = {"left": "right", "right": "left"}
_MIRROR = "pass --mirror z if its world is left-handed (Unity, Unreal), which keeps its name"
_LETTER = re.compile(r"(?i)(?:^|.*[\W_])([lr])$|^([lr])[\W_]")
_DOUBTED = 5
"""In fewer frames the fingers' bending says nothing against a name."""
_AT_END = re.compile(r"(?<=\S) (left|right)$")


def label_hands(
    sequences: list[Sequence],
    labels: list[Hand | None],
    tagged: list[bool],
    choice: HandChoice,
    both: bool,
    by_number: list[bool] | None = None,
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
        by_number: whether the source tells each from the others by a number alone.

    Raises:
        InputError: hands that the source numbers, of which the fingers do not tell which is which.
        SettingsError: "swap" for a source without labels.
    """
    if choice == "swap" and not any(labels):
        raise SettingsError(
            f"{sequences[0].source}: no hand is named there that could be swapped:"
            " choose left or right"
        )
    several = len(sequences) > 1
    hint = None if several else hand_in_name(Path(sequences[0].source))
    out = []
    scores = [bending(sequence.joints) for sequence in sequences]
    agree = any(
        label is not None and abs(score) > STRONG and (score > 0) == (label == "right")
        for label, score in zip(labels, scores, strict=True)
    )
    numbered = any(by_number or ()) and choice not in ("left", "right")
    told = _told_by_bending(sequences, scores) if numbered and hint is None else {}
    for i, (sequence, label, tag) in enumerate(zip(sequences, labels, tagged, strict=True)):
        if both and choice in ("left", "right") and label != choice:
            continue
        hand, note = told.get(i) or _settle(sequence, scores[i], label, choice, both, agree, hint)
        name = sequence.name
        if several or tag:
            # the names in handtrack's own recordings have their hand already
            name = f"{_AT_END.sub('', name)} {hand}"
        notes = sequence.notes if note is None else (*sequence.notes, note)
        out.append(replace(sequence, hand=hand, name=name, notes=notes))
    return out


def hand_in_name(path: Path) -> Hand | None:
    """The hand that the name of a file, or of the folder it is in, says; None: none, or both."""
    name = stem(path)
    side, _ = without_hand(tuple(w for w in words(name) if len(w) > 1))
    letter = _LETTER.match(name)
    if side is None and letter and not {"left", "right"} & set(words(name)):
        side = "left" if (letter[1] or letter[2]).lower() == "l" else "right"
    return side or side_key(path.absolute().parent.name)


def _told_by_bending(sequences: list[Sequence], scores: list[float]) -> dict[int, tuple[Hand, str]]:
    """Which hand each is that has a number; of two the other's bending tells too."""
    sure: dict[int, Hand] = {
        i: "right" if score > 0 else "left"
        for i, score in enumerate(scores)
        if abs(score) > DECIDED
    }
    if len(sequences) == 2 and len(sure) == 1:
        ((i, hand),) = sure.items()
        sure[1 - i] = OTHER[hand]
    if len(sure) < len(sequences):
        raise InputError(
            "hands are numbered there, not named, and the fingers hardly bend: --hand left or"
            " --hand right says which it is, a column or key named hand with left and right which"
            " is which of two",
            sequences[0].source,
        )
    why = "taken as {} from the way the fingers flex"
    return {i: (hand, f"no hand named: {why.format(hand)}") for i, hand in sure.items()}


def _settle(
    sequence: Sequence,
    score: float,
    label: Hand | None,
    choice: HandChoice,
    both: bool,
    agree: bool,
    hint: Hand | None,
) -> tuple[Hand, str | None]:
    """The hand of one sequence, and what to tell the user of it.

    A left-handed world and exchanged labels cannot be told apart by a hand's joints: both are
    named. Where another hand of the source fits its label it is neither.
    """
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
    if hint is not None:
        note = f"no hand named: taken as {hint} from the file's name"
        if bends != hint and abs(score) > STRONG and sequence.present.any(1).sum() >= _DOUBTED:
            note += (
                f", but the fingers flex like a {bends} hand's: pass --hand {bends} to override,"
                f" or {_MIRROR}"
            )
        return hint, note
    if abs(score) > DECIDED:
        return bends, f"no hand named: taken as {bends} from the way the fingers flex"
    return "right", "no hand named and the fingers hardly bend: taken as right (--hand left)"
