"""The simulated MCode drive is divided: how much other files know of the whole drive, and how large its classes are."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.support.paths import ROOT

pytestmark = pytest.mark.slow

LEXIUM = ROOT / "families" / "lexium" / "simulator"
ANOTHER_FAMILY = ("pmx", "tmcl")
MOST_METHODS = 40


class Whole(NamedTuple):
    """An object that could become a blackboard, and how often other files may reach into it."""

    own_file: Path
    classes: frozenset[str]
    """Its class, and the Protocols that stand for all of it."""
    holders: frozenset[str]
    """Names that hold it, annotated or not."""
    most: int


DRIVE = Whole(
    LEXIUM / "device.py",
    frozenset({"MCodeDevice", "Device", "Drive", "SimulatedDrive"}),
    frozenset({"device", "_device", "unit"}),
    97,
)
MOTOR = Whole(LEXIUM / "motion" / "motor.py", frozenset({"Motor"}), frozenset({"motor", "_motor"}), 104)


def _files(whole: Whole) -> list[Path]:
    files = (each for room in ("simulator", "families") for each in (ROOT / room).rglob("*.py"))
    ours = (each for each in files if not set(each.relative_to(ROOT).parts) & set(ANOTHER_FAMILY))
    return [each for each in ours if each != whole.own_file]


def _mentions(annotation: ast.expr | None, classes: frozenset[str]) -> bool:
    if annotation is None:
        return False
    names = {node.id for node in ast.walk(annotation) if isinstance(node, ast.Name)}
    names |= {node.attr for node in ast.walk(annotation) if isinstance(node, ast.Attribute)}
    names |= {str(node.value) for node in ast.walk(annotation) if isinstance(node, ast.Constant)}
    return bool(names & classes)


def _holds(node: ast.expr, names: set[str]) -> bool:
    """Whether an expression is the whole object: a name for it, or an attribute of that name."""
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


def _holders(tree: ast.AST, whole: Whole) -> set[str]:
    """Every name and attribute of a file that holds the object: by name, by annotation, or assigned from one."""
    names = set(whole.holders)
    names |= {
        each.arg for each in ast.walk(tree) if isinstance(each, ast.arg) and _mentions(each.annotation, whole.classes)
    }
    before = -1
    while before != len(names):
        before = len(names)
        for target, value, annotation in _bindings(tree):
            made = isinstance(value, ast.Call) and _named(value.func) in whole.classes
            if made or _mentions(annotation, whole.classes) or (value is not None and _holds(value, names)):
                names.add(_named(target))
    return names - {""}


def _accesses(text: str, whole: Whole) -> int:
    tree = ast.parse(text)
    names = _holders(tree, whole)
    return sum(isinstance(node, ast.Attribute) and _holds(node.value, names) for node in ast.walk(tree))


@pytest.mark.parametrize("whole", [DRIVE, MOTOR], ids=["drive", "motor"])
def test_few_places_reach_into_the_whole(whole: Whole) -> None:
    """Attribute accesses on the simulated drive from outside its own file, however it is called there."""
    counts = {str(each.relative_to(ROOT)): _accesses(each.read_text("utf-8"), whole) for each in _files(whole)}
    counts = {name: count for name, count in counts.items() if count}
    assert 0 < sum(counts.values()) <= whole.most, counts


def test_the_measure_sees_aliases_annotations_and_attributes() -> None:
    held = "class A:\n  def f(self, d: MCodeDevice):\n    self.held = d\n"
    assert _accesses(held + "    x, y = d, 1\n    x.now; self.held.now; d.motor.axis.go()\n", DRIVE) == 3
    assert _accesses("def f(d: Other): d.now", DRIVE) == 0


def test_no_class_of_the_simulated_drive_is_large() -> None:
    sizes = {
        f"{path.relative_to(LEXIUM)}:{node.name}": sum(isinstance(each, ast.FunctionDef) for each in node.body)
        for path in LEXIUM.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ClassDef)
    }
    assert not {name: size for name, size in sizes.items() if size > MOST_METHODS}
