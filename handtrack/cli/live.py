"""handtrack live."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.config import used_config
from handtrack.cli.helping import Command
from handtrack.cli.live_view import connect_option
from handtrack.cli.models import Models, hand_model_option, model_options, take_models
from handtrack.cli.options import (
    json_option,
    quiet_option,
    recording_options,
    take_recording,
    take_tracking,
    tracking_options,
)
from handtrack.cli.outputs import RECORDINGS, check_target, overwrite_option
from handtrack.cli.progress import compiling_said, warm_up
from handtrack.errors import HandtrackError, SettingsError
from handtrack.hand.units import METRES

if TYPE_CHECKING:
    from handtrack.hand.skeleton import Hand
    from handtrack.live.lines import BadLines, LiveFrame
    from handtrack.live.publish import Publisher
    from handtrack.live.sinks import ViewerSink
    from handtrack.live.sources import Newest
    from handtrack.tracking.frame import TrackedFrame
    from handtrack.tracking.settings import TrackSettings
    from handtrack.tracking.tracker import Tracker
    from handtrack.viewer.live_viewer import LiveViewer


@click.command(cls=Command, short_help="Track a camera, or joints that arrive, as it happens.")
@click.option("--camera", type=click.IntRange(0), metavar="NUMBER", help="A camera here: 0, 1, ...")
@click.option("--video", type=click.Path(path_type=Path), help="A video, in its own time.")
@click.option("--stdin", is_flag=True, help="Lines of joints on standard input, JSON or text.")
@click.option("--udp", metavar="[HOST:]PORT", help="The same in datagrams; here only by default.")
@click.option("-o", "--output", type=click.Path(path_type=Path), help="MCAP file to record.")
@overwrite_option
@click.option(
    "--publish",
    metavar="ADDRESS",
    help="Send poses on as JSON lines: udp:[HOST:]PORT, zmq:[HOST:]PORT, ws://[HOST:]PORT;"
    " this machine by default.",
)
@click.option(
    "--publish-format",
    type=click.Choice(["json", "protobuf"]),
    default="json",
    show_default=True,
    help="Of what is sent: lines of JSON, or handtrack.State of one --hand, as in recordings.",
)
@click.option("--no-view", is_flag=True, help="Open no viewer.")
@connect_option
@click.option("--hand", type=click.Choice(["left", "right"]), help="Only this hand.")
@click.option("--unit", type=click.Choice([*METRES]), help="Unit of the joints.")
@click.option("--order", metavar="NAME", help="Joint order, where the joints do not say.")
@click.option("--model", type=click.Path(path_type=Path), help="A hand_landmarker.task.")
@model_options
@hand_model_option
@tracking_options
@recording_options
@json_option
@quiet_option
def live(
    camera: int | None,
    video: Path | None,
    stdin: bool,
    udp: str | None,
    output: Path | None,
    publish: str | None,
    publish_format: str,
    no_view: bool,
    connect: str | None,
    hand: Hand | None,
    unit: str | None,
    order: str | None,
    model: Path | None,
    as_json: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Detect, track, show and record at once, until the source ends or Ctrl-C.

    Pictures and datagrams that come faster than they can be tracked are dropped, the oldest
    first, and counted; a pipe waits. A line that is wrong is counted and left out. A JSON line
    is an object as `handtrack track` reads them from .jsonl files: joints_m (21 x 3), hand,
    time_ns; without a time it is stamped with when it comes. Lines of text such as "Right
    landmarks:, 63 numbers", with "Right wrist:, 7 numbers" before, are read as Hand Tracking
    Streamer sends them.
    """
    sources = [camera is not None, video is not None, stdin, udp is not None]
    if sum(sources) != 1:
        raise SettingsError("choose one source: --camera, --video, --stdin or --udp")
    binary = publish_format == "protobuf"
    if binary and publish is None:
        raise SettingsError("--publish-format protobuf is for --publish: say where to")
    if binary and hand is None:
        raise SettingsError(
            "--publish-format protobuf: a State does not name its hand, say --hand left or"
            " --hand right"
        )
    if no_view and connect is not None:
        raise SettingsError("--no-view opens no viewer and --connect sends to one: choose one")
    if video is not None:
        from handtrack.video.media import count as checked

        checked(video)
    if output is None:
        output = _free_name()
    check_target(output, ".mcap", "-o")
    (settings, limits), recording = take_tracking(options), take_recording(options)
    if settings.filter.name == "rts":
        raise SettingsError("--filter rts needs the whole sequence: choose kalman or fixed-lag")
    calibrate = settings.calibration.method is True
    models = take_models(options, limits)
    from handtrack import Tracker
    from handtrack.live.lines import BadLines
    from handtrack.live.live import LiveCount, run_live
    from handtrack.live.publish import publisher
    from handtrack.live.sinks import CAMERA, RecorderSink, ViewerSink
    from handtrack.viewer.live_viewer import LiveViewer

    silent = quiet or as_json
    bad = BadLines(lambda text: None if silent else click.echo(f"warning: {text}", err=True))
    with ExitStack() as stack:
        with compiling_said(quiet or as_json):
            warm_up(settings)
        pictures = [CAMERA] if camera is not None or video is not None else []
        viewer = LiveViewer(connect, mesh=bool(recording.mesh.every), pictures=pictures)
        shown = ViewerSink(viewer)
        queue, frames, source = _source(
            camera, video, udp, (hand, unit, order, model), quiet, stack, bad, shown
        )
        output.parent.mkdir(parents=True, exist_ok=True)
        sinks: list[Any] = [
            stack.enter_context(RecorderSink(output, source, recording, used_config()))
        ]
        if not no_view and _shown(viewer, connect, quiet or as_json, stack):
            sinks.append(shown)
        send = None
        if publish is not None:
            out = stack.enter_context(publisher(publish, binary))
            send = partial(_send, out, binary)
            if not quiet:
                click.echo(f"publishing to {out.address}", err=True)
        # a subject's own hand, and MANO's, stay as they are given
        given = models.file is not None or models.base[0] == "mano"
        said = "mediapipe" if camera is not None or video is not None else ""
        recalibrated = partial(Tracker, settings=settings) if calibrate and not given else None
        count: LiveCount = run_live(
            (_only(frame, hand) for frame in frames),
            lambda side, size: _tracker(models, side, size, settings, said),
            sinks,
            recalibrated=recalibrated,
            waits=camera is None and video is None and udp is None,
            dropped=lambda: queue.dropped,
            publish=send,
        )
        count.bad = bad.count
        queue.end()
    if as_json:
        click.echo(json.dumps(count.to_dict() | {"output": str(output)}))
    elif not quiet:
        click.echo(f"{count.sentence} -> {output}")
    if bad.first is not None and not count.frames:
        raise bad.first
    if not any(count.seen.values()):
        raise HandtrackError(f"no hand was seen in {count.frames:,} frames")


def _shown(viewer: LiveViewer, connect: str | None, quiet: bool, stack: ExitStack) -> bool:
    """Whether the viewer could be opened; without a display all else goes on.

    Raises:
        HandtrackError: the viewer that was to be connected to is not there.
    """
    try:
        stack.enter_context(viewer)
    except HandtrackError as error:
        if connect is not None:
            raise
        if not quiet:
            click.echo(f"warning: {error}; going on as with --no-view", err=True)
        return False
    return True


def _send(out: Publisher, binary: bool, frame: TrackedFrame, hand: Hand, index: int) -> None:
    from handtrack.live.publish import message_of, state_of

    out.send(state_of(frame, index) if binary else message_of(frame, hand, index))


def _free_name() -> Path:
    """recordings/live.mcap, or with the first number of which there is none yet."""
    names = ("live.mcap", *(f"live-{n}.mcap" for n in range(2, 100_000)))
    return next(path for name in names if not (path := RECORDINGS / name).exists())


def _source(
    camera: int | None,
    video: Path | None,
    udp: str | None,
    said: tuple[Hand | None, str | None, str | None, Path | None],
    quiet: bool,
    stack: ExitStack,
    bad: BadLines,
    shown: ViewerSink,
) -> tuple[Newest[Any], Iterator[LiveFrame], str]:
    """Where frames wait, the hands in them, and what that is."""
    from handtrack.live import sources as live_frames
    from handtrack.live.lines import from_lines
    from handtrack.live.live import from_pictures

    hand, unit, order, model = said
    if camera is not None or video is not None:
        from handtrack.video.detector import MediaPipeDetector

        detector = MediaPipeDetector(model)
        stack.callback(detector.close)
        if video is not None:
            pictures = live_frames.file_in_real_time(video)
        else:
            pictures = live_frames.camera(camera or 0)
        name = f"camera {camera}" if video is None else str(video)
        return pictures, from_pictures(pictures, detector, shown.see), name
    from handtrack.sequences.assemble import check_settings

    given = check_settings(unit, order, None)
    if udp is None:
        lines = live_frames.lines()
        return lines, from_lines(lines, "standard input", given, hand, bad), "standard input"
    lines, (host, port) = live_frames.datagrams(udp)
    if not quiet:
        click.echo(f"listening on {host}:{port}, Ctrl-C ends", err=True)
    name = f"{host}:{port}"
    return lines, from_lines(lines, name, given, hand, bad), name


def _only(frame: LiveFrame, hand: Hand | None) -> LiveFrame:
    if hand is None:
        return frame
    joints = {side: x for side, x in frame.joints.items() if side == hand}
    return replace(frame, joints=joints)


def _tracker(
    models: Models, hand: Hand, size: float, settings: TrackSettings, said: str
) -> Tracker:
    from handtrack import HandModel, Tracker
    from handtrack.detectors.chosen import chosen_profile

    model = models.of(hand)
    profile = chosen_profile(settings.detector, said)
    if profile is not None:
        model = profile.on(model)
    if models.file is not None:  # a subject's own hand has its size
        return Tracker(model, settings=settings, profile=profile)
    # as large as the hand that is seen
    ratio = size * HandModel.default(hand).size / model.size
    return Tracker(model.scaled(ratio), settings=settings, profile=profile)
