"""What is written of a clip: its recording, the table of its frames, its exports."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from handtrack.batching.clip import Clip
from handtrack.batching.pool import file_name
from handtrack.batching.settings import BatchSettings
from handtrack.batching.store import Store, StoreError
from handtrack.errors import HandtrackError
from handtrack.exporting.files import export
from handtrack.exporting.table import columns
from handtrack.files.long_arrays import scratch
from handtrack.hand.mano_pose import to_mano
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import ANGLE_NAMES, JOINT_NAMES
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Track


def write_mano(tracks: Sequence[Track], path: Path) -> list[Path]:
    """MANO's 48 values of each frame and the translation, a file for each hand.

    `global_orient` (T, 3), `hand_pose` (T, 45) [rad], `transl` (T, 3) [m], `betas` (S,) where
    the hand is MANO's own, `time_ns`, `frame_index`, `hand`: as smplx takes them with
    flat_hand_mean=True and use_pca=False. NaN where the hand is lost.
    """
    written = []
    for i, track in enumerate(tracks):
        file = path if len(tracks) == 1 else path.with_stem(f"{path.stem}_{i}_{track.hand}")
        rotation = quaternion_to_matrix(track.quaternion)
        pose = to_mano(track.model, track.angles, rotation, track.translation)
        made: dict[str, Any] = {
            "global_orient": pose.global_orient,
            "hand_pose": pose.hand_pose,
            "transl": pose.transl,
            "time_ns": track.time_ns,
            "frame_index": track.frame_index,
            "hand": np.array(track.hand),
        }
        if pose.betas is not None:
            made["betas"] = pose.betas
        with file.open("wb") as stream:
            np.savez_compressed(stream, **made)
        written.append(file)
    return written


RECORDINGS, FRAMES, EXPORTED = "recordings", "frames", "exports"
SETTINGS = "settings.json"
NO_SUBJECT = "__HIVE_DEFAULT_PARTITION__"
"""What readers of partitioned tables take for null."""

FRAME_NUMBERS = (
    *(f"{name}_deg" for name in ANGLE_NAMES),
    *(f"rotation_{c}" for c in "wxyz"),
    *(f"translation_{c}_mm" for c in "xyz"),
    *(f"{name}_{c}_mm" for name in JOINT_NAMES for c in "xyz"),
    *("error_mean_mm", "error_max_mm", "truth_error_mean_mm"),
)
"""Columns of the table of frames that are numbers: as `handtrack export` calls them."""


class Outputs(NamedTuple):
    """The names of a clip's files among the results.

    Attributes:
        recording: of all its hands, or "".
        frames: by hand.
        exports: all of them.
    """

    recording: str
    frames: dict[str, str]
    exports: tuple[str, ...]

    @staticmethod
    def of(
        clip: Clip, tracks: Sequence[Track], settings: BatchSettings, place: str | None
    ) -> Outputs:
        """Write what is wanted of a clip.

        Raises:
            StoreError: it cannot be written.
        """
        if place is None:
            return Outputs("", {}, ())
        store = Store(place)
        recording, exports = "", []
        frames: dict[str, str] = {}
        if settings.recordings:
            recording = f"{RECORDINGS}/{clip.name}.mcap"
            _write(store, recording, lambda file: _record(tracks, file, settings))
        if settings.frames:
            hands: list[str] = sorted({track.hand for track in tracks})
            for hand in hands:
                mine = [track for track in tracks if track.hand == hand]
                subject = file_name(clip.subject) if clip.subject else NO_SUBJECT
                name = f"{FRAMES}/subject={subject}/{file_name(clip.name)}-{hand}.parquet"
                store.write(name, frames_table(clip, mine))
                frames[hand] = name
        for kind in settings.exports:
            exports += _exported(store, clip, tracks, kind)
        return Outputs(recording, frames, tuple(exports))

    def of_hand(self, hand: str) -> dict[str, Any]:
        """The columns of a hand's row."""
        return {
            "recording": self.recording,
            "frames_file": self.frames.get(hand, ""),
            "exports": " ".join(self.exports),
        }


def keep_settings(store: Store, settings: BatchSettings) -> None:
    """Write by which settings a run tracks, and the configuration file that they came from."""
    told: dict[str, Any] = settings.told() | {"pool": settings.pool}
    if settings.config:
        told["config"] = dict(settings.config)
    store.write(SETTINGS, json.dumps(told, indent=2).encode())


def _record(tracks: Sequence[Track], file: Path, settings: BatchSettings) -> None:
    told = {"config": dict(settings.config)} if settings.config else {}
    tracks = [replace(track, settings={**track.settings, **told}) for track in tracks]
    write_mcap(tracks, file, recording=settings.recording)


def _write(store: Store, name: str, write: Callable[[Path], object]) -> None:
    """Have a file written, and have it appear under its name when it is complete."""
    try:
        if store.folder is not None:
            path = store.folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            write(path)
            return
        with scratch() as folder:
            file = folder / Path(name).name
            write(file)
            store.put(file, name)
    except OSError as error:
        raise StoreError(f"{store.shown(name)}: {error.strerror or error}") from error
    except HandtrackError as error:
        if isinstance(error.__cause__, OSError):
            raise StoreError(str(error)) from error
        raise


def _exported(store: Store, clip: Clip, tracks: Sequence[Track], kind: str) -> list[str]:
    with scratch() as folder:
        base = Path(clip.name).name
        if kind == "mano":
            written = write_mano(tracks, folder / f"{base}_mano.npz")
        else:
            written = [done.path for done in export(tracks, folder / f"{base}.{kind}")]
        above = f"{EXPORTED}/{clip.name}".rpartition("/")[0]
        names = []
        for file in written:
            names.append(f"{above}/{file.name}")
            store.put(file, names[-1])
    return names


def frames_table(clip: Clip, tracks: Sequence[Track]) -> bytes:
    """A row for each frame of a clip's hand: angles, root, joints, errors; Parquet.

    The subject is in the folder's name, as partitioned tables have it.
    """
    import pyarrow as pa
    from pyarrow import parquet

    tables = []
    for track in tracks:
        n = len(track)
        found = columns(track, int(track.time_ns[0]))
        made: dict[str, Any] = {
            "clip": pa.array([clip.name] * n, pa.string()),
            "sequence": pa.array([track.name] * n, pa.string()),
            "hand": pa.array([track.hand] * n, pa.string()),
            "frame": pa.array(found["frame"], pa.int64()),
            "time_ns": pa.array(found["time_ns"], pa.int64()),
            "status": pa.array(found["status"].tolist(), pa.string()),
        }
        for name in FRAME_NUMBERS:
            # a clip without a truth has the column too: all files are of one shape
            values = found.get(name, np.full(n, np.nan))
            made[name] = pa.array(values, pa.float64(), mask=~np.isfinite(values))
        tables.append(pa.table(made))
    sink = pa.BufferOutputStream()
    parquet.write_table(pa.concat_tables(tables), sink, compression="zstd")
    return bytes(sink.getvalue())
