"""Whether what was read is what was there."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from handtrack.sequences.sequence import Sequence

_ASIDE = ("source", "path", "notes", "remarks", "name", "version")
"""What depends on the file's name, or is for people."""
_NEAR = 1e-9


def told(value: Any, truth: Any) -> bool:
    """Whether a note says more than one of the sound input does."""
    return not set(_notes(value)) <= set(_notes(truth))


def _notes(value: Any) -> list[str]:
    if not isinstance(value, list):
        return []
    return [note for each in value if isinstance(each, Sequence) for note in each.notes]


def different(value: Any, truth: Any, where: str = "") -> str:
    """Where two things that were read differ, in few words; empty where they do not."""
    if dataclasses.is_dataclass(truth) and not isinstance(truth, type):
        return different(_fields(value), _fields(truth), where)
    if isinstance(truth, dict) and isinstance(value, dict):
        if value.keys() != truth.keys():
            return f"{where}: names {sorted(map(str, value.keys() ^ truth.keys()))[:5]}"
        pairs = [(value[k], truth[k], f"{where} {k}".strip()) for k in truth]
        return next((d for a, b, w in pairs if (d := different(a, b, w))), "")
    if isinstance(truth, list | tuple) and isinstance(value, list | tuple):
        if len(value) != len(truth):
            return f"{where}: {len(value)} instead of {len(truth)}"
        found = (different(a, b, f"{where}[{i}]") for i, (a, b) in enumerate(zip(value, truth)))  # noqa: B905
        return next((d for d in found if d), "")
    if isinstance(truth, np.ndarray):
        return _arrays(np.asarray(value), truth, where)
    if isinstance(truth, float) and isinstance(value, float):
        return "" if abs(value - truth) <= _NEAR * max(1, abs(truth)) else f"{where}: {value}"
    if isinstance(truth, str | int | bool | None) and value != truth:
        return f"{where}: {value!r:.80} instead of {truth!r:.80}"
    return "" if type(value) is type(truth) else f"{where}: a {type(value).__name__}"


def _fields(value: Any) -> dict[str, Any]:
    """What an object holds, but for what is for people."""
    kept = {f.name: getattr(value, f.name) for f in dataclasses.fields(value)}
    return {k: v for k, v in kept.items() if k not in _ASIDE and not callable(v)}


def _arrays(value: Any, truth: Any, where: str) -> str:
    if value.shape != truth.shape:
        return f"{where}: shape {value.shape} instead of {truth.shape}"
    if truth.dtype.kind == "f" and value.dtype.kind == "f":
        same = np.allclose(value, truth, rtol=_NEAR, atol=_NEAR, equal_nan=True)
    else:
        same = np.array_equal(value, truth)
    return "" if same else f"{where}: other values"


def moved(value: list[Sequence], truth: list[Sequence]) -> str:
    """What is wrong after one number of the text was another: more than one joint is elsewhere,
    or frames are gone."""
    known = np.concatenate([s.joints.reshape(-1, 3) for s in truth])
    found = np.concatenate([s.joints.reshape(-1, 3) for s in value])
    if sum(map(len, value)) < sum(map(len, truth)):
        return f"{sum(map(len, value))} frames instead of {sum(map(len, truth))}"
    found = found[~np.isnan(found).any(1)]
    near = np.abs(found[:, None] - known[None]).max(-1).min(1) < _NEAR
    return f"{(~near).sum()} joints are elsewhere" if (~near).sum() > 1 else ""
