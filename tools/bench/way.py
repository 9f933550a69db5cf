"""The way of a frame: which files of the project it enters, in order.

    python -m tools.bench.way [--filter kalman]

For `Tracker.step` those of one warm step; for `handtrack track` those whose functions are called
the more often the longer the clip is, so that what is done once for a clip does not count.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

import handtrack as ht

_PACKAGE = Path(ht.__file__).parent
Calls = Counter[tuple[str, str]]
"""How often functions were called, by file and name, in the order of their first calls."""


@contextmanager
def calls() -> Iterator[Calls]:
    """The project's functions that are called meanwhile, in all threads started meanwhile too."""
    found: Calls = Counter()

    def look(frame: FrameType, event: str, _: Any) -> None:
        code = frame.f_code
        if event == "call" and code.co_filename.startswith(str(_PACKAGE)):
            file = Path(code.co_filename).relative_to(_PACKAGE).as_posix()
            found[file, code.co_name] += 1

    threading.setprofile(look)
    sys.setprofile(look)
    try:
        yield found
    finally:
        sys.setprofile(None)
        threading.setprofile(None)


def clip(frames: int) -> ht.Sequence:
    """A hand that moves, and is seen with noise."""
    model, t = ht.HandModel.default("right"), np.arange(frames) / 60
    middle = 0.5 * (model.limits.lower + model.limits.upper)
    bent = 0.3 * np.sin(2 * t[:, None] + np.arange(20))
    joints = model.joints(model.limits.clamp(middle + bent))
    noise = np.random.default_rng(0).normal(0, 1e-3, joints.shape)
    return ht.Sequence((t * 1e9).astype(np.int64), joints + noise, hand="right")


def of_step(**settings: Any) -> Calls:
    """What a step of a tracker calls, after others."""
    seen = clip(30)
    tracker = ht.Tracker(ht.HandModel.default("right"), **settings)
    for joints, time_ns in zip(seen.joints[:-1], seen.time_ns[:-1], strict=True):
        tracker.step(joints, int(time_ns))
    with calls() as found:
        tracker.step(seen.joints[-1], int(seen.time_ns[-1]))
    return found


def of_track(*options: str, frames: int = 3000) -> Calls:
    """What `handtrack track` calls more often for a clip of twice the frames."""
    from handtrack.cli import cli

    counted = []
    # one folder: what looks at its name, which is random, does it as often for both
    with tempfile.TemporaryDirectory() as folder:
        source, to = Path(folder, "clip.npz"), Path(folder, "clip.mcap")
        for n in (frames, 2 * frames):
            to.unlink(missing_ok=True)
            seen = clip(n)
            np.savez(source, joints=seen.joints, time_ns=seen.time_ns, hand="right")
            told = ["track", str(source), "-o", str(to), "--quiet", *options]
            with calls() as found:
                cli.main(told, standalone_mode=False)
            counted.append(found)
    short, long = counted
    return Counter({name: long[name] - n for name, n in short.items() if long[name] >= 1.5 * n})


def files(of: Calls) -> dict[str, list[str]]:
    """Files in order, with their functions."""
    found: dict[str, list[str]] = {}
    for file, function in of:
        found.setdefault(file, []).append(function)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--filter", default="none")
    chosen = parser.parse_args()
    ways: tuple[tuple[str, Callable[[], Calls]], ...] = (
        ("Tracker.step", lambda: of_step(filter=chosen.filter)),
        ("handtrack track", lambda: of_track("--filter", chosen.filter)),
    )
    for name, way in ways:
        found = files(way())
        print(f"{name}: {len(found)} files")
        for file, functions in found.items():
            print(f"  {file:32s} {', '.join(f for f in functions if f[0] != '<')}")


if __name__ == "__main__":
    main()
