"""Where results go: a folder, or a place that fsspec knows; what appears there is complete."""

from __future__ import annotations

import errno
import os
import shutil
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path, PurePosixPath
from typing import Any, TypeVar
from uuid import uuid4

from handtrack.errors import HandtrackError, SettingsError, needed

_Result = TypeVar("_Result")

_PAUSES_S = (0.5, 2.0)
"""Between the attempts at what a store refuses."""
_LASTING = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.ENOENT)
"""What does not go away by waiting."""
_PART = ".part"


class StoreError(HandtrackError):
    """A store that cannot be read or written: the run's trouble, not a clip's."""


def is_remote(place: str) -> bool:
    """Whether a path is fsspec's and not the machine's."""
    return "://" in place or "::" in place


def filesystem(place: str) -> tuple[Any, str]:
    """fsspec's file system of a URL, and the path in it.

    Raises:
        SettingsError: what it needs is not installed, or it is no URL of a store.
        StoreError: the store cannot be opened.
    """
    fsspec = needed("fsspec", "paths with :// need fsspec", "batch")
    scheme = place.partition("://")[0]
    if scheme == "s3":
        needed("s3fs", "paths with s3:// need s3fs", "batch")
    if scheme == "gs":
        needed("gcsfs", "paths with gs:// need gcsfs (pip install gcsfs)", "batch")
    known = fsspec.available_protocols()
    if scheme not in known and scheme.partition("::")[0] not in known:
        usual = "s3://, gs://, memory://, http://"
        raise SettingsError(f"{place}: {scheme}:// is unknown, expected one such as {usual}")
    try:
        fs, path = fsspec.core.url_to_fs(place)
    except (ValueError, ImportError) as error:
        raise StoreError(f"{place}: {error}") from error
    return fs, str(path)


def troubles() -> tuple[type[BaseException], ...]:
    """What stores raise when they cannot be reached or refuse; some do not call it OSError."""
    found: list[type[BaseException]] = [OSError, TimeoutError]
    for module, name in (("botocore.exceptions", "BotoCoreError"), ("aiohttp", "ClientError")):
        if module in sys.modules:
            found.append(getattr(sys.modules[module], name))
    return tuple(found)


def tried(what: str, call: Callable[[], _Result]) -> _Result:
    """The result of a call to a store, tried again where that may help.

    Raises:
        FileNotFoundError: there is no such thing.
        StoreError: it cannot be done.
    """
    for pause in (*_PAUSES_S, None):
        try:
            return call()
        except FileNotFoundError:
            raise
        except troubles() as error:
            if pause is None or getattr(error, "errno", None) in _LASTING:
                reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
                raise StoreError(f"{what}: {reason}") from error
        time.sleep(pause)
    raise AssertionError("unreachable")


class Store:
    """A folder of files by their names, with / between the parts."""

    def __init__(self, place: str | Path) -> None:
        self.place = str(place).rstrip("/") if is_remote(str(place)) else str(place)
        self.folder: Path | None = None
        if is_remote(self.place):
            self._fs, self._root = filesystem(self.place)
        else:
            self.folder = Path(place)

    def __reduce__(self) -> tuple[type[Store], tuple[str]]:
        return Store, (self.place,)

    def shown(self, name: str) -> str:
        """The whole path of a name."""
        return f"{self.place}/{name}" if name else self.place

    def path(self, name: str) -> Path:
        """The path of a name in a folder of this machine; not to be asked of other stores."""
        if self.folder is None:
            raise StoreError(f"{self.shown(name)} is not on this machine")
        return self.folder / name

    def _key(self, name: str) -> str:
        return f"{self._root}/{name}" if name else self._root

    def make(self) -> None:
        """Make the folder, where there are folders.

        Raises:
            SettingsError: it is a file.
            StoreError: it cannot be made or written to.
        """

        if self.folder is not None and self.folder.exists() and not self.folder.is_dir():
            raise SettingsError(f"{self.folder} is a file, expected a folder for the results")

        def made() -> None:
            if self.folder is not None:
                self.folder.mkdir(parents=True, exist_ok=True)
            else:
                self._fs.makedirs(self._root, exist_ok=True)

        tried(self.place, made)

    def exists(self, name: str = "") -> bool:
        """Whether there is such a file or folder."""
        if self.folder is not None:
            return (self.folder / name).exists()
        return bool(tried(self.shown(name), lambda: self._fs.exists(self._key(name))))

    def read(self, name: str) -> bytes:
        """A file's content.

        Raises:
            FileNotFoundError: there is none.
            StoreError: it cannot be read.
        """
        if self.folder is not None:
            path = self.folder / name
            return tried(str(path), path.read_bytes)
        return bytes(tried(self.shown(name), lambda: self._fs.cat_file(self._key(name))))

    def write(self, name: str, data: bytes) -> None:
        """Write a whole file; it has its name when it is complete, and not before.

        Raises:
            StoreError: it cannot be written.
        """
        if self.folder is None:
            # an object appears when all of it has been sent
            tried(self.shown(name), lambda: self._fs.pipe_file(self._key(name), data))
            return
        path = self.folder / name
        part = path.with_name(f".{path.name}.{uuid4().hex}{_PART}")

        def written() -> None:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                with part.open("wb") as stream:
                    stream.write(data)
                    stream.flush()
                    os.fsync(stream.fileno())
                part.replace(path)
            finally:
                with suppress(OSError):
                    part.unlink(missing_ok=True)

        tried(str(path), written)

    def put(self, file: Path, name: str) -> None:
        """Bring a complete file of this machine under a name.

        Raises:
            StoreError: it cannot be written.
        """
        if self.folder is None:
            tried(self.shown(name), lambda: self._fs.put_file(str(file), self._key(name)))
            return
        path = self.folder / name
        part = path.with_name(f".{path.name}.{uuid4().hex}{_PART}")

        def moved() -> None:
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, part)
                part.replace(path)
            finally:
                with suppress(OSError):
                    part.unlink(missing_ok=True)

        tried(str(path), moved)

    def names(self, folder: str) -> list[str]:
        """All files below a folder, sorted; parts of files that were never finished are none."""
        if self.folder is not None:
            start = self.folder / folder
            found = [p.relative_to(self.folder).as_posix() for p in start.rglob("*") if p.is_file()]
        else:

            def listed() -> list[str]:
                # what another program has written since is to be seen
                self._fs.invalidate_cache()
                try:
                    return [str(path) for path in self._fs.find(self._key(folder))]
                except FileNotFoundError:
                    return []

            root = self._root.lstrip("/")
            keys = tried(self.shown(folder), listed)
            found = [key.lstrip("/").removeprefix(root).lstrip("/") for key in keys]
        return sorted(n for n in found if not n.endswith(_PART))

    def remove(self, name: str) -> None:
        """Remove a file, if it is there."""
        with suppress(FileNotFoundError):
            if self.folder is not None:
                path = self.folder / name
                tried(str(path), path.unlink)
            else:
                tried(self.shown(name), lambda: self._fs.rm_file(self._key(name)))

    def sweep(self) -> None:
        """Remove what runs that were killed left of files they did not finish."""
        if self.folder is not None:
            for part in self.folder.rglob(f"*{_PART}"):
                with suppress(OSError):
                    part.unlink()


def child(place: str, name: str) -> str:
    """A path below another, of a machine or of a store."""
    if is_remote(name) or PurePosixPath(name).is_absolute():
        return name
    return f"{place.rstrip('/')}/{name}" if is_remote(place) else str(Path(place) / name)
