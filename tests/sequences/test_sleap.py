"""SLEAP's analysis files, made after its documentation: either order of axes, names of nodes."""

from __future__ import annotations

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.skeleton import JOINT_NAMES

h5py = pytest.importorskip("h5py", reason="the extra `formats` is not installed")


def analysis(path, tracks, nodes=JOINT_NAMES, names=("track_0",), standard=False):
    """A file of (tracks, frames, nodes, axes) places."""
    axes = (1, 0, 2, 3) if standard else (0, 3, 2, 1)
    with h5py.File(path, "w") as file:
        file["tracks"] = np.transpose(tracks, axes)
        file["node_names"] = np.array([name.encode() for name in nodes])
        file["track_names"] = np.array([name.encode() for name in names])
        file["track_occupancy"] = np.ones((tracks.shape[1], len(tracks)), np.uint8)
        file["point_scores"] = np.ones((len(tracks), tracks.shape[2], tracks.shape[1]))
        file["video_path"] = "a.mp4"
    return path


@pytest.mark.parametrize("standard", [False, True])
def test_nodes_in_any_order_by_their_names(tmp_path, right, standard):
    order = np.random.default_rng(3).permutation(21)
    seen = right.copy()
    seen[2] = np.nan
    path = analysis(
        tmp_path / "a.h5",
        seen[None][:, :, order],
        [JOINT_NAMES[j] for j in order],
        standard=standard,
    )
    (found,) = ht.load(path)
    np.testing.assert_array_equal(found.joints, seen)


def test_tracks_are_hands_by_their_names_or_fingers(tmp_path, right, left):
    both = np.stack([left, right])
    for names in (("left", "right"), ("track_0", "track_1")):
        found = {s.hand: s for s in ht.load(analysis(tmp_path / "a.h5", both, names=names))}
        np.testing.assert_array_equal(found["left"].joints, left)
        np.testing.assert_array_equal(found["right"].joints, right)


def test_triangulated_points_without_names(tmp_path, right):
    with h5py.File(tmp_path / "points3d.h5", "w") as file:
        file["tracks"] = 1000 * right[:, None]
    (found,) = ht.load(tmp_path / "points3d.h5", unit="mm")
    np.testing.assert_allclose(found.joints, right, atol=1e-12)


def test_tracks_in_a_picture_are_told(tmp_path, right):
    path = analysis(tmp_path / "a.h5", 500 * right[None, ..., :2])
    with pytest.raises(InputError, match="positions in a picture"):
        ht.load(path)


def test_names_by_a_file_and_wrong_shapes(tmp_path, right):
    nodes = [f"n{j}" for j in range(21)]
    path = analysis(tmp_path / "a.h5", right[None], [f"pt_{n}_q" for n in nodes])
    with pytest.raises(InputError, match="--markers"):
        ht.load(path)
    pairs = [f"pt_n{j}_q,{name}" for j, name in enumerate(JOINT_NAMES)]
    (tmp_path / "pairs.csv").write_text("\n".join(pairs))
    (found,) = ht.load(path, markers=tmp_path / "pairs.csv")
    np.testing.assert_array_equal(found.joints, right)
    with pytest.raises(InputError, match="tracks has shape"):
        ht.load(analysis(tmp_path / "b.h5", right[None], nodes[:20]))
