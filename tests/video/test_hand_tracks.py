"""Which detection is which hand."""

from __future__ import annotations

from clips import seen

from handtrack.video.hand_tracks import HandTracks


def names(frames):
    """For each frame, hand -> x of what is called so, after all frames are known."""
    tracks = HandTracks()
    rows = [tracks.add(found) for found in frames]
    return [{h: round(d.image[0, 0]) for h, d in tracks.named(row).items()} for row in rows]


def test_labels_are_taken_where_they_agree():
    out = names([[seen("left", 100), seen("right", 400)]] * 3)
    assert out == [{"left": 100, "right": 400}] * 3


def test_a_label_that_is_wrong_for_a_frame_changes_nothing():
    frames = [[seen("right", 100 + t)] for t in range(9)]
    frames[0], frames[4] = [seen("left", 100)], [seen("left", 104)]
    assert names(frames) == [{"right": 100 + t} for t in range(9)]


def test_two_hands_of_the_same_label_are_told_apart_by_their_history():
    frames = [[seen("left", 100 + t), seen("right", 400 - t)] for t in range(6)]
    frames[3] = [seen("right", 103), seen("right", 397)]
    frames[5] = [seen("right", 395), seen("left", 105)]  # in another order
    out = names(frames)
    assert out[3] == {"left": 103, "right": 397}
    assert out[5] == {"left": 105, "right": 395}


def test_a_jump_across_the_picture_is_another_hand():
    assert names([[seen("right", 100)], [seen("left", 600)]]) == [{"right": 100}, {"left": 600}]


def test_pictures_without_a_link_stand_alone():
    tracks = HandTracks(linked=False)
    rows = [tracks.add([seen(hand, 100)]) for hand in ("right", "left", "right")]
    assert [list(tracks.named(row)) for row in rows] == [["right"], ["left"], ["right"]]


def test_of_three_hands_two_are_taken():
    (row,) = names([[seen("right", 100, 0.95), seen("right", 400, 0.6), seen("left", 700, 0.9)]])
    assert row == {"right": 100, "left": 700}
