"""Classes, files and functions stay small: at most 40 methods (inherited ones included), 500 lines, 60 lines."""

import ast

import pytest

from tests.support.paths import ROOT

pytestmark = pytest.mark.slow

ROOMS = (
    "multidrop",
    "tui",
    "shell",
    "macros",
    "drives",
    "simulator",
    "dialects",
    "transports",
    "base",
    "families",
    "features",
)
MOST = 40


def file_of(module: str) -> str:
    return module.removeprefix("multidrop.").replace(".", "/") + ".py"


def classes() -> tuple[dict[str, ast.ClassDef], dict[str, str]]:
    """Return every class by `file:name`, and where a name in a file comes from."""
    found, imported = {}, {}
    for path in (path for room in ROOMS for path in (ROOT / room).rglob("*.py")):
        file = path.relative_to(ROOT).as_posix()
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef):
                found[f"{file}:{node.name}"] = node
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("multidrop"):
                for each in node.names:
                    imported[f"{file}:{each.asname or each.name}"] = f"{file_of(node.module)}:{each.name}"
    return found, imported


def test_no_class_has_more_than_40_methods_with_those_it_inherits():
    found, imported = classes()

    def methods(name: str) -> set[str]:
        node, file = found[name], name.partition(":")[0]
        own = {each.name for each in node.body if isinstance(each, ast.FunctionDef | ast.AsyncFunctionDef)}
        bases = [base.value if isinstance(base, ast.Subscript) else base for base in node.bases]
        for base in (f"{file}:{base.id}" for base in bases if isinstance(base, ast.Name)):
            own |= methods(imported.get(base, base)) if imported.get(base, base) in found else set()
        return own

    counted = {name: len(methods(name)) for name in found}
    assert counted["shell/session.py:Session"] > counted["shell/workspace.py:Workspace"], (
        "bases are followed across files"
    )
    assert {name: count for name, count in counted.items() if count > MOST} == {}


def test_no_file_has_more_than_500_lines_and_no_function_more_than_60():
    files = {path: path.read_text(encoding="utf-8") for room in ROOMS for path in (ROOT / room).rglob("*.py")}
    assert [str(path) for path, text in files.items() if text.count("\n") > 500] == []
    functions = [
        f"{path}:{node.name}"
        for path, text in files.items()
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and node.end_lineno is not None
        and node.end_lineno - node.lineno >= 60
    ]
    assert functions == []
