"""Arrays of the shapes in which people have hands: each read with the same joints in it."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError

FRAMES = 34
"""More than a hand has joints: else which axis is the frames' is not to be told."""


@pytest.fixture(scope="module")
def clips(motion) -> dict[str, np.ndarray]:
    return {hand: motion(hand, FRAMES) for hand in ("left", "right")}


def loaded(path, array, **options):
    np.save(path, array, allow_pickle=True)
    return ht.load(path, **options)


SHAPES = {
    "(21, T, 3)": lambda x: x.transpose(1, 0, 2),
    "(3, T, 21)": lambda x: x.transpose(2, 0, 1),
    "(21, 3, T)": lambda x: x.transpose(1, 2, 0),
    "(3, 21, T)": lambda x: x.transpose(2, 1, 0),
    "(63, T)": lambda x: x.reshape(len(x), 63).T,
    "(T, 1, 63)": lambda x: x.reshape(len(x), 1, 63),
    "(T, 1, 21, 3)": lambda x: x[:, None],
    "of Fortran's order": np.asfortranarray,
    "a record type": lambda x: np.array(
        list(enumerate(x)), [("frame", "i4"), ("pos", "f8", (21, 3))]
    ),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_one_hand(tmp_path, clips, shape):
    (found,) = loaded(tmp_path / "a.npy", SHAPES[shape](clips["right"]))
    assert np.allclose(found.joints, clips["right"])
    assert found.hand == "right"


PAIRED = {
    "(T, 2, 63)": lambda pair: pair.reshape(len(pair), 2, 63),
    "(T, 2, 21, 4)": lambda pair: np.concatenate([pair, pair[..., :1] * 0 + 0.5], -1),
    "(2, T, 21, 4)": lambda pair: np.concatenate([pair, pair[..., :1] * 0 + 0.5], -1).swapaxes(
        0, 1
    ),
    "(T, 168)": lambda pair: np.concatenate([pair, pair[..., :1] * 0], -1).reshape(len(pair), 168),
}


@pytest.mark.parametrize("shape", PAIRED)
def test_two_hands(tmp_path, clips, shape):
    pair = np.stack([clips["left"], clips["right"]], 1)
    found = loaded(tmp_path / "a.npy", PAIRED[shape](pair))
    assert {s.hand for s in found} == {"left", "right"}
    for sequence in found:
        assert np.allclose(sequence.joints, clips[sequence.hand])


FOURTH = {
    "(T, 21, 4)": lambda x: x,
    "(T, 4, 21)": lambda x: x.swapaxes(1, 2),
    "(T, 84)": lambda x: x.reshape(len(x), 84),
}


@pytest.mark.parametrize("shape", FOURTH)
def test_a_fourth_number_is_the_confidence(tmp_path, clips, shape):
    sure = np.random.default_rng(1).uniform(0.5, 1.0, (FRAMES, 21))
    sure[3, 7] = 0.0
    given = np.concatenate([clips["right"], sure[..., None]], -1)
    for path in (tmp_path / "a.npy", tmp_path / "a.npz"):
        if path.suffix == ".npz":
            np.savez(path, landmarks=FOURTH[shape](given))
        else:
            np.save(path, FOURTH[shape](given))
        (found,) = ht.load(path)
        assert not found.present[3, 7]
        assert found.present.sum() == FRAMES * 21 - 1
        assert np.allclose(found.joints[found.present], clips["right"][found.present])
        assert np.allclose(found.confidence[found.present], sure[found.present])


@pytest.mark.parametrize("flat", [False, True])
def test_as_many_frames_as_joints(tmp_path, clips, flat):
    """21 frames of two hands: a fourth number tells which axis the frames are."""
    pair = np.stack([clips["left"][:21], clips["right"][:21]], 1)
    sure = np.random.default_rng(1).uniform(0.1, 0.9, pair.shape[:-1])
    array = np.concatenate([pair, sure[..., None]], -1)
    found = loaded(tmp_path / "a.npy", array.reshape(21, -1) if flat else array)
    assert [s.hand for s in found] == ["left", "right"]
    for hand, sequence in enumerate(found):
        assert np.allclose(sequence.joints, pair[:, hand])
        assert np.allclose(sequence.confidence, sure[:, hand])


@pytest.mark.parametrize("constant", [0.0, 1.0])
def test_a_fourth_number_that_says_nothing(tmp_path, clips, constant):
    given = np.concatenate([clips["right"], np.full((FRAMES, 21, 1), constant)], -1)
    (found,) = loaded(tmp_path / "a.npy", given)
    assert np.allclose(found.joints, clips["right"])
    assert found.confidence is None or (found.confidence == 1).all()


def test_a_fourth_number_that_is_no_share(tmp_path, clips):
    given = np.concatenate([clips["right"], np.full((FRAMES, 21, 1), 3.0)], -1)
    with pytest.raises(InputError, match=r"fourth number .* leave it out"):
        loaded(tmp_path / "a.npy", given)


@pytest.mark.parametrize(("step", "fps"), [(1, 30.0), (0.02, 50.0)])
def test_a_count_before_63_numbers(tmp_path, clips, step, fps):
    first = np.arange(FRAMES) * step + 7
    (found,) = loaded(tmp_path / "a.npy", np.c_[first, clips["right"].reshape(FRAMES, 63)])
    assert np.allclose(found.joints, clips["right"])
    assert found.fps == pytest.approx(fps, rel=1e-3)
    assert found.frame_index[0] == (7 if step == 1 else 0)


def test_objects_of_which_nothing_is_run(tmp_path, clips):
    right = clips["right"]
    rows = np.empty(FRAMES, object)
    for i in range(FRAMES):
        rows[i] = None if i == 5 else right[i]
    for content in (rows, {"keypoints": right, "fps": 50.0}, {"right_hand": right}):
        (found,) = loaded(tmp_path / "a.npy", np.array(content, dtype=object))
        seen = found.present.all(1)
        assert seen.sum() == FRAMES - (content is rows)
        assert np.allclose(found.joints[seen], right[seen])
    assert found.hand == "right"


def test_objects_that_ask_for_code(tmp_path):
    ran = tmp_path / "ran"

    class Evil:
        def __reduce__(self):
            return ran.touch, ()

    with pytest.raises(InputError, match="no place among arrays"):
        loaded(tmp_path / "a.npy", np.array([Evil()], dtype=object))
    assert not ran.exists()


def test_an_array_a_frame(tmp_path, clips):
    right = clips["right"]
    named = {f"frame_{3 + i:04d}": right[i] for i in reversed(range(FRAMES))}
    np.savez(tmp_path / "a.npz", **named)
    (found,) = ht.load(tmp_path / "a.npz")
    assert np.allclose(found.joints, right)
    assert found.frame_index.tolist() == list(range(3, 3 + FRAMES))


def test_what_could_be_the_joints_is_told(tmp_path, clips):
    np.savez(tmp_path / "a.npz", raw=clips["right"], filtered=clips["right"] + 0.01)
    with pytest.raises(InputError, match=r"found raw, filtered .--key NAME"):
        ht.load(tmp_path / "a.npz")
    (found,) = ht.load(tmp_path / "a.npz", key="raw")
    assert np.allclose(found.joints, clips["right"])


def test_joints_about_the_wrist_are_told(tmp_path, clips):
    right = clips["right"]
    x, y, z = np.moveaxis(right, -1, 0)
    shares = np.stack([0.5 + x / z, 0.5 + y / z, (z - z[:, :1]) / z[:, :1]], -1)
    for frames in (1, FRAMES):
        about = (shares - shares[:, :1])[:frames]
        (found,) = loaded(tmp_path / "a.npy", about)
        assert any("wrist is always at 0" in note for note in found.notes)
    for options in ({}, {"unit": "m"}):
        (found,) = loaded(tmp_path / "a.npy", right - right[:, :1], **options)
        said = any("wrist is always at 0" in note for note in found.notes)
        assert said == (not options)
