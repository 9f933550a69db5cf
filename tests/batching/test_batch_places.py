"""Results on an S3 server of our own, stopped and resumed, and as other programs read them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import handtrack as ht
from handtrack.batching.progress import Progress
from handtrack.batching.source import _as_from
from handtrack.sequences.joint_order import OtherOrder
from handtrack.sequences.readers.raw import NoFramesError
from handtrack.sequences.size import WrongUnit
from tools.make.data_set import Size, write

pytest.importorskip("distributed", reason="Dask is not installed (extra `batch`)")
COPY = Path("/tmp/copy/a.npz")
SIZE = Size(clips=4, frames=20, subjects=2)


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    from handtrack.batching.cluster import engine

    with engine(workers=1, processes=False) as made:
        yield made.client


@pytest.fixture(scope="module")
def manifest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("clips"), SIZE)


@pytest.fixture(scope="module")
def tracked(manifest: Path, client: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("here") / "out"
    ht.batch(manifest, out, client, ht.BatchSettings(frames=True), columns=["action"])
    return out


@pytest.fixture
def bucket(monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """A bucket of a server on loopback."""
    pytest.importorskip("s3fs", reason="s3fs is not installed (extra `batch`)")
    server_of = pytest.importorskip("moto.server", reason="moto is not installed (extra `test`)")
    import fsspec

    server = server_of.ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    _, port = server.get_host_and_port()
    monkeypatch.setenv("AWS_ENDPOINT_URL", f"http://127.0.0.1:{port}")
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "testing")
    monkeypatch.setenv("AWS_DEFAULT_REGION", "us-east-1")
    fs_class = fsspec.get_filesystem_class("s3")
    fs_class.clear_instance_cache()
    fsspec.filesystem("s3").mkdir("bucket")
    yield "s3://bucket"
    fs_class.clear_instance_cache()
    server.stop()


class Stopped(Progress):
    """Ctrl-C after the first clip."""

    def add(self, clips: int, frames: int, failed: int) -> None:
        super().add(clips, frames, failed)
        if frames:
            raise KeyboardInterrupt


def test_in_a_bucket_stopped_and_resumed(tracked, manifest, client, bucket):
    import fsspec
    from pyarrow import parquet

    there = fsspec.filesystem("s3")
    there.put(str(manifest.parent), "bucket/in", recursive=True)
    given = (f"{bucket}/in/manifest.csv", f"{bucket}/out", client, ht.BatchSettings(frames=True))
    with pytest.raises(KeyboardInterrupt):
        ht.batch(*given, columns=["action"], progress=Stopped())
    before = set(there.find("bucket/out/recordings"))
    assert 0 < len(before) < SIZE.clips
    table = ht.batch(*given, columns=["action"])
    numbers = ["clip", "hand", "frames", "pa_mpjpe_mean_mm", "jitter_m_s3", "residual_mm"]
    here = parquet.read_table(tracked / "clips.parquet")
    assert table.select(numbers).equals(here.select(numbers))
    names = [path for path in there.find("bucket/out") if path.endswith(".mcap")]
    assert len(names) == SIZE.clips
    assert not [path for path in there.find("bucket/out") if ".part" in path]
    with there.open(names[0]) as remote:
        local = (tracked / names[0].removeprefix("bucket/out/")).stat().st_size
        assert len(remote.read()) == pytest.approx(local, rel=0.05)


def test_pandas_reads_the_results(tracked):
    pandas = pytest.importorskip("pandas", reason="pandas is not installed")
    assert len(pandas.read_parquet(tracked / "clips.parquet")) == SIZE.clips
    frames = pandas.read_parquet(tracked / "frames")
    assert len(frames) == SIZE.clips * SIZE.frames
    assert set(frames["subject"]) == {"s00", "s01"}


def test_polars_reads_the_results(tracked):
    polars = pytest.importorskip("polars", reason="polars is not installed")
    assert polars.read_parquet(tracked / "clips.parquet").height == SIZE.clips
    where = str(tracked / "frames" / "**" / "*.parquet")
    frames = polars.read_parquet(where, hive_partitioning=True)
    assert frames.height == SIZE.clips * SIZE.frames
    assert set(frames["subject"]) == {"s00", "s01"}


def test_duckdb_reads_the_results(tracked):
    duckdb = pytest.importorskip("duckdb", reason="duckdb is not installed")
    rows = duckdb.sql(
        f"select subject, count(*), avg(error_mean_mm) from '{tracked}/frames/*/*.parquet'"
        " group by subject order by subject"
    ).fetchall()
    assert [row[:2] for row in rows] == [("s00", 2 * SIZE.frames), ("s01", 2 * SIZE.frames)]
    assert all(0 < row[2] < 5 for row in rows)


@pytest.mark.parametrize(
    "error",
    [
        WrongUnit(91.0, "m", COPY),
        OtherOrder("joints in another order", "mano", COPY),
        NoFramesError("no frames", COPY),
    ],
)
def test_errors_of_every_kind_name_the_file_and_not_its_copy(error):
    with pytest.raises(type(error)) as caught, _as_from("s3://bucket/a.npz", COPY):
        raise error
    assert str(caught.value).startswith("s3://bucket/a.npz: ")
    assert str(COPY) not in str(caught.value)
