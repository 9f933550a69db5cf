"""Errors laid over real motion are as large as they are said to be, and of their kind."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from tools.bench.laid_over import KINDS, bone_frames, mirrored, straying
from tools.bench.real_motion_study import Clip, ratios

FPS = 30.0


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    (sample,) = ht.load("recordings/sample.npz")
    assert sample.truth is not None
    return np.asarray(sample.truth[:240])


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_errs_by_millimetres_and_leaves_the_truth_alone(kind, truth):
    before = truth.copy()
    seen = KINDS[kind](truth, FPS, np.random.default_rng(0))
    assert (truth == before).all()
    assert seen.shape == truth.shape
    known = np.isfinite(seen[..., 0])
    assert known.mean() > 0.7
    assert 2e-3 < np.median(np.linalg.norm(seen - truth, axis=-1)[known]) < 25e-3


def test_bones_have_frames_at_right_angles(truth):
    frames = bone_frames(truth)
    assert frames.swapaxes(-1, -2) @ frames == pytest.approx(
        np.broadcast_to(np.eye(3), frames.shape), abs=1e-9
    )
    bone = truth[:, 6] - truth[:, 5]
    assert np.einsum("tx,tx->t", frames[:, 6, :, 0], bone) == pytest.approx(
        np.linalg.norm(bone, axis=1)
    )


def test_strays_are_single_and_mirrored_frames_are_whole(truth):
    far = np.linalg.norm(straying(truth, FPS, np.random.default_rng(1)) - truth, axis=-1) > 0.019
    assert 0.005 < far.mean() < 0.05
    off = np.linalg.norm(mirrored(truth, FPS, np.random.default_rng(1)) - truth, axis=-1).mean(1)
    assert 0.02 < (off > 0.015).mean() < 0.5


def test_the_study_measures_against_the_truth(truth):
    sequence = ht.Sequence(np.arange(240) * 33_333_333, truth, hand="right", name="sample")
    clip = Clip(sequence, ht.track(sequence).angles)
    found, turned = ratios(clip, "lasts 0.1 s, 8 mm")
    assert 8 < found["raw"] < 14
    assert found["rts"] < found["fixed-lag"] < found["`track`"] < 0.95
    assert found["rts"] < found["best window"]
    assert 0 < turned["rts"] < turned["`track`"]
