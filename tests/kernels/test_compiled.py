"""Machine code: where it is kept, that versions do not mix, and that it needs no folder."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from numba import njit

import handtrack.kernels.compiled as compiled
import handtrack.kernels.li2021 as li2021
import handtrack.kernels.newton as newton
import handtrack.kernels.vectors as vectors
from handtrack.kernels.workspace import WORK


def fresh():
    """A function that is not yet a solver."""

    def double(w):
        """Twice the objective."""
        w.objective *= 2.0

    return double


@njit
def run(address, works):
    compiled.call(address, works[0])


@pytest.mark.parametrize("folder", [True, False])
def test_a_solver_runs_with_and_without_a_folder_for_its_code(folder, monkeypatch, tmp_path):
    if not folder:

        def refuse(function):
            raise RuntimeError("cannot cache function: no locator available")

        monkeypatch.setattr(compiled, "_Store", refuse)
    solver = compiled.Solver(fresh())
    assert solver.__doc__ == fresh().__doc__
    assert not (folder and solver.ready)
    works = np.zeros(1, WORK)
    works["objective"] = 21.0
    run(compiled.addresses(solver)[0], works)
    assert works["objective"] == 42.0
    assert solver.ready


def test_names_follow_all_sources_that_code_is_made_of(monkeypatch):
    def name():
        function = fresh()
        function.__module__ = newton.__name__
        compiled._source.cache_clear()
        return compiled._versioned(function).__qualname__

    before, real = name(), compiled.inspect.getsource
    assert name() == before
    changed = vectors  # newton calls it

    def source(module):
        return real(module) + ("# other\n" if module is changed else "")

    monkeypatch.setattr(compiled.inspect, "getsource", source)
    assert name() != before
    changed = li2021  # newton does not
    assert name() == before
    compiled._source.cache_clear()


def test_kept_code_runs_without_all_that_compiling_needs():
    """Loading numba's compiler took longer than a clip; what is compiled later still compiles."""
    later = "numba.njit(lambda a: np.sum(np.dot(a, a)))(np.ones((2, 2)))"
    lines = [
        "import sys, numba, numpy as np",
        "from handtrack.kernels.limits import clamp_all",
        "clamp_all(-np.ones(20), np.ones(20), np.zeros((1, 20)))",
        "print('numba.np.arraymath' in sys.modules, 'scipy.linalg' in sys.modules)",
        f"print({later})",
    ]
    code = "\n".join(lines)
    for _ in range(2):  # the first one may compile
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n")[:2] == ["False False", "8.0"]
