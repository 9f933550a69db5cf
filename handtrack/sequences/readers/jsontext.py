"""Decoding JSON so that an error names the file and the place in it."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import msgspec

from handtrack.errors import InputError
from handtrack.sequences.readers.missing import texts_as_null

_BYTE = re.compile(r" \(byte (\d+)\)$")
# Python's json module writes NaN, which JSON does not have
_NAN = re.compile(rb"(?<=[\[:,\s])NaN(?=[\],}\s])")


def as_utf8(data: bytes) -> bytes:
    """Text in UTF-16 with a byte order mark, as spreadsheets save it, in UTF-8; else the same."""
    if data[:2] not in (b"\xff\xfe", b"\xfe\xff"):
        return data
    try:
        return data.decode("utf-16").encode()
    except UnicodeError:
        return data


def decode(data: bytes, kind: Any, path: str | Path, first_line: int = 1) -> Any:
    """Decode JSON text as `kind`; NaN reads as null, and where any kind will do so do "" and "NaN".

    Args:
        data: UTF-8 text, with or without a byte order mark.
        kind: a type for msgspec; unknown fields are skipped unparsed.
        path: named in errors.
        first_line: the number of the text's first line, for lines of a longer file.

    Raises:
        InputError: malformed (with line and byte), cut short, or not of that type (with the
            field's name).
    """
    data = data.removeprefix(b"\xef\xbb\xbf")
    data = without_nan(data)
    if kind is Any or kind == list[Any]:  # fields of a known type may be texts, and empty
        data = texts_as_null(data)
    try:
        return msgspec.json.decode(data, type=kind)
    except msgspec.ValidationError as error:
        raise InputError(misfit(error) + _line(first_line), path) from None
    except msgspec.DecodeError as error:
        raise InputError(_place(str(error), data, first_line), path) from None
    except UnicodeDecodeError as error:
        raise InputError(
            f"the text is not UTF-8 (byte {error.start} of a string){_line(first_line)}", path
        ) from None
    except RecursionError:
        raise InputError(f"the JSON is nested too deeply{_line(first_line)}", path) from None


def without_nan(data: bytes) -> bytes:
    """JSON text with null for NaN."""
    return _NAN.sub(b"null", data) if b"NaN" in data else data


def _line(first_line: int) -> str:
    return f" (line {first_line})" if first_line > 1 else ""


def misfit(error: msgspec.ValidationError) -> str:
    """What does not fit, and in which field."""
    text = str(error).replace(" - at `$.", " at `").replace(" - at `$", " at `")
    return text[:1].lower() + text[1:]


def _place(message: str, data: bytes, first_line: int) -> str:
    found = _BYTE.search(message)
    if found is None:  # "Input data was truncated"
        line = data.count(b"\n") + first_line
        return f"the JSON is cut short: it ends after {len(data)} bytes (line {line})"
    byte = int(found[1])
    line = data[:byte].count(b"\n") + first_line
    reason = message[: found.start()].removeprefix("JSON is malformed: ")
    return f"wrong JSON: {reason} at byte {byte} (line {line})"


def one_after_another(data: bytes) -> list[Any] | None:
    """The objects of a text in which several stand one behind the other, over lines or not; None
    where it is anything else."""
    try:
        text = as_utf8(data).decode("utf-8-sig")
    except UnicodeDecodeError:
        return None
    decoder, at = json.JSONDecoder(), 0
    values: list[Any] = []
    try:
        while at < len(text):
            while at < len(text) and text[at].isspace():
                at += 1
            if at < len(text):
                value, at = decoder.raw_decode(text, at)
                if not isinstance(value, dict | list):
                    return None
                values.append(value)
    except (ValueError, RecursionError):
        return None
    return values if len(values) > 1 else None
