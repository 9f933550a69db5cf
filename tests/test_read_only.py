"""Whoever writes into what a call returned changes nothing that is computed afterwards."""

from __future__ import annotations

import dataclasses
import pickle
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handtrack as ht
from handtrack.auditing.audit import audit
from handtrack.read_only import make_read_only, read_only

Made = Callable[[], dict[str, Any]]


def arrays(value: Any, name: str = "") -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """All arrays in a value, by where they stand; properties are computed anew and left out."""
    if isinstance(value, np.ndarray):
        yield name, value
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from arrays(inner, f"{name}.{key}")
    elif isinstance(value, list | tuple):
        for i, inner in enumerate(value):
            yield from arrays(inner, f"{name}.{i}")
    elif dataclasses.is_dataclass(value):
        for key, inner in vars(value).items():  # with what cached properties keep
            yield from arrays(inner, f"{name}.{key}")


def containers(value: Any, name: str = "") -> Iterator[tuple[str, Any]]:
    """All dictionaries and lists that a dataclass holds, by where they stand."""
    if isinstance(value, dict | list):
        yield name, value
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from containers(inner, f"{name}.{key}")
    elif isinstance(value, list | tuple):
        for i, inner in enumerate(value):
            yield from containers(inner, f"{name}.{i}")
    elif dataclasses.is_dataclass(value):
        for key, inner in vars(value).items():
            yield from containers(inner, f"{name}.{key}")


def spoil(value: Any) -> int:
    """Write into all arrays that can be written; how many there are in all."""
    found = list(arrays(value))
    for _, array in found:
        with suppress(ValueError):
            array[...] = np.array("no" if array.dtype.kind == "U" else 1).astype(array.dtype)
    return len(found)


@pytest.fixture(scope="module")
def made(sample: ht.Sequence, tmp_path_factory: pytest.TempPathFactory) -> Made:
    folder = tmp_path_factory.mktemp("made")
    model = ht.HandModel.default()
    clip = sample.frames(0, 50)
    lens = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]])
    camera = ht.Camera("front", lens, np.zeros(5), np.eye(3), np.array([0.0, 0, 1]))
    seen = camera.project(model.joints(model.mean_angles))[None]

    def make() -> dict[str, Any]:
        track = ht.track(clip, model, filter="kalman")
        file = ht.write_mcap([track], folder / "a.mcap")
        ht.save_hand(model, Path(folder / "hand.json"))
        fit = ht.fit(model, clip.joints[0])
        pose = ht.to_mano(model, fit.angles, fit.rotation, fit.translation)
        return {
            "clip": clip,
            "model": model,
            "mean angles": model.mean_angles,
            "loaded": ht.load_hand(folder / "hand.json"),
            "track": track,
            "read": ht.read_mcap(file),
            "fit": fit,
            "warm": ht.fit(model, clip.joints[1], start=fit),
            "batch": ht.fit_batch(model, clip.joints[:4], covariances=True),
            "pictures": ht.fit_2d(model, seen, [camera]),
            "camera": camera,
            "calibration": ht.calibrate(model, clip, "proportions"),
            "stability": ht.stability(track),
            "mano": pose,
            "from mano": ht.from_mano(model, pose.values, pose.transl),
        }

    return make


def test_settings_and_numbers_can_only_be_read(made: Made) -> None:
    """What a track says of how it was made is no more to be written to than its arrays."""
    values = made()
    values["audited"] = audit([values["clip"]], fit=False)[0]
    inside = [(name, *found) for name, v in values.items() for found in containers(v)]
    for name, place, held in inside:
        if name in ("read", "from mano") and place == "":
            continue  # the call's own list
        with pytest.raises(TypeError):
            held.__setitem__("x" if isinstance(held, dict) else slice(0, 0), [1])
    assert {"track", "audited"} <= {name for name, *_ in inside}
    track = values["track"]
    assert pickle.loads(pickle.dumps(track.settings)) == track.settings == {**track.settings}


def test_what_leaves_is_safe(made: Made) -> None:
    """The second run is of the same hand and clip, after all of the first was written into."""
    first = made()
    before = [
        (name, array.copy()) for name, array in arrays(first) if not name.startswith(".frames")
    ]
    assert spoil(first) > 100
    after = list(arrays(made()))
    assert [name for name, _ in after] == [name for name, _ in before]
    for (name, a), (_, b) in zip(before, after, strict=True):
        assert np.array_equal(a, b, equal_nan=a.dtype.kind == "f"), name


def test_a_tracker_goes_on_as_if_nobody_wrote(sample: ht.Sequence) -> None:
    model = ht.HandModel.default()
    touched, apart = (ht.Tracker(model, filter="kalman") for _ in range(2))
    for i in range(60):
        joints, weights = np.array(sample.joints[i]), np.ones(21)
        frame = touched.step(joints, int(sample.time_ns[i]), weights)
        expected = apart.step(sample.joints[i], int(sample.time_ns[i]))
        for (name, a), (_, b) in zip(arrays(frame), arrays(expected), strict=True):
            assert np.array_equal(a, b, equal_nan=True), f"frame {i}: {name}"
        spoil(frame)
        joints[...] = weights[...] = 7.0  # the caller's own
        spoil(touched.model)


def test_no_array_of_a_result_can_be_written(made: Made) -> None:
    of_their_own = (".mano.", ".from mano.")  # nobody keeps these
    can = [n for n, a in arrays(made()) if a.flags.writeable and not n.startswith(of_their_own)]
    assert not can


def test_read_only_leaves_the_maker_free() -> None:
    @dataclasses.dataclass(frozen=True)
    class Holder:
        whole: Any
        named: Any

    own = np.arange(3.0)
    holder = Holder(own, {"a": own, "b": "text"})
    make_read_only(holder)
    for array in (holder.whole, holder.named["a"], read_only(own)):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 5.0
    own[0] = 6.0
    assert holder.whole[0] == 6.0
    assert holder.named["b"] == "text"
    assert read_only(holder.whole) is holder.whole
