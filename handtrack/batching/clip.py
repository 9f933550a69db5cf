"""Clips: what a data set consists of, and what is known of each before it is read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath

from handtrack.errors import InputError, SettingsError
from handtrack.sequences.readers.raw import stem


@dataclass(frozen=True)
class Clip:
    """One source of joints: a file, a folder, or the numbered files of a folder.

    Attributes:
        path: a path or URL; of numbered files the first.
        name: of its results, with / between folders.
        group: it stands for all numbered files that belong to it.
        listed: somebody asked for it by name; one that was found may be of something else.
        hand: "left", "right", "swap", or None: as the source says.
        subject: whose hand it is; "" where nobody says.
        fps, unit, order: as `handtrack.load` takes them; None: as the source says.
        start, end: the part to take, in seconds from its first frame; None: all.
        truth: path or URL of the true joints, or None.
        own: the user's columns, by name.
        stamp: what tells without reading whether the source is still the same.
        size: bytes.
    """

    path: str
    name: str
    group: bool = False
    listed: bool = False
    hand: str | None = None
    subject: str = ""
    fps: float | None = None
    unit: str | None = None
    order: str | None = None
    start: float | None = None
    end: float | None = None
    truth: str | None = None
    own: tuple[tuple[str, str], ...] = ()
    stamp: str = ""
    size: int = 0

    def told(self) -> dict[str, object]:
        """What makes a difference to its results, beside the content of its files."""
        names = ("hand", "subject", "fps", "unit", "order", "start", "end", "truth", "group")
        return {name: getattr(self, name) for name in names} | {"own": dict(self.own)}


def with_subjects(clips: Sequence[Clip], pattern: str | None) -> list[Clip]:
    """The clips with the subject that a regular expression finds in their paths.

    Its group `subject`, else its first group, else all that it matches is the subject. A
    subject that a manifest gives stays.

    Raises:
        SettingsError: the expression is none, or is found in no path.
    """
    if pattern is None:
        return list(clips)
    try:
        expression = re.compile(pattern)
    except re.error as error:
        raise SettingsError(f"--subject {pattern}: no regular expression: {error}") from None
    found: list[Clip] = []
    for clip in clips:
        match = None if clip.subject else expression.search(clip.path)
        if match is None:
            found.append(clip)
            continue
        of = "subject" if "subject" in expression.groupindex else min(1, expression.groups)
        found.append(replace(clip, subject=match[of] or ""))
    if not any(clip.subject for clip in found):
        raise SettingsError(f"--subject {pattern} is found in no path, as in {clips[0].path}")
    return found


def named(clips: Sequence[Clip], roots: Sequence[str]) -> list[Clip]:
    """The clips with the names of their results, where they have none yet.

    Args:
        clips: with an empty name: by their paths.
        roots: for each clip the folder that its name is relative to; "" for none.

    Raises:
        InputError: two would have one name.
    """
    made = [
        clip if clip.name else replace(clip, name=_name(clip, root))
        for clip, root in zip(clips, roots, strict=True)
    ]
    seen: dict[str, Clip] = {}
    for i, clip in enumerate(made):
        other = seen.get(clip.name.lower())
        if other is not None and other.path == clip.path and other.hand != clip.hand:
            clip = made[i] = replace(clip, name=f"{clip.name}_{clip.hand or 'both'}")
            other = seen.get(clip.name.lower())
        if other is not None:
            raise InputError(
                f"{other.path} and {clip.path} would both be named {clip.name}: give them names of"
                " their own in a manifest's column `name`"
            )
        seen[clip.name.lower()] = clip
    return made


def _name(clip: Clip, root: str) -> str:
    path = clip.path.partition("::")[0]
    inside = path
    if root and path.startswith(root):
        inside = path[len(root) :]
    elif "://" in path:
        inside = path.partition("://")[2]
    pure = PurePosixPath(inside.replace("\\", "/").lstrip("/"))
    parts = [part for part in pure.parts if part not in ("..", ".", "/")]
    if not parts:
        parts = [PurePosixPath(clip.path).name]
    parts[-1] = stem(Path(parts[-1]))
    if clip.start is not None or clip.end is not None:
        begin, end = clip.start or 0, clip.end
        parts[-1] += f"_{begin:g}-" + ("" if end is None else f"{end:g}")
    return "/".join(parts)


def common_root(paths: Iterable[str]) -> str:
    """The folder that all paths are in, "" for none."""
    folders = [path.rpartition("/")[0].split("/") for path in paths]
    if not folders:
        return ""
    shared = []
    for parts in zip(*folders, strict=False):
        if len(set(parts)) > 1:
            break
        shared.append(parts[0])
    root = "/".join(shared)
    return f"{root}/" if root else ""
