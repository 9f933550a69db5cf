"""Real recordings: what is known of them must come out."""

from pathlib import Path

import numpy as np
import pytest

import handtrack as ht
from handtrack.sequences.chirality import STRONG, chirality
from handtrack.sequences.size import palm_length

# file: per sequence (name, hand, frames, frames/s, joints missing, palm [mm])
KNOWN = {
    "dex/joints.npz": [("joints", "right", 621, 30, 0, 93)],
    "stereo/joints.npz": [("joints", "right", 378, 30, 378, 85)],
    "stereo/mono_cam0.npz": [("mono_cam0", "right", 378, 30, 378, 75)],
    "stereo/mono_cam1.npz": [("mono_cam1", "right", 378, 30, 0, 89)],
    "mediapipe_samples/gesture_recognizer_joints.npz": [
        ("gesture_recognizer_joints", "right", 195, 25, 23 * 21, 93)
    ],
    "mediapipe_samples/hand_landmarker_joints.npz": [
        ("hand_landmarker_joints", "right", 202, 25, 0, 95)
    ],
    "poses/left.npz": [("left", "left", 55, 30, 0, 93)],
    "poses/right.npz": [("right", "right", 55, 30, 0, 93)],
    "leap/grab.json": [("grab", "right", 374, 115.4, 374, 91)],
    "leap/wave.json": [("wave", "right", 111, 115.5, 111, 87)],
    "leap/three-claps.json": [
        ("three-claps left", "left", 403, 110.8, 403, 87),
        ("three-claps right", "right", 403, 110.8, 403, 91),
    ],
}


@pytest.mark.parametrize("file", KNOWN)
def test_known_recordings(shared_data, file):
    sequences = ht.load(shared_data / file)
    assert len(sequences) == len(KNOWN[file])
    for sequence, (name, hand, frames, fps, missing, palm) in zip(
        sequences, KNOWN[file], strict=True
    ):
        assert (sequence.name, sequence.hand, len(sequence)) == (name, hand, frames)
        assert sequence.fps == pytest.approx(fps, abs=0.1)
        assert palm_length(sequence.joints) * 1e3 == pytest.approx(palm, abs=1)
        side = 1 if hand == "right" else -1
        assert side * chirality(sequence.joints) > STRONG
        assert not any("but the fingers" in note for note in sequence.notes)
        if "stereo/joints" not in file:  # there single joints are missing too
            assert (~sequence.present).sum() == missing


def test_ego_recording_has_its_labels_swapped(shared_data):
    path = shared_data / "ego_mcap" / "hand_keypoints_3d.mcap"
    sequences = ht.load(path)
    for sequence, hand in zip(sequences, ("left", "right"), strict=True):
        assert (sequence.hand, len(sequence)) == (hand, 1302)
        assert sequence.fps == pytest.approx(30, abs=0.01)
        assert "pass --hand swap" in sequence.notes[0]
        assert 0.04 < 1 - sequence.present.mean() < 0.08
        assert np.nanmax(np.abs(sequence.joints)) < 2
    swapped = ht.load(path, hand="swap")
    assert [(s.hand, s.notes) for s in swapped] == [("right", ()), ("left", ())]


def test_everything_at_once(shared_data):
    sequences = ht.load(shared_data)
    assert len({s.name for s in sequences}) == len(sequences)
    assert len([s for s in sequences if "formats" not in Path(s.source).parts]) == 14
    assert "passed over: " in sequences[0].notes[-1]


def test_parts_of_the_shared_folder(shared_data):
    assert [s.name for s in ht.load(shared_data / "leap")] == [
        "grab",
        "three-claps left",
        "three-claps right",
        "wave",
    ]
    (part,) = ht.load(shared_data / "dex" / "joints.npz", frames=(100, 199))
    assert len(part) == 100
