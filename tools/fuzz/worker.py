"""Runs one spoilt input after another, watched; the process is the parent's to end.

Reads requests from standard input, a line of JSON each, and answers a line each.
"""

from __future__ import annotations

import gc
import json
import os
import random
import resource
import shutil
import sys
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import handtrack as ht
from handtrack.errors import HandtrackError
from tools.fuzz import corpus, gadgets
from tools.fuzz.bombs import bombs
from tools.fuzz.kinds import kinds
from tools.fuzz.mutate_packed import mutated

MEMORY = 10**9
_FORBIDDEN = {
    "os", "subprocess", "socket", "ctypes", "shutil", "marshal", "pty", "urllib", "http", "ftplib",
    "smtplib", "webbrowser", "pickle", "code", "tempfile", "sqlite3", "mmap",
}  # fmt: skip
_HARMLESS = {"os.listdir", "os.scandir", "os.walk", "os.fwalk", "shutil.rmtree", "os.putenv"}
_OURS = ("handtrack", "numpy", "msgspec", "google", "mcap", "lz4", "zstandard", "scipy", "numba")


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
        elif event == "open":
            path, mode, flags = arguments
            writes = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_TRUNC
            if isinstance(flags, int) and flags & writes and not self.first:
                self.seen.append(f"open {path} {mode}")
        elif event in _HARMLESS or self.first:
            return
        elif event.partition(".")[0] in _FORBIDDEN:
            self.seen.append(f"{event} {arguments}"[:200])


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
        self.folder, self.watch = folder, Watch()
        self.kinds = targets()
        joints = corpus.motion()
        self.files = {name: kind.make(joints) for name, kind in self.kinds.items()}
        self.truth: dict[str, list[Any]] = {}
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
            self.truth[name] = _joints(self._value)

    def case(self, what: str, name: str, number: int) -> dict[str, Any]:
        """One: "mutant" of a kind, or the "bomb" or "gadget" of that number."""
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
        files = dict(self.files[name])
        for _ in range(rng.choice((1, 1, 2))):
            file = rng.choice(sorted(files))
            files[file] = mutated(files[file], rng)
        return self._run(name, files, f"{name} {number}")

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
        elif answer["end"] == "refused":
            text = answer["text"]
            if "\n" in text or len(text) > len(str(self.folder)) + 800 or not text.isprintable():
                answer["end"] = "bad line"
        elif answer["end"] == "ok" and name in self.truth:
            answer |= _compared(self.kinds[name], self.truth[name], self._value, told)


def _joints(value: Any) -> list[Any]:
    return (
        [s.joints for s in value] if isinstance(value, list) and hasattr(value[0], "joints") else []
    )


def _compared(kind: corpus.Kind, truth: list[Any], value: Any, told: bool) -> dict[str, Any]:
    """Numbers that no hand has; and other ones than were there, where sums tell."""
    found = _joints(value)
    for joints in found:
        if np.isinf(joints).any():
            return {"end": "WRONG", "text": "infinite joints"}
    return {}


def _memory() -> int:
    # as high as it ever was; set back by the kernel where it lets us
    with open("/proc/self/status", encoding="ascii") as status:
        high = next(line for line in status if line.startswith("VmHWM"))
    return 1024 * int(high.split()[1])


def main() -> None:
    """Answer until the input ends."""
    folder = Path(sys.argv[1])
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # nothing else may be written there
    runner = Runner(folder)
    resource.setrlimit(resource.RLIMIT_AS, (16 * MEMORY, resource.RLIM_INFINITY))
    gc.freeze()  # else each collection goes through all of it
    counts = {"bombs": len(runner.bombs), "gadgets": 2 * len(runner.gadgets)}
    print(json.dumps(counts | {"kinds": list(kinds())}), file=answers, flush=True)
    for line in sys.stdin:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        print(json.dumps(runner.case(*json.loads(line))), file=answers, flush=True)


if __name__ == "__main__":
    main()
