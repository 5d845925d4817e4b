"""Tests see what a person or a caller sees: few places of them reach into the private parts of another object."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

from tests.support.paths import ROOT

PROTOCOL = frozenset({"_asdict", "_fields", "_make", "_replace"})
"""Public names of `NamedTuple` that begin with an underscore; `_repr_html_` and the like are Jupyter's."""
LIBRARY = frozenset({("os", "_exit")})
"""Documented functions of the library that begin with an underscore."""
KEPT: dict[str, tuple[int, str]] = {}
"""For each file the number of its private accesses, and why they stay. It only falls: lower it with the test's code."""


def is_private(name: str) -> bool:
    return name.startswith("_") and not (
        name.startswith("__") or name in PROTOCOL or (name.startswith("_repr_") and name.endswith("_"))
    )


def private_accesses(tree: ast.AST) -> Iterator[str]:
    """Accesses `x._y` but those of an object to itself, imports of private names, and replaced private names."""
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(value=ast.Name("self" | "cls")):
                pass
            case ast.Attribute(value, name) if is_private(name) and (ast.unparse(value), name) not in LIBRARY:
                yield name
            case ast.ImportFrom(module=str(module)) if module.startswith("multidrop"):
                yield from (each.name for each in node.names if is_private(each.name))
            case ast.Call(ast.Attribute(attr="setattr"), [owner, ast.Constant(str(name)), *_]):
                last = name.rpartition(".")[2]
                if is_private(last) and (ast.unparse(owner), last) not in LIBRARY:
                    yield last


def found() -> Counter[str]:
    """The number of private accesses in each file of tests."""
    counts: Counter[str] = Counter()
    for path in sorted((ROOT / "tests").rglob("*.py")):
        counts[path.relative_to(ROOT / "tests").as_posix()] = len(
            [*private_accesses(ast.parse(path.read_text("utf-8")))]
        )
    return +counts


def test_no_file_reaches_into_more_private_parts_than_are_listed() -> None:
    assert found() == {name: number for name, (number, _) in KEPT.items()}


def test_each_place_that_stays_has_its_reason() -> None:
    assert not [name for name, (_, why) in KEPT.items() if len(why) < 10]


def test_what_is_private_is_seen_in_each_form() -> None:
    text = (
        "from multidrop.a import _one, two\nx._three = self._four\npatch.setattr(x, '_five', 1)\n"
        "patch.setattr('a._six', 1)\nos._exit(1)\nx._replace(a=1)\nx._repr_html_()\nx.__dict__\n"
    )
    assert sorted(private_accesses(ast.parse(text))) == ["_five", "_one", "_six", "_three"]
