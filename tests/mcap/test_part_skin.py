"""The skin in pieces: where its frames put it, and when it is written."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from made_tracks import make_track

from handtrack.hand.model import HandModel
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import N_PARTS, PART_NAMES
from handtrack.mcap.foxglove import AGAIN_NS, PartSkinEncoder, TransformEncoder, piece
from handtrack.mcap.schema import message_class


def placed(transforms, frame):
    """Rotation and translation from a frame to the world, as a viewer chains them."""
    of = {t.child_frame_id: t for t in transforms}
    rotation, translation = np.eye(3), np.zeros(3)
    while frame != "world":
        t = of[frame]
        q, v = t.rotation, t.translation
        turn = quaternion_to_matrix(np.array([q.w, q.x, q.y, q.z]))
        rotation, translation = turn @ rotation, turn @ translation + [v.x, v.y, v.z]
        frame = t.parent_frame_id
    return rotation, translation


@pytest.mark.parametrize("hand", ["right", "left"])
def test_frames_put_the_pieces_where_the_skin_is(hand):
    """Corners that one part alone moves are exactly there; no triangle is left out."""
    track = make_track(30, hand, lost=slice(0, 0))
    model = track.model
    times = track.time_ns.astype(np.uint64)
    encoder = PartSkinEncoder(hand, model)
    said = encoder.messages(times.tolist(), [True] * 30)
    assert list(said) == [0]
    scene = message_class("foxglove.SceneUpdate").FromString(said[0])
    moves = TransformEncoder(hand, model).rows(times, track, slice(0, 30)).messages()
    transforms = message_class("foxglove.FrameTransforms").FromString(moves[17]).transforms
    vertices = track.vertices(np.array([17]))[0]
    stiff = model.weights.max(1) == 1
    covered = set()
    for entity in scene.entities:
        assert entity.frame_locked
        assert entity.frame_id == entity.id
        part = PART_NAMES.index(entity.frame_id.partition("/")[2])
        (triangles,) = entity.triangles
        rotation, translation = placed(transforms, entity.frame_id)
        points = np.array([[p.x, p.y, p.z] for p in triangles.points]) @ rotation.T + translation
        indices = np.array(triangles.indices).reshape(-1, 3)
        chosen = model.faces[np.isin(model.faces, np.flatnonzero(model.weights[:, part])).any(1)]
        used = np.unique(piece_faces(model, part))
        own = stiff[used] & (model.weights[used].argmax(1) == part)
        np.testing.assert_allclose(points[own], vertices[used][own], atol=1e-9)
        assert len(indices) <= len(chosen)
        covered |= {tuple(face) for face in used[indices].tolist()}
    assert covered == {tuple(face) for face in model.faces.tolist()}
    assert stiff.sum() > 100


def piece_faces(model, part):
    """The triangles of a piece, in the skin's own numbers."""
    points, faces = piece(model, part)
    at_rest = (
        points + model.rest_joints[[0, *(4 * f + 1 + i for f in range(5) for i in range(3))]][part]
    )
    near = np.linalg.norm(model.rest_vertices[None] - at_rest[:, None], axis=-1).argmin(1)
    return near[faces]


def test_written_again_only_after_a_loss_and_at_most_once_a_second():
    model = HandModel.default("right")
    known = np.ones(300, bool)
    known[[3, 50, 51, 200]] = False
    known[250:] = False
    times = [i * 33_333_333 for i in range(300)]
    encoder = PartSkinEncoder("right", model)
    # in stretches of any length
    cuts = [0, 1, 51, 128, 300]
    made = {
        a + i: message
        for a, b in pairwise(cuts)
        for i, message in encoder.messages(times[a:b], known[a:b].tolist()).items()
    }
    make = message_class("foxglove.SceneUpdate")
    said = {i: make.FromString(message) for i, message in made.items()}
    # the loss of frame 3 is too near to the beginning
    assert list(said) == [0, 50, 52, 200, 201, 250]
    for i, scene in said.items():
        assert [d.type for d in scene.deletions] == ([] if known[i] else [1])
        assert bool(scene.entities) == known[i]
        if known[i]:
            assert len(scene.entities) == N_PARTS
    full = [times[i] for i in said if known[i]]
    assert all(b - a >= AGAIN_NS for a, b in pairwise(full))


def test_a_long_loss_that_begins_early_is_shown():
    known = [i < 3 for i in range(90)]
    times = [i * 33_333_333 for i in range(90)]
    made = PartSkinEncoder("right", HandModel.default("right")).messages(times, known)
    assert list(made) == [0, 31]
