"""A scheduler that is there already, reached by its address."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import handtrack as ht
from handtrack.batching.rows import RESULTS
from handtrack.cli import run
from tools.make.data_set import Size, write

distributed = pytest.importorskip("distributed", reason="Dask is not installed (extra `batch`)")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    """Of a scheduler with a worker, that listen on loopback."""
    import dask

    with (
        dask.config.set({"distributed.worker.profile.enabled": False}),
        distributed.LocalCluster(
            n_workers=1,
            threads_per_worker=1,
            processes=False,
            protocol="tcp",
            host="127.0.0.1",
            dashboard_address=None,
        ) as cluster,
    ):
        assert cluster.scheduler_address.startswith("tcp://127.0.0.1:")
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def manifest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("clips"), Size(clips=4, frames=20, subjects=2))


def test_it_does_the_same_to_the_bit_as_a_cluster_of_our_own(manifest, address, tmp_path):
    from handtrack.batching.cluster import engine

    there = ht.batch(manifest, tmp_path / "there", scheduler=address, columns=["action"])
    with engine(workers=1, processes=False) as made:
        here = ht.batch(manifest, tmp_path / "here", made.client, columns=["action"])
    assert set(there["state"].to_pylist()) == {"done"}
    assert there.select(list(RESULTS)).equals(here.select(list(RESULTS)))


def test_a_worker_of_another_version_is_one_line_and_status_2(
    manifest, address, tmp_path, monkeypatch, capsys
):
    from handtrack.batching import engine

    def versions() -> tuple[str, str]:
        mine = threading.current_thread() is threading.main_thread()
        return (ht.__version__ if mine else "0.0.1", "3.11")

    monkeypatch.setattr(engine, "versions", versions)
    given: list[Any] = ["batch", str(manifest), "--column", "action", "-o", str(tmp_path / "out")]
    assert run([*given, "--scheduler", address]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert "has handtrack 0.0.1 on Python 3.11, this is" in said[-1]
    assert len([line for line in said if line.startswith("error")]) == 1
