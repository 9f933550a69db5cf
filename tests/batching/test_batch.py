"""A data set from its manifest to its table: what is done, what is not done twice."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import handtrack as ht
from handtrack.errors import InputError, SettingsError
from tools.make.data_set import Size, subject_hands, write

pytest.importorskip("distributed", reason="Dask is not installed (extra `batch`)")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")
SIZE = Size(clips=8, frames=40, subjects=2)


@pytest.fixture(scope="module")
def data_set(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight short clips of two subjects, in two formats."""
    return write(tmp_path_factory.mktemp("data set"), SIZE)


@pytest.fixture(scope="module")
def client() -> Iterator[Any]:
    """A worker that is a thread of this process: quick to start, the same functions.

    None of its threads is left to the tests of other files.
    """
    from handtrack.batching.cluster import engine

    before = set(threading.enumerate())
    with engine(workers=1, processes=False) as made:
        assert "Profile" not in {thread.name for thread in threading.enumerate()}
        yield made.client
    left = _threads_since(before)
    assert not left, f"threads of the cluster are left: {left}"


def _threads_since(before: set[threading.Thread]) -> list[str]:
    """Names of the threads that do not end; Dask keeps idle pools for pickling and callbacks."""
    idle = ("Dask-Offload", "Dask-Callback-Thread")
    since = [t for t in set(threading.enumerate()) - before if not t.name.startswith(idle)]
    for thread in since:
        thread.join(timeout=10)
    return [thread.name for thread in since if thread.is_alive()]


@pytest.fixture(scope="module")
def tracked(data_set: Path, client: Any, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Results of the whole data set."""
    out = tmp_path_factory.mktemp("results") / "out"
    ht.batch(data_set, out, client, columns=["action"])
    return out


def table(out: Path) -> Any:
    from pyarrow import parquet

    return parquet.read_table(out / "clips.parquet")


def test_a_row_and_a_recording_for_each_clip(tracked):
    rows = table(tracked).to_pylist()
    assert [row["clip"] for row in rows] == sorted(row["clip"] for row in rows)
    assert len(rows) == SIZE.clips
    assert {row["state"] for row in rows} == {"done"}
    assert {row["hand_from"] for row in rows} == {"pooled"}
    assert {row["against"] for row in rows} == {"truth"}
    assert {row["action"] for row in rows} == {"count", "pinch"}
    for row in rows:
        (again,) = ht.read_mcap(tracked / row["recording"])
        assert len(again) == row["frames"] == SIZE.frames
        assert again.hand == row["hand"]
        assert 0 < row["pa_mpjpe_mean_mm"] < 5


def test_the_pooled_hand_is_nearer_to_the_subjects_than_the_default(tracked):
    for subject in range(SIZE.subjects):
        true = subject_hands(SIZE, subject)
        for side in ("left", "right"):
            found = ht.load_hand(tracked / "hands" / f"s{subject:02d}" / side / "hand.json")
            lengths = [
                np.linalg.norm(np.diff(hand.rest_joints[1:].reshape(5, 4, 3), axis=1), axis=-1)
                for hand in (found, ht.HandModel.default(side), true[side])
            ]
            off = [np.abs(mine - lengths[2]).mean() for mine in lengths[:2]]
            assert off[0] < 0.8 * off[1]


def test_what_is_done_is_not_done_again(tracked, data_set, client):
    before = table(tracked)
    ht.batch(data_set, tracked, client, columns=["action"])
    assert table(tracked).equals(before)


def test_other_settings_and_other_content_are_tracked_again(data_set, client, tmp_path):
    out, clip = tmp_path / "out", next(data_set.parent.glob("s00/*.npz"))
    first = ht.batch([str(clip)], out, client)
    other = ht.batch([str(clip)], out, client, {"filter": "kalman"})
    assert first["settings_digest"] != other["settings_digest"]
    assert other["jitter_m_s3"][0].as_py() < first["jitter_m_s3"][0].as_py()
    os.utime(clip, ns=(10**18, 10**18))  # another time alone is no other content
    same = ht.batch([str(clip)], out, client, {"filter": "kalman"})
    assert same["finished"] == other["finished"]
    assert same["input_stamp"] != other["input_stamp"]


def test_a_clip_that_fails_is_a_row(data_set, client, tmp_path):
    bad = tmp_path / "bad.npz"
    bad.write_bytes(b"PK\x03\x04 but no more of it")
    good = next(data_set.parent.glob("s01/*.npz"))
    rows = ht.batch([str(bad), str(good)], tmp_path / "out", client).to_pylist()
    assert [row["state"] for row in rows] == ["failed", "done"]
    assert "bad.npz" in rows[0]["error"]


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([{"file": "a"}], "no column `path`"),
        ([{"path": "a", "subjct": "x"}], "is it subject"),
        ([{"path": "nothing.npz"}], "no such file: row 1: nothing.npz"),
        ([{"path": "a", "hand": "third"}], "row 1: hand is 'third'"),
        ([{"path": "a", "fps": "many"}], "row 1: fps is many"),
        ([{"path": "a", "start": 3, "end": 2}], "row 1: end is 2, start 3"),
        ([{"path": "a", "hand": "left"}, {"path": "a"}], "mixed hands of one subject"),
        ([{"path": "a", "subject": "x"}, {"path": "a", "subject": "y"}], "is of x and of y"),
        ([{"path": "a", "name": "../b"}], "name is ../b, expected one inside"),
    ],
)
def test_a_manifest_that_is_wrong_is_refused(rows, message, tmp_path):
    with pytest.raises(InputError, match=message):
        ht.batch(rows, tmp_path / "out")


def test_two_clips_of_one_name_are_refused(tmp_path):
    for name in ("a.npz", "a.csv"):
        (tmp_path / name).write_bytes(b"joints")
    with pytest.raises(InputError, match="would both be named a"):
        ht.batch(tmp_path, tmp_path / "out")


def test_a_second_run_says_so_and_stops(data_set, client, tmp_path):
    from handtrack.batching.lock import only_run
    from handtrack.batching.store import Store

    store = Store(tmp_path)
    with only_run(store), pytest.raises(SettingsError, match="is writing here"):
        ht.batch(data_set, tmp_path, client, columns=["action"])


def test_a_scheduler_that_is_not_there_is_told(data_set, tmp_path, monkeypatch):
    from handtrack.batching import cluster

    monkeypatch.setattr(cluster, "CONNECT_S", 1)
    with pytest.raises(SettingsError, match="no scheduler answers there"):
        ht.batch(data_set, tmp_path, scheduler="tcp://127.0.0.1:9", columns=["action"])


def test_a_worker_with_another_version_is_refused():
    from handtrack.batching.engine import Engine

    class Client:
        def run(self, function: Any, on_error: str) -> dict[str, Any]:
            return {"tcp://host:1": ("0.0.9", "3.12")}

    with pytest.raises(SettingsError, match=r"tcp://host:1 has handtrack 0\.0\.9 on Python 3\.12"):
        Engine(Client()).check()


def test_the_same_in_a_store_as_in_a_folder(tracked, data_set, client):
    fsspec = pytest.importorskip("fsspec")
    there = fsspec.filesystem("memory")
    there.put(str(data_set.parent), "/in", recursive=True)
    table_of = ht.batch("memory://in/manifest.csv", "memory://out", client, columns=["action"])
    numbers = ["clip", "hand", "frames", "pa_mpjpe_mean_mm", "jitter_m_s3", "residual_mm"]
    assert table_of.select(numbers).equals(table(tracked).select(numbers))
    assert len(there.find("/out/recordings")) == SIZE.clips
    again = ht.batch("memory://in/manifest.csv", "memory://out", client, columns=["action"])
    assert again["finished"] == table_of["finished"]


def test_folders_globs_archives_and_subjects_by_their_paths(data_set):
    import zipfile

    from handtrack.batching.run import clips_from

    root = data_set.parent
    found = clips_from([str(root / "s00"), str(root / "s01")], subject=r"/(s\d\d)/")
    assert {clip.subject for clip in found} == {"s00", "s01"}
    assert len(found) == SIZE.clips
    some = clips_from(str(root / "s0*" / "*.npz"))
    assert {clip.name for clip in some} >= {"s00/clip00000", "s01/clip00001"}
    packed = root.parent / "packed.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        for clip in some:
            archive.write(clip.path, f"{clip.name}.npz")
    inside = clips_from(str(packed))
    assert {clip.name for clip in inside} == {clip.name for clip in some}
    from handtrack.batching.source import read_clip

    (one,), (other,) = (read_clip(c, {}).sequences for c in (inside[0], some[0]))
    np.testing.assert_array_equal(one.joints, other.joints)
    with pytest.raises(SettingsError, match="is found in no path"):
        clips_from(str(root / "s00"), subject="person(.)")


def test_a_clip_in_anybodys_program(data_set):
    import pickle

    from handtrack.batching.run import clips_from

    clip = pickle.loads(pickle.dumps(clips_from(data_set, columns=["action"])[0]))
    settings = pickle.loads(pickle.dumps(ht.BatchSettings(recordings=False)))
    (row,) = ht.track_clip(clip, settings)
    assert row["hand_from"] == "own"
    assert row["frames"] == SIZE.frames


def test_frames_and_exports_are_written(data_set, client, tmp_path):
    from pyarrow import dataset

    clip = next(data_set.parent.glob("s00/*.npz"))
    rows = [{"path": str(clip), "subject": "a/b", "start": 0.3, "end": 0.8}]
    settings = ht.BatchSettings(frames=True, exports=("csv", "mano"), recordings=False)
    (row,) = ht.batch(rows, tmp_path, client, settings).to_pylist()
    frames = dataset.dataset(tmp_path / "frames", partitioning="hive").to_table()
    assert frames.num_rows == row["frames"] == 16
    assert {"index_mcp_flexion_deg", "wrist_x_mm", "subject"} <= set(frames.column_names)
    assert all((tmp_path / name).is_file() for name in row["exports"].split())
    assert len(row["exports"].split()) == 2
    assert not (tmp_path / "recordings").exists()


def test_the_cluster_object_of_slurm():
    jobqueue = pytest.importorskip("dask_jobqueue", reason="dask-jobqueue is not installed")
    import dask

    with dask.config.set({"distributed.worker.profile.enabled": False}):
        cluster = jobqueue.SLURMCluster(
            cores=1,
            processes=1,
            memory="2GB",
            walltime="08:00:00",
            n_workers=0,
            scheduler_options={"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"},
        )
    try:
        assert "#SBATCH --cpus-per-task=1" in cluster.job_script()
        assert "distributed.cli.dask_worker" in cluster.job_script() or "dask worker" in (
            cluster.job_script()
        )
    finally:
        cluster.close()
