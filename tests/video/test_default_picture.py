"""Videos, and what `detect` wrote, are fitted to joints and picture without a word."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from seen_hands import made

import handtrack as ht
from handtrack.batching.settings import BatchSettings
from handtrack.batching.work import track_clip
from handtrack.cli import run
from handtrack.errors import InputError
from handtrack.evaluation.metrics import pa_mpjpe
from handtrack.sequences.identity import repair_identity
from handtrack.video import following
from handtrack.video.placing import Seen


def off_mm(joints, truth):
    return 1e3 * float(np.nanmean(pa_mpjpe(joints, truth)))


def place_of(joints):
    return np.median(joints.mean(1)[:, 2])


@pytest.mark.parametrize("hand", ["left", "right"])
@pytest.mark.parametrize("longer", [1.0, 1.3])
def test_the_picture_is_fitted_by_default_whatever_the_lens(hand, longer):
    _, truth, camera, found = made(hand=hand, longer=longer)
    (sequence,) = found.sequences()
    both = ht.track(sequence)
    joints = ht.track(sequence, picture=False)
    assert off_mm(both.fitted_joints, truth) < 0.8 * off_mm(joints.fitted_joints, truth)
    about = both.settings["cameras"]
    assert about["lens"] == "assumed"
    assert about["views"] == 1
    assert about["reprojection_px"]["median"] < 4
    assert "cameras" not in joints.settings
    # as far away as the hand's size and the assumed lens have it
    size = both.model.size / ht.HandModel.default(hand).size
    assert place_of(both.fitted_joints) == pytest.approx(size * place_of(truth) / longer, rel=0.04)
    told = replace(sequence, picture=replace(sequence.picture, camera=camera, lens=""))
    known = ht.track(told)
    assert place_of(known.fitted_joints) == pytest.approx(size * place_of(truth), rel=0.04)
    assert "lens" not in known.settings["cameras"]


def test_without_a_picture_nothing_changes():
    _, _, _, found = made(20)
    (sequence,) = found.sequences()
    bare = replace(sequence, picture=None)
    for one in (ht.track(sequence, picture=False), ht.track(bare)):
        want = ht.track(ht.Sequence(bare.time_ns, bare.joints, bare.confidence))
        np.testing.assert_array_equal(one.angles, want.angles)
        np.testing.assert_array_equal(one.translation, want.translation)


def test_what_detect_writes_is_tracked_as_the_video_is(tmp_path):
    _, _, _, found = made(20)
    found.save(tmp_path / "seen.npz")
    (read,), (seen,) = ht.load(tmp_path / "seen.npz"), found.sequences()
    assert read.picture.size == seen.picture.size
    np.testing.assert_allclose(read.picture.image, seen.picture.image, atol=1e-3)
    np.testing.assert_array_equal(read.picture.sure, seen.picture.sure)
    a, b = ht.track(read), ht.track(replace(seen, detector="mediapipe"))
    np.testing.assert_allclose(a.fitted_joints, b.fitted_joints, atol=1e-4)
    (row,) = track_clip(
        ht.Clip(str(tmp_path / "seen.npz"), "seen"), BatchSettings(), str(tmp_path / "out")
    )
    (again,) = ht.read_mcap(tmp_path / "out" / row["recording"])
    np.testing.assert_array_equal(again.angles, a.angles)
    assert again.settings["cameras"] == a.settings["cameras"]


def test_the_command_says_that_the_lens_is_assumed(tmp_path, capsys):
    made(20)[3].save(tmp_path / "seen.npz")
    out = tmp_path / "seen.mcap"
    assert run(["track", str(tmp_path / "seen.npz"), "-o", str(out), "--mesh", "none"]) == 0
    said = capsys.readouterr().err
    assert "right hand fitted to its joints and its picture, reprojection error" in said
    assert "the lens is assumed" in said
    assert "--fov DEGREES" in said
    (track,) = ht.read_mcap(out)
    assert track.settings["cameras"]["lens"] == "assumed"
    again = ht.retrack(track)
    np.testing.assert_array_equal(again.angles, track.angles)
    np.testing.assert_array_equal(again.translation, track.translation)
    assert again.settings == track.settings
    out = tmp_path / "alone.mcap"
    arguments = ["track", str(tmp_path / "seen.npz"), "--no-picture", "-o", str(out)]
    assert run([*arguments, "--mesh", "none"]) == 0
    assert "lens" not in capsys.readouterr().err
    (alone,) = ht.read_mcap(out)
    assert "cameras" not in alone.settings
    assert alone.settings["picture"] is False


def test_a_part_of_a_sequence_keeps_its_part_of_the_picture():
    (sequence,) = made(20)[3].sequences()
    part = sequence.frames(5, 9)
    np.testing.assert_array_equal(part.picture.image, sequence.picture.image[5:10])
    with pytest.raises(InputError, match="20 pictures for 5 frames"):
        replace(part, picture=sequence.picture)


def test_hands_that_are_put_back_bring_their_pictures():
    n = 40
    hands = {h: made(n, 0.0, hand=h)[3].sequences()[0] for h in ("left", "right")}
    # in the room, half a metre apart
    apart = {"left": -0.3, "right": 0.3}
    whole = [
        replace(s, joints=s.joints + np.array([apart[h], 0, 1.0]), name=f"two {h}")
        for h, s in hands.items()
    ]
    rows = np.arange(n)
    other = np.isin(rows, [20, 21, 22])

    def exchanged(a, b):
        def mixed(x, y):
            return np.where(other.reshape(-1, *[1] * (x.ndim - 1)), y, x)

        image = mixed(a.picture.image, b.picture.image)
        return replace(a, joints=mixed(a.joints, b.joints), picture=replace(a.picture, image=image))

    mended = repair_identity([exchanged(*whole), exchanged(*whole[::-1])])
    for got, want in zip(mended, whole, strict=True):
        assert got.remarks
        np.testing.assert_array_equal(got.joints, want.joints)
        np.testing.assert_array_equal(got.picture.image, want.picture.image)


def test_pictures_of_something_else_are_left_out_and_that_is_said():
    (sequence,) = made(20)[3].sequences()
    image = np.random.default_rng(0).uniform(0, 700, sequence.picture.image.shape)
    wrong = replace(sequence, picture=replace(sequence.picture, image=image))
    track = ht.track(wrong)
    alone = ht.track(sequence, picture=False)
    np.testing.assert_array_equal(track.angles, alone.angles)
    assert any("its picture does not show the hand" in e.text for e in track.events)


def test_the_hand_is_drawn_where_its_picture_shows_it():
    _, _, camera, found = made(20)
    track = ht.track(found.sequences()[0])
    placed = Seen.alone(found).place(track)
    shown = camera.project(track.model.joints(placed.angles, placed.rotation, placed.translation))
    off = np.linalg.norm(shown - found.image["right"], axis=-1)
    assert np.median(off) < 4
    np.testing.assert_array_equal(placed.image, found.image["right"])


def test_pictures_of_several_sizes_are_not_of_one_lens(tmp_path):
    found = replace(made(20)[3], one_size=False)
    (sequence,) = found.sequences()
    assert sequence.picture is None
    assert "of several sizes" in sequence.notes[0]
    found.save(tmp_path / "seen.npz")
    assert ht.load(tmp_path / "seen.npz")[0].picture is None


def test_both_hands_of_a_video_stand_where_they_are_seen():
    """And an exchanged label draws no hand over the other."""
    hands = {h: made(20, hand=h) for h in ("left", "right")}
    image = {
        "left": hands["left"][3].image["left"] - [300, 0],
        "right": hands["right"][3].image["right"] + [300, 0],
    }
    both = replace(
        hands["left"][3],
        image=image,
        world={h: hands[h][3].world[h] for h in hands},
        score={h: np.ones(20) for h in hands},
    )
    places = {}
    for sequence in both.sequences():
        track = ht.track(sequence)
        places[track.hand] = np.median(track.fitted_joints[:, 0, 0])
        np.testing.assert_array_equal(Seen.alone(both).place(track).image, image[track.hand])
        swapped = replace(both, image={"left": image["right"], "right": image["left"]})
        np.testing.assert_array_equal(Seen.alone(swapped).place(track).image, image[track.hand])
    assert places["right"] - places["left"] > 0.15


def test_frames_that_suit_their_picture_badly_are_believed_less() -> None:
    error = np.full((40, 21), 2.0)
    error[20:23], error[30] = 5.0, np.nan
    by_all, by_earlier = (following._trust(error, is_whole) for is_whole in (True, False))
    expected = np.ones(40)
    expected[20:23] = (following.DOUBTFUL * 2.0 / 5.0) ** 6
    assert by_all == pytest.approx(expected)
    assert by_earlier == pytest.approx(expected)
    error[:5] = 5.0  # nobody knows yet what is usual
    assert (following._trust(error, False)[:10] == 1.0).all()
    assert (following._trust(error, True)[:5] < 0.1).all()
