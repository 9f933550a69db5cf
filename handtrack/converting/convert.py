"""Hands from any format that is read to any that is written, and what that loses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from handtrack.converting import egodex, openxr, tables, umetrack
from handtrack.converting.loss import Loss, glb_joints, loss
from handtrack.converting.source import Source, Subject, anyone
from handtrack.converting.targets import TARGETS, target_of
from handtrack.errors import HandtrackError, SettingsError
from handtrack.exporting.files import export
from handtrack.exporting.motion import up_to_y
from handtrack.files.whole import whole_file
from handtrack.hand.mano_pose import to_mano
from handtrack.hand.rotations import quaternion_to_matrix
from handtrack.hand.skeleton import JOINT_NAMES
from handtrack.mcap.hand import hand_topics
from handtrack.recording.read import read_mcap
from handtrack.recording.write import write_mcap
from handtrack.sequences.load import load
from handtrack.sequences.sequence import Sequence as Joints
from handtrack.tracking.track import Track

Array = NDArray[np.float64]


class Made(NamedTuple):
    """A joint that the source lacks and the fitted hand gave.

    Attributes:
        frames: in how many frames.
        sd_mm: its standard deviation there, the median [mm].
        never: whether the source has it in no frame.
    """

    frames: int
    sd_mm: float
    never: bool


class Converted(NamedTuple):
    """A hand in a file that was written.

    Attributes:
        path: the file.
        to: a name of `TARGETS`.
        hand: the hand in it, as "right" or "person0_left".
        frames: how many frames the source has.
        made: joints that the source lacks and the fitted hand gave, by the format's names.
        loss: what was lost.
        notes: what else a user should know.
    """

    path: Path
    to: str
    hand: str
    frames: int
    made: Mapping[str, Made]
    loss: Loss
    notes: tuple[str, ...]


def convert(
    found: Sequence[Joints | Track],
    path: str | Path,
    to: str | None = None,
    *,
    models: Subject = anyone,
    mano: Path | None = None,
    mano_tips: str = "smplx",
    profile: Path | None = None,
    up: str = "y",
    unit: str = "cm",
    told: Mapping[str, Any] = MappingProxyType({}),
) -> list[Converted]:
    """Write joint sequences or tracks in another format, and read them back to see what is lost.

    Joints stay as they are where the format has places for joints; those that it wants and the
    source lacks come from the hand fitted to the source, with their standard deviation. Formats
    of angles (`mcap`, `mano`, `umetrack`, `bvh`, `glb`) hold the fitted hand. Of several hands
    each gets a file of its own, NAME_right and NAME_left, where a file holds but one.

    Args:
        found: sequences (`load`) or tracks (`read_mcap`) of one source.
        path: the file to write.
        to: a name of `TARGETS`; None: by the path's ending.
        models: which hand to fit.
        mano: your MANO files, for `to="mano"`, of which `models` must make hands too.
        mano_tips: whose vertices of MANO are the fingertips.
        profile: of UmeTrack's hand, for `to="umetrack"`.
        up, unit: as `export` takes them, of .bvh and .glb.
        told: what a recording says of its hands beside their settings.

    Returns:
        What was written, hand by hand.

    Raises:
        SettingsError: there is nothing to convert, or something that the format needs is
            missing.
        HandtrackError: a hand cannot be fitted, or writing failed.
    """
    path = Path(path)
    name = target_of(path, to)
    target = TARGETS[name]
    if name == "umetrack" and profile is None:
        raise SettingsError("UmeTrack's angles belong to a hand's profile: --profile FILE")
    if name == "mano" and mano is None:
        raise SettingsError("MANO's parameters need your MANO files: --mano DIR")
    found = [f for f in found if len(f)]
    if not found:
        raise SettingsError("there is nothing to convert: no hand has a frame")
    names = hand_topics((f.name, f.hand) for f in found)
    sources = [Source.of(f, n, models) for f, n in zip(found, names, strict=True)]
    if name in ("egodex", "openxr", "umetrack") and len({s.hand for s in sources}) < len(sources):
        raise SettingsError(f"{name} holds one left and one right hand: choose with --hand")
    origin = min(int(s.time_ns[0]) for s in sources)
    groups = [(path, sources)]
    if not target.together and len(sources) > 1:
        groups = [(own_file(path, s.name), [s]) for s in sources]
    options = {
        "mano": mano,
        "mano_tips": mano_tips,
        "profile": profile,
        "up": up,
        "unit": unit,
        "told": told,
    }
    made = []
    for file, group in groups:
        notes = _write(name, group, file, origin, options)
        for source in group:
            lost = loss(source, *_back(name, source, file, origin, options))
            filled = _filled(name, source)
            made.append(Converted(file, name, source.name, len(source), filled, lost, notes))
    return made


def files_of(found: Sequence[Joints | Track], path: Path, to: str) -> list[Path]:
    """The files that `convert` writes of hands, when it is given that name."""
    found = [f for f in found if len(f)]
    if TARGETS[to].together or len(found) < 2:
        return [path]
    return [own_file(path, name) for name in hand_topics((f.name, f.hand) for f in found)]


def own_file(path: Path, hand: str) -> Path:
    """The file of one hand of several."""
    return path.with_stem(f"{path.stem}_{hand}")


def _write(
    name: str, group: list[Source], file: Path, origin: int, options: Mapping[str, Any]
) -> tuple[str, ...]:
    """Write hands into a file; what should be known of it."""
    notes: list[str] = []
    if name in ("bvh", "glb"):
        made = export([s.track for s in group], file, up=options["up"], unit=options["unit"])
        return tuple(note for m in made for note in m.notes)
    if name == "mcap":
        tracks = [s.track for s in group]
        told = options["told"]
        write_mcap([replace(t, settings={**t.settings, **told}) for t in tracks], file)
        return ()
    with whole_file(file) as part:
        if name == "openxr":
            openxr.write_openxr(group, part)
        elif name == "umetrack":
            umetrack.write_umetrack(group, part, options["profile"])
        elif name == "egodex":
            notes.append(egodex.write_egodex(group, part, origin))
        else:
            (source,) = group
            if name == "lerobot":
                tables.write_lerobot(source, part, _all_joints(source))
            elif name == "trc":
                tables.write_trc(source, part, file.name)
            elif name == "mano":
                notes += _write_mano(source.track, part)
            else:
                {
                    "npz": tables.write_npz,
                    "csv": tables.write_csv,
                    "parquet": tables.write_parquet,
                }[name](source, part)
    return tuple(note for note in notes if note)


def _all_joints(source: Source) -> Array:
    """A source's joints, with the fitted hand's where some are missing."""
    return source.joints if source.present.all() else source.whole.joints


def _filled(name: str, source: Source) -> dict[str, Made]:
    """Joints that a format has from the fitted hand."""
    if name not in ("openxr", "egodex", "lerobot"):
        return {}
    if name == "lerobot":
        if source.present.all():
            return {}
        names, sd = JOINT_NAMES, source.whole.sd
    else:
        names, sd = openxr.XR_JOINTS, openxr.places(source, source.whole).sd
        if name == "egodex":
            names, sd = egodex.NAMES, sd[:, 1:]
    counts = np.isfinite(sd).sum(0)
    posed = int(np.isfinite(source.whole.palm).all(1).sum())
    return {
        joint: Made(int(counts[j]), 1e3 * float(np.nanmedian(sd[:, j])), bool(counts[j] >= posed))
        for j, joint in enumerate(names)
        if counts[j]
    }


def _write_mano(track: Track, part: Path) -> list[str]:
    """`global_orient`, `hand_pose`, `betas`, `transl`, as smplx takes them."""
    pose = to_mano(
        track.model,
        track.angles_raw,
        quaternion_to_matrix(track.quaternion_raw),
        track.translation_raw,
    )
    seen = np.isfinite(pose.hand_pose).all(1)
    if not seen.any():
        raise HandtrackError(f"{track.name}: no frame has a pose")
    with part.open("wb") as stream:
        np.savez_compressed(
            stream,
            global_orient=pose.global_orient[seen],
            hand_pose=pose.hand_pose[seen],
            betas=pose.betas,
            transl=pose.transl[seen],
            flat_hand_mean=True,
            time_ns=track.time_ns[seen],
            frame_index=track.frame_index[seen],
            hand=track.hand,
            name=track.name,
        )
    gone = int((~seen).sum())
    return [f"{gone} lost frames are left out"] if gone else []


def _back(
    name: str, source: Source, file: Path, origin: int, options: Mapping[str, Any]
) -> tuple[NDArray[np.int64], Array]:
    """Times [ns] and joints of a hand in a file that was written."""
    if name == "mcap":
        (track,) = [t for t in read_mcap(file) if (t.name, t.hand) == (source.title, source.hand)]
        return track.time_ns, track.filtered_joints if source.tracked else track.observed
    if name == "glb":
        seconds, joints = glb_joints(file, source.name)
        return origin + np.round(seconds * 1e9).astype(np.int64), joints @ up_to_y(options["up"])
    given: dict[str, Any] = {}
    if name == "bvh":
        given["unit"] = options["unit"]
    elif name == "mano":
        given = {"mano": options["mano"], "mano_tips": options["mano_tips"]}
    elif name == "umetrack":
        given["profile"] = options["profile"]
    hand = source.hand if TARGETS[name].together or name == "mano" else None
    back = load(file, hand=hand, **given)[0]
    time = back.time_ns
    if not TARGETS[name].absolute:
        start = origin if TARGETS[name].together else source.time_ns[0]
        time = time - time[0] + start
    joints = back.joints @ up_to_y(options["up"]) if name == "bvh" else back.joints
    return time, joints
