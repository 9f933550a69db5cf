"""Make clips of rendered hands, look at them, and measure methods on them."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from handtrack.errors import HandtrackError, SettingsError
from tools.bench.rendered.build import (
    LEARN,
    NEXT,
    ROOT,
    SPLITS,
    Plan,
    found_share,
    make,
    plans,
    plans_of,
)
from tools.bench.rendered.layout import read_folder, write

if TYPE_CHECKING:
    from tools.bench.rendered.cases import Case

DATA = ROOT / "tests" / "data" / "rendered"
_MADE = (*SPLITS, LEARN, NEXT)
SHIPPED = ROOT / "handtrack" / "detectors" / "data"


def main(arguments: list[str] | None = None) -> int:
    """Run one of the commands; 2 where input or arguments are wrong."""
    parser = argparse.ArgumentParser(prog="python -m tools.bench.rendered", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    making = commands.add_parser("make", help="draw the clips and let MediaPipe see them")
    making.add_argument(
        "splits", nargs="*", metavar="SPLIT", help=f"{', '.join(_MADE)}; all by default"
    )
    making.add_argument("--motion", type=Path, nargs="+", metavar="FILE", help="joints to move as")
    making.add_argument("-o", "--out", type=Path, default=DATA, help="folder")
    making.add_argument("--cameras", type=int, choices=(1, 2, 3, 4), default=3)
    looking = commands.add_parser("look", help="draw some pictures into one file")
    looking.add_argument("out", type=Path, metavar="OUT.png")
    looking.add_argument(
        "--clips", type=int, nargs="+", default=[0, 1, 2, 3], choices=range(30), metavar="0..29"
    )
    studying = commands.add_parser("study", help="measure raw, smoothed, fitted and filtered")
    studying.add_argument("paths", nargs="*", type=Path, metavar="PATH", help="clips, or folders")
    studying.add_argument(
        "--holdout",
        nargs="?",
        const=SPLITS[-1],
        choices=SPLITS[1:],
        help="clips that were held out; the last ones by default",
    )
    studying.add_argument("--camera", type=int, default=0, help="which one is one camera")
    studying.add_argument("--json", type=Path, metavar="OUT", help="write all numbers")
    studying.add_argument("--only", nargs="+", default=[], metavar="WORD", help="rows named so")
    studying.add_argument(
        "--also",
        nargs=2,
        action="append",
        default=[],
        metavar=("NAME", "JSON"),
        help="a row of one's own: settings of handtrack.track",
    )
    studying.add_argument("--overall", type=Path, metavar="OUT", help="write the summaries alone")
    studying.add_argument("--quick", action="store_true", help="only the first three clips")
    profiling = commands.add_parser("profile", help="make the profiles that ship")
    profiling.add_argument("-o", "--out", type=Path, default=SHIPPED, help="folder")
    tabling = commands.add_parser("tables", help="what each step brings; errors over deviations")
    tabling.add_argument("which", choices=("ladder", "uncertainty"))
    tabling.add_argument("-o", "--out", type=Path, required=True, metavar="OUT.json")
    networks = commands.add_parser("networks", help="depth networks' predictions into clips")
    networks.add_argument("predictions", nargs="+", type=Path, metavar="PREDICTIONS.txt")
    networks.add_argument("--labels", type=Path, required=True, metavar="LABELS.txt")
    networks.add_argument("-o", "--out", type=Path, required=True, help="folder")
    options = parser.parse_args(arguments)
    try:
        if options.command == "make":
            _make(options)
        elif options.command == "look":
            from tools.bench.rendered.sheet import sheet

            sheet(options.out, options.clips)
        elif options.command == "networks":
            _networks(options)
        elif options.command == "profile":
            _profile(options)
        elif options.command == "tables":
            _tables(options)
        else:
            _study(options)
    except HandtrackError as error:
        print(error, file=sys.stderr)
        return 2
    return 0


def _study(options: argparse.Namespace) -> None:
    from rich.console import Console

    from tools.bench.rendered.methods import chosen
    from tools.bench.rendered.study import say, study, write_json, write_overall

    paths = options.paths or [DATA / (options.holdout or SPLITS[0])]
    clips = [clip for path in paths for clip in read_folder(path)]
    others = [] if options.paths or options.holdout else _learnt_from()
    console = Console(width=None if Console().is_terminal else 150)
    with console.status("") as status:
        rows = study(
            clips[:3] if options.quick else clips,
            lambda cases: chosen(cases, options.only, options.also, bool(options.holdout), others),
            options.camera,
            status.update,
        )
    say(rows, console)
    if options.json:
        write_json(rows, options.json)
    if options.overall:
        write_overall(rows, options.overall)


def _profile(options: argparse.Namespace) -> None:
    from tools.bench.rendered.cases import cases
    from tools.bench.rendered.profiles import make_shipped

    tuned = [case for clip in read_folder(DATA / "tune") for case in cases(clip)]
    make_shipped([*tuned, *_learnt_from()], options.out, print)


def _tables(options: argparse.Namespace) -> None:
    from tools.bench.rendered.cases import cases
    from tools.bench.rendered.ladder import ladder, uncertainty, write_table

    def some(split: str, step: int) -> tuple[list[Case], list[Case]]:
        """Every so many of the clips, and all others."""
        given = [list(cases(clip)) for clip in read_folder(DATA / split)]
        rest = [case for i, of in enumerate(given) if i % step for case in of]
        return [case for of in given[::step] for case in of], rest

    if options.which == "ladder":
        measured, rest = some("tune", 5)
        found = ladder(measured, [*rest, *_learnt_from()])
    else:
        measured, rest = some("tune", 7)
        found = uncertainty(measured, [*rest, *_learnt_from()], some(SPLITS[-1], 2)[0])
    write_table(found, options.out)


def _learnt_from() -> list[Case]:
    from tools.bench.rendered.cases import cases

    return [case for clip in read_folder(DATA / LEARN) for case in cases(clip)]


def _networks(options: argparse.Namespace) -> None:
    from tools.bench.rendered.depth_networks import network_clips

    options.out.mkdir(parents=True, exist_ok=True)
    for path in options.predictions:
        clips = network_clips(path, options.labels)
        for clip in clips:
            write(options.out / f"{clip.name}.npz", clip)
        print(f"{path}: {len(clips)} clips in {options.out}")


def _make(options: argparse.Namespace) -> None:
    wanted: list[tuple[str, Plan]] = []
    for path in options.motion or ():
        wanted += [("motion", plan) for plan in plans_of(path)]
    for split in () if options.motion else options.splits or _MADE[:-1]:
        if split not in _MADE:
            raise SettingsError(f"{split} is no split, expected {', '.join(_MADE)}")
        wanted += [(split, plan) for plan in plans(split)]
    from handtrack.video.detector import MediaPipeDetector
    from tools.bench.rendered.raster import Raster
    from tools.bench.rendered.rig import SIZE

    raster = Raster(SIZE)
    for folder, plan in wanted:
        path = options.out / folder / f"{plan.name}.npz"
        if path.exists():
            print(f"{path}: is there already")
            continue
        path.parent.mkdir(parents=True, exist_ok=True)
        clip = make(plan, raster, lambda: MediaPipeDetector(hands=1), options.cameras)
        write(path, clip)
        share = " ".join(f"{100 * x:.0f}" for x in found_share(clip))
        print(f"{path}: {len(clip.time_ns)} frames, right hand found in {share} %", flush=True)


if __name__ == "__main__":
    sys.exit(main())
