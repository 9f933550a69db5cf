"""Inputs and recordings of the command line's tests."""

from __future__ import annotations

import sys
import tarfile
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from handtrack.cli import run
from tools.make import panoptic as make_panoptic

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests" / "hand")]


@pytest.fixture(scope="session")
def made(tmp_path_factory, sample_file) -> SimpleNamespace:
    """Inputs and recordings that many tests read."""
    folder = tmp_path_factory.mktemp("made")
    with np.load(sample_file) as file:
        content = dict(file)
    short = folder / "short.npz"
    part = {k: v[:40] if np.ndim(v) and len(v) == 300 else v for k, v in content.items()}
    np.savez(short, **part)
    truth, joints = make_panoptic.make(frames=12, noise_mm=2.0, people=2)
    make_panoptic.write(folder / "171204_pose6", joints)
    make_panoptic.write_truth(folder / "truth", truth)
    with tarfile.open(folder / "171204_pose6.tar.gz", "w:gz") as archive:
        archive.add(folder / "171204_pose6", "171204_pose6")
    recording = folder / "short.mcap"
    assert run(["track", str(short), "-o", str(recording), "-q"]) == 0
    return SimpleNamespace(
        folder=folder,
        content=part,
        short=str(short),
        recording=str(recording),
        panoptic=str(folder / "171204_pose6"),
        archive=str(folder / "171204_pose6.tar.gz"),
        truth=str(folder / "truth"),
    )


@pytest.fixture
def elsewhere(tmp_path, monkeypatch) -> Path:
    """The test starts in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def call(capsys):
    """call(...) -> (exit status, stdout, stderr)"""

    def made(*arguments: object) -> tuple[int, str, str]:
        capsys.readouterr()
        status = run([str(a) for a in arguments])
        return status, *capsys.readouterr()

    return made
