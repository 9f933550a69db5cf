"""What is public is exported and documented; what older programs write still works, and is told."""

from __future__ import annotations

import builtins
import dataclasses
import importlib
import inspect
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

import handtrack as ht
from handtrack.deprecated import MODULES, old_positions
from handtrack.mcap.hands import HandDecoder

OF_604F333 = (
    *("Camera", "Fit", "HandModel", "HandtrackError", "InputError", "Limits", "LiveViewer", "MANO"),
    *("McapRecorder", "ModelError", "Sequence", "SettingsError", "Track", "Tracker", "calibrate"),
    *("explain", "export", "fit", "fit_2d", "fit_batch", "follow_mcap", "load", "load_cameras"),
    *("load_hand", "log_rerun", "read_mcap", "repair_identity", "retrack", "save_hand"),
    *("stability", "track", "write_mcap", "metrics"),
)
PUBLIC = [(name, getattr(ht, name)) for name in ht.__all__ if name != "__version__"]
JOINTS = ht.HandModel.default().rest_joints + 0.001 * np.random.default_rng(5).normal(size=(21, 3))


def classes(kind: Any) -> Iterator[type]:
    """Classes of the package in a type."""
    if isinstance(kind, type) and kind.__module__.startswith("handtrack"):
        yield kind
    for inner in typing.get_args(kind):
        yield from classes(inner)


def functions(value: Any) -> Iterator[tuple[str, Callable[..., Any]]]:
    """A function, or the public methods and properties of a class."""
    if inspect.isfunction(value):
        yield value.__name__, value
    elif isinstance(value, type):
        for name, member in vars(value).items():
            inner = getattr(member, "__func__", getattr(member, "fget", member))
            if not name.startswith("_") and inspect.isfunction(inner):
                yield name, inner


class Names(dict[str, Any]):
    """Names of a module; of packages that it imports only for types nothing is known."""

    def __missing__(self, name: str) -> Any:
        if hasattr(builtins, name):
            return getattr(builtins, name)
        assert name.islower(), f"{name} is imported for types alone: nobody can look it up"
        return mock.MagicMock()


def test_every_type_that_a_public_call_returns_is_exported() -> None:
    public = {value for _, value in PUBLIC if isinstance(value, type)}
    hidden = {}
    for owner, value in PUBLIC:
        for name, function in functions(value):
            said = function.__annotations__.get("return")
            names = Names(inspect.unwrap(function).__globals__)
            if isinstance(said, str) and said != "Self":
                for kind in classes(eval(said, {}, names)):
                    hidden |= {} if kind in public else {f"{owner}.{name}": kind}
        if dataclasses.is_dataclass(value):
            for name, said in typing.get_type_hints(value).items():
                for kind in classes(said):
                    hidden |= {} if kind in public else {f"{owner}.{name}": kind}
    assert not hidden


def test_public_results_cannot_be_changed() -> None:
    """Their fields; that arrays in them can only be read, `test_read_only` sees."""
    kinds = [
        kind for _, kind in PUBLIC if isinstance(kind, type) and dataclasses.is_dataclass(kind)
    ]
    assert len(kinds) > 20
    loose = [kind for kind in kinds if not kind.__dataclass_params__.frozen]  # type: ignore[attr-defined]
    assert not loose


def test_everything_public_says_what_it_is() -> None:
    for owner, value in PUBLIC:
        assert (value.__doc__ or "").strip(), owner
        if isinstance(value, type) and dataclasses.is_dataclass(value):
            assert not value.__doc__.startswith(f"{value.__name__}("), f"{owner}: made by dataclass"


def test_the_names_of_the_version_before_are_there() -> None:
    assert set(OF_604F333) <= set(ht.__all__)


@pytest.mark.parametrize("module", MODULES)
def test_old_modules_give_what_stands_elsewhere(module: str) -> None:
    old = importlib.import_module(f"handtrack.{module}")
    for name, place in MODULES[module].items():
        with pytest.warns(DeprecationWarning, match=name):
            value = getattr(old, name)
        place, _, now = place.partition(":")
        assert value is getattr(importlib.import_module(f"handtrack.{place}"), now or name)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        old.nothing  # noqa: B018


def test_names_that_left_a_module_which_stays() -> None:
    for module, name, now in (
        ("fitting.batch", "BatchFit", ht.Fit),
        ("fitting.images", "ViewFit", ht.Fit),
        ("tracking.tracker", "track", ht.track),
    ):
        with pytest.warns(DeprecationWarning, match=f"{module}.{name} is handtrack."):
            assert getattr(importlib.import_module(f"handtrack.{module}"), name) is now


def test_options_without_names_are_those_of_that_place() -> None:
    model = ht.HandModel.default()
    named = ht.fit(model, JOINTS, None, None, update="li2021", spread_mm=4.0, max_sweeps=3)
    with pytest.warns(DeprecationWarning, match="by name only: update, method, robust, spread_mm"):
        placed = ht.fit(model, JOINTS, None, None, *_old("li2021", "newton", "none", 4.0, 1, 3))
    assert np.array_equal(named.angles, placed.angles)
    assert named.sweeps == placed.sweeps == 3
    with pytest.warns(DeprecationWarning, match="Tracker"):
        tracker = ht.Tracker(model, *_old("kalman", "exact", 9, 0.7, 3.0, False, 4))
    chosen = tracker.chosen
    assert (chosen.filter.name, chosen.min_joints, chosen.coast_s) == ("kalman", 9, 0.7)
    assert (chosen.filter.process_noise, chosen.filter.couple, chosen.filter.lag) == (3.0, False, 4)
    sequence = ht.Sequence(np.arange(2) * 10**8, np.stack([JOINTS, JOINTS]))
    done: list[int] = []
    options = (False, "kalman", "exact", 5, 0.2, 1.0, True, 2, 1.5, "compiled", False, "huber", 7.0)
    with pytest.warns(DeprecationWarning, match="calibrate, filter"):
        track = ht.track(sequence, model, *_old(*options, True, done.append))
    assert done == [0, 2]  # the hand is known, all frames are done
    wanted = {"filter": "kalman", "noise_mm": 1.5, "gate": False, "robust": "huber"}
    assert {name: track.settings[name] for name in wanted} == wanted
    with pytest.warns(DeprecationWarning, match="update"):
        batch = ht.fit_batch(model, JOINTS[None], None, *_old("exact", "bcd"))
    assert batch.steps[0] == 0 < batch.sweeps[0]
    with pytest.warns(DeprecationWarning, match="frames"):
        ht.calibrate(model, sequence, "scale", *_old(50))


def _old(*options: Any) -> Any:
    """Options as older programs give them, which types do not allow any more."""
    return options


def test_sweeps_of_a_tracked_frame_are_its_iterations() -> None:
    model = ht.HandModel.default()
    frame = ht.Tracker(model).step(JOINTS, 0)
    fit = ht.fit(model, JOINTS)
    assert frame.iterations == fit.iterations > fit.sweeps > 0
    track = ht.track(ht.Sequence(np.array([0]), JOINTS[None]), model, calibrate="none")
    old = {name: array for name, array in track.arrays().items() if name != "iterations"}
    with pytest.warns(DeprecationWarning, match="Track.sweeps is iterations now"):
        again = ht.Track(name="", hand="right", model=model, sweeps=np.array([7]), **old)
    assert again.iterations.tolist() == [7]
    with pytest.warns(DeprecationWarning, match="TrackedFrame.sweeps is iterations now"):
        assert getattr(frame, "sweeps") == frame.iterations  # noqa: B009
    with pytest.warns(DeprecationWarning, match="Track.sweeps"):
        assert getattr(again, "sweeps").tolist() == [7]  # noqa: B009


def test_what_no_version_took_is_refused() -> None:
    @old_positions("b")
    def add(a: int, *, b: int = 0, c: int = 0) -> int:
        return a + 10 * b + 100 * c

    assert add(1, c=1) == 101
    with pytest.warns(DeprecationWarning, match="by name only: b;"):
        assert add(*_old(1, 2), c=3) == 321
    with pytest.raises(TypeError, match="positional"):
        add(*_old(1, 2, 3))
    with pytest.raises(TypeError, match="several values of 'b'"):
        add(*_old(1, 2), b=2)


def test_an_input_error_is_a_value_error_and_passes_where_those_are_caught() -> None:
    hand = HandDecoder("/right", Path("a.mcap"))
    with pytest.raises(ValueError, match="frame 0 of a hand is missing") as caught:
        hand.add("handtrack.State", 5, b"")
    assert caught.type is ht.InputError
    assert str(caught.value).count("a.mcap") == 1
