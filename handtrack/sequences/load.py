"""load: joint sequences from a file or a folder, whatever format they are in."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from os import PathLike, sep
from pathlib import Path
from typing import Any, NamedTuple

from handtrack.errors import InputError, SettingsError
from handtrack.files import budget
from handtrack.sequences.assemble import (
    Given,
    anything_seen,
    assemble,
    check_settings,
    unit_of,
    without_marks,
)
from handtrack.sequences.clips import clips_of
from handtrack.sequences.hands import CHOICES, HandChoice, label_hands
from handtrack.sequences.note import Note
from handtrack.sequences.places import put_in_place
from handtrack.sequences.readers import packed
from handtrack.sequences.readers.chosen import read_chosen
from handtrack.sequences.readers.companions import Companions, Pending, check_taken, resolved
from handtrack.sequences.readers.folder import Source, is_ignored, sources
from handtrack.sequences.readers.mano_params import decoded
from handtrack.sequences.readers.raw import NoFramesError, NotJointsError, Raw
from handtrack.sequences.readers.recognise import check_format, read_file
from handtrack.sequences.sequence import Sequence, unique_names
from handtrack.sequences.size import check_sizes
from handtrack.sequences.world_check import about_the_wrist, world_doubts


def load(
    path: str | PathLike[str],
    hand: str | None = None,
    unit: str | None = None,
    order: str | None = None,
    fps: float | None = None,
    frames: tuple[int, int] | None = None,
    format: str | None = None,
    mano: str | PathLike[str] | None = None,
    mano_tips: str = "smplx",
    time_unit: str | None = None,
    mirror: str | None = None,
    max_size: str | int | None = None,
    profile: str | PathLike[str] | None = None,
    trajectory: str | PathLike[str] | None = None,
    markers: str | PathLike[str] | None = None,
    *,
    key: str | None = None,
    columns: str | None = None,
    image_size: tuple[int, int] | None = None,
    passed_over: list[PassedOver] | None = None,
) -> list[Sequence]:
    """Joint sequences from a file or a folder; the format is recognised by content.

    Understood are CMU Panoptic hands (`hdHand3d/handRecon3D_hd*.json`: a file, a folder, a
    .tar or .tar.gz), .npz, .npy, .csv, .json and .jsonl with joints, FreiHAND, InterHand2.6M,
    AssemblyHands, folders of DexYCB labels, of HO-3D's and of FrankMocap's pickles (in which
    nothing is run), MANO parameters (with your MANO), WebXR and OpenXR streams, FPHA
    `skeleton.txt`, Leap Motion recordings, MCAP files with JSON joints, and handtrack's own MCAP
    recordings; and videos, images and folders of images, in which MediaPipe finds the hands (extra
    `video`). Each hand of each person is a sequence of its own. What the user should know (a
    doubtful hand, an assumed frame rate) stands in `Sequence.notes`.

    Args:
        path: a file, or a folder whose files (and folders) are all read; README, LICENSE,
            hidden files and files of other kinds are passed over.
        hand: None or "auto": as the source says, else from the way the fingers flex. "left" or
            "right": where a file labels both hands, only that one; where it labels one or none,
            that is what it is. "swap": the file's labels exchanged, for files that have them
            the wrong way round.
        unit: "m", "cm", "mm" or "in", instead of what the source says (where it is silent: m).
        order: joint order, instead of the source's: a name of `handtrack.hand.skeleton.ORDERS`,
            "axis-major" (all x, all y, all z), or the 21 places of our joints in the source,
            separated by commas (-1: it has none).
        fps: frames per second; replaces the source's times: frame i is at i / fps seconds.
        frames: first and last source frame number to keep, both included.
        format: name of the format (`readers.catalogue.kinds`), where content could be taken
            for another's.
        mano: your MANO files, for inputs that hold MANO parameters: a file, or a folder with
            MANO_RIGHT.pkl and MANO_LEFT.pkl.
        mano_tips: whose vertices are the fingertips (`handtrack.hand.mano.TIP_VERTICES`).
        time_unit: "s", "ms", "us" or "ns", instead of what the source says or its times suggest.
        mirror: "x", "y" or "z": the axis whose sign is changed, for sources whose world is
            left-handed (Unity, Unreal); hands keep their names.
        max_size: bytes of one file that are read, and that an archive may unpack to: a number,
            or as in "16GB"; by default 4 GB, and less of what unpacks to many times its size.
        profile: UmeTrack's description of a hand, which makes joints of its angles.
        trajectory: where Project Aria's device was, which brings its hands into the world.
        markers: a file that says which marker of a motion capture file is which joint.
        key: what is the joints, where names do not tell: an array of an .npz, a dataset of an
            HDF5 ("group/name"), a key of a JSON ("above.name").
        columns: of a text table the columns of the joints, x y z of each in its turn: "A:B", the
            first and the last, or all with commas between; titles, or numbers from 0.
        image_size: (width, height) [px] of the pictures that a detector found the hands in, where
            landmarks in the picture stand beside those in space and the source does not say it.
        passed_over: of a folder: what cannot be read is added to it, and nothing of it said in
            notes; without it a damaged file is an error.

    Returns:
        At least one sequence, in order of path, person and hand, with different names.

    Raises:
        InputError: nothing there, nothing readable, or a file that is damaged, cut short or not
            as its format says; the message starts with the file and is one line.
        SettingsError: unknown unit, order, hand, format or unit of time (with those that are
            known), fps not above zero, frames the wrong way round.
    """
    where = as_path(path)
    given = check_settings(unit, order, fps, time_unit, mirror, image_size)
    choice = _hand_choice(hand)
    _check_frames(frames)
    check_format(format)
    beside = Companions(*(None if p is None else Path(p) for p in (profile, trajectory, markers)))
    if not _is_there(where):
        raise InputError("no such file or folder", where)

    pending: list[Pending] = []

    def made(raws: list[Raw]) -> list[Sequence]:
        pending.extend(raw.pending for raw in raws if raw.pending is not None)
        raws = resolved(raws, beside)
        ready = [decoded(r, None if mano is None else Path(mano), mano_tips, choice) for r in raws]
        clips = clips_of(without_marks(ready))
        if len(clips) == 1:
            return finished(clips[0], given, choice, frames)
        return _of_clips(clips, given, choice, frames)

    with budget.limited(max_size):
        if where.is_dir():
            if key is not None or columns is not None:
                raise SettingsError(f"{where} is a folder: --key and --columns are for a file")
            found = _from_folder(where, lambda s: made(s.read(frames, format)), passed_over)
        elif key is None and columns is None and packed.holds_files(where):
            found = _from_zip(where, lambda s: made(s.read(frames, format)), passed_over)
        else:
            chosen = key is not None or columns is not None
            raws = read_chosen(where, key, columns) if chosen else read_file(where, frames, format)
            found = unique_names(made(raws))
    check_taken(pending, beside, where)
    return found


class PassedOver(NamedTuple):
    """What of a folder was not read.

    Attributes:
        path: the file.
        error: why.
        joints: whether there are joints in it, but damaged ones or none in the frames asked for.
    """

    path: Path
    error: InputError
    joints: bool


def load_some(path: str | PathLike[str], **options: Any) -> tuple[list[Sequence], list[PassedOver]]:
    """What can be read of a folder, and what cannot: a damaged file does not end it.

    Args:
        path: the folder.
        **options: of `load`.

    Raises:
        InputError, SettingsError: as `load`; of files only where nothing can be read.
    """
    passed_over: list[PassedOver] = []
    return load(path, **options, passed_over=passed_over), passed_over


def as_path(given: object) -> Path:
    """A path that was given as one.

    Raises:
        InputError: it is something else.
    """
    if isinstance(given, str | PathLike):
        return Path(given)
    raise InputError(
        f"a {type(given).__name__} is no path of a file or folder; joints that are in memory go to"
        " handtrack.track as they are"
    )


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _hand_choice(hand: str | None) -> HandChoice:
    for choice in CHOICES:
        if (hand or "auto") == choice:
            return choice
    raise SettingsError(f"unknown hand {hand!r}, expected one of {', '.join(CHOICES)}")


def _check_frames(frames: tuple[int, int] | None) -> None:
    if frames is not None and (len(frames) != 2 or frames[0] > frames[1]):
        raise SettingsError(f"frames are {frames}, expected (first, last)")


def _of_clips(
    clips: list[list[Raw]], given: Given, choice: HandChoice, frames: tuple[int, int] | None
) -> list[Sequence]:
    """The sequences of each clip in which a hand is seen.

    Raises:
        InputError: as `finished`; none is seen in any.
    """
    found: list[Sequence] = []
    outside: NoFramesError | None = None
    for raws in [c for c in clips if any(map(anything_seen, c))] or clips[:1]:
        try:
            found += finished(raws, given, choice, frames)
        except NoFramesError as error:
            outside = error
    if outside is not None and not found:
        raise outside
    return found


def finished(
    raws: list[Raw], given: Given, choice: HandChoice, frames: tuple[int, int] | None
) -> list[Sequence]:
    """The sequences of one source, checked, labelled and cut to the frames asked for."""
    raws = put_in_place(raws)
    seen = [raw for raw in raws if anything_seen(raw)] or raws[:1]
    sequences = [assemble(raw, given) for raw in seen]
    units = [unit_of(raw, given) for raw in seen]
    # what is flat is no hand in any unit
    worlds = [world_doubts(s.joints, raws[0].path) for s in sequences]
    doubts = check_sizes([s.joints for s in sequences], units, raws[0].path)
    sequences = [
        _noted(s, doubt, *world) for s, doubt, world in zip(sequences, doubts, worlds, strict=True)
    ]
    labels = [raw.hand for raw in seen]
    both = {"left", "right"} <= {raw.hand for raw in raws}
    sequences = label_hands(
        sequences,
        labels,
        [raw.tagged for raw in seen],
        choice,
        both,
        [raw.by_number for raw in seen],
    )
    if not sequences:
        raise InputError(f"every joint of the {choice} hand is missing", raws[0].path)
    if given.unit is None and all(raw.says_nothing for raw in seen):
        sequences = [_noted(s, about_the_wrist(s.joints)) for s in sequences]
    if len(seen) < len(raws):
        gone = ", ".join(
            f"{r.name} {r.hand or ''}".strip() for r in raws if not any(r is s for s in seen)
        )
        note = f"left out, as every joint is missing: {gone}"
        sequences[0] = _noted(sequences[0], note)
    return sequences if frames is None else _cut(sequences, frames)


def _noted(sequence: Sequence, *notes: str | None) -> Sequence:
    return replace(sequence, notes=(*sequence.notes, *(n for n in notes if n is not None)))


_COUNTED = "no frame numbers in the file: counted from 0"


def _cut(sequences: list[Sequence], frames: tuple[int, int]) -> list[Sequence]:
    """The part of each sequence inside the frames; those that are not seen there are left out."""
    parts = []
    for sequence in sequences:
        index = sequence.frame_index
        inside = (index >= frames[0]) & (index <= frames[1])
        if sequence.present[inside].any():
            counted = None if sequence.numbered else _COUNTED
            parts.append(_noted(sequence.frames(*frames), counted))
    if not parts:
        first = min(int(s.frame_index.min()) for s in sequences)
        last = max(int(s.frame_index.max()) for s in sequences)
        raise NoFramesError(
            f"no joint in frames {frames[0]}:{frames[1]}, there are {first}:{last}",
            sequences[0].source,
        )
    return parts


def _from_folder(
    folder: Path, read: Callable[[Source], list[Sequence]], told: list[PassedOver] | None
) -> list[Sequence]:
    sequences: list[Sequence] = []
    passed_over: list[PassedOver] = []
    for source in sources(folder):
        try:
            sequences += read(source)
        except InputError as error:
            joints = not isinstance(error, NotJointsError)
            if joints and told is None and not isinstance(error, NoFramesError):
                raise
            where = Path(error.path or source.folder / source.names[0])
            passed_over.append(PassedOver(where, error, joints))
    damaged = [p.error for p in passed_over if p.joints]
    others = [str(p.error) for p in passed_over if not p.joints]
    if not sequences:
        if damaged:
            raise damaged[-1]
        reason = f" ({_listed(others, folder)})" if others else ""
        raise InputError(f"no joint sequence found{reason}", folder)
    if told is not None:
        told += passed_over
    elif others:
        sequences[0] = _noted(sequences[0], f"passed over: {_listed(others, folder)}")
    return unique_names(sequences)


def _from_zip(
    path: Path, read: Callable[[Source], list[Sequence]], told: list[PassedOver] | None
) -> list[Sequence]:
    """The sequences of the files in a .zip; what is said of them names the archive."""
    with packed.as_folder(path, lambda name: not is_ignored(name)) as folder:
        inside = str(folder)
        try:
            found = _from_folder(folder, read, told)
        except InputError as error:
            said = str(error).replace(inside, str(path)).removeprefix(f"{path}: ")
            raise error.retold(f"{path}: {said}", path) from None
        return [
            replace(
                s,
                source=s.source.replace(inside, str(path)),
                notes=tuple(Note.of(n).renamed(inside, str(path)) for n in s.notes),
            )
            for s in found
        ]


def _listed(passed_over: list[str], folder: Path) -> str:
    first = passed_over[0].removeprefix(f"{folder}{sep}")
    more = len(passed_over) - 1
    return f"{first}; and {more} more" if more else first
