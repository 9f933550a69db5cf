"""Options from a file: --config run.toml, [tool.handtrack] of pyproject.toml, --save-config."""

from __future__ import annotations

import json
import tomllib
from difflib import get_close_matches
from pathlib import Path
from typing import Any

import click

from handtrack.errors import InputError, SettingsError

PYPROJECT = Path("pyproject.toml")
_USED, _SAVE = "handtrack.config", "handtrack.save_config"
_NEVER = {"help", "config", "save_config", "overwrite"}
"""Options that no file says: what is replaced is said when it is."""


def config_options() -> list[click.Option]:
    """The options of every command on configuration files."""
    path = click.Path(path_type=Path)
    return [
        click.Option(
            ["--config"],
            type=path,
            metavar="FILE",
            is_eager=True,
            expose_value=False,
            callback=_take,
            help="Options from a TOML file: a table for each command. Without it, from"
            " [tool.handtrack] of pyproject.toml here, if there is one.",
        ),
        click.Option(
            ["--save-config"],
            type=path,
            metavar="FILE",
            expose_value=False,
            callback=_keep,
            help="Write the options that are given to such a file.",
        ),
    ]


def used_config() -> dict[str, Any]:
    """The file whose options the running command took, and what they are; empty if none."""
    context = click.get_current_context(silent=True)
    found: dict[str, Any] = {} if context is None else context.meta.get(_USED, {})
    return found


def save_config(context: click.Context) -> None:
    """Write what --save-config asks for: the options that are not at their defaults.

    Raises:
        SettingsError: the file cannot be written, or is there already.
    """
    path = context.meta.get(_SAVE)
    if path is None:
        return
    from handtrack.cli.outputs import check_target
    from handtrack.files.whole import whole_file

    check_target(path, ".toml", "--save-config")
    default = (click.core.ParameterSource.DEFAULT, None)
    lines = [f"[{context.info_name}]"]
    for param in context.command.params:
        name = param.name or ""
        if not isinstance(param, click.Option) or name in _NEVER:
            continue
        if context.get_parameter_source(name) not in default and name in context.params:
            value = _toml(context.params[name])
            lines += [f"{_long(param)} = {value}"] if value else []
    path.parent.mkdir(parents=True, exist_ok=True)
    with whole_file(path) as part:
        part.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _toml(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, tuple | list):
        return f"[{', '.join(_toml(v) for v in value)}]"
    return json.dumps(str(value), ensure_ascii=False)


def _keep(context: click.Context, option: click.Parameter, value: Path | None) -> None:
    context.meta[_SAVE] = value


def _take(context: click.Context, option: click.Parameter, value: Path | None) -> None:
    if value is None and not PYPROJECT.is_file():
        return
    path = value or PYPROJECT
    table = _read(path)
    if path.name == PYPROJECT.name:
        tool = table.get("tool", {})
        table = tool.get("handtrack", {}) if isinstance(tool, dict) else {}
        if not table:
            if value is not None:
                raise InputError("there is no [tool.handtrack] in it", path)
            return
    elif not table:
        raise InputError("there is no option in it, expected a table for each command", path)
    options = _options(table, context, path)
    if options:
        _check(options, context, path)
        context.default_map = options
        plain = {n: v for n, v in options.items() if isinstance(v, str | int | float | bool | list)}
        context.meta[_USED] = {"file": str(path), "options": plain}


def _read(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", path) from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise InputError(f"not valid TOML: {error}", path) from None


def _options(table: dict[str, Any], context: click.Context, path: Path) -> dict[str, Any]:
    """The options of the running command, those of all commands first.

    Raises:
        SettingsError: one is of no command, or none that a file may say.
    """
    from handtrack.cli.commands import COMMANDS

    command = context.info_name or ""
    shared = {name: value for name, value in table.items() if not isinstance(value, dict)}
    unknown = [n for n, v in table.items() if isinstance(v, dict) and n not in COMMANDS]
    if unknown:
        raise SettingsError(f"{path}: [{unknown[0]}] is no command{_close(unknown[0], COMMANDS)}")
    own = _names(context.command)
    found = {}
    for name, value in shared.items():
        if name.replace("-", "_") in own:
            found[own[name.replace("-", "_")]] = value
        elif not any(name.replace("-", "_") in _names(each) for each in _all_commands(context)):
            raise SettingsError(f"{path}: {name} is an option of no command")
    for name, value in table.get(command, {}).items():
        plain = name.replace("-", "_")
        if plain not in own:
            close = _close(plain, tuple(own))
            raise SettingsError(f"{path}: [{command}] {name}: no such option of {command}{close}")
        found[own[plain]] = value
    return found


def _check(options: dict[str, Any], context: click.Context, path: Path) -> None:
    """Refuse a value that its option cannot have, while it is known which file says it.

    Raises:
        SettingsError: there is one.
    """
    for param in context.command.params:
        name = param.name or ""
        if name not in options or not isinstance(param, click.Option):
            continue
        value, many = options[name], param.multiple or param.nargs != 1
        try:
            if isinstance(value, list) != many or isinstance(value, dict):
                expected = "a list" if many else "one value"
                raise click.BadParameter(f"{json.dumps(value, default=str)}: expected {expected}")
            param.type_cast_value(context, value)
        except click.BadParameter as error:
            raise SettingsError(f"{path}: {_long(param)}: {error.message}") from None


def _names(command: click.Command) -> dict[str, str]:
    """The names of the values of the options that a file may say, by these and by the options'."""
    options = [p for p in command.params if isinstance(p, click.Option) and p.name not in _NEVER]
    found = {_long(option).replace("-", "_"): option.name or "" for option in options}
    return {option.name or "": option.name or "" for option in options} | found


def _long(option: click.Option) -> str:
    """The option as people type it, without its dashes."""
    return max(option.opts, key=len).lstrip("-")


def _all_commands(context: click.Context) -> list[click.Command]:
    group = context.find_root().command
    if not isinstance(group, click.Group):
        return []
    found = (group.get_command(context, name) for name in group.list_commands(context))
    return [command for command in found if command is not None]


def _close(word: str, known: tuple[str, ...]) -> str:
    close = get_close_matches(word, known, n=1)
    return f", did you mean {close[0]}?" if close else ""
