"""The command line: arguments and printing only. Imports wait until a command needs them.

Each command stands in the module of its name, as a click command of that name.
"""

from __future__ import annotations

import errno
import gc
import importlib
import os
import sys
import warnings
from typing import Any

import click

from handtrack import __version__
from handtrack.cli.commands import COMMANDS as COMMANDS
from handtrack.cli.helping import pointing_to_help, suggestion
from handtrack.cli.progress import begin
from handtrack.cli.streams import INTERRUPTED, NOT_READ, STOPPED, stopping, usable_streams
from handtrack.errors import HandtrackError, InputError, ModelError, SettingsError, shown

_COLLECT_EVERY = 50_000
"""Objects made before the youngest are looked through."""
NO_NAME = (errno.ENAMETOOLONG, errno.ELOOP)
"""What the system says of names that no file can have: the argument is wrong, not the job."""


def main() -> None:
    """Run the command line and exit: 0 done, 1 the job failed, 2 input or arguments are wrong; 130,
    143, 141 as shells have it: Ctrl-C, told to end, nobody reads on."""
    usable_streams()
    # NumPy is not loaded yet; on matrices as small as ours threads only wait for one another,
    # on a busy machine ten times as long as the work takes
    for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
        os.environ.setdefault(name, "1")
    # a thousand modules and compiled functions are nothing to be collected: 3 to 6 % of a start
    gc.set_threshold(_COLLECT_EVERY)
    sys.exit(run(sys.argv[1:]))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit status; what goes wrong is one line on stderr."""
    begin()
    output = sys.stdout
    with warnings.catch_warnings(), stopping():
        warnings.showwarning = _show_warning  # type: ignore[assignment]
        if arguments[:1] == ["help"]:
            arguments = [*arguments[1:2], "--help"]
        try:
            return int(cli.main(arguments or ["--help"], "handtrack", standalone_mode=False) or 0)
        except click.ClickException as error:
            return _failed(pointing_to_help(error), 2)
        except (InputError, SettingsError, ModelError) as error:
            return _failed(str(error), 2)
        except HandtrackError as error:
            return _failed(str(error), 1)
        except BrokenPipeError:
            # whoever read the output has seen enough; the interpreter's last flush must not fail
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            return NOT_READ
        except OSError as error:
            name = f"{shown(error.filename)}: " if error.filename else ""
            return _failed(f"{name}{error.strerror or error}", 2 if error.errno in NO_NAME else 1)
        except (click.Abort, KeyboardInterrupt):
            click.echo("stopped", err=True)
            return INTERRUPTED
        except SystemExit as left:
            if left.code == STOPPED:
                click.echo("stopped", err=True)
            if sys.stdout is not output:  # click met a pipe that is closed, and put it aside
                return NOT_READ
            raise


def _failed(message: str, status: int) -> int:
    click.echo(f"error: {' '.join(message.split())}", err=True)
    return status


def _show_warning(message: Warning | str, category: type[Warning], *where: Any) -> None:
    """What the library warns of, without the place in its code."""
    text = str(message) if category is UserWarning else f"{category.__name__}: {message}"
    click.echo(f"warning: {text}", err=True)


EXAMPLES = (
    "handtrack track clip.json            fit, record, print the numbers",
    "handtrack replay recordings/clip.mcap     look at it",
    "handtrack help track                 options and examples of a command",
)
COMPLETION = (
    'Completion of commands and options: eval "$(_HANDTRACK_COMPLETE=bash_source handtrack)" in'
    " ~/.bashrc; zsh_source in ~/.zshrc; for fish, _HANDTRACK_COMPLETE=fish_source handtrack |"
    " source."
)


class _Commands(click.Group):
    """Commands that load when they are asked for."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] not in COMMANDS and not args[0].startswith("-"):
            ctx.fail(f"No such command {args[0]!r}.{suggestion(args[0], COMMANDS)}")
        return super().resolve_command(ctx, args)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Examples"):
            for line in EXAMPLES:
                formatter.write_text(line)
        formatter.write_paragraph()
        formatter.write_text(COMPLETION)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        command: click.Command = getattr(
            importlib.import_module(f"handtrack.cli.{cmd_name}"), cmd_name
        )
        return command


@click.group(
    cls=_Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
)
@click.version_option(__version__, prog_name="handtrack")
def cli() -> None:
    """Track 3D hand joint sequences, replay them, and measure how steady they are."""
