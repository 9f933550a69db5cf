"""Seed faults into the package, one at a time, and see whether the tests notice.

    python -m tools.bench.mutants handtrack/kernels handtrack/tracking [--count 72] [--seed 1]
        [--also tests/test_pipeline.py] [--seconds 600] [--json OUT]

The faults stand one after another in a copy of the project, so that only what depends on one is
compiled again. Run are the tests that mirror the module
or name it, all of its package (tests/tracking for handtrack/tracking), then those named by --also.
A fault that all of them pass is printed with its place: it is a hole in the tests, or makes no
difference. Tests that do not end with a fault have noticed it only if they end without: --seconds
is to be well above what they take. Exit status 1 if more than --survive of the faults survive.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
COPIED = (
    "handtrack",
    "tests",
    "tools",
    "recordings",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
)
TESTS = {
    "kernels": ["tests/kernels", "tests/fitting", "tests/tracking"],
    "fitting": ["tests/fitting", "tests/tracking"],
    "mcap": ["tests/mcap", "tests/recording"],
    "viewer": ["tests/viewer"],
    "exporting": ["tests/exporting"],
    "live": ["tests/live"],
    "files": ["tests/mcap", "tests/recording", "tests/sequences"],
}
"""Where a package's tests are, if not in the folder of its name."""

COMPARED = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "=="}
REVERSED = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.MatMult: "*"}
SIGNS = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.MatMult: "@"}
TWINS = {"min": "max", "max": "min", "left": "right", "right": "left", "any": "all", "all": "any"}


@dataclass(frozen=True)
class Mutant:
    """A fault: the text that stands in the place of another.

    Attributes:
        path: of the module, from the project's root.
        line: its number.
        kind: what was done.
        start, end: offsets in the file.
        text: what stands there instead.
        before: what stood there.
    """

    path: str
    line: int
    kind: str
    start: int
    end: int
    text: str
    before: str


class Finder(ast.NodeVisitor):
    """All faults that can be seeded into a module."""

    def __init__(self, path: str, source: str) -> None:
        self.found: list[Mutant] = []
        self._path, self._source = path, source
        lengths = [len(line.encode()) for line in source.splitlines(keepends=True)]
        self._starts = [sum(lengths[:i]) for i in range(len(lengths) + 1)]
        self._bytes = source.encode()
        self.visit(ast.parse(source))

    def _at(self, line: int, column: int) -> int:
        return self._starts[line - 1] + column

    def _span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        line, column = node.end_lineno or node.lineno, node.end_col_offset or 0
        return self._at(node.lineno, node.col_offset), self._at(line, column)

    def _text(self, node: ast.expr | ast.stmt) -> str:
        start, end = self._span(node)
        return self._bytes[start:end].decode()

    def _add(self, kind: str, node: ast.expr | ast.stmt, text: str) -> None:
        start, end = self._span(node)
        before = self._bytes[start:end].decode()
        self.found.append(Mutant(self._path, node.lineno, kind, start, end, text, before))

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        # annotations and docstrings cannot be wrong at run time
        for default in [*node.args.defaults, *filter(None, node.args.kw_defaults)]:
            self.visit(default)
        first = node.body[0]
        told = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)
        for statement in node.body[int(told) :]:
            self.visit(statement)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Wording is not held to the letter."""

    def visit_Raise(self, node: ast.Raise) -> None:
        self._add("an error is not raised", node, "pass")

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call):
            self._add("a call is left out", node, "pass")
        self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> None:
        sign = COMPARED.get(type(node.ops[0]))
        if sign is not None and len(node.ops) == 1:
            text = f"{self._text(node.left)} {sign} {self._text(node.comparators[0])}"
            self._add("another comparison", node, f"({text})")
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        kind = type(node.op)
        if kind in REVERSED:
            left, right = self._text(node.left), self._text(node.right)
            self._add("another operation", node, f"({left} {REVERSED[kind]} {right})")
            if kind in (ast.Sub, ast.Div, ast.MatMult):
                self._add("operands exchanged", node, f"(({right}) {SIGNS[kind]} ({left}))")
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._add("another constant", node, str(not value))
        elif isinstance(value, int):
            self._add("another constant", node, str(value + 1))
        elif isinstance(value, float):
            self._add("another constant", node, repr(value * 1.5 if value else 1.0))
        elif isinstance(value, str) and value in TWINS:
            self._add("the other side", node, repr(TWINS[value]))

    def visit_Name(self, node: ast.Name) -> None:
        if isinstance(node.ctx, ast.Load) and node.id in TWINS:
            self._add("its twin", node, TWINS[node.id])

    def visit_Attribute(self, node: ast.Attribute) -> None:
        if node.attr == "T":
            self._add("not transposed", node, self._text(node.value))
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        plain = [a for a in node.args if isinstance(a, ast.Name | ast.Attribute)]
        if len(plain) == len(node.args) >= 2:
            texts = [self._text(a) for a in node.args]
            swapped = [texts[1], texts[0], *texts[2:]]
            keys = [f"{k.arg}={self._text(k.value)}" for k in node.keywords if k.arg]
            if len(keys) == len(node.keywords):
                inside = ", ".join([*swapped, *keys])
                self._add("arguments exchanged", node, f"{self._text(node.func)}({inside})")
        if node.keywords and all(k.arg for k in node.keywords):
            kept = [self._text(a) for a in node.args]
            kept += [f"{k.arg}={self._text(k.value)}" for k in node.keywords[1:]]
            left = f"{self._text(node.func)}({', '.join(kept)})"
            self._add("an argument is left out", node, left)
        self.generic_visit(node)

    def visit_If(self, node: ast.If) -> None:
        if "TYPE_CHECKING" not in self._text(node.test):
            self._add("the condition reversed", node.test, f"not ({self._text(node.test)})")
            self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        word = " or " if isinstance(node.op, ast.And) else " and "
        self._add("and for or", node, f"({word.join(self._text(v) for v in node.values)})")
        self.generic_visit(node)


def mutants(places: list[str], count: int, seed: int) -> list[Mutant]:
    """So many faults in files or folders: every kind as likely as any other."""
    files = sorted(
        path
        for place in places
        for path in ([ROOT / place] if place.endswith(".py") else (ROOT / place).rglob("*.py"))
    )
    kinds: dict[str, list[Mutant]] = {}
    for path in files:
        for mutant in Finder(str(path.relative_to(ROOT)), path.read_text()).found:
            kinds.setdefault(mutant.kind, []).append(mutant)
    chance = random.Random(seed)
    chosen: list[Mutant] = []
    while len(chosen) < count and any(kinds.values()):
        for some in kinds.values():
            if some and len(chosen) < count:
                chosen.append(some.pop(chance.randrange(len(some))))
    return chosen


def tests_of(path: str, also: list[str]) -> Iterator[list[str]]:
    """The tests of a module, in the order in which they are run."""
    package, stem = Path(path).parts[1], Path(path).stem
    named = [name for name in TESTS.get(package, [f"tests/{package}"]) if (ROOT / name).exists()]
    files = [file for name in named for file in sorted((ROOT / name).rglob("test_*.py"))]
    own = [file for file in files if file.name == f"test_{stem}.py"]
    using = re.compile(rf"\b{package}(\.{stem}| import .*\b{stem})\b")
    naming = [file for file in files if file not in own and using.search(file.read_text())]
    for some in (own, naming):
        if some:
            yield [str(file.relative_to(ROOT)) for file in some]
    for name in [*named, *also]:
        yield [name]


def copied(folder: Path) -> None:
    """The project, with what it has compiled: files keep their times, by which that is found."""
    for name in COPIED:
        copy = shutil.copytree if (ROOT / name).is_dir() else shutil.copy2
        copy(ROOT / name, folder / name)


def noticed(folder: Path, mutant: Mutant, also: list[str], seconds: float) -> str:
    """Which tests of a copy of the project notice a fault; "" for none. The copy is put back."""
    path = folder / mutant.path
    data, times = path.read_bytes(), path.stat()
    path.write_bytes(data[: mutant.start] + mutant.text.encode() + data[mutant.end :])
    try:
        return _seen_by(folder, list(tests_of(mutant.path, also)), seconds)
    finally:
        path.write_bytes(data)
        os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))


def _seen_by(folder: Path, runs: list[list[str]], seconds: float) -> str:
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    for tests in runs:
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-n0", *tests]
        with subprocess.Popen(
            [*command, "-p", "no:cacheprovider"],
            cwd=folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        ) as run:
            try:
                status = run.wait(seconds)
            except subprocess.TimeoutExpired:
                os.killpg(run.pid, signal.SIGKILL)  # with what the tests started
                return f"{' '.join(tests)}: no end in {seconds:g} s"
        if status not in (0, 5):
            return " ".join(tests)
    return ""


def main(arguments: list[str] | None = None) -> int:
    """Seed faults, print what survived, and return the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("places", nargs="+", help="files or folders, as handtrack/tracking")
    parser.add_argument("--count", type=int, default=72)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--also", action="append", default=[], help="more tests; may be repeated")
    parser.add_argument("--seconds", type=float, default=600, help="longest run of some tests")
    parser.add_argument("--survive", type=float, default=0.05, help="share that may survive")
    parser.add_argument("--json", type=Path, metavar="OUT", help="write what became of each")
    options = parser.parse_args(arguments)
    chosen, survived, told = mutants(options.places, options.count, options.seed), 0, []
    with tempfile.TemporaryDirectory(prefix="mutant") as folder:
        copied(Path(folder))
        for number, mutant in enumerate(chosen, 1):
            by = noticed(Path(folder), mutant, options.also, options.seconds)
            survived += not by
            told.append({**asdict(mutant), "noticed": by})
            what = f"SURVIVED: {mutant.before!r} -> {mutant.text!r}"
            said = f"noticed by {by}" if by else what
            place = f"{mutant.path}:{mutant.line}"
            print(f"{number}/{len(chosen)} {place} {mutant.kind}: {said}", flush=True)
            if options.json:
                options.json.write_text(json.dumps(told, indent=1) + "\n")
    print(f"{survived} of {len(chosen)} faults survived")
    return int(survived > options.survive * len(chosen))


if __name__ == "__main__":
    sys.exit(main())
