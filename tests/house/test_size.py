"""Classes stay small: at most 25 methods, except for the Textual app."""

import ast

from tests.support.paths import ROOT

ROOMS = ("multidrop", "tui", "shell", "macros", "drives", "simulator", "dialects", "transports")
MOST = 25
EXCEPT = {"MultidropApp"}


def test_no_class_has_more_than_25_methods():
    large = {}
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and node.name not in EXCEPT:
                methods = [each for each in node.body if isinstance(each, (ast.FunctionDef, ast.AsyncFunctionDef))]
                if len(methods) > MOST:
                    large[node.name] = len(methods)
    assert large == {}
