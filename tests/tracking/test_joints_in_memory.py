"""Joints as an array go straight into `handtrack.track`; what is no joints is told in one line."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import handtrack as ht


@pytest.fixture(scope="module")
def sequence(sample_file):
    (whole,) = ht.load(sample_file)
    return whole.between(0.0, 1.0)


FORMS = {
    "(T, 21, 3)": lambda joints: joints,
    "(T, 63)": lambda joints: joints.reshape(-1, 63),
    "lists": lambda joints: joints.tolist(),
    "lists with None": lambda joints: np.where(np.isnan(joints), None, joints).tolist(),
    "another layout": lambda joints: np.asfortranarray(joints),
}


@pytest.mark.parametrize("form", FORMS)
def test_an_array_is_tracked_as_the_same_sequence(form, sequence):
    with pytest.warns(UserWarning, match="30 frames/s assumed; no hand named: taken as right"):
        track = ht.track(FORMS[form](np.array(sequence.joints)))
    expected = ht.track(sequence)
    np.testing.assert_allclose(track.angles, expected.angles, atol=1e-9)
    assert track.hand == "right"
    assert not track.timed


def test_one_frame(sequence):
    with pytest.warns(UserWarning, match="assumed"):
        assert len(ht.track(np.array(sequence.joints[0]))) == 1


def test_a_sequence_is_taken_without_a_word(sequence):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(ht.track(sequence)) == len(sequence)


REFUSED = {
    "millimetres": (lambda j: j * 1000, "mm would fit: divide by 1000"),
    "two hands": (lambda j: np.concatenate([j, j], 1), "of two hands each is tracked by itself"),
    "hands by frame": (lambda j: np.stack([j, j], 1), "of two hands each is tracked by itself"),
    "x and y": (lambda j: j[..., :2], "places in a picture"),
    "20 joints": (lambda j: j[:, :20], "shape (31, 20, 3), expected a Sequence, or joints (T, 21"),
    "no frame": (lambda j: j[:0], "joints of no frame"),
    "nothing seen": (lambda j: j * np.nan, "every joint is missing"),
    "infinite": (lambda j: np.where(j == j[0, 0, 0], np.inf, j), "a joint is infinite"),
    "a path": (lambda j: "clip.npz", "clip.npz is a path"),
    "sequences": (lambda j: [ht.Sequence(np.arange(len(j)), j)], "a list of 1 sequences"),
    "texts": (lambda j: [["a"] * 63], "a list is no joints"),
    "complex": (lambda j: j + 1j, "a ndarray is no joints"),
    "nothing": (lambda j: None, "a NoneType is no joints"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_hand_in_metres_is_refused(case, sequence):
    make, message = REFUSED[case]
    with pytest.raises(ht.InputError) as caught:
        ht.track(make(np.array(sequence.joints)))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("given", [3, None, [b"a"], np.zeros((3, 21, 3))])
def test_what_is_no_path_is_not_loaded(given):
    with pytest.raises(ht.InputError, match=r"is no path of a file or folder"):
        ht.load(given)


@pytest.mark.parametrize("given", ["run.mcap", 3, None, ["run.mcap"]])
def test_what_is_no_track_is_refused(given, sequence, tmp_path):
    for call in (
        lambda: ht.write_mcap(given, tmp_path / "a.mcap"),
        lambda: ht.export(given, tmp_path / "a.csv"),
        lambda: ht.log_rerun(given, save=tmp_path / "a.rrd"),
        lambda: ht.plot(given),
    ):
        with pytest.raises(ht.InputError, match=r"is no track: handtrack\.track makes one"):
            call()
    with pytest.raises(ht.InputError, match=r"neither a track nor a sequence"):
        ht.stability(given)
    assert not list(tmp_path.iterdir())
