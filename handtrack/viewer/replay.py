"""Recordings in the viewer: in a window, in a browser, in a running viewer, or as an .rrd file."""

from __future__ import annotations

import subprocess
import tempfile
import webbrowser
from collections.abc import Callable, Sequence
from pathlib import Path

from handtrack.errors import HandtrackError, SettingsError
from handtrack.hand.limits import Limits, preset
from handtrack.recording.read import read_part
from handtrack.viewer.blueprint import blueprint, placed
from handtrack.viewer.eye import Seen, eye
from handtrack.viewer.live_viewer import DEFAULT_ADDRESS, connected, stream
from handtrack.viewer.process import (
    free_port,
    grpc_address,
    page_address,
    sigterm_as_exit,
    until_closed,
    viewer,
    wait_for,
)
from handtrack.viewer.rerun_log import log_hands, save_hands
from handtrack.viewer.sending import send_blueprint
from handtrack.viewer.shown import Run, Shown, on_one_clock, shown
from handtrack.viewer.style import Look

MOST_SKINS = 20_000
"""More frames are shown without the skin, unless it is asked for: a viewer needs 56 kB for each."""

MOST_APART = 3
"""More files than that are shown in one world: their views would be too small."""


def replay(
    paths: str | Path | Sequence[str | Path],
    *,
    save: str | Path | None = None,
    web: bool = False,
    connect: str | None = None,
    speed: float | None = None,
    port: int | None = None,
    open_viewer: bool = True,
    hand: str | None = None,
    start_s: float | None = None,
    end_s: float | None = None,
    mesh: bool | None = None,
    limits: Limits | str | None = None,
    side_by_side: bool | None = None,
    offset_m: float = 0.0,
    light: bool = False,
    still: bool = False,
    say: Callable[[str], None] = print,
) -> Path | None:
    """Show what MCAP files hold.

    The viewer runs as a child process that ends with this call; nothing listens on any
    address but 127.0.0.1. Without `save` and `connect` this returns when the viewer is closed
    or, for the browser, on Ctrl-C.

    Several files are shown side by side, each in its own colour, the first run's hands
    compared with those of the others: angles in the same plots, distances between the joints.
    Those that do not overlap in time start together.

    Args:
        paths: one file or several.
        save: write this .rrd file and open nothing.
        web: serve the viewer for a browser.
        connect: send to the viewer that runs at this address, HOST:PORT; "" for the one that
            `rerun` starts.
        speed: send the frames in recorded time, so many times as fast, instead of all at once.
        port: port of the browser's page; a free one by default.
        open_viewer: with `web`, open the address in the browser too.
        hand: "left" or "right", to show only those.
        start_s, end_s: first and last time, from the start of each recording [s].
        mesh: draw the skin; by default up to `MOST_SKINS` frames.
        limits: limits to draw and to hold the angles against, by name or as such; those that
            the hand was fitted with by default.
        side_by_side: 3D views for each file, or all files in one world, later ones seen
            through; by default side by side, up to `MOST_APART` files.
        offset_m: move each file's hands so far to the right of those before [m], in one world.
        light: draw on a light ground.
        still: the eye stays where it is; otherwise it goes along with a hand that goes far.
        say: is told, with `web`, the address once it answers, and what else matters.

    Returns:
        The file saved, if any.

    Raises:
        InputError: a file can't be read; see `read_mcap`.
        SettingsError: no file is given, options do not go together, or the port is taken.
        HandtrackError: the viewer can't be started or reached, or writing failed.
    """
    paths = [paths] if isinstance(paths, str | Path) else list(paths)
    if not paths:
        raise SettingsError("there is no file to replay")
    if (save is not None) + web + (connect is not None) > 1:
        raise SettingsError("save to a file, serve a browser or connect to a viewer: choose one")
    if save is not None and speed is not None:
        raise SettingsError("a file has no speed: the viewer's own control sets it")
    if speed is not None and not speed > 0:
        raise SettingsError(f"the speed is {speed:g}, expected more than 0")
    if side_by_side and offset_m:
        raise SettingsError("hands in views of their own need no offset: side by side, or offset")
    limits = preset(limits) if isinstance(limits, str) else limits
    page = free_port(port) if web else None
    runs = [Run(Path(p).stem, read_part(p, hand, start_s, end_s)) for p in paths]
    runs, moved = on_one_clock(runs)
    if moved:
        say("the recordings do not overlap in time: they are shown as if they began together")
    if side_by_side is None:
        side_by_side = not offset_m and len(runs) <= MOST_APART
    hands = _offset(shown(runs), offset_m, through=not side_by_side)
    frames = sum(len(h.track) for h in hands)
    if mesh is None:
        mesh = frames <= MOST_SKINS
        if not mesh and any(h.track.n_vertices for h in hands):
            say(f"{frames:,} frames are shown without the skin; --mesh draws it")
    look = Look(mesh, limits, light, side_by_side, still)
    if save is not None:
        return save_hands(hands, Path(save), look)
    show = _Show(hands, look, speed)
    with sigterm_as_exit():
        try:
            if connect is not None:
                show.send(connect or DEFAULT_ADDRESS)
            elif page is not None:
                _serve(show, page, say, open_viewer)
            else:
                _window(show)
        except KeyboardInterrupt:
            # how a user says that it is enough
            return None
    return None


def _offset(hands: list[Shown], offset_m: float, through: bool) -> list[Shown]:
    """Each run's hands so far to the right of those of the run before, or over them."""
    if not offset_m:
        return [hand._replace(pale=through and hand.run > 0) for hand in hands]
    right = eye([Seen.of(hand.track) for hand in hands if hand.run == 0]).right
    return [hand._replace(offset=tuple((offset_m * hand.run * right).tolist())) for hand in hands]


class _Show:
    """What is shown, and how."""

    def __init__(self, hands: list[Shown], look: Look, speed: float | None) -> None:
        self.hands, self._look, self.speed = hands, look, speed

    def save(self, path: Path) -> None:
        """Into a file."""
        save_hands(self.hands, path, self._look)

    def send(self, address: str, process: subprocess.Popen[bytes] | None = None) -> None:
        """To a viewer, as long as its process runs, if that is known."""
        at = placed(self.hands, self._look)
        arranged = blueprint(self.hands, self._look, follow=self.speed is not None, at=at)
        names = dict.fromkeys(hand.run_name for hand in self.hands)
        with connected(address, process, name=", ".join(names)) as recording:
            send_blueprint(recording, arranged)
            if self.speed is None:
                log_hands(recording, self.hands, self._look, at=at)
            else:
                stream(
                    recording,
                    self.hands,
                    self.speed,
                    self._look,
                    at=at,
                    going_on=lambda: process is None or process.poll() is None,
                )


def _window(show: _Show) -> None:
    """The native viewer, until it is closed."""
    port = free_port()
    with tempfile.TemporaryDirectory(prefix="handtrack-") as folder:
        if show.speed is None:
            file = Path(folder) / f"{show.hands[0].run_name or 'recording'}.rrd"
            show.save(file)
            with viewer(file, "--port", str(port)) as process:
                until_closed(process)
            return
    with viewer("--port", str(port), "--hide-welcome-screen") as process:
        wait_for(process, port)
        show.send(grpc_address(port), process)
        until_closed(process)


def _serve(show: _Show, page: int, say: Callable[[str], None], open_browser: bool) -> None:
    """The viewer for browsers, until Ctrl-C."""
    data = free_port(but=page)
    with tempfile.TemporaryDirectory(prefix="handtrack-") as folder:
        ports: list[str | Path] = ["--port", str(data), "--web-viewer-port", str(page)]
        if show.speed is None:
            file = Path(folder) / "recording.rrd"
            show.save(file)
            # the server drops what exceeds its memory: the whole recording must fit
            limit = f"{max(1, 2 * file.stat().st_size >> 30)}GiB"
            ports = [file, *ports, "--server-memory-limit", limit]
        with viewer("--serve-web", *ports) as process:
            wait_for(process, page)
            address = page_address(page, data)
            say(address)
            if open_browser:
                webbrowser.open(address)
            if show.speed is not None:
                show.send(grpc_address(data), process)
            code = process.wait()
    raise HandtrackError(f"the viewer's server ended with status {code}")
