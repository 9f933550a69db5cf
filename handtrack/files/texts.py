"""Small texts beside the joints: JSON and TOML that people edit by hand."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from handtrack.errors import InputError, shown
from handtrack.files import budget

_LINE = 10_000
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")
_WRONG = (ValueError, RecursionError)


def read_text(path: Path, wrong: str) -> str:
    """A small file's text.

    Args:
        path: it.
        wrong: what to say of a file that is none, such as "is no hand file".

    Raises:
        InputError: it is not there, is larger than `budget.TEXT`, or no text in UTF-8.
    """
    data = budget.read(path, budget.TEXT)
    try:
        return data.decode("utf-16" if data[:2] in _UTF_16 else "utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"{wrong}: not UTF-8 text (byte {error.start})", path) from None


def read_json(path: Path, wrong: str) -> Any:
    """The value of a small JSON file; arguments as in `read_text`.

    Raises:
        InputError: as `read_text`, no JSON, nested too deeply, or a name twice in an object.
    """
    return parse_json(read_text(path, wrong), path, wrong)


def parse_json(text: str, path: Path, wrong: str) -> Any:
    """As `read_json`, of a text that was read already."""
    try:
        return json.loads(text, object_pairs_hook=_once)
    except _WRONG as error:
        raise InputError(f"{wrong}: {_reason(error)}", path) from None


def parse_toml(text: str, path: Path, wrong: str) -> dict[str, Any]:
    """The tables of a TOML text; arguments as in `read_text`.

    Raises:
        InputError: no TOML, nested too deeply, a name twice, or a line that is too long.
    """
    # a name of thousands of parts takes the square of them
    if max(map(len, text.split("\n"))) > _LINE:
        raise InputError(f"{wrong}: a line of more than {_LINE:,} letters", path)
    try:
        return tomllib.loads(text)
    except _WRONG as error:
        raise InputError(f"{wrong}: {_reason(error)}", path) from None


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        seen: set[str] = set()
        twice = next(name for name, _ in pairs if name in seen or seen.add(name))  # type: ignore[func-returns-value]
        raise ValueError(f"{shown(twice, 60)} is there twice")
    return found


def _reason(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "nested too deeply"
    return shown(str(error), 120)
