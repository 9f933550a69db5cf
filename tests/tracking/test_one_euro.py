"""The one-euro filter against its formula (Casiez 2012), number by number in plain Python."""

from __future__ import annotations

import math

import numpy as np
from filter_cases import FRAME_NS, MODEL, frames_of, moving, steady
from scipy.spatial.transform import Rotation

from handtrack.tracking import one_euro
from handtrack.tracking.filters import make_filter

CUTOFFS = zip(one_euro.CUTOFF, one_euro.BETA, strict=True)
PARAMETERS = [(float(c), float(b)) for c, b in CUTOFFS]


def smoothed(raw: list[float], dt: list[float], cutoff: float, beta: float) -> list[float]:
    """x += a(fc) (raw - x) with fc = cutoff + beta |speed|, the speed smoothed at its own."""

    def share(fc: float, dt: float) -> float:
        return 1.0 / (1.0 + 1.0 / (2.0 * math.pi * fc * dt))

    out, x, speed = [raw[0]], raw[0], 0.0
    for before, now, step in zip(raw, raw[1:], dt, strict=False):
        speed += share(one_euro.SPEED_CUTOFF, step) * ((now - before) / step - speed)
        x += share(cutoff + beta * abs(speed), step) * (now - x)
        out.append(x)
    return out


def noisy(frames: int, **motion):
    """Raw fits of a hand with a jitter of its own, and their times."""
    rng = np.random.default_rng(3)
    _, _, _, joints = moving(frames, **motion)
    times_ns = np.cumsum(rng.integers(20_000_000, 50_000_000, frames))
    return times_ns, frames_of(times_ns, joints + rng.normal(0, 1e-3, joints.shape))


def run(frames, coast_s: float = 0.3):
    made = make_filter(steady("one-euro", coast_s=coast_s), MODEL)
    out, known = made.advance(frames)
    assert len(made.finish()[0]) == 0
    return out, known


def test_angles_and_place_are_the_formulas():
    times_ns, frames = noisy(40)
    out, known = run(frames)
    assert known.all()
    dt = [1e-9 * float(d) for d in np.diff(times_ns)]
    for name, count, first in (("angles", 20, 0), ("shift", 3, 23)):
        for i in range(count):
            raw = frames.raw["angles"][:, i] if name == "angles" else frames.raw["root"][:, 9 + i]
            found = out["angles"][:, i] if name == "angles" else out["root"][:, 9 + i]
            expected = smoothed([float(x) for x in raw], dt, *PARAMETERS[first + i])
            np.testing.assert_allclose(found, expected, atol=1e-10, err_msg=f"{name} {i}")
            assert np.abs(found - raw).max() > 1e-6


def test_a_turn_about_one_axis_is_smoothed_as_its_angle():
    """Its other parts are the turn's: rotation, quaternion and joints say the same pose."""
    _, frames = noisy(30, turn=0.0)
    rng = np.random.default_rng(4)
    angle = 0.3 * np.sin(np.arange(30) * 0.2) + rng.normal(0, 0.02, 30)
    axis = np.array([0.0, 0.0, 1.0])
    frames.raw["root"][:, :9] = (
        Rotation.from_rotvec(angle[:, None] * axis).as_matrix().reshape(30, 9)
    )
    out, _ = run(frames)
    dt = [1e-9 * float(d) for d in np.diff(frames.times_ns)]
    expected = smoothed([float(a) for a in angle], dt, *PARAMETERS[22])
    turns = Rotation.from_matrix(out["root"][:, :9].reshape(30, 3, 3))
    np.testing.assert_allclose(turns.as_rotvec(), np.outer(expected, axis), atol=1e-9)
    same = np.abs((out["quaternion"] * turns.as_quat(scalar_first=True)).sum(1))
    np.testing.assert_allclose(same[1:], 1.0, atol=1e-9)
    posed = MODEL.joints(out["angles"], turns.as_matrix(), out["root"][:, 9:])
    np.testing.assert_allclose(out["joints"][1:].reshape(-1, 21, 3), posed[1:], atol=1e-9)


def test_a_pose_is_held_for_the_coast_and_begins_anew_after_it():
    _, frames = noisy(30)
    frames.times_ns[:] = np.arange(30) * FRAME_NS
    lost = slice(10, 20)
    frames.raw["noise"][lost] = np.nan
    coast_s = 4.5 * FRAME_NS * 1e-9
    out, known = run(frames, coast_s)
    # the last fit is frame 9: 4 frames are within the coast
    assert np.flatnonzero(~known).tolist() == list(range(14, 20))
    np.testing.assert_array_equal(out["angles"][10:14], np.repeat(out["angles"][9:10], 4, 0))
    np.testing.assert_array_equal(out["angles"][20], frames.raw["angles"][20])
    assert (out["angles"][21] != frames.raw["angles"][21]).any()
    # what is to begin anew does at once
    frames.raw["anew"][25] = 1
    out, _ = run(frames, coast_s)
    np.testing.assert_array_equal(out["angles"][25], frames.raw["angles"][25])
