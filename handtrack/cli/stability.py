"""handtrack stability."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from handtrack.cli.inputs import Reading, pairs, reading_options, recordings
from handtrack.cli.options import json_option
from handtrack.errors import SettingsError


@click.command(short_help="How accurate and how steady recordings are.")
@click.argument("files", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--truth",
    type=click.Path(path_type=Path),
    help="True joints to measure against; FILES may then be joint sequences too.",
)
@json_option
@reading_options
def stability(files: tuple[Path, ...], truth: Path | None, as_json: bool, **reading: Any) -> None:
    """How accurate and how steady recordings are: PA-MPJPE mean and std, jitter.

    FILES are recordings written by `handtrack track`, or folders of them. They are measured
    against the truth that they hold, else against the observed joints. With --truth any joint
    sequences can be measured; the options on units, order, hand and frames are for those.
    """
    import handtrack as ht
    from handtrack.evaluation.report import print_table, to_json

    given = Reading(**reading)
    if truth is not None:
        from handtrack.evaluation.stability import stability_of_pairs

        report = stability_of_pairs(pairs(files, truth, given))
    else:
        if given != Reading():
            raise SettingsError("--frames, --hand, --unit, --order and --fps need --truth here")
        found = [(f, t) for f in recordings(files) for t in ht.read_mcap(f)]
        count = Counter(t.name for _, t in found)
        # recordings of joints.npz and joints.npz are told apart by their files
        report = ht.stability(
            [replace(t, name=f"{f.stem} {t.name}") if count[t.name] > 1 else t for f, t in found]
        )
    if as_json:
        click.echo(to_json(report))
    else:
        print_table(report)
