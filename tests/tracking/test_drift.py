"""Noise of the joints that lasts: the filter and smoother against dense least squares."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from filter_cases import MODEL, frames_of, moving, poses, steady, turns_of

import handtrack as ht
from handtrack.detectors.profile import load_profile
from handtrack.hand.rotations import matrix_to_vector
from handtrack.kernels import joint_noise
from handtrack.kernels.drift import LEAST_UNIT
from handtrack.kernels.workspace import UNFITTED
from handtrack.tracking import process_noise
from handtrack.tracking.filter_input import Frames, LongFrames
from handtrack.tracking.kalman import DriftingFilter, KalmanFilter
from handtrack.tracking.process_noise import lasting_share
from handtrack.tracking.tracker import Tracker
from tools.bench.rendered.__main__ import DATA
from tools.bench.rendered.cases import TRIANGULATED, Case, cases
from tools.bench.rendered.layout import read
from tools.bench.rendered.measures import measure

N = 26


def lasting(shape: tuple[int, ...], dt: float, time_s: float, rng: np.random.Generator):
    """Noise of the first order, of deviation 1."""
    a = np.exp(-dt / time_s)
    out = rng.normal(size=shape)
    for t in range(1, shape[0]):
        out[t] = a * out[t - 1] + np.sqrt(1 - a * a) * out[t]
    return out


def drifting(share: float, time_s: float = 0.1, **settings) -> DriftingFilter:
    made = DriftingFilter(MODEL, steady("kalman", noise_colour=time_s, **settings))
    made.numbers = made.numbers._replace(share=share)
    return made


def still(frames: int, rng: np.random.Generator) -> Frames:
    """A hand that hardly moves, so that all is linear; a finger and then all of it unseen."""
    times_ns, _, _, joints = moving(frames, turn=0.0, speed=0.01)
    joints = joints[:1] + rng.normal(0, 1e-6, joints.shape)
    joints[4:6, 17:] = np.nan
    joints[8:9] = np.nan
    return frames_of(times_ns, joints)


def numbers(row: np.ndarray, first: np.ndarray) -> np.ndarray:
    """(26,) a row's pose less another's."""
    vector = matrix_to_vector(turns_of(row) @ turns_of(first).T)
    angles, root = row["angles"] - first["angles"], row["root"] - first["root"]
    return np.concatenate([angles, vector, root[9:]])


def dense(frames: Frames, filter_: DriftingFilter) -> np.ndarray:
    """(T, 26) the likeliest poses, by one system of equations over all frames.

    Unknowns of a frame are its pose, velocities and drift. Each line says that a combination of
    unknowns is a number, with a precision. What the joints say of a pose, and the drift's
    covariance, are read off the running filter.
    """
    n, wanted = len(frames.raw), 3 * N
    weight, pull = np.zeros((n * wanted, n * wanted)), np.zeros(n * wanted)

    def add(lines: dict[int, np.ndarray], value: np.ndarray, precision: np.ndarray) -> None:
        for i, a in lines.items():
            pull[i : i + N] += a.T @ precision @ value
            for j, b in lines.items():
                weight[i : i + N, j : j + N] += a.T @ precision @ b

    one, first, stays = np.eye(N), frames.raw[0], np.exp(-np.diff(frames.times_ns) * 1e-9 / 0.1)
    filter_.reset()
    for t in range(n):
        filter_.run(frames.part(slice(t, t + 1)), None)
        s, at = filter_.state[0], wanted * t
        if t == 0:
            information = s["white"] * s["noise"] * np.linalg.inv(s["pose_pose"])
            unit = np.linalg.inv(information + (LEAST_UNIT * np.eye(N)))
            np.testing.assert_allclose(s["unit"], unit, rtol=1e-6, atol=1e-6 * unit.max())
            add({0: one, 2 * N: one}, np.zeros(N), np.linalg.inv(s["pose_pose"]))
            add({N: one}, np.zeros(N), np.diag(1 / process_noise.FIRST_SPEED**2))
            add({2 * N: one}, np.zeros(N), np.linalg.inv(s["colour"] * s["noise"] * s["unit"]))
            continue
        before = at - wanted
        q = np.array([[s["q00"], s["q01"]], [s["q01"], s["q11"]]]) * s["density"]
        precision = np.linalg.inv(q.transpose(2, 0, 1)).transpose(1, 2, 0)
        moves = {before: -one, before + N: -np.diag(s["f01"]), at: one}
        slows = {before + N: -np.diag(s["f11"]), at + N: one}
        for i, a in ((0, moves), (1, slows)):
            for j, b in ((0, moves), (1, slows)):
                for k, x in a.items():
                    for m, y in b.items():
                        weight[k : k + N, m : m + N] += x.T @ np.diag(precision[i, j]) @ y
        keep = np.full(N, stays[t - 1])
        keep[16:20] = 0.0 if t == 6 else keep[16:20]
        keep = 0.0 * keep if t == 9 else keep
        new = np.sqrt(1 - keep**2)
        spread = new[:, None] * s["spread"] * new
        add({before + 2 * N: -np.diag(keep), at + 2 * N: one}, np.zeros(N), np.linalg.inv(spread))
        if np.isfinite(frames.raw[t]["objective"]):
            seen = numbers(frames.raw[t], first)
            add({at: one, at + 2 * N: one}, seen, s["system"] - s["precision"])
    return np.linalg.solve(weight, pull).reshape(n, 3, N)[:, 0]


@pytest.mark.parametrize("frames", [4, 7, 12])
def test_filter_and_smoother_are_least_squares(frames):
    """The filter is its last frame; fingers and hands that come back begin a new drift."""
    given = still(frames, np.random.default_rng(1))
    settings = {"couple": False, "process_noise": 1.0, "noise_mm": 3.0}
    made = drifting(1.0, **settings)
    expected = dense(given, made)
    made.reset()
    kept = np.zeros(frames, made.kept)
    causal, notes = made.run(given, kept)
    out = np.full(frames, UNFITTED)
    made.smooth(*made.with_model, 0, frames, notes, kept, out)
    found = np.array([numbers(row, given.raw[0]) for row in out])
    scale = np.abs(expected).max()
    np.testing.assert_allclose(found, expected, atol=1e-5 * scale)
    last = numbers(causal[-1], given.raw[0])
    np.testing.assert_allclose(last, expected[-1], atol=1e-5 * scale)
    assert np.abs(numbers(given.raw[-1], given.raw[0]) - expected[-1]).max() > 0.1 * scale


@pytest.mark.parametrize("couple", [True, False])
def test_no_share_is_the_white_filter(couple):
    rng = np.random.default_rng(2)
    times_ns, _, _, joints = moving(40)
    frames = frames_of(times_ns, joints + rng.normal(0, 2e-3, joints.shape))
    made = drifting(0.0, couple=couple)
    white = KalmanFilter(MODEL, steady("kalman", couple=couple))
    ours, theirs = made.run(frames, None)[0], white.run(frames, None)[0]
    np.testing.assert_allclose(poses(ours), poses(theirs), atol=1e-9)


def noisy(time_s: float | None, frames: int = 150, size: float = 4e-3) -> tuple[Frames, np.ndarray]:
    """A moving hand whose joints' noise lasts that long, or is white; and the true joints."""
    rng = np.random.default_rng(4)
    times_ns, _, _, joints = moving(frames)
    noise = rng.normal(size=joints.shape)
    if time_s is not None:
        noise = lasting(joints.shape, 1 / 30, time_s, rng)
    return frames_of(times_ns, joints + size * noise), joints


def test_residuals_show_whether_noise_lasts():
    """In a sequence and in a stream: none of white noise, all of noise that lasts; less of both."""
    white, _ = noisy(None)
    long, truth = noisy(0.3)
    share, moving_part = lasting_share(LongFrames.of(long), 0.1)
    assert lasting_share(LongFrames.of(white), 0.1)[0] == 0.0
    assert share > 0.9
    assert moving_part > 0.8
    mixed = long.joints + 4e-3 * np.random.default_rng(5).normal(size=truth.shape)
    half = lasting_share(LongFrames.of(frames_of(long.times_ns, mixed)), 0.1)[0]
    assert 0.2 < half < 0.8
    for frames, least, most in ((white, 0.0, 0.1), (long, 0.8, 1.0)):
        made = DriftingFilter(MODEL, steady("kalman"))
        made.run(frames, None)
        assert least <= made.state[0]["share"] <= most


def test_what_a_clean_hand_leaves_is_no_noise():
    """Errors that last of a tenth of a millimetre are the hand's own."""
    clean, _ = noisy(0.3, size=1e-4)
    assert lasting_share(LongFrames.of(clean), 0.1)[0] == 0.0
    made = DriftingFilter(MODEL, steady("kalman"))
    made.run(clean, None)
    assert made.state[0]["share"] == 0.0


def test_a_hand_that_does_not_fit_is_no_noise():
    """A constant error of each joint makes the noise that lasts no larger."""
    frames, _ = noisy(0.3)
    offset = np.random.default_rng(6).normal(0, 0.02, (21, 3))
    turned = moving(150)[2] @ offset[..., None][:, None]
    off = frames_of(frames.times_ns, frames.joints + turned[..., 0].swapaxes(0, 1))
    share, part = lasting_share(LongFrames.of(off), 0.1)
    white, lasts = joint_noise.parts_of.py_func(share, part)
    level = np.nanmedian(off.raw["noise"])
    own = np.nanmedian(frames.raw["noise"])
    assert level > 4 * own
    assert share > 0.8
    assert (white + lasts) * level < 3.5 * own
    assert white > 2 * lasts - 1e-9


@pytest.fixture(scope="module")
def detected() -> Case:
    """A rendered hand as a real detector saw it from three cameras."""
    clip = sorted(DATA.joinpath("tune").glob("*.npz"))[1]
    return next(case for case in cases(read(clip)) if case.input == TRIANGULATED)


@pytest.mark.parametrize(("name", "calmer"), [("kalman", 1.1), ("fixed-lag", 1.1), ("rts", 0.8)])
def test_a_real_detectors_noise_lasts(name, calmer, detected):
    """The motion is nearer to the true one (of all clips; without waiting, of one it may not be),
    and the joints are no farther off.
    """
    plain = ht.track(detected.sequence)
    found = []
    for told in ("white", "auto", 0.1):
        settings = {"filter": name, "noise_colour": told, "calibrate": "none"}
        track = ht.track(detected.sequence, plain.model, **settings)
        found.append(measure(track.filtered_joints, track.angles, detected))
    white, auto, given = found
    assert auto["acceleration"] < calmer * white["acceleration"]
    assert auto["pa_mm"] < 1.02 * white["pa_mm"]
    assert given == auto


def test_white_is_said_of_older_recordings(sample):
    from dataclasses import replace

    from handtrack.recording.retrack import settings_of

    track = ht.track(sample, filter="kalman", noise_colour=0.2)
    assert settings_of(track)["noise_colour"] == 0.2
    older = {k: v for k, v in track.settings.items() if k != "noise_colour"}
    assert settings_of(replace(track, settings=older))["noise_colour"] == "white"


@pytest.mark.parametrize("value", ["pink", 0.0, -1.0, np.nan, 100.0])
def test_a_colour_that_is_none(value):
    message = "noise colour is .*, expected auto or white or a time 0.001..10 s"
    with pytest.raises(ht.SettingsError, match=message):
        steady("kalman", noise_colour=value)


def test_filterpy_has_no_noise_that_lasts():
    with pytest.raises(ht.SettingsError, match="filterpy has no noise that lasts"):
        steady("kalman", noise_colour=0.1, engine="filterpy")


def test_the_noise_of_unseen_joints_is_vague_not_infinite():
    """A hand of which a finger was never seen has a drift of some size."""
    rng = np.random.default_rng(3)
    times_ns, _, _, joints = moving(20)
    joints = joints + rng.normal(0, 1e-3, joints.shape)
    joints[:10, 17:] = np.nan
    made = drifting(1.0)
    out, _ = made.run(frames_of(times_ns, joints), None)
    assert np.isfinite(poses(out)).all()
    assert np.linalg.norm(out["joints"][-1] - joints[-1], axis=-1).max() < 8e-3


def test_corrected_joints_are_trusted_less_from_frame_to_frame():
    """White noise stays what it is; of noise that lasts residuals show less than there is."""
    assert joint_noise.corrected_parts.py_func(0.0, 1.0) == (1.0, 0.0)
    white, lasts = joint_noise.parts_of.py_func(1.0, 1.0)
    new, less = joint_noise.corrected_parts.py_func(1.0, 1.0)
    assert new > 2 * white
    assert less < lasts


def test_a_filter_knows_that_joints_are_corrected():
    """By the tracker's profile; noise that somebody says is taken as it is said."""
    profile = load_profile("mediapipe-3d")
    hand = profile.on(MODEL)
    offsets_alone = replace(profile, correction=None)
    made = {
        "corrected": Tracker(hand, profile=profile, filter="kalman"),
        "offsets": Tracker(hand, profile=offsets_alone, filter="kalman"),
        "joints": Tracker(MODEL, filter="kalman"),
        "told": Tracker(hand, profile=profile, filter="kalman", noise_mm=3.0),
    }
    found = {name for name, tracker in made.items() if tracker._filter.with_model[2][-1]}
    assert found == {"corrected"}
