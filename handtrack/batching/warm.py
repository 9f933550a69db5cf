"""Compiled code, ready before the work begins.

A process that compiles the kernels itself may inline what one that loads them from the cache
calls, and so round sums differently in their last digit. Numbers of a data set are to be the
same whoever makes them: compiled once by a worker that is then started anew, and only loaded
after.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from handtrack.batching.settings import BatchSettings
from handtrack.calibration.calibrate import calibrate
from handtrack.calibration.explain import explain
from handtrack.evaluation.stability import stability
from handtrack.hand.model import HandModel
from handtrack.hand.skeleton import HANDS
from handtrack.sequences.sequence import Sequence
from handtrack.tracking.sequence_track import track_joints

_FRAMES = 24


def warm_up(settings: BatchSettings) -> bool:
    """Have all machine code at hand that the work needs; whether some of it was compiled."""
    with compiled() as made, one_thread():
        for hand in HANDS:
            model = HandModel.default(hand)
            rng = np.random.default_rng(1)
            angles = model.mean_angles + rng.normal(0.0, 0.1, (_FRAMES, 20))
            joints = model.joints(
                angles, np.repeat(np.eye(3)[None], _FRAMES, 0), np.zeros((_FRAMES, 3))
            )
            joints += rng.normal(0.0, 1e-3, joints.shape)
            joints[_FRAMES // 2, 3] = np.nan
            time_ns = np.arange(_FRAMES) * 33_333_333
            sequence = Sequence(time_ns, joints, hand=hand, name="warm up")
            found = calibrate(model, sequence).model
            calibrate(found, sequence, "lengths")
            explain(found, sequence)
            stability(track_joints(sequence, found, settings.tracking.but(calibrate="none")))
    return bool(made)


@contextmanager
def compiled() -> Iterator[list[str]]:
    """What is compiled inside the block, by its passes."""
    from numba.core import event

    events: Any = event
    found: list[str] = []

    class Listener(events.Listener):  # type: ignore[misc]
        def on_start(self, event: Any) -> None:
            found.append(str(event.kind))

        def on_end(self, event: Any) -> None: ...

    listener = Listener()
    events.register("numba:run_pass", listener)
    try:
        yield found
    finally:
        events.unregister("numba:run_pass", listener)


@contextmanager
def one_thread() -> Iterator[None]:
    """NumPy's libraries use one thread: on matrices as small as ours more of them only wait for
    one another, and the order in which they add changes the last digit."""
    try:
        import threadpoolctl
    except ImportError:  # numbers alone need nothing but NumPy
        yield
        return
    with threadpoolctl.threadpool_limits(limits=1):
        yield
