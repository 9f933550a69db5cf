"""What remarks above a table say of all of it: `# unit: mm`, `# fps=60`, `# hand: left`."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace

from handtrack.errors import InputError
from handtrack.hand.skeleton import ORDERS
from handtrack.hand.units import Unit
from handtrack.sequences.names import UNITS, as_side
from handtrack.sequences.readers.fields import RATES
from handtrack.sequences.readers.raw import Raw

MOST = 50
"""Remarks that are looked at."""
_PAIR = re.compile(r"\s*([A-Za-z][\w ()/-]{0,40}?)\s*[:=]\s*[\"']?([^\"',;]{1,40}?)[\"']?\s*")
_RATE = re.compile(r"(?i)(?<![\d.])(\d{1,5}(?:\.\d{1,9})?)\s*(?:fps|hz|frames\s*(?:/|per)\s*s)")
_IN_UNITS = re.compile(r"(?i)\b(?:in|are)\s+(?P<unit>[a-z]{1,12})\b")
_ABOUT_PLACES = re.compile(r"(?i)\b(?:unit|units|position|positions|coordinate|coordinates|joints)")
_UNIT = {"unit", "units", "length unit", "position unit", "position units", "coordinate unit"}
_FPS = {name.replace("_", " ") for name in RATES}
_HAND = {"hand", "side", "handedness"}


def remarked(raws: list[Raw], remarks: list[str]) -> list[Raw]:
    """The hands of a table, with what its remarks say where the table itself does not."""
    said = dict(_said(remarks[:MOST]))
    if not said:
        return raws
    out = []
    for raw in raws:
        used = []
        unit = UNITS.get(said.get("unit", ""))
        if raw.unit is None and not raw.picture and unit is not None:
            raw = replace(raw, unit=unit)
            used.append(f"unit {unit}")
        if raw.fps is None and "fps" in said:
            raw = replace(raw, fps=float(said["fps"]))
            used.append(f"{said['fps']} frames/s")
        side = as_side(said.get("hand"))
        if raw.hand is None and len(raws) == 1 and side is not None:
            raw = replace(raw, hand=side)
            used.append(f"{side} hand")
        if raw.order is None and said.get("order") in ORDERS:
            raw = replace(raw, order=said["order"])
            used.append(f"order {raw.order}")
        note = f"a remark in the file says: {', '.join(used)}"
        out.append(replace(raw, notes=(*raw.notes, note)) if used else raw)
    return out


def stated(raws: list[Raw], unit: Unit) -> list[Raw]:
    """The hands of a table whose cells state their unit.

    Raises:
        InputError: its titles state another one.
    """
    for raw in raws:
        if raw.unit is not None and raw.unit != unit:
            raise InputError(f"its titles are in {raw.unit}, its cells in {unit}", raw.path)
    return [raw if raw.picture else replace(raw, unit=unit) for raw in raws]


def _said(remarks: list[str]) -> Iterable[tuple[str, str]]:
    for remark in remarks:
        for part in re.split(r"[,;|]", remark):
            pair = _PAIR.fullmatch(part)
            if pair is not None:
                yield from _of_pair(pair[1].lower().replace("_", " ").strip(), pair[2])
                continue
            rate = _RATE.search(part)
            if rate is not None:
                yield "fps", rate[1]
            found = _IN_UNITS.search(part) if _ABOUT_PLACES.search(part) else None
            if found is not None and found["unit"].lower() in UNITS:
                yield "unit", found["unit"].lower()


def _of_pair(name: str, value: str) -> Iterable[tuple[str, str]]:
    if name in _UNIT and value.lower() in UNITS:
        yield "unit", value.lower()
    elif name in _FPS:
        rate = re.fullmatch(r"(?i)(\d{1,5}(?:\.\d{1,9})?)(?:\s*(?:fps|hz))?", value)
        if rate is not None and float(rate[1]) > 0:
            yield "fps", rate[1]
    elif name in _HAND and as_side(value) is not None:
        yield "hand", value
    elif name in ("order", "joint order"):
        yield "order", value.lower()
