"""The declarations of operations: TOML, of which the program reads the part that it uses."""

from __future__ import annotations

import tomllib
from pathlib import Path

from multidrop.base import registry
from multidrop.shell.operations import table
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.table import COMMANDS, VERBS, fields_of, sections

FOLDER = Path(table.__file__).parent


def test_every_section_is_read_as_toml_reads_it() -> None:
    for file in FOLDER.glob("*.toml"):
        text = file.read_text(encoding="utf-8")
        heads = tomllib.loads(text)
        found = {section[1:].partition("]")[0].strip('"'): fields_of(section) for _, _, section in sections(text)}
        assert found == heads, file.name


def test_every_section_is_a_verb_or_a_command() -> None:
    added = [*registry.added(Operation)]
    sections_of = [each for each in (*VERBS.values(), *COMMANDS.values()) if isinstance(each, Operation)]
    declared = {each.command or each.name for each in sections_of if each not in added}
    heads = [head for file in FOLDER.glob("*.toml") for head in tomllib.loads(file.read_text(encoding="utf-8"))]
    assert sorted(heads) == sorted(declared)
