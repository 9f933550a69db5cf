"""A real viewer without a screen, for the tests that look at its pictures."""

from __future__ import annotations

import io
import os
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from handtrack.viewer.process import free_port, grpc_address, viewer, wait_for

MUST_RUN = "HANDTRACK_MUST_RUN"
"""Names what is installed: a test that lacks one of these fails instead of being skipped."""


def lacking(what: str, reason: str) -> None:
    """Skip the test; where the environment says that this is installed, fail."""
    if what in os.environ.get(MUST_RUN, "").split():
        pytest.fail(f"{what} is installed, but: {reason}")
    pytest.skip(f"no {what}: {reason}")


def pictures_wanted() -> bool:
    """Whether HANDTRACK_PICTURES says where pictures are kept."""
    return bool(os.environ.get("HANDTRACK_PICTURES"))


def keep(name: str, data: bytes) -> None:
    """A picture NAME.png, kept where HANDTRACK_PICTURES says."""
    if folder := os.environ.get("HANDTRACK_PICTURES"):
        Path(folder).mkdir(parents=True, exist_ok=True)
        (Path(folder) / f"{name}.png").write_bytes(data)


class Screen:
    """A viewer without a screen.

    Attributes:
        client: to control it.
        pid: of its process.
        address: HOST:PORT that it listens on.
    """

    def __init__(self, client: Any, pid: int, port: int) -> None:
        self.client, self.pid = client, pid
        self.address = f"127.0.0.1:{port}"

    def picture(self, name: str = "") -> np.ndarray:
        """(height, width, 3) of what the viewer shows; kept where HANDTRACK_PICTURES says."""
        image = pytest.importorskip("PIL.Image")
        data = self.client.take_screenshot(max_size=1600 if name else 960)
        if name:
            keep(name, data)
        return np.asarray(image.open(io.BytesIO(data)).convert("RGB"), int)

    def until(self, there: Callable[[np.ndarray], bool], seconds: float = 30) -> np.ndarray:
        """The first picture that shows something, or the last one."""
        deadline = time.monotonic() + seconds
        picture = self.picture()
        while not there(picture) and time.monotonic() < deadline:
            time.sleep(0.1)
            picture = self.picture()
        return picture


@contextmanager
def started(said: Path) -> Iterator[Screen]:
    """An empty viewer that has drawn a picture.

    Args:
        said: a file for what it says.

    Raises:
        HandtrackError: it ended, or does not answer.
        RuntimeError: it draws nothing.
    """
    from rerun.experimental import ViewerClient

    port = free_port()
    with (
        said.open("wb") as errors,
        viewer(
            *("--headless", "--hide-welcome-screen", "--port", str(port)),
            errors=errors,
        ) as process,
    ):
        wait_for(process, port)
        screen = Screen(ViewerClient(grpc_address(port)), process.pid, port)
        screen.client.take_screenshot(max_size=96)
        yield screen


def own_reason(said: Path) -> str:
    """What a viewer that failed says of it, in a line; "" if it said nothing."""
    lines = said.read_text(errors="replace").splitlines() if said.exists() else []
    told = [line for line in lines if re.search("panicked at|error|ERROR", line)]
    return (told or [line for line in lines if line] or [""])[0].strip()
