"""The rules of the house: who imports whom, what loads late, what the package may not hold."""

from __future__ import annotations

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = ROOT / "handtrack"
FILES = sorted(p for p in PACKAGE.rglob("*.py") if not p.name.endswith("_pb2.py"))

ORDER = (
    *("errors", "deprecated", "read_only", "settings", "files"),
    *("kernels", "hand", "detectors", "cameras", "mcap", "sequences"),
    "fitting",
    *("calibration", "tracking", "recording", "viewer", "exporting", "converting"),
    *("evaluation", "plotting", "auditing", "video", "live", "batching"),
    "cli",
)
"""The parts of the house: each imports only those before it, inside functions too."""
TOP = {"", "__main__", "cli"}
"""Those may import everything."""
SLOW = ("rerun", "matplotlib", "filterpy", "mcap", "scipy", "google", "pyarrow", "h5py", "c3d")
SLOW += ("dask", "distributed", "fsspec")
"""Imported inside the functions that need them; numba only where code is compiled."""
COMPILED = "kernels"
HOSTS = ("pypi" + ".org", "pythonhosted" + ".org", "registry.npmjs" + ".org", "deb.debian" + ".org")


def module_name(path: Path) -> str:
    """The name inside the package: "" for the package itself, else "hand.model"."""
    parts = path.relative_to(PACKAGE).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def part_of(module: str) -> str:
    """The part of the house that a module is in."""
    return module.split(".")[0]


def at_top_level(tree: ast.Module) -> list[ast.stmt]:
    """Statements that run on import: not those in functions or under TYPE_CHECKING."""
    found: list[ast.stmt] = []
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            waiting += node.orelse
            continue
        if isinstance(node, ast.Import | ast.ImportFrom):
            found.append(node)
        waiting += ast.iter_child_nodes(node)
    return found


def imported(nodes: list[ast.AST]) -> set[str]:
    """Full names of the modules that import statements name; of `from a import b` a and a.b."""
    names: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative import"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {node.module} - {"handtrack"}
    return names


def ours(names: set[str]) -> set[str]:
    """Modules of the project among them, by their names inside the package.

    "" stands for the package's version, "everything" for all else that the package offers.
    """
    known = {module_name(path) for path in FILES} - {""}
    found = set()
    for name in names:
        package, _, inside = name.partition(".")
        if package != "handtrack":
            continue
        if inside in known:
            found.add(inside)
        elif inside == "__version__":
            found.add("")
        elif inside.rpartition(".")[0] not in known:
            found.add("everything")
    return found


@pytest.fixture(scope="module", params=FILES, ids=lambda p: str(p.relative_to(PACKAGE)))
def file(request) -> tuple[str, ast.Module]:
    return module_name(request.param), ast.parse(request.param.read_text())


def test_imports_run_one_way(file):
    module, tree = file
    part = part_of(module)
    if part in TOP:
        return
    for other in ours(imported(list(ast.walk(tree)))) - {""}:
        assert other != "everything", f"{module} imports the whole package"
        assert ORDER.index(part_of(other)) <= ORDER.index(part), f"{module} imports {other}"


def test_the_errors_and_the_skeleton_stand_alone(file):
    module, tree = file
    if module in ("errors", "hand.skeleton"):
        assert not ours(imported(list(ast.walk(tree))))


def test_slow_modules_load_late(file):
    module, tree = file
    roots = {name.split(".")[0] for name in imported(at_top_level(tree))}
    slow = roots & set(SLOW)
    if part_of(module) != COMPILED:
        assert not roots & {"numba", "llvmlite"}, f"{module} loads numba"
    assert not slow, f"{module} loads {slow}"


def test_modules_import_no_cycle():
    graph = {}
    for path in FILES:
        name = module_name(path)
        found = ours(imported(at_top_level(ast.parse(path.read_text()))))
        graph[name] = {m for m in found if m and m != name}
    done: set[str] = set()

    def visit(name: str, above: tuple[str, ...]) -> None:
        assert name not in above, " -> ".join((*above, name))
        if name not in done:
            for other in graph[name]:
                visit(other, (*above, name))
            done.add(name)

    for name in graph:
        visit(name, ())


def test_input_is_not_checked_by_assert(file):
    module, tree = file
    assert not any(isinstance(node, ast.Assert) for node in ast.walk(tree)), module


def test_no_catch_all(file):
    module, tree = file
    for node in ast.walk(tree):
        if isinstance(node, ast.ExceptHandler):
            caught = "" if node.type is None else ast.unparse(node.type)
            assert caught not in ("", "Exception", "BaseException"), f"{module}:{node.lineno}"


def test_public_names_are_there():
    import handtrack as ht

    for name in ht.__all__:
        assert getattr(ht, name) is not None
    kept = {"load", "HandModel", "calibrate", "fit", "Tracker", "track", "metrics"}
    assert kept | {"write_mcap", "read_mcap", "stability"} <= set(ht.__all__)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = ht.nothing


@pytest.mark.parametrize("code", ["import handtrack", "from handtrack.cli import run; run(['-h'])"])
def test_the_command_line_starts_light(code):
    code += "; import sys; print('LOADED', *sorted(sys.modules))"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(out.stdout.partition("LOADED ")[2].split())
    heavy = {"numpy", "numba", "rich", "msgspec", *SLOW}
    assert not loaded & heavy
    assert len(loaded) < 250


def tracked_files() -> list[Path]:
    found = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if found.returncode:
        pytest.skip("not a git checkout")
    return [p for name in found.stdout.split("\0") if name and (p := ROOT / name).is_file()]


def test_no_package_registry_is_named():
    for path in tracked_files():
        data = path.read_bytes()
        for host in HOSTS:
            assert host.encode() not in data, f"{path} names {host}"


def test_the_top_level_holds_what_was_agreed():
    agreed = {"pyproject.toml", "handtrack", "recordings", "tests", "tools"}
    agreed |= {"README.md", "LICENSE", "CHANGELOG.md"}
    top = {p.relative_to(ROOT).parts[0] for p in tracked_files()}
    assert {name for name in top if not name.startswith(".")} <= agreed
