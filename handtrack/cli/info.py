"""handtrack info."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import recordings
from handtrack.cli.options import json_option, quiet_option
from handtrack.errors import shown


@click.command(cls=Command, short_help="What recordings hold.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--follow", is_flag=True, help="Tell what comes, while FILE is being written.")
@json_option
@quiet_option
def info(files: tuple[Path, ...], follow: bool, as_json: bool, quiet: bool) -> None:
    """What recordings hold: hands, frames, rate, settings, statuses, errors, sizes.

    FILES are recordings written by `handtrack track`, or folders of them; only their indexes are
    read. A file that is still being written (NAME.mcap.part) is read as far as it goes.
    """
    if follow:
        for file in files:
            _follow(file, as_json)
        return
    from handtrack.recording.info import info as look

    found = [look(path) for path in recordings(files)]
    if as_json:
        click.echo(json.dumps(found, indent=2))
        return
    for i, about in enumerate(found if not quiet else ()):
        if i:
            click.echo()
        _print(about)


def _print(about: dict[str, Any]) -> None:
    from handtrack.tracking.settings import reprojection_px

    chunks = f"{about['chunks']:,} chunks of {about['compression']}"
    version = shown(about["version"])
    click.echo(
        f"{about['path']}: {_bytes(about['size'])}, {chunks}, format {about['format_version']},"
        f" handtrack {version}"
    )
    if not about["complete"]:
        click.echo(f"  not complete: {about['note']}")
    for topic, hand in about["hands"].items():
        name, model = shown(hand["name"]), shown(hand["model"])
        click.echo(f"  {shown(topic)}: {name}, {hand['hand']} hand, model {model}")
        seconds = (hand["last_ns"] - hand["first_ns"]) * 1e-9 if hand["frames"] else 0.0
        rate = f", {hand['fps']:.2f} frames/s" if hand["fps"] else ""
        click.echo(f"    {hand['frames']:,} frames, {seconds:.2f} s{rate}")
        counts = [f"{hand[name]:,} {name}" for name in ("fitted", "predicted", "lost")]
        click.echo(
            f"    {', '.join(counts)}; {hand['events']:,} events, {hand['warnings']} warnings"
        )
        pixels = reprojection_px(hand["settings"])
        for against, error in hand["error_mm"].items():
            if against == "observed" and pixels is not None:
                continue  # what was observed is in pictures
            numbers = ", ".join(
                f"{name} {'beyond all numbers' if value is None else f'{value:.2f}'}"
                for name, value in error.items()
            )
            click.echo(f"    error to the {shown(against)} joints, mm: {numbers}")
        _print_reasons(hand["settings"])
        if pixels is not None:
            numbers = ", ".join(f"{shown(name)} {_short(value)}" for name, value in pixels.items())
            views = hand["settings"]["cameras"].get("views")
            click.echo(f"    reprojection error in {views} cameras, px: {numbers}")
        settings = ", ".join(
            f"{shown(name)} {_short(value)}"
            for name, value in hand["settings"].items()
            if value is not None and value != {}
        )
        click.echo(f"    settings: {settings}")
    width = max((len(shown(topic)) for topic in about["topics"]), default=0)
    for topic, of in sorted(about["topics"].items(), key=lambda item: -(item[1]["bytes"] or 0)):
        size = "" if of["bytes"] is None else _bytes(of["bytes"])
        schema = shown(of["schema"])
        click.echo(f"  {shown(topic):{width}}  {of['messages']:>9,}  {size:>9}  {schema}")


def _print_reasons(settings: dict[str, Any]) -> None:
    """Whose landmarks the joints were taken for, and what the calibrated hand leaves of them."""
    if "detector" in settings:
        from handtrack.detectors.chosen import told as detector_told

        click.echo(f"    landmarks as of {detector_told(settings)}")
    calibration = settings.get("calibration")
    if isinstance(calibration, dict):
        from handtrack.calibration.split import told as split_told

        if text := split_told(calibration):
            click.echo(f"    {text}")


def _short(value: Any, depth: int = 3) -> str:
    if isinstance(value, dict | list) and (not depth or len(value) > 20):
        return f"({len(value)} of them)"
    if isinstance(value, dict):
        return f"({', '.join(f'{shown(k)} {_short(v, depth - 1)}' for k, v in value.items())})"
    if isinstance(value, list):
        if len(value) > 6:
            return f"({len(value)} of them)"
        return f"[{', '.join(_short(v, depth - 1) for v in value)}]"
    if value is None or isinstance(value, bool):
        return {None: "none", True: "yes", False: "no"}[value]
    return f"{value:.6g}" if isinstance(value, float) else shown(str(value))


def _bytes(size: float) -> str:
    for unit in ("B", "kB", "MB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.2f} GB"


def _follow(file: Path, as_json: bool) -> None:
    import numpy as np

    from handtrack import follow_mcap

    for part in follow_mcap(file):
        error = float(np.nanmean(part.error)) * 1e3 if np.isfinite(part.error).any() else None
        last = {
            "name": part.name,
            "hand": part.hand,
            "frames": len(part),
            "frame_index": int(part.frame_index[-1]),
            "time_ns": int(part.time_ns[-1]),
            "status": str(part.status[-1]),
            "error_mm": error,
        }
        if as_json:
            click.echo(json.dumps(last))
        else:
            mean = "" if error is None else f", error {error:.2f} mm"
            click.echo(
                f"{part.name} {part.hand}: {len(part)} frames to {last['frame_index']},"
                f" {last['status']}{mean}"
            )
