"""Truths from elsewhere: matched by what they state, with marks, units, orders and clocks."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from made_files import bare, csv, fpha, jsonl, mcap, npz
from made_hands import FPS, Brought, brought, clip, missing, ordered, scaled, timed
from made_names import NAMES

from handtrack.cli import run

RIGHT_MM = 1.0
"""The fit is nearer to the truth than this; a shift by a frame is not."""


@pytest.fixture(scope="module")
def estimate(tmp_path_factory) -> Path:
    """A recording of joints with a clock that starts at 100 s."""
    folder = tmp_path_factory.mktemp("truths")
    path = npz(folder / "a.npz", timed(brought().but(label="right"), "time_s", 100.0))
    out = folder / "a.mcap"
    assert run(["track", str(path), "-o", str(out), "--mesh", "none", "-q"]) == 0
    return out


def truth(b: Brought | None = None) -> Brought:
    made = clip("right")
    b = b or brought().but(label="right")
    return b.but(joints=made.truth.copy(), expected=made.truth.copy())


def measured(estimate: Path, path: Path, *options: str) -> tuple[float | None, str]:
    """PA-MPJPE [mm], None where it is refused; and what is said."""
    out, err = io.StringIO(), io.StringIO()
    arguments = ["stability", str(estimate), "--truth", str(path), "--json", *options]
    with redirect_stdout(out), redirect_stderr(err):
        status = run(arguments)
    if status:
        assert status == 2
        return None, err.getvalue()
    found = json.loads(out.getvalue())
    return found["overall"]["pa_mpjpe_mm"]["mean"], err.getvalue() + out.getvalue()


def part(b: Brought, rows: slice | np.ndarray) -> Brought:
    times = None if b.times is None else [b.times[i] for i in np.arange(len(b.joints))[rows]]
    return b.but(joints=b.joints[rows], expected=b.expected[rows], times=times)


clocked = timed(truth(), "time_s", 100.0)
RIGHT: dict[str, tuple[Callable[..., Path], str, Brought, dict, list[str]]] = {
    "the same clock": (npz, "t.npz", clocked, {}, []),
    "no clock, as many frames": (npz, "t.npz", truth(), {}, []),
    "begins later by the clock": (npz, "t.npz", part(clocked, slice(9, None)), {}, []),
    "ends earlier by the clock": (csv, "t.csv", part(clocked, slice(0, 30)), {}, []),
    "every second frame by the clock": (jsonl, "t.jsonl", part(clocked, slice(1, None, 2)), {}, []),
    "milliseconds": (csv, "t.csv", part(timed(truth(), "time_ms", 100.0, 1e3), slice(5, None)), {},
                     []),
    "zeros": (npz, "t.npz", missing(clocked, 0.0), {}, []),
    "-1": (csv, "t.csv", missing(clocked, -1.0), {}, []),
    "nothing": (jsonl, "t.jsonl", missing(clocked, None), {}, []),
    "named": (jsonl, "t.jsonl", clocked, {"names": NAMES["mediapipe"]}, []),
    "millimetres told": (npz, "t.npz", scaled(clocked, 1e3), {}, ["--unit", "mm"]),
    "interhand told": (npz, "t.npz", ordered(clocked, "interhand"), {}, ["--order", "interhand"]),
    "bare": (bare, "t.csv", truth(), {}, []),
}  # fmt: skip


@pytest.mark.parametrize("word", RIGHT)
def test_right(word, estimate, tmp_path):
    write, file, b, how, options = RIGHT[word]
    error, said = measured(estimate, write(tmp_path / file, b, **how), *options)
    assert error is not None, said
    assert error < RIGHT_MM, said


DOUBTED: dict[str, tuple[Callable[..., Path], str, Brought, str]] = {
    "millimetres": (npz, "t.npz", scaled(clocked, 1e3), "mm"),
    "another order": (npz, "t.npz", ordered(clocked, "mano"), "order"),
    "another hand": (npz, "t.npz", clocked.but(label="left"), "left"),
    "a clock that was never": (npz, "t.npz", timed(truth(), "time_s", 5000.0), "time|clock|frame"),
    "a part of it, no clock": (npz, "t.npz", part(truth(), slice(9, None)), "frame|time"),
    "a clock of half the speed": (npz, "t.npz", clocked.but(
        times=[100 + 2 * i / FPS for i in range(45)]), "rate|frames/s|frame|time"),
    "fpha's": (fpha, "skeleton.txt", scaled(truth(), 1e3), "order|FPHA|frame"),
    "a message's clock": (mcap, "t.mcap", truth(), "time|clock|frame"),
}  # fmt: skip


@pytest.mark.parametrize("word", DOUBTED)
def test_right_or_not_without_a_word(word, estimate, tmp_path):
    write, file, b, says = DOUBTED[word]
    error, said = measured(estimate, write(tmp_path / file, b))
    if error is not None and error < RIGHT_MM:
        return
    assert any(w in said for w in says.split("|")), said
    assert error is None or "warning" in said or "notes" in said, said
