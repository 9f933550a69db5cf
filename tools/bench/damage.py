"""Recordings that are cut, flipped and patched at random: what is read of them is right, or told.

    python -m tools.bench.damage --runs 10000

Of every damaged file all is read that there is to read: the whole, a stretch of time through the
index, what `info` tells, and what `recover` makes of it. What comes without a warning must equal
what was written, to the bit; with a warning it must be a beginning of it; all else is one error.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import random
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from handtrack.errors import HandtrackError
from handtrack.hand.model import HandModel
from handtrack.recording import write
from handtrack.recording.info import info
from handtrack.recording.read import read_mcap, read_part
from handtrack.recording.recover import recover
from handtrack.recording.write import write_mcap
from handtrack.tracking.track import Event, Track

COMPRESSIONS = ("lz4", "zstd", "none")
SPANS = ((0.2, 0.5), (None, 0.3), (0.4, None))
SECONDS = 5.0
"""No file may take more of a processor's time."""


class Wrong(AssertionError):
    """Something was read that was not written, and nothing said so."""


def hands(frames: int = 24) -> list[Track]:
    """Two hands that turn; times from before zero, an event every few frames."""
    out = []
    for side, n in (("right", frames), ("left", frames * 2 // 3)):
        model = HandModel.default(side)  # type: ignore[arg-type]
        model = dataclasses.replace(
            model,
            rest_vertices=np.empty((0, 3)),
            faces=np.empty((0, 3), np.int32),
            weights=np.empty((0, 16)),
        )
        rng = np.random.default_rng(n)
        angles = model.limits.clamp(rng.normal(0.3, 0.2, (n, 20)))
        half = 0.1 * np.arange(n)
        quaternion = np.stack([np.cos(half), 0 * half, 0 * half, np.sin(half)], 1)
        shift = rng.normal(0, 0.1, (n, 3))
        turn = np.zeros((n, 3, 3))
        turn[:, 0, 0] = turn[:, 1, 1] = np.cos(2 * half)
        turn[:, 1, 0], turn[:, 0, 1], turn[:, 2, 2] = np.sin(2 * half), -np.sin(2 * half), 1.0
        joints = model.joints(angles, turn, shift)
        times = np.arange(n) * 33_333_333 - 300_000_000
        out.append(
            Track(
                name=f"{side} one",
                hand=model.hand,
                time_ns=times,
                frame_index=np.arange(n) + 7,
                observed=joints + rng.normal(0, 0.002, joints.shape),
                confidence=np.ones((n, 21)),
                truth=None,
                angles_raw=angles,
                angles=angles,
                quaternion_raw=quaternion,
                quaternion=quaternion,
                translation_raw=shift,
                translation=shift,
                fitted_joints=joints,
                filtered_joints=joints,
                angle_variance=np.full((n, 20), 1e-4),
                objective=rng.random(n),
                iterations=np.arange(n),
                status=np.full(n, "fitted"),
                reason=np.full(n, ""),
                model=model,
                settings={"filter": "none"},
                version="0.1.0",
                events=tuple(Event(int(t), "info", f"at {t}") for t in times[::4]),
            )
        )
    return out


@contextmanager
def _small_chunks() -> Iterator[None]:
    before, write.CHUNK_BYTES = write.CHUNK_BYTES, 9_000
    try:
        yield
    finally:
        write.CHUNK_BYTES = before


class Study:
    """One recording and all that is right of it.

    Args:
        compression: of its chunks.
        folder: for files.
    """

    def __init__(self, compression: str, folder: Path) -> None:
        whole = folder / "whole.mcap"
        with _small_chunks():
            write_mcap(hands(), whole, mesh=False, compression=compression)
        self.data = whole.read_bytes()
        self.tracks: dict[str, Track] = {track.hand: track for track in read_mcap(whole)}
        self.spans: list[dict[str, Track]] = [
            {t.hand: t for t in read_part(whole, None, *span)} for span in SPANS
        ]
        self.about = _about(info(whole))
        self.end = self.data.rindex(bytes([15, 4, 0, 0, 0, 0, 0, 0, 0]))
        self.path, self.clean = folder / "damaged.mcap", folder / "clean.mcap"
        self.counts: Counter[str] = Counter()

    def damaged(self, rng: random.Random) -> bytes:
        """The file, cut, or changed in a few places; or the part that a writer leaves behind."""
        data = bytearray(self.data if rng.random() < 0.7 else self.data[: self.end])
        how = rng.choice(("cut", "flip", "flip", "flip", "bytes", "zeros", "twice", "without"))
        # the index, the end and the heads of chunks are little of the file, and hurt most
        at = rng.randrange(len(data))
        if rng.random() < 0.4:
            at = rng.randrange(min(self.end, len(data)) - 3000, len(data))
        elif rng.random() < 0.4:
            at = self._head(rng) % len(data)
        size = rng.choice((1, 4, 8, 64, 1000))
        if how == "cut":
            del data[at:]
        elif how == "flip":
            data[at] ^= 1 << rng.randrange(8)
        elif how == "bytes":
            data[at : at + size] = rng.randbytes(len(data[at : at + size]))
        elif how == "zeros":
            data[at : at + size] = bytes(len(data[at : at + size]))
        elif how == "twice":
            data[at:at] = data[at : at + size]
        else:
            del data[at : at + size]
        self.counts[f"made: {how}"] += 1
        return bytes(data)

    def _head(self, rng: random.Random) -> int:
        """A byte of the head of a record outside of chunks."""
        place, heads = 8, []
        while place < self.end:
            heads.append(place)
            place += 9 + int.from_bytes(self.data[place + 1 : place + 9], "little")
        return rng.choice(heads) + rng.randrange(60)

    def run(self, data: bytes) -> None:
        """Read all of a damaged file.

        Raises:
            Wrong: what was read is wrong, and nothing says so; or it took too long.
        """
        if data == self.data:
            return
        self.path.write_bytes(data)
        began = time.process_time()
        self._whole()
        for span, expected in zip(SPANS, self.spans, strict=True):
            self._span(span, expected)
        self._info()
        self._recover()
        took = time.process_time() - began
        if took > SECONDS:
            raise Wrong(f"it took {took:.1f} s")

    def _try(self, what: str, read: Callable[[], Any]) -> tuple[Any, bool]:
        """What comes of it, None for an error; and whether there was a warning."""
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            try:
                found = read()
            except HandtrackError as error:
                if "\n" in str(error) or len(str(error)) > 700:
                    raise Wrong(f"{what}: not one line: {error}") from error
                self.counts[f"{what}: error"] += 1
                return None, True
        if any(not issubclass(w.category, UserWarning) for w in told):
            raise Wrong(f"{what}: a library warns: {told[0].message}")
        self.counts[f"{what}: {'warned' if told else 'the same'}"] += 1
        return found, bool(told)

    def _whole(self) -> None:
        found, warned = self._try("whole", lambda: read_mcap(self.path))
        for track in found or []:
            _compare(track, self.tracks[track.hand], warned, "whole")
        if found is not None and not warned and len(found) != len(self.tracks):
            raise Wrong("whole: a hand is missing")

    def _span(self, span: tuple[float | None, float | None], expected: dict[str, Track]) -> None:
        found, warned = self._try("range", lambda: read_part(self.path, None, *span))
        if found is None:
            return
        if not warned and {t.hand for t in found} != set(expected):
            raise Wrong(f"range {span}: hands {[t.hand for t in found]}")
        for track in found:
            if not warned:
                _compare(track, expected[track.hand], False, f"range {span}")
                continue
            # of a beginning the stretch begins where that does
            _contained(track, self.tracks[track.hand], f"range {span}")

    def _info(self) -> None:
        found, warned = self._try("info", lambda: info(self.path))
        if found is None:
            return
        json.dumps(found, allow_nan=False)
        if found["complete"] and not warned and _about(found) != self.about:
            raise Wrong("info: other numbers")
        for hand in found["hands"].values():
            if hand["frames"] > len(self.tracks[hand["hand"]]):
                raise Wrong("info: more frames than there are")

    def _recover(self) -> None:
        self.clean.unlink(missing_ok=True)
        found, _ = self._try("recover", lambda: recover(self.path, self.clean))
        if found is None:
            if self.clean.exists():
                raise Wrong("recover: it failed and left a file")
            return
        tracks = read_mcap(self.clean)
        for track in tracks:
            _compare(track, self.tracks[track.hand], bool(found.note), "recover")
        if sum(map(len, tracks)) != found.frames:
            raise Wrong("recover: another number of frames")


def _about(found: dict[str, Any]) -> dict[str, Any]:
    """What does not depend on the file's name and size."""
    return {name: value for name, value in found.items() if name not in ("path", "size")}


def _arrays(track: Track) -> dict[str, Any]:
    values = {f.name: getattr(track, f.name) for f in dataclasses.fields(track)}
    return {name: value for name, value in values.items() if isinstance(value, np.ndarray)}


def _compare(track: Track, expected: Track, beginning: bool, what: str) -> None:
    """Whether it is the expected one; or, if that is allowed, its beginning."""
    n = len(track)
    if n > len(expected) or (n < len(expected) and not beginning):
        raise Wrong(f"{what}: {n} frames instead of {len(expected)}")
    _contained(track, expected, what)
    if n and track.time_ns[0] != expected.time_ns[0]:
        raise Wrong(f"{what}: it begins later")
    events = expected.events[: len(track.events)]
    if track.events != events or (not beginning and len(events) != len(expected.events)):
        raise Wrong(f"{what}: other events")


def _contained(track: Track, expected: Track, what: str) -> None:
    """Whether every frame and event is one of the expected ones, to the bit, none left out."""
    places = np.flatnonzero(np.isin(expected.time_ns, track.time_ns))
    if len(places) != len(track) or (np.diff(places) != 1).any():
        raise Wrong(f"{what}: other times")
    theirs = _arrays(expected)
    for name, array in _arrays(track).items():
        if array.tolist() != theirs[name][places].tolist() and not np.array_equal(
            array, theirs[name][places], equal_nan=array.dtype.kind == "f"
        ):
            raise Wrong(f"{what}: {name} differs")
    if (track.name, dict(track.settings)) != (expected.name, dict(expected.settings)):
        raise Wrong(f"{what}: another name or other settings")
    if not set(track.events) <= set(expected.events):
        raise Wrong(f"{what}: other events")
    if len(set(track.events)) != len(track.events):
        raise Wrong(f"{what}: an event twice")


def study(
    compression: str, runs: int, seed: int = 0, until: float | None = None
) -> tuple[Counter[str], list[str]]:
    """Damage a recording again and again.

    Args:
        compression: "lz4", "zstd" or "none".
        runs: how many damaged files.
        seed: of the damage.
        until: stop at this time of `time.monotonic`.

    Returns:
        How often what happened, and what was wrong, a line each with the number of the run.
    """
    wrong = []
    with tempfile.TemporaryDirectory(prefix="handtrack-damage-") as folder:
        made = Study(compression, Path(folder))
        for run in range(runs):
            if until is not None and time.monotonic() > until:
                break
            data = made.damaged(random.Random(f"{compression} {seed} {run}"))
            try:
                made.run(data)
            except Exception as error:  # noqa: BLE001 - whatever comes out is what we look for
                wrong.append(
                    f"{compression}, seed {seed}, run {run}: {type(error).__name__}: {error}"
                )
            made.counts["files"] += 1
    return made.counts, wrong


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=10_000, help="files of each compression")
    parser.add_argument("--seed", type=int, default=0)
    chosen = parser.parse_args()
    failed = False
    for compression in COMPRESSIONS:
        counts, wrong = study(compression, chosen.runs, chosen.seed)
        print(f"{compression}: {len(wrong)} of {counts['files']} files wrong")
        print("  " + ", ".join(f"{name} {count}" for name, count in sorted(counts.items())))
        for line in wrong[:20]:
            print(f"  {line}")
        failed |= bool(wrong)
    return int(failed)


if __name__ == "__main__":
    raise SystemExit(main())
