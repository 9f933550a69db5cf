"""handtrack audit."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from handtrack.cli.helping import Command
from handtrack.cli.inputs import Reading
from handtrack.cli.models import mano_options
from handtrack.cli.options import json_option, quiet_option, reading_options
from handtrack.cli.outputs import check_target, overwrite_option
from handtrack.files.whole import whole_file

if TYPE_CHECKING:
    from handtrack import Sequence
    from handtrack.auditing.findings import Audited
    from handtrack.auditing.reading import DataSet


@click.command(cls=Command, short_help="What cannot be true of joint sequences; the worst first.")
@click.argument("data", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option("--mask", type=click.Path(path_type=Path), help="Write what to leave out, .parquet.")
@click.option("--html", type=click.Path(path_type=Path), help="Write a page with pictures, .html.")
@click.option("--no-fit", is_flag=True, help="Calibrate no hand: quicker, and no residual.")
@overwrite_option
@mano_options
@reading_options
@json_option
@quiet_option
def audit(
    data: tuple[Path, ...],
    mask: Path | None,
    html: Path | None,
    no_fit: bool,
    as_json: bool,
    quiet: bool,
    **reading: Any,
) -> None:
    """Rank the sequences of DATA by what cannot be true of them.

    DATA are joint files in any format that `track` reads, or folders of them. Looked for: bones
    that jump or breathe, the other hand's fingers, bends beyond limits, shakes (the whole hand's
    apart from the fingers'), repeated frames, exchanged identities, another unit or joint order,
    time that jumps, hands and joints that are suddenly elsewhere, and what a calibrated hand
    leaves beside what any hand of rigid bones would.

    The mask has a row for every joint of every frame in which something was found: sequence,
    source, hand, frame, time_ns, joint, reason.
    """
    from handtrack.auditing.audit import audit as find
    from handtrack.auditing.findings import mask_table
    from handtrack.auditing.people import people

    for path, suffix, option in ((mask, ".parquet", "--mask"), (html, ".html", "--html")):
        if path is not None:
            check_target(path, suffix, option, list(data))
    given = Reading(**reading)
    sequences, unread = _read(data, given, quiet or as_json)
    audits = find(sequences, fit=not no_fit)
    if as_json:
        told = {
            "sequences": [a.to_dict() for a in audits],
            "unread": [u.to_dict() for u in unread],
            "people": people(audits),
        }
        click.echo(json.dumps(told, indent=2))
    elif not quiet:
        _print(audits)
        for one in unread:
            click.echo(f"not read: {one.error}")
        _print_people(people(audits))
    if html is not None:
        from handtrack.auditing.page import to_html

        with whole_file(html) as part:
            part.write_text(to_html(audits, unread), encoding="utf-8")
    if mask is not None:
        import pyarrow.parquet as pq

        with whole_file(mask) as part:
            pq.write_table(mask_table(audits), part)
    for path in (html, mask):
        if path is not None and not quiet:
            click.echo(f"wrote {path}", err=as_json)


def _read(data: tuple[Path, ...], reading: Reading, quiet: bool) -> DataSet:
    from handtrack.auditing.reading import read_data

    def detect(path: Path) -> list[Sequence]:
        return reading.load(path, quiet)

    found = read_data(data, detect, **reading.load_options)
    reading.say_notes(found.sequences, quiet)
    return found


def _print(audits: list[Audited]) -> None:
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD)
    for heading in ("sequence", "hand"):
        table.add_column(heading, overflow="fold")
    for heading in ("frames", "marked", "score"):
        table.add_column(heading, justify="right")
    table.add_column("found")
    for a in audits:
        kinds = ", ".join(f"{f.kind} ({f.frames:,})" for f in a.findings) or "nothing"
        share = f"{100 * a.share:.1f} %"
        table.add_row(a.name, a.hand, f"{len(a.time_ns):,}", share, f"{a.score:.2f}", kinds)
    console = Console()
    console.print(table)
    for a in audits:
        for f in a.findings:
            where = int(a.frame_index[int(f.marks.any(1).argmax())])
            console.print(
                f"{a.name} ({a.hand}), {f.kind}, from frame {where}: {f.text}",
                markup=False,
                highlight=False,
                soft_wrap=True,
            )


def _print_people(folders: list[dict[str, Any]]) -> None:
    from handtrack.auditing.findings import some
    from handtrack.auditing.people import APART

    for of in folders:
        groups = " | ".join(some(group) for group in of["people"][:4])
        click.echo(
            f"{of['folder']}: hands of {len(of['people'])} people (no fault by itself), bones of"
            f" the first two differ by {of['apart_percent']} %,"
            f" {100 * APART:.0f} % is let pass: {groups}"
        )
