"""Random combinations of what people do: order, unit, marks, time, names, side."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from made_files import bare, csv, json_frames, json_object, jsonl, leap, mcap, npy, npz, sides
from made_hands import (
    FPS,
    OTHER_ORDERS,
    Brought,
    both,
    brought,
    late,
    mirrored,
    missing,
    ordered,
    scaled,
    seconds,
    timed,
    unsure,
)
from made_names import NAMES

MILLIMETRES = {"m": 1.0, "cm": 100.0, "mm": 1000.0}


@dataclass(frozen=True)
class Combination:
    """A file as somebody might bring it.

    Attributes:
        words: what was done to the hand.
        brought: what should come out.
        arguments: of the command line.
        make: writes it into a folder.
    """

    words: str
    brought: Brought
    arguments: list[str]
    make: Callable[[Path], Path]


def _weighed(rng: np.random.Generator, **choices: float) -> str:
    weights = np.array(list(choices.values()))
    return str(rng.choice(list(choices), p=weights / weights.sum()))


def combination(seed: int) -> Combination:
    """The combination of that number, always the same."""
    rng = np.random.default_rng([20261127, seed])
    side = _weighed(rng, right=3, left=3, both=3)
    b = both() if side == "both" else brought(side)
    words, arguments = [side], list[str]()
    b, label = _labelled(rng, b)
    words.append(label)

    marks = _weighed(rng, none=3, NaN=2, zeros=2, minus=2, late=2, confidence=1)
    mark = {"zeros": 0.0, "minus": -1.0}.get(marks)
    if marks in ("NaN", "zeros", "minus"):
        b = missing(b, mark, seed=seed)
    elif marks == "late":
        b = late(b)
    elif marks == "confidence":
        b = unsure(b)
    words.append(f"marks {marks}")

    unit = str(rng.choice(["m", "m", "cm", "mm", "mm"]))
    stated = unit == "m" or bool(rng.random() < 0.5)
    time = _time(rng)
    write, file, how, format_words, by_name = _format(rng, b, unit if stated else None, time)

    # who names the joints has them in the order of the names
    order = "ours" if by_name else _weighed(rng, ours=5, named=2, other=2)
    if order == "named":
        name = str(rng.choice(["mano", "interhand", "fpha"]))
        told = bool(rng.random() < 0.5)
        b, order = ordered(b, name), f"{name}{' told' if told else ''}"
        arguments += ["--order", name] if told else []
    elif order == "other":
        order = str(rng.choice(list(OTHER_ORDERS)))
        b = ordered(b, order)
    words.append(f"order {order}")

    world = _weighed(rng, same=8, mirrored=1, told=1)
    if world != "same":
        axis = int(rng.integers(3))
        b = mirrored(b, axis)
        arguments += ["--mirror", "xyz"[axis]] if world == "told" else []
        words.append(f"mirrored {'xyz'[axis]}{' told' if world == 'told' else ''}")

    words.append(f"time {time}")
    b = _timed(scaled(b, MILLIMETRES[unit]), time)
    unit_stated = how.pop("unit_stated", False)
    if unit != "m" and stated and not unit_stated:
        arguments += ["--unit", unit]
    words += [f"unit {unit}{'' if stated else ' untold'}", format_words]
    if format_words.startswith("leap"):  # it has no wrist
        b = _without_wrist(b)

    def make(folder: Path) -> Path:
        return write(folder / file, b, **how)

    return Combination(", ".join(words), b, arguments, make)


def _labelled(rng: np.random.Generator, b: Brought) -> tuple[Brought, str]:
    style = _weighed(rng, lower=4, Capital=3, letter=1, hand=1, none=1 if b.other is None else 0)
    say: dict[str, Callable[[str], Any]] = {
        "lower": str,
        "Capital": str.capitalize,
        "letter": lambda h: h[0].upper(),
        "hand": lambda h: f"{h}_hand",
        "none": lambda h: None,
    }
    other = None if b.other is None else b.other.but(label=say[style](b.other.hand))
    return b.but(label=say[style](b.hand), other=other), f"label {style}"


def _time(rng: np.random.Generator) -> str:
    return _weighed(
        rng,
        none=3,
        time=2,
        time_ms=1,
        timestamp_ms=1,
        ms_in_time=1,
        us_in_timestamp=1,
        epoch=1,
        epoch_ms=1,
        repeated=1,
        jump=1,
        back=1,
        numbers=1,
        t=1,
        frame=1,
    )


def _timed(b: Brought, time: str) -> Brought:
    names: dict[str, tuple[str, float, float]] = {
        "time": ("time", 0.0, 1.0),
        "t": ("t", 3.0, 1.0),
        "time_ms": ("time_ms", 0.0, 1e3),
        "timestamp_ms": ("timestamp_ms", 5.0, 1e3),
        "ms_in_time": ("time", 0.0, 1e3),
        "us_in_timestamp": ("timestamp", 7.0, 1e6),
        "epoch": ("timestamp", 1.7e9, 1.0),
        "epoch_ms": ("timestamp", 1.7e9, 1e3),
    }
    if time in names:
        name, start, per_second = names[time]
        return timed(b, name, start, per_second)
    if time == "none":
        return b
    t = seconds(b)
    if time == "frame":
        values: Any = list(range(len(t)))
    elif time == "numbers":
        values = [float(i) for i in range(len(t))]
    else:
        if time == "repeated":
            t[11] = t[10]
        elif time == "jump":
            t[20:] += 3.2e7
        else:
            t[20:] -= 0.4
        values = t.tolist()
    name = "frame" if time == "frame" else "time"
    fps = None if time in ("numbers", "frame") else FPS
    other = None if b.other is None else b.other.but(times=values, time_name=name, fps=fps)
    return b.but(times=values, time_name=name, fps=fps, other=other)


def _without_wrist(b: Brought) -> Brought:
    def gone(one: Brought) -> Brought:
        expected = one.expected.copy()
        expected[:, 0] = np.nan
        return one.but(expected=expected)

    out = gone(b)
    return out if b.other is None else out.but(other=gone(b.other))


_COLUMNS = ("name_x", "name.x", "name_X", "nameX", "name X")


def _format(
    rng: np.random.Generator, b: Brought, unit: str | None, time: str
) -> tuple[Callable[..., Path], str, dict[str, Any], str, bool]:
    """A writer, its file, how it writes, words for it, and whether it names the joints."""
    two, clock = b.other is not None, time != "none"
    kind = _weighed(
        rng,
        npz=2,
        csv=4,
        jsonl=2,
        named=2,
        xyz=1,
        mcap=1,
        sides=2 if two else 0,
        blocks=2 if two else 0,
        json=0 if two else 1,
        bare=0 if two or clock else 1,
        npy=0 if two or clock else 1,
        leap=1 if unit == "mm" else 0,
    )
    hand_key = str(rng.choice(["hand", "handedness", "side", "label"]))
    stated = unit is not None and unit != "m"
    front = f"_{unit}" if stated else ""
    if kind == "npz":
        how = {"key": f"joints{front}", "unit_stated": stated, "hand_key": hand_key}
        return npz, "a.npz", how, f"npz hand under {hand_key}", False
    if kind in ("csv", "blocks"):
        names = str(rng.choice([n for n in NAMES if n != "numbers"]))
        column = str(rng.choice(_COLUMNS))
        if rng.random() < 0.3 and kind == "csv":
            names, column = "numbers", "x_name"
        elif stated and rng.random() < 0.5:
            column = str(rng.choice(["name_x_mm", "name_x (mm)"]))
        how = {"names": names, "column": column, "hand_name": "" if kind == "blocks" else hand_key}
        if stated and "mm" in column:
            how |= {"unit": unit, "unit_stated": True}
        named = not any(c.isdigit() for c in NAMES[names][0])
        sep, comma = ((",", False), (";", False), (";", True), ("\t", False))[rng.integers(4)]
        how |= {"sep": sep, "comma": comma}
        return csv, "a.csv", how, f"csv {kind} {names} {column} {sep!r} {hand_key}", named
    if kind == "bare":
        first = [None, "index0", "index1"][rng.integers(3)]
        return bare, "a.csv", {"first": first}, f"bare csv {first}", False
    if kind == "npy":
        return npy, "a.npy", {}, "npy", False
    if kind == "json":
        how = {"key": f"joints{front}", "unit_stated": stated}
        return json_object, "a.json", how, "json object", False
    if kind == "sides":
        name = str(rng.choice(["webxr", "mediapipe_py", "unity_xr", "none"]))
        return sides, "a.jsonl", {"names": NAMES.get(name)}, f"jsonl sides {name}", name != "none"
    if kind == "mcap":
        how = {"how": str(rng.choice(["joints", "bones"]))}
        return mcap, "a.mcap", how, f"mcap {how['how']}", False
    if kind == "leap":
        return leap, "a.json", {"unit_stated": True}, "leap", True
    if kind == "named":
        name = str(rng.choice(["webxr", "openxr", "mediapipe", "mrtk", "visionos", "handtrack"]))
        how = {"names": NAMES[name], "hand_key": hand_key}
        return jsonl, "a.jsonl", how, f"jsonl {name} hand under {hand_key}", True
    if kind == "xyz":
        how = {"key": "landmarks", "point": "xyz"}
        return json_frames, "a.json", how, "json landmarks xyz", False
    how = {"key": f"joints{front}", "unit_stated": stated, "hand_key": hand_key}
    return jsonl, "a.jsonl", how, f"jsonl hand under {hand_key}", False
