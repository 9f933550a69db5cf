"""The compiled schemas are those of the .proto files, and Foxglove's numbers are right."""

from __future__ import annotations

import subprocess
import sys
from importlib.resources import files
from pathlib import Path

import pytest
from google.protobuf.descriptor_pb2 import FileDescriptorSet

from handtrack.mcap.schema import array_class, descriptor_set, message_class

# from the schemas that Foxglove publishes (foxglove-schemas-protobuf 0.4)
FOXGLOVE = {
    "Vector3": {"x": 1, "y": 2, "z": 3},
    "Quaternion": {"x": 1, "y": 2, "z": 3, "w": 4},
    "Pose": {"position": 1, "orientation": 2},
    "PackedElementField": {"name": 1, "offset": 2, "type": 3},
    "PointCloud": {
        "timestamp": 1,
        "frame_id": 2,
        "pose": 3,
        "point_stride": 4,
        "fields": 5,
        "data": 6,
    },
    "FrameTransform": {
        "timestamp": 1,
        "parent_frame_id": 2,
        "child_frame_id": 3,
        "translation": 4,
        "rotation": 5,
    },
    "FrameTransforms": {"transforms": 1},
    "SceneEntityDeletion": {"timestamp": 1, "type": 2, "id": 3},
    "SceneEntity": {
        "timestamp": 1,
        "frame_id": 2,
        "id": 3,
        "frame_locked": 5,
        "triangles": 12,
    },
    "TriangleListPrimitive": {"pose": 1, "points": 2, "color": 3, "colors": 4, "indices": 5},
    "SceneUpdate": {"deletions": 1, "entities": 2},
    "Log": {"timestamp": 1, "level": 2, "message": 3, "name": 4, "file": 5, "line": 6},
}


def test_compiled_schemas_are_up_to_date(tmp_path: Path) -> None:
    pytest.importorskip("grpc_tools", reason="grpcio-tools compiles .proto files")
    folder = Path(str(files("handtrack.mcap")))
    out = tmp_path / "schemas.binpb"
    command = [sys.executable, "-m", "grpc_tools.protoc", f"-I{folder}", "--include_imports"]
    command += [f"--descriptor_set_out={out}", "handtrack.proto", "foxglove.proto"]
    subprocess.run(command, check=True)
    fresh = FileDescriptorSet.FromString(out.read_bytes())
    shipped = FileDescriptorSet.FromString((folder / "schemas.binpb").read_bytes())
    assert shipped == fresh


@pytest.mark.parametrize("name", FOXGLOVE)
def test_foxglove_field_numbers(name: str) -> None:
    fields = message_class(f"foxglove.{name}").DESCRIPTOR.fields
    assert {f.name: f.number for f in fields} == FOXGLOVE[name]


def test_foxglove_schemas_equal_the_published_package() -> None:
    published = pytest.importorskip("foxglove_schemas_protobuf")
    import importlib

    for name in FOXGLOVE:
        module = importlib.import_module(f"{published.__name__}.{name}_pb2")
        theirs = module.DESCRIPTOR.message_types_by_name[name].fields
        ours = message_class(f"foxglove.{name}").DESCRIPTOR.fields
        assert [(f.number, f.name, f.type) for f in ours] == [
            (f.number, f.name, f.type) for f in theirs
        ]


@pytest.mark.parametrize("name", ["handtrack.State", "foxglove.PointCloud"])
def test_a_schema_record_holds_all_it_refers_to(name: str) -> None:
    known: set[str] = set()
    for file in FileDescriptorSet.FromString(descriptor_set(name)).file:
        assert set(file.dependency) <= known
        known.add(file.name)


def test_arrays_are_the_same_on_the_wire() -> None:
    import struct

    message = message_class("handtrack.State")(observed=[1.5, float("nan")], status="lost")
    raw = array_class("handtrack.State").FromString(message.SerializeToString())
    assert raw.observed == struct.pack("<2d", 1.5, float("nan"))
    assert raw.status == "lost"
