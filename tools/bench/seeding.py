"""Faults that can be seeded into Python source: one place changed, what it was and what it is."""

from __future__ import annotations

import ast
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Any

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

    def _operand(self, node: ast.expr) -> str:
        """As it stands beside an operator: its span leaves out the parentheses it may need."""
        loose = isinstance(node, ast.BinOp | ast.BoolOp | ast.Compare | ast.IfExp | ast.UnaryOp)
        return f"({self._text(node)})" if loose else self._text(node)

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
            text = f"{self._operand(node.left)} {sign} {self._operand(node.comparators[0])}"
            self._add("another comparison", node, f"({text})")
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        kind = type(node.op)
        if kind in REVERSED:
            left, right = self._operand(node.left), self._operand(node.right)
            self._add("another operation", node, f"({left} {REVERSED[kind]} {right})")
            if kind in (ast.Sub, ast.Div, ast.MatMult):
                self._add("operands exchanged", node, f"({right} {SIGNS[kind]} {left})")
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
        self._add("and for or", node, f"({word.join(self._operand(v) for v in node.values)})")
        self.generic_visit(node)


def mutants(root: Path, places: list[str], count: int, seed: int) -> list[Mutant]:
    """So many faults in files or folders: every kind as likely as any other."""
    files = sorted(
        path
        for place in places
        for path in ([root / place] if place.endswith(".py") else (root / place).rglob("*.py"))
    )
    kinds: dict[str, list[Mutant]] = {}
    for path in files:
        for mutant in Finder(str(path.relative_to(root)), path.read_text()).found:
            kinds.setdefault(mutant.kind, []).append(mutant)
    chance = random.Random(seed)
    chosen: list[Mutant] = []
    while len(chosen) < count and any(kinds.values()):
        for some in kinds.values():
            if some and len(chosen) < count:
                chosen.append(some.pop(chance.randrange(len(some))))
    return chosen


def again(root: Path, told: list[dict[str, Any]]) -> list[Mutant]:
    """The same faults in today's source, each at the nearest line that has it."""
    chosen = []
    for old in told:
        source = (root / old["path"]).read_text()
        same = [
            mutant
            for mutant in Finder(old["path"], source).found
            if all(getattr(mutant, name) == old[name] for name in ("kind", "text", "before"))
        ]
        chosen += sorted(same, key=lambda mutant: abs(mutant.line - old["line"]))[:1]
    return chosen
