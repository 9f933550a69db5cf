"""Put the generated tables into README.md, between their markers.

    python -m tools.docs.readme [--check]

A marker is `<!-- generated: NAME -->`, the table ends at `<!-- end -->`.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from tools.docs import generated, measured

README = Path(__file__).resolve().parents[2] / "README.md"
TABLES = {"formats": generated.formats_short, "numbers": measured.sample}
_BLOCK = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def filled(text: str) -> str:
    """A text with its tables as they are now."""
    return _BLOCK.sub(lambda m: f"{m[1]}\n{TABLES[m[2]]()}\n{m[3]}", text)


def main(arguments: list[str] | None = None) -> int:
    """Write the README, or with --check say whether it is as it would be written."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="change nothing")
    options = parser.parse_args(arguments)
    text = README.read_text(encoding="utf-8")
    new = filled(text)
    if options.check:
        return int(new != text)
    README.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
