"""Every feature of the wheel has a record, and the registry's table says what it answers to."""

from __future__ import annotations

import tomllib

import pytest

from multidrop.base import registry
from multidrop.base.registry import IN_WHEEL
from multidrop.shell.connect.scheme import Scheme
from multidrop.shell.hooks import AtSession, Options
from multidrop.shell.operations.operation import Operation
from multidrop.shell.relaying import Lent
from multidrop.shell.sections import Section
from multidrop.simulator.cell.endpoint_kinds import EndpointKind
from tests.support.paths import ROOT


def test_each_folder_and_file_of_the_room_is_in_the_table() -> None:
    found = {each.stem for each in (ROOT / "features").iterdir() if not each.name.startswith("_")}
    assert found == set(IN_WHEEL)


@pytest.mark.parametrize("name", IN_WHEEL)
def test_the_table_has_the_words_that_the_record_answers_to(name: str) -> None:
    record = registry.wheel(name)
    assert record is not None and record.name == name and record.meaning
    operations = [each for each in record.adds if isinstance(each, Operation)]
    words = {word for each in operations for word in (each.name, each.command) if word}
    words |= {f"[{each.name}]" for each in record.adds if isinstance(each, Section)}
    words |= {f"{each.name}:" for each in record.adds if isinstance(each, Scheme)}
    words |= {f"{each.scheme}:" for each in record.adds if isinstance(each, EndpointKind)}
    options = [each for each in record.adds if isinstance(each, Options)]
    words |= {f"{each.command} {notation.partition(' ')[0]}" for each in options for notation in each.arguments}
    words |= {f"relay {each.name}" for each in record.adds if isinstance(each, Lent)}
    assert words == set(IN_WHEEL[name])
    kinds = Operation | AtSession | Options | Section | Scheme | EndpointKind | Lent
    assert all(isinstance(each, kinds) for each in record.adds)
    for each in operations:
        assert each.meaning if each.command else each.help
        assert callable(each.run) or not each.run, "a feature names its functions, not their places"


def test_each_extra_of_a_feature_is_one_of_the_wheel() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [extra for each in registry.wheels() for extra in each.extras]
    assert set(extras) <= set(project["optional-dependencies"]) and len(extras) == len(set(extras))
