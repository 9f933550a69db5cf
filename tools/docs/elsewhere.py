"""References of other projects, which ours may link into where the network is there."""

from __future__ import annotations

import urllib.error
import urllib.request

OTHERS = {
    "python": "https://docs.python.org/3",
    "numpy": "https://numpy.org/doc/stable",
    "scipy": "https://docs.scipy.org/doc/scipy",
}
"""Address of each one's reference."""
LINKED = "HANDTRACK_DOCS_LINKED"
"""Environment variable: names of those that are linked into, by commas."""
_PATIENCE_S = 10.0


def to_be_had(others: dict[str, str] = OTHERS) -> list[str]:
    """Names of those whose inventory can be read, saying of the others why not."""
    found = []
    for name, address in others.items():
        try:
            with urllib.request.urlopen(f"{address}/objects.inv", timeout=_PATIENCE_S) as answer:
                answer.read(1)
        except (urllib.error.URLError, TimeoutError) as error:
            print(f"no links into the reference of {name}: {error}")
        else:
            found.append(name)
    return found
