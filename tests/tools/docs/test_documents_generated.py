"""What documents hold of generated text is that of today."""

from __future__ import annotations

import inspect
import json
import re

import pytest
from documents_of import DOCUMENTS, ROOT, SITE, blocks

import handtrack as ht
from tools.docs import generated, numbers, readme
from tools.docs.docstrings import restructured, short_types


def test_the_readmes_tables_are_as_generated() -> None:
    """`python -m tools.docs.readme` writes them."""
    text = readme.README.read_text()
    assert readme.filled(text) == text
    for name in readme.TABLES:
        assert f"<!-- generated: {name} -->" in text


def test_the_readmes_first_two_blocks_are_those_that_ci_runs() -> None:
    first, second = (b.text for b in blocks(readme.README) if b.language == "bash")
    assert "pip install '.[test]'" in first
    assert second.split() == [".venv/bin/pytest"]


def test_the_readmes_python_is_twelve_lines() -> None:
    (example,) = (b.text for b in blocks(readme.README) if b.language == "python")
    assert len([line for line in example.splitlines() if line.strip()]) <= 12


def test_the_samples_numbers_are_those_of_today() -> None:
    """`python -m tools.docs.numbers` measures them; another processor rounds otherwise."""
    kept = generated.numbers("sample")["rows"]
    for row, now in zip(kept, numbers.measure()["rows"], strict=True):
        assert row["what"] == now["what"]
        for name in ("pa_mpjpe_mm", "std_mm", "jitter_m_s3"):
            assert row[name] == pytest.approx(now[name], rel=0.02), (row["what"], name)
        assert row["lost"] == now["lost"]


# --- the site


def test_every_page_stands_in_the_table_of_contents() -> None:
    entries = re.findall(r"^(pages/\w+|theory)$", (SITE / "index.md").read_text(), re.MULTILINE)
    listed = set(entries)
    assert len(listed) == len(entries)
    assert listed == {f"pages/{p.stem}" for p in (SITE / "pages").glob("*.md")} | {"theory"}
    notebooks = {p.stem for p in (SITE / "notebooks").glob("*.ipynb")}
    index = (SITE / "notebooks" / "index.md").read_text()
    assert len(notebooks) >= 3
    assert all(re.search(rf"^{name}$", index, re.MULTILINE) for name in notebooks)


def test_every_public_name_stands_in_the_reference_once() -> None:
    listed = [name for names in generated.groups().values() for name in names]
    assert sorted(listed) == sorted(set(ht.__all__) - {"__version__"})


@pytest.mark.parametrize("name", sorted(set(ht.__all__) - {"__version__"}))
def test_a_public_name_says_what_it_is(name: str) -> None:
    """Functions their arguments, results and errors, classes their attributes."""
    value = getattr(ht, name)
    text = inspect.getdoc(value) or ""
    assert len(text.split()) >= 5, name
    if inspect.isfunction(value):
        given = [p for p in inspect.signature(value).parameters if p not in ("self", "cls")]
        said = text.partition("Args:")[2]
        for argument in given:
            assert re.search(rf"^\s+.*\b{argument}\b.*:", said, re.MULTILINE), f"{name}({argument})"
        gives = inspect.signature(value).return_annotation
        assert gives in ("None", None) or re.search(
            r"Returns:|Yields:|: |^The |^What |^How |^Whe", text
        ), name


def test_pages_hold_no_table_of_numbers_of_their_own() -> None:
    """Numbers in tables are generated; a pasted one would be true for a while."""
    for document in DOCUMENTS[1:]:
        for line in document.read_text().splitlines():
            if line.startswith("|"):
                assert not re.search(r"\d\.\d", line), f"{document.name}: {line}"


def test_notebooks_are_kept_without_what_they_printed() -> None:
    for path in (SITE / "notebooks").glob("*.ipynb"):
        for cell in json.loads(path.read_text())["cells"]:
            assert not cell.get("outputs"), path
            assert cell.get("execution_count") is None, path


def test_docstrings_become_restructured_text() -> None:
    text = """The norm |x| of
- one
  more
- two

Formula
    y = |x|
after

Args:
    a, b: both."""
    assert restructured(text.splitlines()) == [
        *("The norm \\|x\\| of", "", "- one", "  more", "- two", "", "Formula", "", "::", ""),
        *("    y = |x|", "", "after", "", "Args:", "    a: both.", "    b: both."),
    ]
    arrays = "~numpy.ndarray[tuple[~typing.Any, ...], ~numpy.dtype[~numpy.float64]]"
    assert short_types(f"(x: {arrays}, y: ~typing.Literal['a'])") == (
        "(x: NDArray[float64], y: Literal['a'])"
    )
    like = "~numpy._typing._array_like._"
    some = f"{like}SupportsArray[~numpy.dtype[~typing.Any]]"
    text = f"~numpy.typing._Buffer | {some} | ~numpy._NestedSequence[{some}]"
    text += " | complex | bytes | str | ~numpy._NestedSequence[complex | bytes | str] | None"
    assert short_types(f"(x: {text})") == "(x: ArrayLike | None)"
    assert short_types(None) is None


def test_citation_and_metadata() -> None:
    text = (ROOT / ".github" / "CITATION.cff").read_text()
    for author in ("Li", "Wu", "Liu", "Zhang", "Nie", "Mao"):
        assert f"family-names: {author}" in text
    assert f"version: {ht.__version__}" in text
    change = (ROOT / "CHANGELOG.md").read_text()
    assert re.search(r"^## \[?Unreleased", change, re.MULTILINE)
