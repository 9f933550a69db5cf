"""Formulas as MathML, which browsers draw by themselves: the site needs no network for them."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

_TAG = re.compile(r"\\tag\{([^{}]+)\}")
_GATHERED = re.compile(r"\\begin\{gather\*?\}(.*)\\end\{gather\*?\}", re.DOTALL)


def setup(app: Any) -> dict[str, Any]:
    """Register the renderer, as Sphinx's extensions do."""
    app.add_html_math_renderer("mathml", (_inline, None), (_block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def _inline(writer: Any, node: nodes.math) -> None:
    writer.body.append(convert(node.astext()))
    raise nodes.SkipNode


def _block(writer: Any, node: nodes.math_block) -> None:
    text = node.astext()
    for formula, number in _rows(text):
        writer.body.append('<div class="math notranslate">')
        writer.body.append(convert(formula, display="block"))
        writer.body.append(f'<span class="eqno">{number}</span></div>\n')
    raise nodes.SkipNode


def _rows(text: str) -> list[tuple[str, str]]:
    """The lines of a block with their numbers, "" for none."""
    if found := _GATHERED.fullmatch(text.strip()):
        return [row for line in found[1].split(r"\\") for row in _rows(line)]
    number = _TAG.search(text)
    return [(_TAG.sub("", text).strip(), f"({number[1]})" if number else "")]
