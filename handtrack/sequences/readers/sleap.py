"""Reader of SLEAP's analysis files: HDF5 with `tracks` and `node_names`.

Tracks are (tracks, 2 or 3, nodes, frames), as SLEAP exports them for MATLAB, or (frames, tracks,
nodes, 2 or 3), as sleap-io may; SLEAP's triangulated points are as the latter, without names.
Where nothing was seen there is NaN. Layout: SLEAP's and sleap-io's documentation.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import InputError
from handtrack.hand.skeleton import N_JOINTS
from handtrack.sequences.names import as_side
from handtrack.sequences.readers.catalogue import Format
from handtrack.sequences.readers.hdf5_arrays import texts
from handtrack.sequences.readers.hdf5_file import dataset, numbers
from handtrack.sequences.readers.markers import Markers, told_apart
from handtrack.sequences.readers.pictures import flat
from handtrack.sequences.readers.raw import Array, Raw, stem


def read(file: Any, path: Path) -> list[Raw] | None:
    """The hands of an open HDF5 file's tracks; None where it has none.

    Raises:
        InputError: tracks of another shape than their nodes say.
    """
    data = dataset(file, "tracks", path) if "tracks" in file else None
    if data is None or data.ndim != 4 or data.dtype.kind != "f":
        return None
    nodes = _names(file, "node_names", path)
    places = _frames_first(numbers(data, "tracks", path), len(nodes) or N_JOINTS)
    if places is None:
        there = f"{len(nodes)} nodes" if nodes else f"{N_JOINTS} joints"
        raise InputError(
            f"tracks has shape {data.shape}, expected (tracks, 2 or 3, nodes, frames) or (frames,"
            f" tracks, nodes, 2 or 3) of {there}",
            path,
        )
    names = _names(file, "track_names", path)
    raws = []
    for i in range(places.shape[1]):
        name = names[i] if i < len(names) else f"track {i}"
        raw = _of_track(places[:, i], nodes, path)
        side = as_side(name)
        several = places.shape[1] > 1
        raws.append(
            replace(
                raw,
                hand=side,
                name=f"{raw.name} {name}" if several and side is None else raw.name,
                by_number=several and side is None,
            )
        )
    return raws


def _of_track(places: Array, nodes: list[str], path: Path) -> Raw:
    """One track's (T, N, 2 or 3) places."""
    deep = np.zeros((*places.shape[:2], 3))
    deep[..., : places.shape[2]] = places
    raw = Raw(deep, path, stem(path))
    if nodes:
        raw.pending = Markers(tuple(told_apart(nodes)))
    return flat(raw) if places.shape[2] == 2 else raw


def _frames_first(tracks: Array, nodes: int) -> Array | None:
    """(frames, tracks, nodes, axes) from either order of axes; None of any other."""
    if tracks.shape[2] != nodes:
        return None
    if tracks.shape[1] in (2, 3) and tracks.shape[3] not in (2, 3):
        return tracks.transpose(3, 0, 2, 1)
    return tracks if tracks.shape[3] in (2, 3) else None


def _names(file: Any, name: str, path: Path) -> list[str]:
    data = dataset(file, name, path) if name in file else None
    found = None if data is None or data.ndim != 1 else texts(data, name, path)
    return [] if found is None else [str(text) for text in found]


FORMATS = (
    Format(
        "SLEAP",
        "analysis HDF5: `tracks`, `node_names`; triangulated `points3d.h5`",
        "by name of nodes",
        "m",
        "by name of tracks",
        "file magic, `tracks`",
        "`--markers FILE` for other names; extra `formats`; in pictures `--camera LENS`",
        hdf5=read,
    ),
)
