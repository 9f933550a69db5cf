"""A detector's noise, found again in errors that are made of known parts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from handtrack.errors import InputError
from handtrack.evaluation.landmark_noise import Errors, noise_of

CONSTANT, FADING, WHITE, FADES_S = 0.002, 0.003, 0.0015, 0.2
DT_NS = 20_000_000
FRAMES, CLIPS = 500, 16


def fading(rng, shape, fades_s):
    """(FRAMES, ...) an AR(1) series of deviation 1."""
    memory = np.exp(-1e-9 * DT_NS / fades_s)
    noise = rng.normal(size=(FRAMES + 200, *shape))
    return lfilter([np.sqrt(1 - memory**2)], [1, -memory], noise, axis=0)[200:]


def clip(rng, bone=(1.0, 1.0, 1.0), turned=True):
    """Errors of the three parts, times `bone` along the axes of the bones."""
    inside = CONSTANT * rng.normal(size=(21, 3)) + FADING * fading(rng, (21, 3), FADES_S)
    inside = (inside + WHITE * rng.normal(size=(FRAMES, 21, 3))) * bone
    frames = np.broadcast_to(np.eye(3), (FRAMES, 21, 3, 3))
    if turned:
        frames = Rotation.random(FRAMES * 21, rng=rng).as_matrix().reshape(FRAMES, 21, 3, 3)
    off = np.einsum("tjik,tjk->tji", frames, inside)
    times_ns = DT_NS * np.arange(FRAMES, dtype=np.int64)
    return Errors(off, frames, times_ns, None, np.zeros(FRAMES), aligned=False)


def clips(seed, **made):
    rng = np.random.default_rng(seed)
    return [clip(rng, **made) for _ in range(CLIPS)]


def test_constant_fading_and_white_parts_are_told_apart_in_the_frames_of_the_bones():
    bone = np.array([1.5, 0.8, np.sqrt(3 - 1.5**2 - 0.8**2)])
    found = noise_of(clips(0, bone=bone), one_camera=False)
    # a mean over a clip holds what of the fading part has not faded: 2 fades / length
    constant = np.hypot(CONSTANT, FADING * np.sqrt(2 * FADES_S / (1e-9 * DT_NS * FRAMES)))
    assert np.sqrt(np.mean(found.constant**2)) == pytest.approx(constant, rel=0.06)
    assert np.sqrt(np.mean(found.fading**2)) == pytest.approx(FADING, rel=0.06)
    assert np.sqrt(np.mean(found.white**2)) == pytest.approx(WHITE, rel=0.06)
    assert found.fades_s == pytest.approx(FADES_S, rel=0.15)
    np.testing.assert_allclose(found.bone.mean(0), bone, rtol=0.04)
    whole = np.sqrt(found.constant**2 + found.fading**2 + found.white**2)
    np.testing.assert_allclose(whole, np.hypot(np.hypot(CONSTANT, FADING), WHITE), rtol=0.2)
    assert (found.view, found.scale, found.scale_fades_s, found.size) == (1.0, 0.0, 0.5, 0.0)
    assert found.outliers < 1e-3


def test_an_alignment_has_taken_seven_of_63_coordinates_along():
    made = clips(1)
    plain = noise_of(made, one_camera=False)
    aligned = noise_of([replace(c, aligned=True) for c in made], one_camera=False)
    for name in ("constant", "fading", "white"):
        more = getattr(aligned, name) / getattr(plain, name)
        np.testing.assert_allclose(more, np.sqrt(63 / 56))


def test_errors_along_the_view_are_told_from_those_across():
    rng = np.random.default_rng(2)
    made = []
    for c in clips(3):
        view = rng.normal(size=(FRAMES, 3))
        view /= np.linalg.norm(view, axis=1, keepdims=True)
        along = np.einsum("tjk,tk->tj", c.off, view)
        made.append(replace(c, off=c.off + 1.5 * along[..., None] * view[:, None], view=view))
    assert noise_of(made, one_camera=False).view == pytest.approx(2.5, rel=0.04)
    # a clip without a camera says nothing of it
    made[0] = replace(made[0], view=None)
    assert noise_of(made, one_camera=False).view == pytest.approx(2.5, rel=0.04)


@pytest.mark.parametrize("shared", [0.0, 0.6])
def test_neighbours_in_a_finger_err_alike(shared):
    rng = np.random.default_rng(4)
    made = []
    for c in clips(5, turned=False):
        finger = np.repeat(fading(rng, (5, 3), FADES_S), 4, axis=1)
        off = c.off / np.sqrt(CONSTANT**2 + FADING**2 + WHITE**2)
        off[:, 1:] = np.sqrt(1 - shared) * off[:, 1:] + np.sqrt(shared) * finger
        made.append(replace(c, off=off))
    assert noise_of(made, one_camera=False).finger == pytest.approx(shared, abs=0.05)


def test_strays_are_counted_and_do_not_count_as_noise():
    made, rng = clips(6), np.random.default_rng(7)
    plain = noise_of(made, one_camera=False)
    for c in made:
        c.off[rng.random((FRAMES, 21)) < 0.01] += 0.2
    found = noise_of(made, one_camera=False)
    assert found.outliers == pytest.approx(0.01, rel=0.15)
    assert np.sqrt(np.mean(found.white**2)) < 2.5 * np.sqrt(np.mean(plain.white**2))


def sized(series):
    made = clips(8)[: len(series)]
    return [replace(c, log_scale=np.asarray(s)) for c, s in zip(made, series, strict=True)]


def test_sizes_deviate_within_clips_and_between_them():
    rng = np.random.default_rng(9)
    middles = 0.04 * rng.normal(size=CLIPS)
    series = [m + 0.02 * fading(rng, (), 0.3) for m in middles]
    found = noise_of(sized(series), one_camera=True)
    means = [s.mean() for s in series]
    assert found.size == pytest.approx(np.sqrt(np.mean(np.square(means))), rel=1e-9)
    left = np.concatenate([s - s.mean() for s in series])
    assert found.scale == pytest.approx(left.std(), rel=1e-9)
    # Kendall (1954): about their own mean the frames of a clip correlate less by (1 + 4 r) / n
    memory = np.exp(-1e-9 * DT_NS / 0.3)
    fades_s = -1e-9 * DT_NS / np.log(memory - (1 + 4 * memory) / FRAMES)
    assert found.scale_fades_s == pytest.approx(fades_s, rel=0.15)
    # several cameras do not err about the size
    several = noise_of(sized(series), one_camera=False)
    assert (several.size, several.scale, several.scale_fades_s) == (0.0, 0.0, 0.5)


@pytest.mark.parametrize(
    ("series", "correlation"),
    [
        ([np.tile([0.01, -0.01], FRAMES // 2)] * 2, 0.01),  # one frame says the contrary
        ([np.repeat([0.01, -0.01], FRAMES // 2)] * 2, 0.994),
        ([np.cumsum(np.full(FRAMES, 1e-3))] * 2, 0.994),
        ([np.full(FRAMES, 0.01)] * 2, 0.01),  # it does not change
    ],
)
def test_how_long_a_size_lasts_is_bounded(series, correlation):
    found = noise_of(sized(series), one_camera=True).scale_fades_s
    # (1 - 3 / n) of a step's or a ramp's products are left a frame later
    assert np.exp(-1e-9 * DT_NS / found) == pytest.approx(correlation, abs=2e-3)


def test_what_does_not_err_is_no_detector():
    exact = [replace(c, off=np.zeros_like(c.off)) for c in clips(10)[:1]]
    with pytest.raises(InputError, match="detections do not err"):
        noise_of(exact, one_camera=False)
