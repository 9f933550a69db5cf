"""What tests of several packages share."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import blas  # noqa: F401, first: before NumPy
import pytest
from made_tracks import make_track
from screens import Screen, lacking, own_reason, started

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track

ROOT = Path(__file__).resolve().parent.parent
# the tools are no part of the package; the package itself is the installed one, where there is one
sys.path.append(str(ROOT))
SHARED = ROOT.parent / "shared" / "data"


def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """How many processes run the tests: where some are named, a start costs more than it saves."""
    named = config.args_source is not pytest.Config.ArgsSource.TESTPATHS
    return 0 if named else min(os.cpu_count() or 1, 8)


_TRACK = """
import sys, handtrack as ht
(sample,) = ht.load(sys.argv[1])
for settings in {settings}:
    ht.track(sample, **settings)
"""
# what most tests need, in rounds: of each the programs run at the same time
_COMPILED = (
    ([{"filter": "none"}],),
    tuple(
        [{"filter": name, "noise_colour": colour} for name in ("kalman", "rts", "fixed-lag")]
        for colour in ("white", 0.2)
    ),
)


def pytest_configure(config: pytest.Config) -> None:
    """Compile once, on all cores, before several processes would do the same at the same time."""
    several = getattr(config.option, "tx", None) and not hasattr(config, "workerinput")
    if several and config.option.dist != "no":
        config.option.loadscopereorder = False  # files as they stand: see `_LONG`
        sample = str(ROOT / "recordings" / "sample.npz")
        for programs in _COMPILED:
            running = [
                subprocess.Popen(
                    [sys.executable, "-c", _TRACK.format(settings=settings), sample],
                    stderr=subprocess.DEVNULL,
                )
                for settings in programs
            ]
            # what fails here fails in the tests, and is told there
            for process in running:
                process.wait()


# those that take longest: begun last, one of them would keep a process alone with it
_LONG = (
    "tools/docs/test_documents.py",
    "tracking/test_drift.py",
    "test_pipeline.py",
    "brought/test_table.py",
    "brought/test_shared_cases.py",
    "batching/test_batch.py",
    "auditing/test_audit.py",
    "cli/test_cli_track.py",
    "cli/test_cli_recordings.py",
    "calibration/test_bundle.py",
    "tools/paper/test_paper_tables.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Long files first."""
    place = {ROOT / "tests" / name: i for i, name in enumerate(_LONG)}
    items.sort(key=lambda item: place.get(item.path, len(place)))


@pytest.fixture(scope="session")
def sample_file() -> Path:
    """The recording that ships with the project."""
    return ROOT / "recordings" / "sample.npz"


@pytest.fixture(scope="session")
def sample(sample_file: Path) -> ht.Sequence:
    """Its sequence: 300 frames with truth, 2 mm noise, some joints missing, a 10-frame gap."""
    (sequence,) = ht.load(sample_file)
    return sequence


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The real recordings, which are not part of the project."""
    if not SHARED.is_dir():
        pytest.skip(f"real data not there: {SHARED}")
    return SHARED


@pytest.fixture(scope="session")
def screen(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Screen]:
    """A viewer that draws, one for the session; tests are skipped where it cannot, as it says."""
    said = tmp_path_factory.mktemp("viewer") / "said.txt"
    with ExitStack() as stack:
        try:
            found = stack.enter_context(started(said))
        except (HandtrackError, RuntimeError, OSError) as error:
            lacking("viewer", own_reason(said) or str(error))
        yield found


@pytest.fixture
def track() -> Track:
    return make_track()


@pytest.fixture
def two_hands() -> list[Track]:
    return [
        make_track(40, "right", offset=(0.0, 0.15, 0.0)),
        make_track(50, "left", seed=1, offset=(0.0, -0.15, 0.0), truth=False),
    ]


@pytest.fixture
def recording(track: Track, tmp_path: Path) -> Path:
    return write_mcap(track, tmp_path / "run.mcap")
