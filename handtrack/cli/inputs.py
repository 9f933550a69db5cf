"""What the command line reads: joint sequences, recordings, and what belongs together."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from handtrack.errors import InputError, SettingsError

if TYPE_CHECKING:
    from handtrack import Sequence, Track
    from handtrack.evaluation.measure import Estimate
    from handtrack.sequences.hands import HandChoice
    from handtrack.sequences.load import PassedOver
    from handtrack.sequences.picture_landmarks import PictureLandmarks
    from handtrack.video.detections import Detections


class Reading(NamedTuple):
    """How to read joint sequences: the values of `reading_options`, and the size of pictures."""

    hand: str = "auto"
    unit: str | None = None
    order: str | None = None
    fps: float | None = None
    frames: str | None = None
    format: str | None = None
    mano: Path | None = None
    mano_tips: str = "smplx"
    time_unit: str | None = None
    max_size: str | None = None
    mirror: str | None = None
    profile: Path | None = None
    trajectory: Path | None = None
    markers: Path | None = None
    key: str | None = None
    columns: str | None = None
    image_size: tuple[int, int] | None = None

    @property
    def choice(self) -> HandChoice:
        """The hand, as one of the choices."""
        from handtrack.sequences.hands import CHOICES

        return next(c for c in CHOICES if c == self.hand)

    def load(
        self, path: Path, quiet: bool = False, found: Detections | None = None
    ) -> list[Sequence]:
        """The sequences of a file or folder; what the user should know of them is printed.

        Args:
            path: it.
            quiet: print nothing.
            found: the hands in it, where `detect` found them already.
        """
        import handtrack as ht
        from handtrack.files.pictures import pictures_in

        if found is None and pictures_in(path) is not None:
            found = self.detect(path, quiet)
        sequences = ht.load(path, **self.load_options) if found is None else self.labelled(found)
        self.say_notes(sequences, quiet)
        return sequences

    def load_folder(self, path: Path, quiet: bool) -> tuple[list[Sequence], list[PassedOver]]:
        """The joint sequences in a folder, and the files that are none, or damaged.

        Raises:
            InputError: there is no joint sequence in it.
        """
        from handtrack.sequences.load import load_some

        sequences, passed_over = load_some(path, **self.load_options)
        self.say_notes(sequences, quiet)
        return sequences, passed_over

    @property
    def load_options(self) -> dict[str, Any]:
        """As `handtrack.load` takes them."""
        given = self._asdict() | {"frames": self.frame_range}
        return given | {"hand": None if self.hand == "auto" else self.hand}

    @staticmethod
    def say_notes(sequences: list[Sequence], quiet: bool) -> None:
        """Print what the user should know of sequences."""
        for sequence in sequences if not quiet else ():
            for note in sequence.notes:
                click.echo(f"warning: {sequence.name}: {note}", err=True)

    def check_pictures(self, path: Path) -> None:
        """Refuse options that pictures have no use for.

        Raises:
            SettingsError: one is given.
        """
        from handtrack.video.loading import check_picture_options

        check_picture_options(path, self._asdict())

    def detect(self, path: Path, quiet: bool = False) -> Detections:
        """The hands in a video or in images."""
        from handtrack.cli.progress import progress_shown
        from handtrack.video.detections import detect
        from handtrack.video.media import count

        self.check_pictures(path)
        with progress_shown(count(path), quiet, "detecting") as progress:
            return detect(path, fps=self.fps, frames=self.frame_range, progress=progress.frames)

    def landmarks(self, path: Path) -> list[PictureLandmarks]:
        """The landmarks in pictures that a file or folder holds.

        Raises:
            SettingsError: an option that these have no use for is given.
        """
        from handtrack.sequences.picture_landmarks import load_picture_landmarks

        if any(o is not None for o in (self.mirror, self.profile, self.trajectory, self.markers)):
            raise SettingsError(
                f"{path}: --mirror, --profile, --trajectory and --markers are for joints in space,"
                " not for landmarks in a picture"
            )
        names = ("order", "fps", "format", "time_unit", "max_size")
        given = {name: getattr(self, name) for name in names}
        return load_picture_landmarks(path, frames=self.frame_range, **given)

    def labelled(self, found: Detections) -> list[Sequence]:
        """The joints of detected hands, labelled as the user wants them."""
        from handtrack.video.detections import labelled

        return labelled(found, self.choice)

    @property
    def frame_range(self) -> tuple[int, int] | None:
        """First and last frame.

        Raises:
            SettingsError: it is no range.
        """
        if self.frames is None:
            return None
        start, colon, stop = self.frames.partition(":")
        try:
            a, b = int(start), int(stop)
        except ValueError:
            a, b = 0, -1
        if not colon or a > b:
            raise SettingsError(
                f"--frames {self.frames} is no range, expected A:B, as in 20701:20800"
            )
        return a, b


def recordings(paths: tuple[Path, ...]) -> list[Path]:
    """The recordings that are named, or in the folders that are named.

    Raises:
        InputError: something is not there, or a folder has none.
    """
    found: list[Path] = []
    for path in paths:
        if not path.exists():
            raise InputError("no such file or folder", path)
        inside = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
        if not inside:
            raise InputError("no .mcap recording in this folder", path)
        found += inside
    return found


class Truths(NamedTuple):
    """True joints, to be paired with estimates.

    Attributes:
        path: the file or folder they are from.
        sequences: what was read; a file with observed and true joints is asked for the true.
    """

    path: Path
    sequences: list[Sequence]

    @staticmethod
    def load(path: Path, reading: Reading) -> Truths:
        """Read the true joints of a file or a folder."""
        found = reading.load(path)
        return Truths(path, [s if s.truth is None else replace(s, joints=s.truth) for s in found])

    def of(self, estimate: Track | Sequence | Estimate) -> Sequence:
        """The truth of an estimate: the only one, or that of its hand and name.

        Raises:
            InputError: none or several fit.
        """
        from handtrack.evaluation.matching import same_name

        truths = self.sequences
        fitting = [t for t in truths if len(truths) == 1 or t.hand == estimate.hand]
        if len(fitting) > 1:
            fitting = [t for t in fitting if same_name(t.name, estimate.name)]
        if len(fitting) != 1:
            raise InputError(
                f"{len(fitting)} sequences fit {estimate.name} ({estimate.hand}), expected one",
                self.path,
            )
        return fitting[0]


def estimates(
    paths: tuple[Path, ...], reading: Reading
) -> list[tuple[Path, Track | Sequence | Estimate]]:
    """What is to be measured: recordings, and joint sequences as they are, with their files.

    Of a folder that holds recordings only these are taken.

    Raises:
        InputError: something is not there or cannot be read, or no frame is left of it.
    """
    import handtrack as ht

    found: list[tuple[Path, Track | Sequence | Estimate]] = []
    for path in paths:
        if not path.exists():
            raise InputError("no such file or folder", path)
        inside = sorted(path.rglob("*.mcap")) if path.is_dir() else [path]
        for file in inside or [path]:
            if not _is_recording(file):
                found += [(file, _output(file, sequence)) for sequence in reading.load(file)]
                continue
            tracks = ht.read_mcap(file)
            if reading.hand in ("left", "right"):
                tracks = [t for t in tracks if t.hand == reading.hand]
            found += [(file, _cut(track, reading.frame_range)) for track in tracks]
    if not found:
        raise InputError(f"no {reading.hand} hand in it", paths[0])
    return found


_BY_FRAME = ("frame_index", "status", "angles_rad", "filtered_joints_m")
_EXPORTED = (*_BY_FRAME, "limits_lower_rad", "limits_upper_rad")


def _output(path: Path, sequence: Sequence) -> Sequence | Estimate:
    """Of arrays that `handtrack export` wrote what was tracked, not what was observed."""
    import numpy as np

    from handtrack.evaluation.measure import Estimate
    from handtrack.files.npz import read_npz

    if path.suffix != ".npz":
        return sequence
    arrays, _ = read_npz(path, path)
    if "filtered_joints_m" not in arrays:
        return sequence
    missing = [name for name in _EXPORTED if name not in arrays]
    if missing:
        raise InputError(f"has filtered_joints_m, but no {', '.join(missing)}", path)
    rows = np.isin(arrays["frame_index"], sequence.frame_index)
    if any(np.shape(arrays[name])[:1] != rows.shape for name in _BY_FRAME):
        raise InputError(f"{', '.join(_BY_FRAME)} are not of one length", path)
    joints, status = arrays["filtered_joints_m"][rows], arrays["status"][rows]
    angles = arrays["angles_rad"][rows]
    limits = arrays["limits_lower_rad"], arrays["limits_upper_rad"]
    if joints.shape != sequence.joints.shape:
        raise InputError(
            f"filtered_joints_m has shape {joints.shape}, joints_m {sequence.joints.shape}", path
        )
    from handtrack.hand.limits import Limits

    def count(kind: str) -> int:
        return int((status == kind).sum())

    return replace(
        Estimate.of_sequence(sequence),
        joints=joints.astype(np.float64),
        observed=sequence.joints,
        counts=(count("fitted"), count("predicted"), count("lost")),
        angles=angles,
        limits=Limits("as exported", *limits),
    )


def _cut(track: Track, frames: tuple[int, int] | None) -> Track:
    """The part of a track inside the frames, both included."""
    import numpy as np

    from handtrack.recording.parts import frames_of

    if frames is None:
        return track
    index = track.frame_index
    keep = (index >= frames[0]) & (index <= frames[1])
    if not keep.any():
        raise InputError(
            f"no frame in {frames[0]}:{frames[1]}, the recording has {index[0]}:{index[-1]}",
            track.name,
        )
    return frames_of(track, np.flatnonzero(keep))


def _is_recording(path: Path) -> bool:
    """Whether it is one of ours, and not another MCAP file with joints."""
    from handtrack.mcap.hands import is_recording

    return path.suffix in (".mcap", ".part") and path.is_file() and is_recording(path)
