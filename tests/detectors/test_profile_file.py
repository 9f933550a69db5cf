"""Profiles as files: what is written is read, and what is wrong is said in one line."""

from __future__ import annotations

import json

import numpy as np
import pytest

from handtrack.detectors.profile import (
    IN_SPACE,
    Noise,
    Profile,
    load_profile,
    save_profile,
    shipped,
)
from handtrack.errors import HandtrackError, InputError, SettingsError


@pytest.fixture
def saved(tmp_path):
    rng = np.random.default_rng(0)
    noise = Noise(*rng.uniform(1e-3, 5e-3, (3, 21)), 0.25, view=1.5, finger=0.4, outliers=0.01)
    profile = Profile("mine", "mine", IN_SPACE, rng.normal(0, 0.1, (21, 3)), noise, {"clips": 3})
    return profile, save_profile(profile, tmp_path / "p.json")


def test_what_is_written_is_read(saved):
    profile, path = saved
    back = load_profile(path)
    np.testing.assert_allclose(back.offsets, profile.offsets, atol=1e-4)
    np.testing.assert_allclose(back.noise.fading, profile.noise.fading, atol=1e-7)
    assert (back.name, back.input, back.evidence) == ("mine", IN_SPACE, {"clips": 3})
    assert back.noise.view == 1.5


@pytest.mark.parametrize("name", shipped())
def test_profiles_that_ship_load(name):
    assert load_profile(name).name == name


def test_an_unknown_profile_is_said():
    with pytest.raises(SettingsError, match=r"detector 'mediapie' is unknown, expected .*none"):
        load_profile("mediapie")


def other_joints(content):
    content["offsets"]["palm"] = content["offsets"].pop("wrist")


def other_version(content):
    content["version"] = 2


def text_number(content):
    content["noise"]["white_mm"]["index_tip"] = "2"


def short_row(content):
    content["offsets"]["index_tip"] = [0.0, 1.0]


def negative(content):
    content["noise"]["fading_mm"]["index_tip"] = -2


def other_input(content):
    content["input"] = "radar"


def no_noise(content):
    del content["noise"]


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (other_joints, "joint set"),
        (other_version, "version 2, expected 1"),
        (text_number, "noise.white_mm.index_tip is 2, expected a number"),
        (short_row, "offsets.index_tip expects 3 numbers"),
        (negative, "noise.fading .*negative"),
        (other_input, "input is .*radar"),
        (no_noise, "noise is missing"),
    ],
)
def test_what_is_wrong_is_said(saved, spoil, said):
    _, path = saved
    content = json.loads(path.read_text())
    spoil(content)
    path.write_text(json.dumps(content))
    with pytest.raises(InputError, match=said) as caught:
        load_profile(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    "text", ["", "{", "[]", '{"format": "handtrack hand"}', '{"a": 1, "a": 2}']
)
def test_what_is_no_profile_is_said(tmp_path, text):
    path = tmp_path / "p.json"
    path.write_text(text)
    with pytest.raises(HandtrackError, match="no detector profile"):
        load_profile(path)


def test_a_file_is_named_once(saved):
    _, path = saved
    content = json.loads(path.read_text())
    other_joints(content)
    path.write_text(json.dumps(content))
    with pytest.raises(InputError) as caught:
        load_profile(path)
    assert str(caught.value).count("p.json") == 1
