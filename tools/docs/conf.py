"""Sphinx's settings. `python -m tools.docs.build` runs it on a copy with the generated pages."""

from __future__ import annotations

import os
from typing import Any

from docutils import nodes
from sphinx import addnodes

from handtrack import __version__
from tools.docs.docstrings import inherited, restructured, short_types
from tools.docs.elsewhere import LINKED, OTHERS

project = "handtrack"
author = "the handtrack developers"
copyright = "2026, the handtrack developers"
version = release = __version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.intersphinx",
    "tools.docs.mathml",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "myst_nb",
]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb", ".rst": "restructuredtext"}
exclude_patterns = ["gallery/*", "generated/*", "examples/*.ipynb", "examples/*.md"]

html_theme = "furo"
html_title = f"handtrack {__version__}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_theme_options = {"navigation_with_keys": True}
html_show_sphinx = False
html_math_renderer = "mathml"

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "attrs_inline"]
myst_heading_anchors = 3

# notebooks run when the site is built, so that nothing in them can be out of date
nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_timeout = 240
nb_merge_streams = True

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "examples",
    "filename_pattern": r"/show_",
    "ignore_pattern": r"__init__\.py",
    "download_all_examples": False,
    "show_memory": False,
    "show_signature": False,
    "min_reported_time": 1e9,
    "write_computation_times": False,
    "abort_on_example_error": True,
    "remove_config_comments": True,
}

autodoc_typehints = "signature"
autodoc_typehints_format = "short"
maximum_signature_line_length = 88
autodoc_member_order = "bysource"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_attr_annotations = False  # the docstrings say shapes and units
default_role = "py:obj"
smartquotes = False  # they make one dash of an option's two, and code of no use of its quotes
python_use_unqualified_type_names = True

# links into other projects' references need the network: `tools.docs.build --links` says into which
intersphinx_mapping = {
    name: (OTHERS[name], None) for name in os.environ.get(LINKED, "").split(",") if name
}


def setup(app: Any) -> None:
    """Our docstrings are plain text; Sphinx reads reStructuredText."""
    app.connect("autodoc-process-docstring", _plain, priority=400)
    app.connect("autodoc-process-signature", _short)
    app.connect("object-description-transform", _short_property)


def _plain(app: Any, what: str, name: str, value: Any, options: Any, lines: list[str]) -> None:
    if what == "class":
        lines[:] = inherited(value, lines)
    lines[:] = restructured(lines)


def _short_property(app: Any, domain: str, kind: str, content: nodes.Element) -> None:
    for node in list(content.parent.findall(addnodes.desc_annotation)):
        text = node.astext()
        if (short := short_types(text)) != text:
            node.children = [nodes.Text(short or "")]


def _short(
    app: Any,
    what: str,
    name: str,
    value: Any,
    options: Any,
    signature: str | None,
    gives: str | None,
) -> tuple[str | None, str | None]:
    return short_types(signature), short_types(gives)
