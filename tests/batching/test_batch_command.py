"""`handtrack batch` as it is typed: what it would do with folders, archives and manifests."""

from __future__ import annotations

import csv
import json
import tarfile
import zipfile
from pathlib import Path

import pytest

from handtrack.cli import run
from tools.make.data_set import Size, write

pytest.importorskip("pyarrow", reason="pyarrow is not installed")
SIZE = Size(clips=4, frames=12, subjects=2)


@pytest.fixture(scope="module")
def manifest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("clips"), SIZE)


@pytest.fixture
def planned(tmp_path, capsys):
    def of(*given: object) -> dict[str, object]:
        out = tmp_path / "out"
        assert run(["batch", *map(str, given), "-o", str(out), "--dry-run", "--json"]) == 0
        assert not out.exists()
        return json.loads(capsys.readouterr().out)

    return of


def test_a_manifest_with_a_column_of_ones_own(planned, manifest, tmp_path, capsys):
    from pyarrow import csv as csv_file
    from pyarrow import parquet

    said = planned(manifest, "--column", "action")
    assert (said["clips"], said["done"], said["subjects"]) == (SIZE.clips, 0, ["s00", "s01"])
    assert said["bytes"] > 0
    other = manifest.with_suffix(".parquet")
    parquet.write_table(csv_file.read_csv(manifest), other)
    assert planned(other, "--column", "action") == said
    own = ["--column", "action"]
    for more, message in (([], "for a column of your own"), ([*own, "--column", "no"], "'no'")):
        assert run(["batch", str(manifest), "-o", str(tmp_path / "out"), "--dry-run", *more]) == 2
        assert message in capsys.readouterr().err


@pytest.mark.parametrize("kind", ["zip", "tar", "tar.gz"])
def test_clips_in_archives_with_subjects_by_their_paths(planned, manifest, tmp_path, kind):
    with manifest.open(newline="") as lines:
        names = [row["path"] for row in csv.DictReader(lines)]
    packed = tmp_path / f"packed.{kind}"
    if kind == "zip":
        with zipfile.ZipFile(packed, "w") as archive:
            for name in names:
                archive.write(manifest.parent / name, name)
    else:
        with tarfile.open(packed, "w:gz" if kind == "tar.gz" else "w") as archive:
            for name in names:
                archive.add(manifest.parent / name, name)
    said = planned(packed, "--subject", r"(s\d\d)/")
    assert said["clips"] == SIZE.clips
    assert said["subjects"] == ["s00", "s01"]
