"""What older programs write: it works for one more version, and says what to write instead."""

from __future__ import annotations

import functools
import importlib
import sys
import warnings
from collections.abc import Callable, Mapping
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")
C = TypeVar("C")

MODULES = {
    "fitting.bcd": {
        "Fit": "fitting.result",
        "fit": "fitting.fit",
        "warm_up": "fitting.fit",
        "Update": "fitting.settings",
        "Method": "fitting.settings",
        "Robust": "fitting.settings",
    },
    "fitting.batch": {"fit_batch": "fitting.fit", "BatchFit": "fitting.result:Fit"},
    "hand.mano_decode": {"decode": "hand.mano_pose"},
    "recording.mcap_io": {
        "read_mcap": "recording.read",
        "follow_mcap": "recording.read",
        "write_mcap": "recording.write",
    },
    "recording.mesh_choice": {"MeshChoice": "recording.settings"},
    "recording.export": {},
    "recording.export.files": {"export": "exporting.files", "Exported": "exporting.files"},
    "recording.live": {"LiveViewer": "viewer.live_viewer"},
    "recording.replay": {"replay": "viewer.replay"},
    "recording.rerun_log": {"log_rerun": "viewer.rerun_log"},
    "recording.picture_log": {"PictureView": "viewer.picture_log"},
    "tracking.filter_settings": {
        "FilterSettings": "tracking.settings",
        "FILTERS": "tracking.settings",
        "ENGINES": "tracking.settings",
    },
    "tracking.retrack": {
        "retrack": "recording.retrack",
        "input_of": "recording.retrack",
        "settings_of": "recording.retrack",
    },
}
"""Modules that are gone: what programs may have taken from them, and where it is now."""


def warn(message: str) -> None:
    """Say to the programmer that something old was used."""
    warnings.warn(f"{message}; the next version will not know it", DeprecationWarning, 3)


def old_positions(*names: str) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Arguments that may stand without their names, as they once could.

    Args:
        names: of those after the arguments that still can, in order.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        today: int = function.__code__.co_argcount
        of = function.__qualname__.removesuffix(".__init__")

        @functools.wraps(function)
        def call(*args: Any, **options: Any) -> Any:
            if len(args) > today:
                old = args[today:]
                if len(old) > len(names):
                    return function(*args, **options)
                given = dict(zip(names, old, strict=False))
                twice = [name for name in given if name in options]
                if twice:
                    raise TypeError(f"{of}() got several values of {twice[0]!r}")
                warn(f"{of}() takes by name only: {', '.join(given)}")
                args, options = args[:today], {**options, **given}
            return function(*args, **options)

        return call

    return decorate


def renamed(**names: str) -> Callable[[type[C]], type[C]]:
    """A class whose attributes can still be called as they were.

    Args:
        names: how each that was called so is called now.
    """

    def decorate(cls: type[C]) -> type[C]:
        for old, new in names.items():
            setattr(cls, old, _old_attribute(cls.__name__, old, new))
        return cls

    return decorate


def old_arguments(**names: str) -> Callable[[type[C]], type[C]]:
    """A class that can still be made with arguments called as they were; as `renamed`."""

    def decorate(cls: type[C]) -> type[C]:
        make: Any = cls.__init__

        @functools.wraps(make)
        def init(self: C, *args: Any, **options: Any) -> None:
            for old, new in names.items():
                if old in options and new not in options:
                    warn(f"{cls.__name__}.{old} is {new} now")
                    options[new] = options.pop(old)
            make(self, *args, **options)

        setattr(cls, "__init__", init)  # noqa: B010
        return cls

    return decorate


def _old_attribute(owner: str, old: str, new: str) -> property:
    def give(self: Any) -> Any:
        warn(f"{owner}.{old} is {new} now")
        return getattr(self, new)

    return property(give)


def moved(module: str, names: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a module that gives names which stand elsewhere now.

    Args:
        module: its full name.
        names: where each is: "fitting.result", or "fitting.result:Fit" under another name.
    """

    def give(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        place, _, there = names[name].partition(":")
        there = there or name
        public = vars(sys.modules["handtrack"]).get("__all__", ())
        best = f"handtrack.{there if there in public else f'{place}.{there}'}"
        warn(f"{module}.{name} is {best} now")
        return getattr(importlib.import_module(f"handtrack.{place}"), there)

    return give


class OldModules:
    """Finds the modules of `MODULES`, where nothing is any more."""

    @staticmethod
    def find_spec(name: str, path: object = None, target: object = None) -> ModuleSpec | None:
        """As `importlib.abc.MetaPathFinder`."""
        package, _, old = name.partition(".")
        if package != "handtrack" or old not in MODULES:
            return None
        holds = any(other.startswith(f"{old}.") for other in MODULES)
        return ModuleSpec(name, OldModules(), is_package=holds)  # type: ignore[arg-type]

    @staticmethod
    def create_module(spec: ModuleSpec) -> None:
        """As `importlib.abc.Loader`: the usual one."""

    @staticmethod
    def exec_module(module: ModuleType) -> None:
        """As `importlib.abc.Loader`."""
        old = module.__name__.partition(".")[2]
        module.__getattr__ = moved(module.__name__, MODULES[old])  # type: ignore[method-assign]


def find_old_modules() -> None:
    """Let `import` find the modules of `MODULES`."""
    if not any(isinstance(finder, type) and finder is OldModules for finder in sys.meta_path):
        sys.meta_path.append(OldModules)
