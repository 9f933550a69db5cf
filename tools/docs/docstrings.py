"""Docstrings are plain text with Google's sections; this makes reStructuredText of them."""

from __future__ import annotations

import inspect
import re

import handtrack

_SECTION = re.compile(r"[A-Z]\w+:$")
_ARRAY = re.compile(
    r"~?(?:numpy\.)?ndarray\[tuple\[~?(?:typing\.)?Any, \.\.\.\], "
    r"~?(?:numpy\.)?dtype\[~?(?:numpy\.)?(\w+?)_?\]\]"
)
_LIKE = (
    "_Buffer | _SupportsArray[dtype[Any]] | _NestedSequence[_SupportsArray[dtype[Any]]] | complex"
    " | bytes | str | _NestedSequence[complex | bytes | str]"
)
_LONG = re.compile(r"~(?:\w+\.)*(\w+)")
_SEVERAL = re.compile(r"(\s+)(\w+(?:, \w+)+):(.*)")
_ITEM = re.compile(r"\s*(- |\d+\. )")


def restructured(lines: list[str]) -> list[str]:
    """The lines with norms |x| kept, lists set off, and indented formulas as they stand."""
    end = next((i for i, line in enumerate(lines) if _SECTION.match(line)), len(lines))
    out: list[str] = []
    block = in_list = False
    for line in lines[:end]:
        before = out[-1] if out else ""
        if not line.strip():
            in_list = False
            out.append("")
            continue
        indented = line.startswith("  ") and not in_list
        if _ITEM.match(line) and not indented:
            if before.strip() and not in_list:
                out.append("")
            in_list = True
        if indented and not block:
            out += [*([""] if before.strip() else []), "::", ""]
        elif block and not indented and before.strip():
            out.append("")
        block = indented
        out.append(line if indented else line.replace("|", "\\|"))
    return out + [line.replace("|", "\\|") for line in _one_by_one(lines[end:])]


def inherited(value: type, lines: list[str]) -> list[str]:
    """The lines of a class with the attributes of those it is made of, where these are not public.

    Those have no page of their own to look them up.
    """
    more = [
        line
        for base in value.__mro__[1:]
        if base.__module__.startswith("handtrack.") and base.__name__ not in handtrack.__all__
        for line in _attributes((inspect.getdoc(base) or "").splitlines())
    ]
    if not more:
        return lines
    head = "Attributes:"
    at = lines.index(head) + 1 if head in lines else len(lines)
    return [*lines[:at], *([] if head in lines else ["", head]), *more, *lines[at:]]


def _attributes(lines: list[str]) -> list[str]:
    """What stands in the section of attributes."""
    if "Attributes:" not in lines:
        return []
    rest = lines[lines.index("Attributes:") + 1 :]
    end = next((i for i, line in enumerate(rest) if line and not line.startswith(" ")), len(rest))
    return [line for line in rest[:end] if line.strip()]


def _one_by_one(lines: list[str]) -> list[str]:
    """Sections in which `a, b: text` is an entry for each name: Sphinx knows no other."""
    out: list[str] = []
    i = 0
    while i < len(lines):
        several = _SEVERAL.match(lines[i])
        if not several:
            out.append(lines[i])
            i += 1
            continue
        indent, names, text = several.groups()
        rest = i + 1
        while rest < len(lines) and lines[rest].startswith(indent + "  "):
            rest += 1
        for name in names.split(", "):
            out += [f"{indent}{name}:{text}", *lines[i + 1 : rest]]
        i = rest
    return out


def short_types(text: str | None) -> str | None:
    """A signature with arrays written as in the code."""
    # a default that is made is no Python, and Sphinx breaks only what it can parse into lines
    if not text:
        return text
    text = _LONG.sub(r"\1", _ARRAY.sub(r"NDArray[\1]", text))
    return text.replace("<factory>", "...").replace(_LIKE, "ArrayLike")
