"""JSON of many frames of few forms, read without decoding each: what a reader makes of one record
of each form tells where in all others the numbers are.

The numbers of the first record of each form are exchanged for others that stand nowhere else, and
`records_by_hand` reads these few records, twice, with other numbers. A number that it hands over
is then known by the place that it was written at; whatever depends on the numbers in another way
differs between the two, and the records are decoded one by one.
"""

from __future__ import annotations

from collections.abc import Callable
from collections.abc import Sequence as Items
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from handtrack.errors import InputError
from handtrack.files.long_arrays import Growing, blocks
from handtrack.sequences.clock import Stamps
from handtrack.sequences.readers.beside_world import with_pictures, without_world
from handtrack.sequences.readers.fields import frame_numbers
from handtrack.sequences.readers.jsontext import decode, without_nan
from handtrack.sequences.readers.number_text import Form, Forms, NotAlikeError
from handtrack.sequences.readers.pictures import seen_in_picture
from handtrack.sequences.readers.raw import Array, NotJointsError, Raw, usable_confidence
from handtrack.sequences.readers.record_places import Picked
from handtrack.sequences.readers.records import HandRecords, records_by_hand
from handtrack.sequences.readers.spelling import in_small_letters
from handtrack.sequences.titles import is_frame_number

FEWEST = 200
"""Fewer records are decoded one by one at once."""
_MOST_NUMBERS = 4000
_BLANK = -1
_FIXED = -2

Prepare = Callable[[Items[Any], Items[str], Path], list[Any]]


@dataclass
class _Hand:
    """Where in records of each form the numbers of one hand are.

    Attributes:
        hand: as read of the first records.
        forms: of its records.
        joints: (K, N, 3) of each of its forms the columns of the joints, `_BLANK` for none.
        sure: (K, N) the columns of confidence, `_FIXED` where it is `fixed` (K, N); or None.
        number: (K,) the columns of the frames' numbers, or None.
        stamps: of each of its forms what stands for its time, with columns for numbers; or None.
    """

    hand: HandRecords
    forms: list[int]
    joints: NDArray[np.int64]
    joints_fixed: Array
    sure: NDArray[np.int64] | None
    sure_fixed: Array | None
    number: NDArray[np.int64] | None
    stamps: list[Any] | None


class _Column(int):
    """A number's column, in the place of the number."""


def read_alike(
    forms: Forms,
    places: Items[str],
    path: Path,
    about: dict[str, Any] | None = None,
    prepared: Prepare | None = None,
) -> list[Raw] | None:
    """The sequences of records, one per hand, as `read_records` makes them.

    Args:
        forms: all records.
        places: where each stands.
        path: the file.
        about: what the file says of all of them.
        prepared: makes records that `read_records` takes of what a source has.

    Returns:
        None where the records must be decoded one by one, also to say what is wrong in them.
    """
    if sum(len(form.spans) for form in forms.forms) > _MOST_NUMBERS:
        return None
    try:
        readings = [_reading(forms, places, path, about, way, False, prepared) for way in (0, 1)]
        hands = _same(readings)
        raws = [_whole(hand, forms, places, path) for hand in hands]
    except (InputError, NotAlikeError, OverflowError):
        return None
    if not any(hand.hand.world for hand in hands):
        return raws
    try:
        hands = _same([_reading(forms, places, path, about, way, True) for way in (0, 1)])
        shown = [_whole(hand, forms, places, path) for hand in hands]
    except NotJointsError:  # nothing in a picture
        return raws
    except (InputError, NotAlikeError, OverflowError):
        return None
    first = in_small_letters([decode(form.first, Any, path) for form in forms.forms])
    return with_pictures(raws, shown, first, about)


def _reading(
    forms: Forms,
    places: Items[str],
    path: Path,
    about: dict[str, Any] | None,
    way: int,
    beside: bool = False,
    prepared: Prepare | None = None,
) -> list[_Hand]:
    """What is made of the first records with other numbers in them; `beside`: of what stands
    beside the joints in the world."""
    values: list[Any] = []
    columns: list[dict[float, int]] = []
    for f, form in enumerate(forms.forms):
        text, known = _with_codes(form, f, way)
        values.append(decode(text, Any, path))
        columns.append(known)
    values = in_small_letters(values)
    if beside:
        values = without_world(values)
    numbered = any(is_frame_number(str(k)) for v in values if isinstance(v, dict) for k in v)
    where = Picked(places, forms.firsts)
    if prepared is not None:
        values = prepared(values, where, path)
    found = records_by_hand(values, where, path, about)
    hands = []
    for hand in found:
        raw = hand.raw
        of = [columns[f] for f in hand.rows]
        if numbered and raw.frame_index is None:
            raise NotAlikeError
        joints, fixed = _columns_of(raw.joints, of)
        sure = None if raw.confidence is None else _columns_of(raw.confidence, of)
        number = None if raw.frame_index is None else _columns_of(raw.frame_index, of)[0]
        if number is not None and (number < 0).any():
            raise NotAlikeError
        stamps = None
        if raw.stamps is not None:
            stamps = [_stamp_of(v, known) for v, known in zip(raw.stamps.values, of, strict=True)]
        hands.append(
            _Hand(
                hand,
                hand.rows,
                joints,
                fixed,
                None if sure is None else sure[0],
                None if sure is None else sure[1],
                number,
                stamps,
            )
        )
    return hands


def _with_codes(form: Form, index: int, way: int) -> tuple[bytes, dict[float, int]]:
    """The first record of a form with a number of its own in the place of each that changes, and
    the columns of these numbers."""
    parts, end, known = [], 0, {}
    fixed = form.fixed
    for c, (a, b) in enumerate(form.spans.tolist()):
        if fixed[c]:
            continue
        k = 1 + c + _MOST_NUMBERS * (index + 1) + way * (1 << 20)
        # what is written as a whole number stays one; others may be confidences
        code: float = 10**9 + k if c in form.whole else k / 2.0**24
        known[float(code)] = c
        parts += [form.first[end:a], repr(code).encode()]
        end = b
    return b"".join((*parts, form.first[end:])), known


def _columns_of(
    values: NDArray[Any], known: Items[dict[float, int]]
) -> tuple[NDArray[np.int64], Array]:
    """The columns of numbers (K, ...), and those that are no column's."""
    out = np.full(values.shape, _FIXED, np.int64)
    for i, columns in enumerate(known):
        flat = [columns.get(float(v), _FIXED) for v in np.ravel(values[i])]
        out[i] = np.array(flat).reshape(values[i].shape)
    out[np.isnan(values)] = _BLANK
    return out, np.where(out == _FIXED, values, np.nan).astype(np.float64)


def _stamp_of(value: Any, known: dict[float, int]) -> Any:
    if isinstance(value, dict):
        return {k: _stamp_of(v, known) for k, v in value.items()}
    if isinstance(value, int | float) and not isinstance(value, bool) and float(value) in known:
        return _Column(known[float(value)])
    return value


def _same(readings: list[list[_Hand]]) -> list[_Hand]:
    """One reading, where both are the same.

    Raises:
        NotAlikeError: they are not.
    """
    first, second = readings
    if len(first) != len(second):
        raise NotAlikeError
    for a, b in zip(first, second, strict=True):
        kept: list[Raw] = [
            replace(h.hand.raw, joints=np.empty(0), confidence=None, stamps=None, frame_index=None)
            for h in (a, b)
        ]
        alike = vars(kept[0]) | {"joints": 0} == vars(kept[1]) | {"joints": 0}
        alike &= a.forms == b.forms and a.hand.world == b.hand.world and a.stamps == b.stamps
        for name in ("joints", "joints_fixed", "sure", "sure_fixed", "number"):
            x, y = getattr(a, name), getattr(b, name)
            alike &= (x is None) == (y is None)
            alike = alike and (x is None or np.array_equal(x, y, equal_nan=x.dtype.kind == "f"))
        if not alike or not _same_stamps(a.hand.raw.stamps, b.hand.raw.stamps):
            raise NotAlikeError
    return first


def _same_stamps(a: Stamps | None, b: Stamps | None) -> bool:
    if a is None or b is None:
        return a is b
    return (a.name, a.unit) == (b.name, b.unit)


def _whole(hand: _Hand, forms: Forms, places: Items[str], path: Path) -> Raw:
    """One hand's sequence of all records."""
    place_of = np.full(len(forms.forms), -1, np.int64)
    place_of[hand.forms] = np.arange(len(hand.forms))
    n = hand.joints.shape[1]
    joints, sure = Growing((n, 3)), Growing((n,))
    numbers, rows, stamps = Growing(()), Growing((), np.int64), list[Any]()
    at = np.zeros(len(forms.forms), np.int64)
    for part in blocks(len(forms)):
        of_record = forms.of_record.read(part)
        mine = place_of[of_record] >= 0
        rows.append(np.flatnonzero(mine) + part.start)
        block = np.full((len(of_record), n, 3), np.nan)
        confident, number = np.ones((len(of_record), n)), np.full(len(of_record), np.nan)
        times: list[Any] = [None] * len(of_record)
        for f in np.unique(of_record).tolist():
            here, k = np.flatnonzero(of_record == f), place_of[f]
            form, some = forms.forms[f], slice(int(at[f]), int(at[f]) + len(of_record))
            some = slice(some.start, some.start + len(here))
            at[f] = some.stop
            if k < 0:
                continue
            values = form.numbers.read(some) if len(form.spans) else np.full((len(here), 1), np.nan)
            block[here] = _taken(values, hand.joints[k], hand.joints_fixed[k])
            if hand.sure is not None and hand.sure_fixed is not None:
                confident[here] = _taken(values, hand.sure[k], hand.sure_fixed[k])
            if hand.number is not None:
                number[here] = values[:, hand.number[k]]
            if hand.stamps is not None:
                _put(times, here, hand.stamps[k], form, values, some)
        joints.append(block[mine])
        sure.append(confident[mine])
        numbers.append(number[mine])
        if hand.stamps is not None:
            stamps += [times[i] for i in np.flatnonzero(mine).tolist()]
    index = rows.whole().tolist()
    raw = replace(hand.hand.raw, joints=joints.whole(), confidence=None)
    if hand.sure is not None:
        raw.confidence = _confidence(sure.whole(), hand)
    if hand.number is not None:
        raw.frame_index = frame_numbers(numbers.whole(), len(index), path, "the frame's number")
    if raw.stamps is not None:
        raw.stamps = replace(raw.stamps, values=stamps, places=Picked(places, index))
    return raw if hand.hand.world else seen_in_picture(raw)


def _taken(values: Array, columns: NDArray[np.int64], fixed: Array) -> Array:
    """(R, ...) the columns (...) of numbers (R, M), or what is the same in all."""
    out = values[:, np.maximum(columns, 0)]
    return out if (columns >= 0).all() else np.where(columns >= 0, out, fixed)


def _put(
    times: list[Any],
    here: NDArray[np.int64],
    stamp: Any,
    form: Form,
    values: Array,
    some: slice,
) -> None:
    """The times of some records of one form."""
    if isinstance(stamp, dict):
        parts = {k: list[Any]([None] * len(here)) for k in stamp}
        for k, inner in stamp.items():
            _put(parts[k], np.arange(len(here)), inner, form, values, some)
        rows = zip(*parts.values(), strict=True)
        given: list[Any] = [dict(zip(parts, row, strict=True)) for row in rows]
    elif isinstance(stamp, _Column):
        exact = form.whole.get(stamp)
        given = (values[:, stamp] if exact is None else exact.read(some)).tolist()
    else:
        given = [stamp] * len(here)
    for i, value in zip(here.tolist(), given, strict=True):
        times[i] = value


def _confidence(values: Array, hand: _Hand) -> Array | None:
    """The confidences, as in `records`.

    Raises:
        NotAlikeError: none is above 0, of which records that say nothing are no part.
    """
    found = usable_confidence(values)
    said = np.asarray(hand.sure != _BLANK).any(0)
    if found is None or not (found[:, said] > 0).any():
        raise NotAlikeError
    return found


def forms_of(text: bytes) -> Forms | None:
    """The records of a JSON list, by their forms; None where they are few, of many forms, or no
    well-formed list."""
    forms = Forms()
    return forms if append_list(forms, text) and len(forms) >= FEWEST else None


def append_list(forms: Forms, text: bytes) -> bool:
    """Add the records of a JSON list, if it is one and they have few forms."""
    try:
        raws = msgspec.json.decode(without_nan(text), type=list[msgspec.Raw])
        for start in range(0, len(raws), 4096):
            forms.append([bytes(raw) for raw in raws[start : start + 4096]])
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError, NotAlikeError):
        return False
    return True
