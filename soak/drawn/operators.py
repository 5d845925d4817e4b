"""The changes that a mutant makes: one place of one file, replaced by another text.

Left out is what changes no behaviour: annotations, docstrings, decorators, imports for types, texts of messages.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from typing import NamedTuple

COMPARED = {
    ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">", ast.Eq: "!=", ast.NotEq: "==",
    ast.In: "not in", ast.NotIn: "in", ast.Is: "is not", ast.IsNot: "is",
}  # fmt: skip
COMPUTED = {
    ast.Add: "-", ast.Sub: "+", ast.Mult: "//", ast.Div: "*", ast.FloorDiv: "*", ast.Mod: "+",
    ast.LShift: ">>", ast.RShift: "<<", ast.BitAnd: "|", ast.BitOr: "&",
}  # fmt: skip

SAME_IN_ANY_ORDER = {"isinstance", "cast", "TypeVar", "NamedTuple", "min", "max", "suppress"}
"""Functions of which the swapped arguments are the same, or an error at once."""


class Mutant(NamedTuple):
    """A change. `after` replaces the bytes from `start` to `end`; `function`: dotted, empty at module level."""

    path: str
    function: str
    line: int
    start: int
    end: int
    before: str
    after: str

    @property
    def words(self) -> str:
        """The change in one line."""
        return f"{self.path}:{self.line} {self.function}: {_short(self.before)} -> {_short(self.after)}"

    def planted(self, source: bytes) -> bytes:
        """The file with the change."""
        return source[: self.start] + self.after.encode() + source[self.end :]


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= 70 else f"{text[:67]}..."


def mutants(path: str, source: bytes) -> list[Mutant]:
    """Every mutant of a file, in the order of the text."""
    finder = _Finder(path, source)
    finder.visit(ast.parse(source))
    return sorted(set(finder.found), key=lambda each: (each.start, each.end, each.after))


def valid(source: bytes) -> bool:
    """True if a file with a mutant in it is Python."""
    try:
        compile(source, "mutant", "exec")
    except SyntaxError:
        return False
    return True


class _Finder(ast.NodeVisitor):
    """Collects the mutants of a file."""

    def __init__(self, path: str, source: bytes) -> None:
        self.path, self.source, self.found = path, source, list[Mutant]()
        self._names = list[str]()
        self._begins = [0]
        for line in source.splitlines(keepends=True):
            self._begins.append(self._begins[-1] + len(line))

    # Places and texts

    def _place(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        return (
            self._begins[node.lineno - 1] + node.col_offset,
            self._begins[node.end_lineno - 1] + node.end_col_offset,
        )

    def _text(self, node: ast.expr | ast.stmt) -> str:
        start, end = self._place(node)
        return self.source[start:end].decode()

    def _change(self, node: ast.expr | ast.stmt, after: str) -> None:
        start, end = self._place(node)
        before = self._text(node)
        if before != after:
            self.found.append(Mutant(self.path, ".".join(self._names), node.lineno, start, end, before, after))

    # What is not behaviour

    def _named(self, node: ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> None:
        self._names.append(node.name)
        if not isinstance(node, ast.ClassDef):
            for default in (*node.args.defaults, *filter(None, node.args.kw_defaults)):
                self.visit(default)
        for statement in node.body:
            self.visit(statement)
        self._names.pop()

    visit_ClassDef = visit_FunctionDef = visit_AsyncFunctionDef = _named

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self._removable(node)
            self.visit(node.value)

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None:
        """Leave out a text: before Python 3.12 what is in it has no place of its own."""

    # Statements

    def visit_Expr(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Call | ast.Await):
            self._change(node, "pass")
        if not isinstance(node.value, ast.Constant):
            self.generic_visit(node)

    def _removable(self, node: ast.Assign | ast.AugAssign | ast.AnnAssign) -> None:
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        if isinstance(node, ast.AugAssign) or any(isinstance(each, ast.Attribute | ast.Subscript) for each in targets):
            self._change(node, "pass")

    def visit_Assign(self, node: ast.Assign) -> None:
        if self._names or not isinstance(node.value, ast.Subscript | ast.BinOp):  # else the name of a type
            self._removable(node)
            self.visit(node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        self._removable(node)
        self.visit(node.value)

    def visit_Raise(self, node: ast.Raise) -> None:
        self._change(node, "pass")

    def visit_Break(self, node: ast.Break) -> None:
        self._change(node, "continue")

    def visit_Continue(self, node: ast.Continue) -> None:
        self._change(node, "break")

    def visit_Return(self, node: ast.Return) -> None:
        value = node.value
        if value is None:
            self._change(node, "pass")
        elif not isinstance(value, ast.Constant | ast.Compare | ast.BoolOp | ast.JoinedStr):
            self._change(value, "None")
        if value is not None:
            self.visit(value)

    # Conditions

    def visit_If(self, node: ast.If) -> None:
        if isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            return
        self._condition(node.test)
        self.generic_visit(node)

    def visit_While(self, node: ast.While) -> None:
        self._condition(node.test)
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        self._condition(node.test)
        self.generic_visit(node)

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for test in node.ifs:
            self._condition(test)
        self.generic_visit(node)

    def _condition(self, test: ast.expr) -> None:
        if not isinstance(
            test, ast.Constant | ast.UnaryOp | ast.Compare | ast.NamedExpr
        ):  # the others change by themselves
            self._change(test, f"(not ({self._text(test)}))")

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        other = " or " if isinstance(node.op, ast.And) else " and "
        self._change(node, f"({other.join(f'({self._text(each)})' for each in node.values)})")
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        if isinstance(node.op, ast.Not | ast.USub):
            self._change(node, f"({self._text(node.operand)})")
        if isinstance(node.op, ast.Not):
            self.visit(node.operand)

    def visit_Compare(self, node: ast.Compare) -> None:
        for at in range(len(node.ops)):
            parts = [self._text(node.left)]
            for n, (op, right) in enumerate(zip(node.ops, node.comparators, strict=True)):
                parts += [COMPARED[type(op)] if n == at else _sign(op), self._text(right)]
            self._change(node, " ".join(parts))
        if ast.unparse(node.left) != "sys.platform":  # which only another machine has
            for each in (node.left, *node.comparators):
                self._word(each)
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        texts = isinstance(node.left, ast.JoinedStr) or (
            isinstance(node.left, ast.Constant) and isinstance(node.left.value, str)
        )
        if (sign := COMPUTED.get(type(node.op))) is not None and not texts:
            self._change(node, f"({self._text(node.left)} {sign} {self._text(node.right)})")
        self.generic_visit(node)

    # Values

    def visit_Constant(self, node: ast.Constant) -> None:
        value = node.value
        if isinstance(value, bool):
            self._change(node, str(not value))
        elif isinstance(value, int | float):
            self._change(node, repr(value + 1))
        elif isinstance(value, bytes) and value:
            self._change(node, repr(value[:-1]))

    def _word(self, node: ast.expr) -> None:
        """A word that is compared: a text of another kind is a message."""
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value:
            self._change(node, repr(node.value + "?"))

    def visit_Subscript(self, node: ast.Subscript) -> None:
        self._word(node.slice)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        first, second = (*node.args, None, None)[:2]
        if (
            first is not None
            and second is not None
            and not any(isinstance(each, ast.Starred) for each in node.args[:2])
        ):
            self._swap(first, second, node)
        self.generic_visit(node)

    def visit_keyword(self, node: ast.keyword) -> None:
        """Leave out `strict` of a zip: it is an assertion, which no input can fail."""
        if node.arg != "strict":
            self.generic_visit(node)

    def _swap(self, first: ast.expr, second: ast.expr, call: ast.Call) -> None:
        called = call.func
        name = called.id if isinstance(called, ast.Name) else called.attr if isinstance(called, ast.Attribute) else ""
        if name in SAME_IN_ANY_ORDER:
            return
        (start, first_end), (second_start, end) = self._place(first), self._place(second)
        between = self.source[first_end:second_start].decode()
        before = self.source[start:end].decode()
        after = f"{self._text(second)}{between}{self._text(first)}"
        if after == before:
            return
        self.found.append(Mutant(self.path, ".".join(self._names), first.lineno, start, end, before, after))


def _sign(op: ast.cmpop) -> str:
    """How an operator of a comparison is written."""
    text = ast.unparse(ast.Compare(ast.Name("a"), [op], [ast.Name("b")]))
    return text[2:-2]


def functions(source: bytes) -> Iterator[tuple[str, int, int]]:
    """The functions of a file: dotted name, first and last line. One in another one comes after it."""

    def inner(nodes: list[ast.stmt], names: tuple[str, ...]) -> Iterator[tuple[str, int, int]]:
        for node in nodes:
            if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
                here = (*names, node.name)
                if not isinstance(node, ast.ClassDef):
                    yield ".".join(here), node.lineno, node.end_lineno or node.lineno
                yield from inner(node.body, here)
            elif isinstance(node, ast.If):  # such as `if not TYPE_CHECKING`
                yield from inner([*node.body, *node.orelse], names)

    yield from inner(ast.parse(source).body, ())
