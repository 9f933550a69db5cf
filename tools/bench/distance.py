"""How many imports lie between tests and a module of the package."""

from __future__ import annotations

import ast
from functools import cache
from pathlib import Path

FAR = 99
"""Of the other tests of the package, which loads what it needs as that is used."""


@cache
def _imports(path: Path) -> frozenset[str]:
    """Names of modules that a file imports, anywhere in it; of `from a import b` a and a.b."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
    return frozenset(names)


def _name(root: Path, path: Path) -> str:
    return ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def distances(root: Path, place: str, tests: list[str]) -> dict[str, int]:
    """Of tests that reach a module, or one in a folder: how far they are from it.

    Args:
        root: the project's.
        place: the module's file, or a folder.
        tests: files of tests.

    Returns:
        by file: 0 the one named as the module, 1 those that import it, and so on; FAR the others
        of the package.
    """
    package = {_name(root, path): path for path in sorted((root / "handtrack").rglob("*.py"))}
    target = root / place
    steps = {
        name: 0
        for name, path in package.items()
        if path == target or (target.is_dir() and path.is_relative_to(target))
    }
    level = 0
    while any(found == level for found in steps.values()):
        at = {name for name, found in steps.items() if found == level}
        for name, path in package.items():
            # the package itself imports all
            if name not in steps and name != "handtrack" and _imports(path) & at:
                steps[name] = level + 1
        level += 1
    found = {test: _from(root / test, steps) for test in tests}
    own = {f"test_{Path(name.replace('.', '/')).name}.py" for name, n in steps.items() if n == 0}
    nearest = {test: 0 for test in tests if Path(test).name in own}
    return {test: near for test, near in found.items() if near is not None} | nearest


def _from(test: Path, steps: dict[str, int]) -> int | None:
    """How far a file of tests is, what stands beside it and in `tests` included."""
    names = set(_imports(test))
    for helper in sorted(names):
        for folder in (test.parent, *(p for p in test.parents if p.name == "tests")):
            if (folder / f"{helper}.py").exists():
                names |= _imports(folder / f"{helper}.py")
    near = [1 + steps[name] for name in names if name in steps]
    if near:
        return min(near)
    return FAR if any(name.split(".")[0] in ("handtrack", "tools") for name in names) else None
