"""The project's documents."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]


SITE = ROOT / "tools" / "docs"


DOCUMENTS = [ROOT / "README.md", *sorted((SITE / "pages").glob("*.md"))]


@dataclass(frozen=True)
class Block:
    """What stands between fences: language and text; what it needs, or why it is not run."""

    language: str
    text: str
    needs: str = ""
    not_run: str = ""


def blocks(document: Path) -> list[Block]:
    found = []
    pattern = r"(?:<!-- (needs|not run): (.*?) -->\n)?^```(\w+)\n(.*?)^```$"
    for mark, said, language, text in re.findall(
        pattern, document.read_text(), re.MULTILINE | re.DOTALL
    ):
        marks = {"needs": said} if mark == "needs" else {"not_run": said} if mark else {}
        found.append(Block(language, text, **marks))
    return found
