"""Which recordings the command line makes of an input, and whether they can be written."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from handtrack.errors import SettingsError

if TYPE_CHECKING:
    from handtrack import McapRecorder, Sequence
    from handtrack.cli.sources import Item
    from handtrack.recording.settings import RecordingSettings

RECORDINGS = Path("recordings")
_Command = TypeVar("_Command", bound=Callable[..., Any])
_OVERWRITE = "handtrack.overwrite"


def _keep_overwrite(context: click.Context, option: click.Parameter, value: bool) -> None:
    context.meta[_OVERWRITE] = value


def overwrite_option(command: _Command) -> _Command:
    """Give a command the option that lets `check_target` pass files that are there already."""
    return click.option(
        "--overwrite",
        is_flag=True,
        expose_value=False,
        callback=_keep_overwrite,
        help="Replace files that are there already.",
    )(command)


def refuse_existing(paths: Iterable[Path], cure: str) -> None:
    """Refuse to replace files that are there already, unless --overwrite is given.

    Args:
        paths: what is to be written.
        cure: what else the user could do, as in "-o gives another name".

    Raises:
        SettingsError: some are there.
    """
    context = click.get_current_context(silent=True)
    if context is not None and context.meta.get(_OVERWRITE):
        return
    there = [path for path in paths if path.exists()]
    if there:
        more = f" and {len(there) - 1} more are" if len(there) > 1 else " is"
        what = "them" if len(there) > 1 else "it"
        raise SettingsError(f"{there[0]}{more} there already: --overwrite replaces {what}, {cure}")


class Job(NamedTuple):
    """What goes into one recording, and where it goes."""

    items: list[Item]
    mcap: Path
    rrd: Path | None

    @property
    def files(self) -> list[Path]:
        """What is written."""
        return [self.mcap] if self.rrd is None else [self.mcap, self.rrd]


def jobs(
    items: list[Item], inputs: Iterable[Path], output: Path | None, rrd: Path | None
) -> list[Job]:
    """One recording for each source, or one of everything where the output is one file.

    Args:
        items: what is to be tracked.
        inputs: what the user named.
        output: an .mcap file or a folder; by default in recordings/.
        rrd: an .rrd file or a folder, or None.

    Raises:
        SettingsError: an output has another ending, cannot be written, is the input, or there
            already.
    """
    together = any(path is not None and not _is_folder(path) for path in (output, rrd))
    groups = [items] if together else [[item] for item in items]
    names = names_of([next(iter(inputs))] if together else [item.source for item in items])
    sources = [Path(file) for item in items for file in item.files]
    made = []
    for name, group in zip(names, groups, strict=True):
        if output is None:
            mcap = RECORDINGS / f"{_default(group, list(inputs), rrd)}.mcap"
        else:
            mcap = output / f"{name}.mcap" if _is_folder(output) else output
        shown = rrd / f"{name}.rrd" if rrd is not None and _is_folder(rrd) else rrd
        made.append(Job(group, mcap, shown))
    for job in made:
        check_target(job.mcap, ".mcap", "-o", sources, new=False)
        if job.rrd is not None:
            check_target(job.rrd, ".rrd", "--rrd", new=False)
    refuse_existing([file for job in made for file in job.files], "-o and --rrd give other names")
    return made


def _default(group: list[Item], inputs: list[Path], rrd: Path | None) -> str:
    """Where a recording goes in recordings/ if nobody says."""
    if len(group) > 1:
        return rrd.stem if rrd is not None and len(inputs) > 1 else default_name(inputs[0])
    (item,) = group
    if item.folder is None:
        return default_name(item.source)
    # those of a folder stay together
    return str(Path(default_name(item.folder)) / item.name)


def recorder(mcap: Path, sequences: list[Sequence], recording: RecordingSettings) -> McapRecorder:
    """What writes a recording while its sequences are tracked.

    Args:
        mcap: the file.
        sequences: what goes into it.
        recording: as `take_recording` takes it.
    """
    from handtrack import McapRecorder

    mcap.parent.mkdir(parents=True, exist_ok=True)
    return McapRecorder(
        mcap,
        hands=[(sequence.name, sequence.hand) for sequence in sequences],
        start_ns=min(int(sequence.time_ns[0]) for sequence in sequences),
        recording=recording,
    )


def check_target(
    path: Path, suffix: str, option: str, inputs: Iterable[Path] = (), new: bool = True
) -> None:
    """Refuse a file that cannot be written, before the work begins.

    Args:
        path: the file.
        suffix: what its name must end in.
        option: that it was given by.
        inputs: files that are read, which it may not take the place of.
        new: refuse it, too, if it is there already and --overwrite is not given.

    Raises:
        SettingsError: it is a folder or an input, or there already without --overwrite; its name
            does not end in the suffix, or its folder can be neither made nor written to.
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
    if new:
        refuse_existing([path], f"{option} gives another name")
    check_place(path)


def check_place(path: Path) -> None:
    """Refuse a file whose folder can be neither made nor written to."""
    above = next(folder for folder in path.absolute().parents if folder.exists())
    if not above.is_dir():
        raise SettingsError(f"{path} cannot be written: {above} is no folder")
    if not os.access(above, os.W_OK):
        raise SettingsError(f"{path} cannot be written: no permission to write to {above}")


def _is_folder(path: Path) -> bool:
    return path.is_dir() or not path.suffix


def default_name(source: Path) -> str:
    """The name of what is made of a source: its path from here, without endings.

    So `a/take.json` and `b/take.json` get different ones, whoever tracks them, and when.
    """
    path = source.resolve()
    # a Panoptic sequence is named by the folder around hdHand3d
    path = path.parent if path.name == "hdHand3d" else path
    try:
        parts = Path(os.path.relpath(path.parent)).parts
    except ValueError:  # another drive
        parts = path.parent.parts[1:]
    named = [part for part in parts if part not in (os.curdir, os.pardir)]
    return "-".join([*named, _plain(path)])


def _plain(path: Path) -> str:
    """A file's name without endings, or a folder's."""
    from handtrack.files.pictures import pictures_in
    from handtrack.sequences.readers.raw import stem

    if path.is_dir():
        return path.name
    return path.stem if path.is_file() and pictures_in(path) is not None else stem(path)


def names_of(sources: list[Path]) -> list[str]:
    """Different names for recordings: those of the sources without endings, if they can be."""
    paths = [source.resolve() for source in sources]
    # a Panoptic sequence is named by the folder around hdHand3d
    paths = [path.parent if path.name == "hdHand3d" else path for path in paths]
    names = [_plain(path) for path in paths]
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
