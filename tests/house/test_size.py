"""Classes stay small: at most 25 methods, except for the Textual app."""

import ast
from collections.abc import Iterator

import pytest

from tests.support.paths import ROOT

pytestmark = pytest.mark.slow

ROOMS = ("multidrop", "tui", "shell", "macros", "drives", "simulator", "dialects", "transports")
MOST = 25
EXCEPT = {"MultidropApp"}


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the statements below a node, and nothing of their expressions."""
    for each in ast.iter_child_nodes(node):
        if isinstance(each, (ast.stmt, ast.excepthandler, ast.match_case)):
            yield each
            yield from statements(each)


def test_no_class_has_more_than_25_methods():
    large = {}
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        for node in statements(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and node.name not in EXCEPT:
                methods = [each for each in node.body if isinstance(each, (ast.FunctionDef, ast.AsyncFunctionDef))]
                if len(methods) > MOST:
                    large[node.name] = len(methods)
    assert large == {}
