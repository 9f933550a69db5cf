"""handtrack diff."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from handtrack.cli.helping import Command
from handtrack.cli.options import json_option, quiet_option

if TYPE_CHECKING:
    from handtrack.evaluation.difference import Difference


@click.command(cls=Command, short_help="What differs between two recordings.")
@click.argument("a", type=click.Path(path_type=Path))
@click.argument("b", type=click.Path(path_type=Path))
@click.option(
    "--tolerance-deg",
    type=click.FloatRange(min=0),
    default=0.01,
    show_default=True,
    help="How far an angle may differ.",
)
@click.option(
    "--tolerance-mm",
    type=click.FloatRange(min=0),
    default=0.01,
    show_default=True,
    help="How far a joint may differ.",
)
@json_option
@quiet_option
def diff(
    a: Path, b: Path, tolerance_deg: float, tolerance_mm: float, as_json: bool, quiet: bool
) -> int:
    """What differs between recordings A and B, per angle and joint; exit status 1 if too much.

    Hands belong together by name and side, frames by number, else by time. What only one of the
    two has a pose for is beyond any tolerance; settings and statuses are told, not judged.
    """
    import handtrack as ht
    from handtrack.evaluation.difference import differences

    found = differences(ht.read_mcap(a), ht.read_mcap(b))
    within = all(d.within(tolerance_deg, tolerance_mm) for d in found)
    if as_json:
        hands = [d.to_dict() for d in found]
        click.echo(json.dumps({"a": str(a), "b": str(b), "within": within, "hands": hands}))
    elif not quiet:
        for each in found:
            _print(each)
        limits = f"{tolerance_deg:g} deg and {tolerance_mm:g} mm"
        click.echo(f"{'within' if within else 'beyond'} {limits}")
    return 0 if within else 1


def _print(d: Difference) -> None:
    first, second, common = d.frames
    frames = (
        f"{common:,} frames"
        if first == second == common
        else (f"{common:,} frames in common, of {first:,} and {second:,}")
    )
    click.echo(f"{d.name} ({d.hand}): {frames}")
    if d.same:
        click.echo("  every array is the same, to the bit")
    for name, (x, y) in d.settings.items():
        click.echo(f"  {name}: {x} -> {y}")
    if d.bones_mm:
        click.echo(f"  bones of the hand: up to {d.bones_mm:.4g} mm")
    if d.statuses:
        click.echo(f"  status: differs in {d.statuses:,} frames")
    if d.one_sided:
        click.echo(f"  a pose in only one of the two: {d.one_sided:,} frames")
    if d.same:
        return
    rows = [("root turn", d.root_deg, "deg")]
    rows += [(name, change, "deg") for name, change in d.angles_deg.items()]
    rows += [(name, change, "mm") for name, change in d.joints_mm.items()]
    rows = [row for row in rows if row[1].max > 0]
    width = max((len(name) for name, _, _ in rows), default=0)
    for name, change, unit in rows:
        click.echo(f"  {name:{width}}  mean {change.mean:9.4f}  max {change.max:9.4f} {unit}")
