"""The simulated MCode drive is divided: how much other files know of the whole drive, and how large its classes are."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
LEXIUM = ROOT / "simulator" / "lexium"
OWN_FILE = LEXIUM / "device.py"
ANOTHER_FAMILY = ("pmx", "tmcl")
WHOLE_DRIVE = {"MCodeDevice", "Device", "SimulatedDrive"}
"""The drive's class, and the Protocols that stand for all of it."""
HOLDERS = {"device", "_device", "unit"}
"""Names that have always held the whole drive, annotated or not."""
MOST_ACCESSES = 120
MOST_METHODS = 25


def _files() -> list[Path]:
    files = (ROOT / "simulator").rglob("*.py")
    return [each for each in files if each != OWN_FILE and not set(each.parts) & set(ANOTHER_FAMILY)]


def _mentions(annotation: ast.expr | None) -> bool:
    if annotation is None:
        return False
    names = {node.id for node in ast.walk(annotation) if isinstance(node, ast.Name)}
    names |= {node.attr for node in ast.walk(annotation) if isinstance(node, ast.Attribute)}
    names |= {str(node.value) for node in ast.walk(annotation) if isinstance(node, ast.Constant)}
    return bool(names & WHOLE_DRIVE)


def _holds(node: ast.expr, names: set[str]) -> bool:
    """Whether an expression is the whole drive: a name for it, or an attribute of that name."""
    return (isinstance(node, ast.Name) and node.id in names) or (isinstance(node, ast.Attribute) and node.attr in names)


def _named(target: ast.expr) -> str:
    return target.id if isinstance(target, ast.Name) else target.attr if isinstance(target, ast.Attribute) else ""


def _bindings(tree: ast.AST) -> Iterator[tuple[ast.expr, ast.expr | None, ast.expr | None]]:
    """What each assignment binds: target, value, annotation."""
    for node in ast.walk(tree):
        if isinstance(node, ast.AnnAssign):
            yield node.target, node.value, node.annotation
        elif isinstance(node, ast.Assign):
            for target in node.targets:
                if isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                    yield from ((left, right, None) for left, right in zip(target.elts, node.value.elts, strict=False))
                else:
                    yield target, node.value, None


def _holders(tree: ast.AST) -> set[str]:
    """Every name and attribute of a file that holds the whole drive: by name, by annotation, or assigned from one."""
    names = set(HOLDERS)
    names |= {each.arg for each in ast.walk(tree) if isinstance(each, ast.arg) and _mentions(each.annotation)}
    before = -1
    while before != len(names):
        before = len(names)
        for target, value, annotation in _bindings(tree):
            made = isinstance(value, ast.Call) and _named(value.func) in WHOLE_DRIVE
            if made or _mentions(annotation) or (value is not None and _holds(value, names)):
                names.add(_named(target))
    return names - {""}


def _accesses(text: str) -> int:
    tree = ast.parse(text)
    names = _holders(tree)
    return sum(isinstance(node, ast.Attribute) and _holds(node.value, names) for node in ast.walk(tree))


def test_few_places_know_the_whole_drive() -> None:
    """Attribute accesses on the simulated drive from outside its own file, however it is called there."""
    counts = {str(each.relative_to(ROOT)): _accesses(each.read_text("utf-8")) for each in _files()}
    counts = {name: count for name, count in counts.items() if count}
    assert sum(counts.values()) <= MOST_ACCESSES, counts


def test_the_measure_sees_aliases_annotations_and_attributes() -> None:
    held = "class A:\n  def f(self, d: MCodeDevice):\n    self.held = d\n"
    assert _accesses(held + "    x, y = d, 1\n    x.now; self.held.now; d.motor.axis.go()\n") == 3
    assert _accesses("def f(d: Other): d.now") == 0


def test_no_class_of_the_simulated_drive_is_large() -> None:
    sizes = {
        f"{path.relative_to(LEXIUM)}:{node.name}": sum(isinstance(each, ast.FunctionDef) for each in node.body)
        for path in LEXIUM.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ClassDef)
    }
    assert not {name: size for name, size in sizes.items() if size > MOST_METHODS}
