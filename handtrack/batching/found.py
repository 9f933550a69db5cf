"""Clips in folders, globs, archives and stores, by the readers' own recognition."""

from __future__ import annotations

import glob
import os
import tarfile
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import Any

from handtrack.batching.clip import Clip
from handtrack.batching.store import filesystem, is_remote, tried
from handtrack.errors import InputError
from handtrack.sequences.readers import panoptic
from handtrack.sequences.readers.folder import may_be_data, sources, together_by_name

_ZIP, _TARS = ".zip", (".tar", ".tar.gz", ".tgz", ".tar.bz2", ".tar.xz")
_HEAD = 512


def clips_in(place: str) -> tuple[list[Clip], str]:
    """The clips that a path, URL or glob stands for, and the folder that they are named within.

    Files are recognised by their names, and by their first bytes where names do not tell.

    Raises:
        InputError: nothing is there, or nothing in it can hold joints.
    """
    if is_remote(place):
        return _in_store(place)
    path = Path(place)
    if not path.exists():
        if not glob.has_magic(place):
            raise InputError("no such file or folder", place)
        found = [Path(p) for p in sorted(glob.glob(place, recursive=True))]
        if not found:
            raise InputError("no file or folder fits", place)
        clips: list[Clip] = []
        for each in found:
            clips += clips_in(str(each))[0] if each.is_dir() or _is_archive(each) else [_file(each)]
        fixed = place[: min(i for i in (place.find(c) for c in "*?[") if i >= 0)]
        return clips, fixed[: fixed.rfind("/") + 1]
    if path.is_dir():
        clips = list(_in_folder(path))
        if not clips:
            raise InputError("no file in this folder can hold joints", place)
        return clips, f"{place.rstrip('/')}/"
    if _is_archive(path):
        return _in_archive(path), ""
    return [_file(path)], str(path.parent) + "/"


def _file(path: Path) -> Clip:
    return stamped(Clip(str(path), "", listed=True))


def stamped(clip: Clip) -> Clip:
    """The clip with its size and with what tells without reading whether it is the same."""
    files = [Path(clip.path)]
    if files[0].is_dir():
        files = sorted(p for p in files[0].rglob("*") if p.is_file())
    marks = [os.stat(file) for file in files]
    size, last = sum(m.st_size for m in marks), max((m.st_mtime_ns for m in marks), default=0)
    stamp = f"{len(marks)}-{size}-{last}"
    if clip.truth is not None and not is_remote(clip.truth) and os.path.exists(clip.truth):
        truth = os.stat(clip.truth)
        stamp += f"-{truth.st_size}-{truth.st_mtime_ns}"
    return replace(clip, stamp=stamp, size=size)


def _in_folder(folder: Path) -> Iterator[Clip]:
    for source in sources(folder):
        first = source.folder / source.names[0]
        if len(source.names) == 1 and not panoptic.FILE_NAME.fullmatch(first.name):
            if _is_archive(first):
                yield from _in_archive(first)
            elif _may_hold_joints(first):
                yield stamped(Clip(str(first), ""))
            continue
        marks = [os.stat(source.folder / name) for name in source.names]
        size, last = sum(m.st_size for m in marks), max(m.st_mtime_ns for m in marks)
        yield Clip(str(first), "", group=True, stamp=f"{len(marks)}-{size}-{last}", size=size)


def _may_hold_joints(path: Path) -> bool:
    """Whether the first bytes speak against it: text that is none, or our own hand files."""
    with path.open("rb") as stream:
        head = stream.read(_HEAD)
    return bool(head) and b'"handtrack hand"' not in head


def _is_archive(path: Path) -> bool:
    """Whether it holds clips, and is none itself."""
    name = path.name.lower()
    if not path.is_file():
        return False
    if name.endswith(_ZIP):
        return zipfile.is_zipfile(path)
    return name.endswith(_TARS) and not _is_panoptic(path)


def _is_panoptic(path: Path) -> bool:
    """Whether an archive is one sequence of Panoptic's."""
    try:
        with tarfile.open(path) as archive:
            for member in archive:
                if member.isfile():
                    name = PurePosixPath(member.name).name
                    if panoptic.FILE_NAME.fullmatch(name):
                        return True
                    if may_be_data(name):
                        return False
    except (tarfile.TarError, OSError, EOFError):
        pass  # read by itself it will say what is wrong
    return True


def _in_archive(path: Path) -> list[Clip]:
    whole = os.stat(path)
    scheme = "zip" if path.name.lower().endswith(_ZIP) else "tar"
    try:
        if scheme == "zip":
            with zipfile.ZipFile(path) as packed:
                members = [(m.filename, m.file_size) for m in packed.infolist() if not m.is_dir()]
        else:
            with tarfile.open(path) as archive:
                members = [(m.name, m.size) for m in archive if m.isfile()]
    except (zipfile.BadZipFile, tarfile.TarError, OSError, EOFError) as error:
        raise InputError(f"is a damaged archive: {error}", path) from error
    sizes = dict(members)
    made = []
    for folder, group in _by_folder(sizes):
        keys = [f"{folder}/{name}" if folder else name for name in group]
        size = sum(sizes[key] for key in keys)
        made.append(
            Clip(
                f"{scheme}://{keys[0]}::{path}",
                "",
                group=len(keys) > 1,
                stamp=f"{size}-{whole.st_size}-{whole.st_mtime_ns}",
                size=size,
            )
        )
    if not made:
        raise InputError("nothing in this archive can hold joints", path)
    return made


def _in_store(place: str) -> tuple[list[Clip], str]:
    fs, root = filesystem(place)

    def listed() -> dict[str, Any]:
        fs.invalidate_cache()
        if glob.has_magic(root):
            return dict(fs.glob(root, detail=True))
        try:
            found = dict(fs.find(root, detail=True))
        except FileNotFoundError:
            found = {}
        return found

    try:
        infos = {k: i for k, i in tried(place, listed).items() if i.get("type") != "directory"}
    except FileNotFoundError:
        infos = {}
    if not infos:
        raise InputError("no such file or folder", place)
    clean = place.partition("::")[0]
    scheme = clean.partition("://")[0]
    chain = place[len(clean) :]
    made = []
    for folder, group in _by_folder(infos):
        keys = [f"{folder}/{name}" if folder else name for name in group]
        marks = [infos[key] for key in keys]
        made.append(
            Clip(
                f"{scheme}://{keys[0].lstrip('/') if scheme != 'file' else keys[0]}{chain}",
                "",
                group=len(keys) > 1,
                listed=len(infos) == 1,
                stamp="-".join(mark(m) for m in marks[:1]) + f"-{len(marks)}",
                size=sum(int(m.get("size") or 0) for m in marks),
            )
        )
    if not made:
        raise InputError("nothing in it can hold joints", place)
    fixed = root.lstrip("/")
    if glob.has_magic(fixed):
        fixed = fixed[: min(i for i in (fixed.find(c) for c in "*?[") if i >= 0)]
        fixed = fixed[: fixed.rfind("/") + 1]
    elif len(infos) == 1 and next(iter(infos)).lstrip("/") == fixed:
        fixed = fixed[: fixed.rfind("/") + 1]
    return made, f"{scheme}://{fixed.rstrip('/')}/"


def mark(info: dict[str, Any]) -> str:
    """What tells without reading whether a file of a store is the same."""
    for name in ("ETag", "etag", "md5Hash", "mtime", "LastModified", "created"):
        if info.get(name):
            return f"{info.get('size')}-{str(info[name]).strip(chr(34))}"
    return str(info.get("size"))


def _by_folder(keys: Iterable[str]) -> Iterator[tuple[str, list[str]]]:
    """Folders, each with the names in it that make one clip."""
    folders: dict[str, list[str]] = {}
    for key in sorted(keys):
        folder, _, name = key.rpartition("/")
        if not any(part.startswith(".") for part in folder.split("/")):
            folders.setdefault(folder, []).append(name)
    for folder, names in folders.items():
        for group in grouped(names):
            yield folder, group


def grouped(names: Iterable[str]) -> list[list[str]]:
    """Files of a folder that make one clip each, told by their names alone."""
    return together_by_name(sorted(n for n in names if may_be_data(n)))
