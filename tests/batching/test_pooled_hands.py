"""The hand for a clip: the subject's, as long as the clip does not clearly show another one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.batching.hands import Pooled, file_digest, hand_for
from handtrack.batching.settings import BatchSettings
from tools.make.sample import motion, subject_hand

FRAMES = 60


@pytest.fixture(scope="module")
def subjects() -> list[ht.HandModel]:
    return [subject_hand(np.random.default_rng([5, i]), "right") for i in range(2)]


def _clip(hand: ht.HandModel, noise: float) -> ht.Sequence:
    rng = np.random.default_rng(3)
    truth = hand.joints(*motion(FRAMES / 15.0, 15.0, rng))
    time_ns = np.arange(len(truth)) * 66_666_667
    seen = truth + rng.normal(0.0, noise, truth.shape)
    return ht.Sequence(time_ns, seen, hand="right", truth=truth, name="clip")


def _chosen(folder: Path, pooled: ht.HandModel, clip: ht.Sequence):
    data = ht.save_hand(pooled, folder / "hand.json").read_bytes()
    hands = {"right": Pooled("hand.json", file_digest(data))}
    return hand_for(clip, BatchSettings(), hands, str(folder))


@pytest.mark.parametrize("noise", [3e-4, 2e-3])
def test_the_subjects_own_clip_keeps_the_pooled_hand(subjects, tmp_path, noise):
    chosen = _chosen(tmp_path, subjects[0], _clip(subjects[0], noise))
    assert chosen.source == "pooled"
    assert chosen.drift_mm == 0


def test_noise_alone_is_no_reason_to_calibrate_a_clip(subjects, tmp_path, monkeypatch):
    def refused(*given: object, **named: object) -> None:
        raise AssertionError("a calibration that cannot be worth its freedoms was made")

    monkeypatch.setattr("handtrack.batching.hands.calibrate", refused)
    assert _chosen(tmp_path, subjects[0], _clip(subjects[0], 2e-3)).source == "pooled"


@pytest.mark.parametrize("noise", [3e-4, 2e-3])
def test_a_clip_of_another_hand_finds_its_own(subjects, tmp_path, noise):
    clip = _clip(subjects[0], noise)
    chosen = _chosen(tmp_path, subjects[1], clip)
    assert chosen.source in ("pooled, lengths own", "pooled, own from there")
    assert chosen.drift_mm > 1
    error = [
        ht.stability(ht.track(clip, hand, calibrate="none")).overall.pa_mpjpe_mm.mean
        for hand in (subjects[1], chosen.model)
    ]
    assert error[1] < 0.75 * error[0]
