"""Runs one spoilt input after another, watched; the process is the parent's to end.

Reads requests from standard input, a line of JSON each, and answers a line each.
"""

from __future__ import annotations

import codecs
import gc
import json
import mmap
import os
import random
import resource
import shutil
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.errors import HandtrackError
from handtrack.sequences.sequence import Sequence
from tools.fuzz import corpus, gadgets, judge
from tools.fuzz.bombs import bombs
from tools.fuzz.harmless import NONE, rewritten
from tools.fuzz.kinds import kinds
from tools.fuzz.mutate import of_bytes, of_numbers
from tools.fuzz.mutate_packed import mutated

MEMORY = 10**9
_FORBIDDEN = {
    "os", "subprocess", "socket", "ctypes", "shutil", "marshal", "pty", "urllib", "http", "ftplib",
    "smtplib", "webbrowser", "pickle", "code", "tempfile", "sqlite3", "mmap",
}  # fmt: skip
_HARMLESS = {"os.listdir", "os.scandir", "os.walk", "os.fwalk", "shutil.rmtree", "os.putenv"}
_UNPACKING = ("open", "tempfile.mkdtemp", "os.mkdir", "os.remove", "os.rmdir")
_SCRATCH = os.path.join(tempfile.gettempdir(), "handtrack-")
"""What the readers' own folders begin with."""
ONE_NUMBER = ("json bare", "freihand", "csv bare", "interhand")
"""Kinds of text in which nearly every number is of a joint."""
_OURS = (
    *("handtrack", "numpy", "msgspec", "google", "mcap", "lz4", "zstandard", "scipy", "numba"),
    *("h5py", "c3d", "pyarrow", "flatbuffers"),
)


class Watch:
    """What the interpreter is asked to do while a reader runs."""

    def __init__(self) -> None:
        self.on = False
        self.seen: list[str] = []
        self.first = True
        sys.addaudithook(self._hook)

    def _hook(self, event: str, arguments: tuple[Any, ...]) -> None:
        if not self.on:
            return
        if event == "import":
            name = str(arguments[0])
            if not self.first and name.partition(".")[0] not in _OURS:
                self.seen.append(f"import {name}")
        elif _in_scratch(event, arguments):
            return
        elif event == "open":
            path, mode, flags = arguments
            writes = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_TRUNC
            if isinstance(flags, int) and flags & writes and not self.first:
                self.seen.append(f"open {path} {mode}")
        elif event in _HARMLESS or self.first:
            return
        elif event == "mmap.__new__" and arguments[2] == mmap.ACCESS_READ:
            return  # a file that is read
        elif event.partition(".")[0] in _FORBIDDEN:
            self.seen.append(f"{event} {arguments}"[:200])


def _in_scratch(event: str, arguments: tuple[Any, ...]) -> bool:
    """Whether it is about what the reader unpacks to, which is gone afterwards."""
    if event not in _UNPACKING or not isinstance(arguments[0], str):
        return False
    place, above = arguments[0], arguments[-1]
    if event in ("os.mkdir", "os.remove", "os.rmdir") and above >= 0:
        place = os.path.join(os.readlink(f"/proc/self/fd/{above}"), place)
    return os.path.realpath(place).startswith(os.path.realpath(_SCRATCH))


def targets() -> dict[str, corpus.Kind]:
    """Kinds, and the same of one file only, for bombs."""
    found = kinds()
    read: Callable[[Path], Any] = lambda path: ht.load(path, format="ho3d")  # noqa: E731
    found["ho3d file"] = corpus.Kind(lambda j: {"a.pkl": corpus.ho3d(j)["0002.pkl"]}, "a.pkl", read)
    name = "handRecon3D_hd00000001.json"
    found["panoptic file"] = corpus.Kind(
        lambda j: {name: corpus.panoptic_frame(j[0])}, name, lambda path: ht.load(path)
    )
    found["dexycb meta"] = corpus.Kind(corpus.dexycb, "", lambda path: ht.load(path))
    return found


class Runner:
    """Cases by their numbers.

    Args:
        folder: where they are written.
    """

    def __init__(self, folder: Path) -> None:
        for name in ("latin-1", "cp1252"):  # loaded at their first use
            codecs.lookup(name)
        self.folder, self.watch = folder, Watch()
        self.kinds = targets()
        joints = corpus.motion()
        self.files = {name: kind.make(joints) for name, kind in self.kinds.items()}
        self.truth: dict[str, Any] = {}
        self._how = ""
        self.bombs = list(bombs())
        self.gadgets = [
            (f"{name} {i}", data)
            for name in gadgets.NAMES
            for i, data in enumerate(gadgets.forms(*name.split(), f"touch {folder}/trace"))  # type: ignore[call-arg]
        ]
        self.gadgets += list(gadgets.odd())
        # twice: what is loaded late is loaded then
        for name in (*self.kinds, *self.kinds):
            answer = self._run(name, self.files[name], name)
            if answer["end"] != "ok":
                raise SystemExit(f"the sound {name} is not read: {answer}")
        self.watch.first = False
        for name in self.kinds:
            self._run(name, self.files[name], name)
            self.truth[name] = self._value

    def case(self, what: str, name: str, number: int) -> dict[str, Any]:
        """One: "mutant", "same", "flip" or "number" of a kind, or the "bomb" or "gadget" of that
        number."""
        self._how = what
        if what == "bomb":
            name, file, make = self.bombs[number]
            files = {**self.files[name], file: make()}
            target = self.kinds[name].target and file
            return self._run(name, files, f"bomb {file}", target)
        if what == "gadget":
            form, data = self.gadgets[number // 2]
            kind, file = (("ho3d file", "a.pkl"), ("mano", "MANO_RIGHT.pkl"))[number % 2]
            answer = self._run(kind, {file: data}, f"gadget {form}", file)
            if (self.folder / "trace").exists():
                answer |= {"end": "executed"}
            return answer
        rng = random.Random(f"{name} {number}")
        files, how = self._spoilt(what, name, rng)
        return self._run(name, files, f"{what} {name} {number} {how}")

    def _spoilt(self, what: str, name: str, rng: random.Random) -> tuple[corpus.Files, str]:
        files = dict(self.files[name])
        if what == "same":
            return rewritten(name, files, rng)
        if what in ("flip", "number"):
            with_sums = [f for f in sorted(files) if f != "meta.yml"]
            file = rng.choice(with_sums)
            files[file] = (of_bytes if what == "flip" else of_numbers)(files[file], rng)
            return files, file
        for _ in range(rng.choice((1, 1, 2))):
            file = rng.choice(sorted(files))
            files[file] = mutated(files[file], rng)
        return files, ""

    def _run(
        self, name: str, files: corpus.Files, label: str, target: str | None = None
    ) -> dict[str, Any]:
        kind = self.kinds[name]
        here = self.folder / "case"
        shutil.rmtree(here, ignore_errors=True)
        here.mkdir(parents=True)
        for file, data in files.items():
            (here / file).write_bytes(data)
        path = here / (kind.target if target is None else target)
        del files
        answer: dict[str, Any] = {"label": label, "end": "ok", "text": ""}
        before, start = _memory(), time.process_time()
        self.watch.seen.clear()
        self._value: Any = None
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            self.watch.on = True
            try:
                self._value = kind.read(path)
            except HandtrackError as error:
                answer |= {"end": "refused", "text": str(error)}
            except Exception as error:  # noqa: BLE001 - what may not come is looked for
                trace = traceback.extract_tb(error.__traceback__)[-3:]
                place = " < ".join(f"{Path(f.filename).name}:{f.lineno}" for f in reversed(trace))
                answer |= {"end": "traceback", "text": f"{error!r:.300} at {place}"}
            finally:
                self.watch.on = False
        answer["seconds"] = round(time.process_time() - start, 3)
        answer["memory"] = _memory() - before
        self._judge(name, answer, [w for w in told if w.category is not UserWarning], bool(told))
        return answer

    def _judge(self, name: str, answer: dict[str, Any], odd: list[Any], told: bool) -> None:
        """What is worse than it seems."""
        if self.watch.seen:
            answer |= {"end": "executed", "text": "; ".join(self.watch.seen[:3])}
        elif answer["seconds"] > 5 and not self.watch.first:
            answer["end"] = "hang"
        elif answer["memory"] > MEMORY and not self.watch.first:
            answer["end"] = "memory"
        elif odd and answer["end"] in ("ok", "refused"):
            first = odd[0]
            answer |= {"end": "warning", "text": f"{first.message} {first.filename}:{first.lineno}"}
        elif answer["end"] == "refused" and self._how == "same" and not self.watch.first:
            answer["end"] = "WRONG"
        elif answer["end"] == "refused":
            text = answer["text"]
            if "\n" in text or len(text) > len(str(self.folder)) + 800 or not text.isprintable():
                answer["end"] = "bad line"
        elif answer["end"] == "ok" and name in self.truth:
            answer |= self._compared(name, told)

    def _compared(self, name: str, told: bool) -> dict[str, Any]:
        """Whether the values are those of the sound input, where they must be."""
        truth, value = self.truth[name], self._value
        for each in value if isinstance(value, list) else ():
            if isinstance(each, Sequence) and np.isinf(each.joints).any():
                return {"end": "WRONG", "text": "infinite joints"}
        told = told or judge.told(value, truth)
        wrong = ""
        if self._how == "same" or (self._how == "flip" and not told):
            wrong = judge.different(value, truth)
        elif self._how == "number" and not told:
            wrong = judge.moved(value, truth)
        return {"end": "WRONG", "text": wrong} if wrong else {}


def _memory() -> int:
    # as high as it ever was; set back by the kernel where it lets us
    with open("/proc/self/status", encoding="ascii") as status:
        high = next(line for line in status if line.startswith("VmHWM"))
    return 1024 * int(high.split()[1])


def judged(name: str, kind: corpus.Kind) -> list[str]:
    """The ways to spoil a kind of which it is known what must come out."""
    ways = [] if name in NONE else ["same"]
    return ways + ["flip"] * kind.checked + ["number"] * (name in ONE_NUMBER)


def main() -> None:
    """Answer until the input ends."""
    folder = Path(sys.argv[1])
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # nothing else may be written there
    runner = Runner(folder)
    resource.setrlimit(resource.RLIMIT_AS, (16 * MEMORY, resource.RLIM_INFINITY))
    gc.freeze()  # else each collection goes through all of it
    about: dict[str, Any] = {"bombs": len(runner.bombs), "gadgets": 2 * len(runner.gadgets)}
    about["kinds"] = {name: judged(name, kind) for name, kind in kinds().items()}
    print(json.dumps(about), file=answers, flush=True)
    for line in sys.stdin:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        print(json.dumps(runner.case(*json.loads(line))), file=answers, flush=True)


if __name__ == "__main__":
    main()
