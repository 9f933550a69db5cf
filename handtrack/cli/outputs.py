"""Which recordings the command line makes of an input, and whether they can be written."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from handtrack.errors import SettingsError

if TYPE_CHECKING:
    from handtrack import McapRecorder, Sequence
    from handtrack.mcap.state import Stretch
    from handtrack.recording.settings import RecordingSettings

RECORDINGS = Path("recordings")


class Job(NamedTuple):
    """The sequences that go into one recording, and where it goes."""

    sequences: list[Sequence]
    mcap: Path
    rrd: Path | None

    @property
    def files(self) -> list[Path]:
        """What is written."""
        return [self.mcap] if self.rrd is None else [self.mcap, self.rrd]


def jobs(
    sequences: list[Sequence], source: Path, output: Path | None, rrd: Path | None
) -> list[Job]:
    """One recording for each source file, or one of everything where the output is one file.

    Args:
        sequences: what was read.
        source: the file or folder that they were read from.
        output: an .mcap file or a folder; by default in recordings/.
        rrd: an .rrd file or a folder, or None.

    Raises:
        SettingsError: an output has another ending, cannot be written, or is the input.
    """
    groups: dict[str, list[Sequence]] = {}
    together = any(path is not None and not _is_folder(path) for path in (output, rrd))
    for sequence in sequences:
        groups.setdefault("" if together else sequence.source, []).append(sequence)
    if output is None:
        # those of a folder stay together
        output = RECORDINGS / source.resolve().name if len(groups) > 1 else RECORDINGS
    sources = [Path(sequence.source) for sequence in sequences if sequence.source]
    names = _names([source] if together else [Path(file) for file in groups])
    made = []
    for name, group in zip(names, groups.values(), strict=True):
        mcap = output / f"{name}.mcap" if _is_folder(output) else output
        check_target(mcap, ".mcap", "-o", sources)
        shown = rrd / f"{name}.rrd" if rrd is not None and _is_folder(rrd) else rrd
        if shown is not None:
            check_target(shown, ".rrd", "--rrd")
        made.append(Job(group, mcap, shown))
    return made


def recorder(job: Job, recording: RecordingSettings) -> McapRecorder:
    """What writes a job's recording while its sequences are tracked.

    Args:
        job: what goes into it.
        recording: as `take_recording` takes it.
    """
    from handtrack import McapRecorder

    job.mcap.parent.mkdir(parents=True, exist_ok=True)
    return McapRecorder(
        job.mcap,
        hands=[(sequence.name, sequence.hand) for sequence in job.sequences],
        start_ns=min(int(sequence.time_ns[0]) for sequence in job.sequences),
        recording=recording,
    )


class Stretches:
    """Records the stretches of a track, from the first on that a hand is seen in.

    So a hand that is never seen leaves nothing.

    Attributes:
        seconds: time spent with recording [s].
    """

    def __init__(self, recorder: McapRecorder, hand: int) -> None:
        self._recorder, self._hand = recorder, hand
        self._waiting: list[Stretch] = []
        self._seen = False
        self.seconds = 0.0

    def __call__(self, part: Stretch) -> None:
        start = time.perf_counter()
        self._seen = self._seen or bool((part.status != "lost").any())
        self._waiting.append(part)
        if self._seen:
            for waiting in self._waiting:
                self._recorder.add(waiting, self._hand)
            self._waiting = []
        self.seconds += time.perf_counter() - start


def check_target(path: Path, suffix: str, option: str, inputs: Iterable[Path] = ()) -> None:
    """Refuse a file that cannot be written, before the work begins.

    Args:
        path: the file.
        suffix: what its name must end in.
        option: that it was given by.
        inputs: files that are read, which it may not take the place of.

    Raises:
        SettingsError: it is a folder or an input, its name does not end in the suffix, or its
            folder can be neither made nor written to.
    """
    for given in inputs if path.exists() else ():
        if given.exists() and path.samefile(given):
            raise SettingsError(
                f"{path} is the input: give the new file another name with {option}"
            )
    if path.is_dir():
        raise SettingsError(f"{path} is a folder, expected the name of a file to write")
    if path.suffix != suffix:
        raise SettingsError(f"{option} {path}: expected a name that ends in {suffix}")
    above = next(folder for folder in path.absolute().parents if folder.exists())
    if not above.is_dir():
        raise SettingsError(f"{path} cannot be written: {above} is no folder")
    if not os.access(above, os.W_OK):
        raise SettingsError(f"{path} cannot be written: no permission to write to {above}")


def _is_folder(path: Path) -> bool:
    return path.is_dir() or not path.suffix


def _names(sources: list[Path]) -> list[str]:
    """Different names for recordings: those of the sources without endings, if they can be."""
    from handtrack.sequences.readers.raw import stem

    paths = [source.resolve() for source in sources]
    # a Panoptic sequence is named by the folder around hdHand3d
    paths = [path.parent if path.name == "hdHand3d" else path for path in paths]
    names = [path.name if path.is_dir() else stem(path) for path in paths]
    names = [
        f"{path.parent.name}-{name}" if names.count(name) > 1 else name
        for path, name in zip(paths, names, strict=True)
    ]
    seen: Counter[str] = Counter()
    for i, name in enumerate(names):
        seen[name] += 1
        if seen[name] > 1:
            names[i] = f"{name}-{seen[name]}"
    return names
