"""The shell reads the table of families and names none of them, so a new family changes no file of it."""

import ast
from pathlib import Path

import pytest

from multidrop.dialects.families import FAMILIES, dialects
from multidrop.shell.connect.schemes import schemes
from multidrop.shell.connect.urls import parse
from tests.support.cases import for_each
from tests.support.paths import ROOT

FILES = sorted((ROOT / "shell").rglob("*.py"))


def texts(file: Path) -> list[str]:
    return [
        node.value
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8")))
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    ]


@for_each("file", [file for file in FILES if file.name != "schemes.py"])
def test_no_family_is_named(file: Path) -> None:
    assert not set(FAMILIES) & set(texts(file))


@pytest.mark.parametrize("family", FAMILIES.values(), ids=lambda family: family.name)
def test_every_family_is_opened_by_its_scheme_or_by_dialect(family) -> None:
    if scheme := dialects()[family.name].scheme:
        assert scheme in schemes()
        assert parse(f"{scheme}://host").hints.family == family.name
    else:
        assert parse(f"tcp://host?dialect={family.name}").hints.family == family.name
