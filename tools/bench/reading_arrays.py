"""Made files of arrays and messages, of one moving hand, and how their own libraries read them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import handtrack as ht
from handtrack.hand.skeleton import JOINT_NAMES, ORDERS
from tools.bench.reading_files import RATE, Array, motion
from tools.make import robot_logs
from tools.make.hdf5_files import write_egodex, write_emg2pose

Read = Callable[[Path], object]


class Kind(NamedTuple):
    """A kind of file.

    Attributes:
        file: its name.
        make: makes one of so many MB.
        plain: reads all that is in it with the library of the format.
    """

    file: str
    make: Callable[[Path, float], Path]
    plain: Read


def cycles(mb: float, bytes_of_frame: float) -> Array:
    """(T, 21, 3) joints of so many MB, where a frame takes so many bytes; noise on them, as files
    of repeated frames would be packed away."""
    n = max(int(mb * 1e6 / bytes_of_frame), 300)
    joints = np.resize(motion(), (n, 21, 3))
    return joints + np.random.default_rng(1).normal(0, 1e-4, joints.shape)


# --- arrays


def npz(path: Path, mb: float) -> Path:
    """Ours."""
    np.savez(path, joints_m=cycles(mb, 504), fps=RATE, hand="right")
    return path


def npz_packed(path: Path, mb: float) -> Path:
    """Ours, packed."""
    np.savez_compressed(path, joints_m=cycles(mb, 475), fps=RATE, hand="right")
    return path


def npy(path: Path, mb: float) -> Path:
    """An array alone."""
    np.save(path, cycles(mb, 504))
    return path


def _arrays(path: Path) -> object:
    found = np.load(path)
    return found if isinstance(found, np.ndarray) else {k: found[k] for k in found.files}


def lerobot(path: Path, mb: float) -> Path:
    """A LeRobot column of lists of 63 numbers."""
    import pyarrow as pa
    from pyarrow import parquet

    flat = cycles(mb, 4 * 63 + 4).astype(np.float32)
    lists = pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), 63)
    counted = pa.array(np.arange(len(flat)))
    stamps = pa.array((np.arange(len(flat)) / RATE).astype(np.float32))
    table = {"observation.state": lists, "timestamp": stamps, "frame_index": counted}
    made = pa.table(table).replace_schema_metadata({"hand": "right", "unit": "m"})
    parquet.write_table(made, path, compression="zstd")
    return path


def parquet_columns(path: Path, mb: float) -> Path:
    """A column for each axis of each joint."""
    import pyarrow as pa
    from pyarrow import parquet

    flat = cycles(mb, 600).reshape(-1, 63)
    names = [f"{name}_{axis}" for name in JOINT_NAMES for axis in "xyz"]
    columns = {"time_s": pa.array(np.arange(len(flat)) / RATE)}
    columns |= {name: pa.array(flat[:, i]) for i, name in enumerate(names)}
    parquet.write_table(pa.table(columns), path)
    return path


def _parquet(path: Path) -> object:
    from pyarrow import parquet

    columns = parquet.read_table(path, use_threads=False).columns
    flat = (c.combine_chunks() for c in columns)
    return [np.asarray(c.flatten() if hasattr(c, "flatten") else c) for c in flat]


def hdf5(path: Path, mb: float) -> Path:
    """An HDF5 of one array."""
    import h5py

    with h5py.File(path, "w") as file:
        file.create_dataset("right/joints", data=cycles(mb, 504), chunks=(1024, 21, 3))
        file.attrs["fps"] = RATE
    return path


def egodex(path: Path, mb: float) -> Path:
    """EgoDex: matrices of the joints of both hands and of the body, packed."""
    joints = cycles(mb, 1700)
    return write_egodex(path, {"left": joints * [-1, 1, 1], "right": joints})


def emg2pose(path: Path, mb: float) -> Path:
    """emg2pose: UmeTrack's angles at 2 kHz beside 16 channels of noise."""
    time = np.arange(int(mb * 1e6 / 75))[:, None] / 2000
    noise = np.random.default_rng(2).normal(0, 1e-4, (len(time), 20))
    return write_emg2pose(path, 0.4 + 0.2 * np.sin(time + np.arange(20)) + noise)


def _hdf5(path: Path) -> object:
    import h5py

    found: list[Any] = []
    with h5py.File(path) as file:
        file.visititems(lambda _, o: found.append(o[()]) if isinstance(o, h5py.Dataset) else None)
    return found


def c3d(path: Path, mb: float) -> Path:
    """Markers of the joints' names [mm]."""
    import c3d as package

    writer = package.Writer(point_rate=120, analog_rate=0, point_scale=-1.0)
    writer.set_point_labels([f"R_{name}".ljust(24) for name in JOINT_NAMES])
    for row in 1e3 * cycles(min(mb, 20), 336):  # of 65,535 frames at most
        points = np.zeros((21, 5), np.float32)
        points[:, :3] = row
        writer.add_frames([(points, np.zeros((0, 0), np.float32))])
    with path.open("wb") as file:
        writer.write(file)
    return path


def _c3d(path: Path) -> object:
    import c3d as package

    with path.open("rb") as file:
        return [points for _, points, _ in package.Reader(file).read_frames()]


# --- messages


def own_recording(path: Path, mb: float) -> Path:
    """What `track` writes, without the mesh."""
    joints = cycles(mb, 3000)
    times = np.round(np.arange(len(joints)) * 1e9 / RATE).astype(np.int64)
    sequence = ht.Sequence(times, joints)
    return ht.write_mcap(ht.track(sequence), path, mesh="none")


def _log(bytes_of_frame: float, topics: Callable[[Array], robot_logs.Topics]) -> Any:
    def make(path: Path, mb: float) -> Path:
        joints = cycles(mb, bytes_of_frame)
        return robot_logs.write_log(path, topics(joints), len(joints))

    return make


def _openxr(joints: Array) -> Array:
    out = np.repeat(joints[:, :1] + [0.01, 0.0, 0.0], 26, axis=1)
    out[:, list(ORDERS["openxr"])] = joints
    return out


def _pose_arrays(joints: Array) -> robot_logs.Topics:
    kind = ("geometry_msgs/msg/PoseArray", "ros2msg", "cdr", b"")
    return {"/right_hand": (*kind, lambda time, i: robot_logs.pose_array(time, joints[i]))}


def _markers(joints: Array) -> robot_logs.Topics:
    kind = ("visualization_msgs/msg/MarkerArray", "ros2msg", "cdr", robot_logs.HUMBLE)

    def message(time: int, i: int) -> bytes:
        return robot_logs.marker_array(time, [("right_hand", j, joints[i, j]) for j in range(21)])

    return {"/markers": (*kind, message)}


def _frames(joints: Array) -> Iterator[list[tuple[str, str, Any, Any]]]:
    names = [f"right_{name}" for name in JOINT_NAMES]
    for row in joints:
        yield [("world", name, p, (0, 0, 0, 1)) for name, p in zip(names, row, strict=True)]


def _tf(joints: Array) -> robot_logs.Topics:
    frames = _frames(joints)
    kind = ("tf2_msgs/msg/TFMessage", "ros2msg", "cdr", b"")
    return {"/tf": (*kind, lambda time, i: robot_logs.tf_message(time, next(frames)))}


def _foxglove(joints: Array) -> robot_logs.Topics:
    frames, schema = _frames(joints), "foxglove.FrameTransforms"
    kind = (schema, "protobuf", "protobuf", robot_logs.protobuf(schema))
    return {"/tf": (*kind, lambda time, i: robot_logs.foxglove_frames(time, next(frames)))}


def _foxglove_json(joints: Array) -> robot_logs.Topics:
    kind = ("foxglove.PosesInFrame", "jsonschema", "json", b"{}")
    return {"/right": (*kind, lambda time, i: robot_logs.foxglove_poses_json(time, joints[i]))}


def _isaac(joints: Array) -> robot_logs.Topics:
    places = _openxr(joints).astype(np.float32)
    kind = ("core.HandPoseRecord", "flatbuffer", "flatbuffer", b"bfbs")
    message = lambda time, i: robot_logs.isaac_record(time, places[i])  # noqa: E731
    return {"hands/right_hand": (*kind, message)}


def _mcap(path: Path) -> object:
    from mcap.reader import make_reader

    with path.open("rb") as file:
        return sum(len(m.data) for _, _, m in make_reader(file).iter_messages(log_time_order=False))


ARRAYS: dict[str, Kind] = {
    ".npz": Kind("a.npz", npz, _arrays),
    ".npz, packed": Kind("packed.npz", npz_packed, _arrays),
    ".npy": Kind("a.npy", npy, _arrays),
    "Parquet, LeRobot's lists": Kind("lerobot.parquet", lerobot, _parquet),
    "Parquet, a column for each number": Kind("columns.parquet", parquet_columns, _parquet),
    "HDF5": Kind("a.hdf5", hdf5, _hdf5),
    "EgoDex": Kind("egodex.hdf5", egodex, _hdf5),
    "emg2pose": Kind("emg2pose.hdf5", emg2pose, _hdf5),
    ".c3d": Kind("a.c3d", c3d, _c3d),
    "MCAP, handtrack's own": Kind("own.mcap", own_recording, _mcap),
    "MCAP, IsaacTeleop": Kind("isaac.mcap", _log(285, _isaac), _mcap),
    "MCAP, ROS 2, PoseArray": Kind("poses.mcap", _log(500, _pose_arrays), _mcap),
    "MCAP, ROS 2, MarkerArray": Kind("markers.mcap", _log(540, _markers), _mcap),
    "MCAP, ROS 2, TF": Kind("tf.mcap", _log(530, _tf), _mcap),
    "MCAP, Foxglove, Protobuf": Kind("foxglove.mcap", _log(575, _foxglove), _mcap),
    "MCAP, Foxglove, JSON": Kind("json.mcap", _log(690, _foxglove_json), _mcap),
}
"""Name, and what each is."""
