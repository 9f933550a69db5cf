"""Names beside the joints that scripts write: rates, what is seen, and what is not used."""

from __future__ import annotations

import json

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError
from handtrack.hand.model import HandModel

N = 12
JOINTS = HandModel.default("right").rest_joints + np.linspace(0.1, 0.15, N)[:, None, None]


def written(folder, form, **fields):
    path = folder / f"a.{form}"
    if form == "npz":
        np.savez(path, joints=JOINTS, hand="right", **fields)
    else:
        told = {k: np.asarray(v).tolist() for k, v in fields.items()}
        path.write_text(json.dumps({"joints": JOINTS.tolist(), "hand": "right"} | told))
    return path


@pytest.mark.parametrize("form", ["npz", "json"])
@pytest.mark.parametrize("name", ["fps", "sampling_rate", "frequency", "fs", "video_fps"])
def test_a_rate_by_its_names(tmp_path, form, name):
    (sequence,) = ht.load(written(tmp_path, form, **{name: 25.0}))
    np.testing.assert_array_equal(np.diff(sequence.time_ns), 40_000_000)


@pytest.mark.parametrize("form", ["npz", "json"])
def test_what_is_seen_of_joints(tmp_path, form):
    seen = np.ones((N, 21), dtype=bool)
    seen[3, 8] = False
    for name in ("valid", "is_valid"):
        (sequence,) = ht.load(written(tmp_path, form, **{name: seen}))
        np.testing.assert_array_equal(sequence.confidence > 0, seen)
    with pytest.raises(InputError, match="'mask' is true or false of each joint"):
        ht.load(written(tmp_path, form, mask=seen))


@pytest.mark.parametrize("form", ["npz", "json"])
def test_numbers_of_joints_that_are_not_used_are_named(tmp_path, form):
    (sequence,) = ht.load(written(tmp_path, form, weights=np.full((N, 21), 0.5)))
    assert "not used: weights" in sequence.notes
    assert (sequence.confidence[sequence.present] == 1).all()


def test_a_rate_above_a_table(tmp_path):
    path = tmp_path / "a.csv"
    rows = "".join(",".join(map(repr, frame.ravel().tolist())) + "\n" for frame in JOINTS)
    path.write_text(f"# sampling rate: 25\n{rows}")
    (sequence,) = ht.load(path, hand="right")
    np.testing.assert_array_equal(np.diff(sequence.time_ns), 40_000_000)
