"""Help that people can read: options in groups, the ones needed first on top, examples."""

from __future__ import annotations

import os
from collections import Counter
from difflib import get_close_matches
from typing import Any

import click

from handtrack.cli.config import config_options, save_config

FEW = 12
"""A command with no more options than these has them in one list."""
_FIRST = "Options that people need first"
TEN = 10
"""At most so many are among these; what is over stands in its other group."""
_LAST = ("quiet", "help", "_click_default_help")
_GROUPS = {
    _FIRST: (
        *("output", "overwrite", "filter", "camera", "overlay", "video", "stdin", "udp"),
        *("publish", "hand", "unit", "fps", "finger", "joint", "truth", "compare", "html"),
        *("save", "web", "to"),
        *("workers", "as_json", "order", "rrd", "live"),
        *_LAST,
    ),
    "Input": (
        *("hand", "unit", "fps", "board_unit", "image_size", "fov", "no_picture"),
        *(
            "order",
            "frames",
            "format",
            "key",
            "columns",
            "time_unit",
            "mirror",
            "max_size",
            "profile",
        ),
        *("trajectory", "markers", "no_repair", "start", "end", "match", "model"),
    ),
    "The data set": (
        *("subject", "no_pool", "own_columns", "no_recordings", "exports", "scheduler"),
        *("dry_run", "retry_failed"),
    ),
    "The hand": ("hand_model", "calibrate", "detector", "mano", "mano_tips", "gltf", "limits"),
    "The recording": (
        "rrd",
        "as_json",
        "mesh",
        "no_mesh",
        "compression",
        "foxglove_mesh",
        "csv",
        "latex",
    ),
    "The viewer": (
        *("connect", "no_view", "speed", "port", "no_open", "side_by_side", "offset", "still"),
        *("live", "light", "overlay_skin"),
    ),
    "What is written": ("up", "length", "rotations", "frame", "base", "raw", "name", "mask"),
    "How it is judged": (
        *("by", "worst", "no_fit", "follow", "one_camera", "tolerance_deg", "tolerance_mm"),
    ),
    "The figure": ("width_mm", "font_pt", "bands", "errors", "statuses", "dpi"),
    "Poses out": ("publish_format",),
    "Fit and filter": (),
    "Configuration": ("config", "save_config"),
}
_REST = "Fit and filter"

EXAMPLES = {
    "track": (
        "track clip.json",
        "track a.npz b.json -o OUT/",
        "track clip.mp4 --overlay seen.mp4",
        "track cam0.mp4 cam1.mp4 --camera calibration.toml",
        "track pixels.npz --camera dats/ --board-unit 42mm",
        "track noisy.csv --filter rts --unit mm",
    ),
    "batch": ("batch takes/ -o runs/",),
    "live": (
        "live --camera 0",
        "live --stdin --no-view -o session.mcap",
        "live --udp 9000 --publish ws://127.0.0.1:8000",
    ),
    "detect": ("detect --make-model", "detect clip.mp4 -o joints.npz"),
    "calibrate": ("calibrate a.json b.json -o hand.json",),
    "profile": ("profile seen.npz --truth true.npz -o profile.json",),
    "replay": (
        "replay out.mcap",
        "replay before.mcap after.mcap",
        "replay out.mcap --save out.rrd",
    ),
    "stability": (
        "stability out.mcap",
        "stability out.mcap --truth true.npz",
        "stability ours=a.mcap theirs=b.npz --truth true.npz --html report.html",
    ),
    "export": ("export out.mcap hand.glb", "export recordings/ tables/ --to csv"),
    "convert": ("convert hands.csv out.npz",),
    "audit": ("audit recordings/sample.npz", "audit DATA/ --html audit.html --mask mask.parquet"),
    "plot": (
        "plot out.mcap angles.pdf",
        "plot out.mcap index.png --finger index",
        "plot before=a.mcap after=b.mcap pip.svg --joint pip",
    ),
    "info": ("info out.mcap", "info recordings/ --json"),
    "retrack": ("retrack out.mcap -o again.mcap --filter kalman",),
    "diff": ("diff out.mcap again.mcap",),
    "recover": ("recover recordings/live.mcap.part",),
}


class Command(click.Command):
    """A command whose help has groups and examples, and which takes a configuration file."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.params += config_options()

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        given = list(args)
        if "" in given:
            after = given[given.index("") - 1] if given[0] else "the command"
            ctx.fail(f"what follows {after} is empty: is a variable of the shell not set?")
        if "-" in given:
            ctx.fail("- is no file here: `handtrack live --stdin` reads joints from a pipe")
        try:
            self._refuse_twice(ctx, given)
            return super().parse_args(ctx, args)
        except click.NoSuchOption as error:
            named = [a for a in given if a.startswith("-") and os.path.exists(a)]
            if named:
                ctx.fail(f"{error.format_message()} ./{named[0]} means the file")
            raise
        except click.UsageError as error:
            error.ctx = error.ctx or ctx
            raise

    def _refuse_twice(self, ctx: click.Context, given: list[str]) -> None:
        """Refuse an option whose value would take the place of one that was given before."""
        _, _, order = self.make_parser(ctx).parse_args(list(given))
        for option, times in Counter(order).items():
            if not isinstance(option, click.Option) or option.multiple or option.is_flag:
                continue
            if times > 1:
                name = max(option.opts, key=len)
                ctx.fail(f"{name} is given {times} times and takes one value: give it once")

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        # newer versions of click tell of arguments here, too, which the text above does
        given = [p for p in self.get_params(ctx) if isinstance(p, click.Option)]
        records = [(p.name or "", r) for p in given if (r := p.get_help_record(ctx))]
        if len(records) <= FEW:
            groups = {"Options": [record for _, record in records]}
        else:
            first = _GROUPS[_FIRST]
            ranked = sorted({n for n, _ in records if n in first}, key=first.index)
            ends = [name for name in ranked if name in _LAST]
            foremost = [*[n for n in ranked if n not in ends][: TEN - len(ends)], *ends]
            where = {n: title for title, names in _GROUPS.items() for n in names if title != _FIRST}
            where |= dict.fromkeys(foremost, _FIRST)
            groups = {title: [] for title in _GROUPS}
            for name, record in records:
                groups[where.get(name, _REST)].append(record)
            order = {record[0]: first.index(n) for n, record in records if n in first}
            groups[_FIRST].sort(key=lambda record: order[record[0]])
        for title, rows in groups.items():
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        examples = EXAMPLES.get(self.name or "", ())
        if examples:
            with formatter.section("Examples"):
                for line in examples:
                    formatter.write_text(f"handtrack {line}")
        super().format_epilog(ctx, formatter)

    def invoke(self, ctx: click.Context) -> Any:
        save_config(ctx)
        return super().invoke(ctx)


def suggestion(word: str, known: list[str] | tuple[str, ...]) -> str:
    """ ", did you mean X?" where X is close to a word; else nothing."""
    close = get_close_matches(word, known, n=1, cutoff=0.6)
    return f" Did you mean {close[0]!r}?" if close else ""


def pointing_to_help(error: click.ClickException) -> str:
    """A usage error, with the help that tells more."""
    text = error.format_message()
    if not isinstance(error, click.UsageError) or error.ctx is None:
        return text
    return f"{text} (`{error.ctx.command_path} --help` tells more)"
