"""Every feature that is there has a record, and the registry's table says what it answers to."""

from __future__ import annotations

import tomllib

import pytest

from multidrop.api.notebooks import Pictures
from multidrop.base import registry
from multidrop.base.registry import IN_WHEEL
from multidrop.dialects.families import Dialect
from multidrop.shell.connect.scheme import NoLine, Scheme
from multidrop.shell.hooks import AtSession, Options, Predicting, Switch
from multidrop.shell.operations.operation import Forms, Operation
from multidrop.shell.operations.table import VERBS
from multidrop.shell.plot_targets import PlotTargets
from multidrop.shell.relaying import Lent
from multidrop.shell.sections import Section
from multidrop.simulator.cell.endpoint_kinds import EndpointKind
from tests.support.paths import ROOT, THERE

KINDS: tuple[type, ...] = (
    Switch,
    Predicting,
    Operation,
    AtSession,
    Options,
    Forms,
    PlotTargets,
    Pictures,
    Section,
    Scheme,
    NoLine,
    EndpointKind,
    Lent,
)
FUNCTIONS: dict[type, tuple[str, ...]] = {PlotTargets: ("multidrop.read_rrd",), Pictures: ("Session.live",)}
"""The functions of the Python API that need a record of a kind."""


def test_each_folder_and_file_of_the_room_is_in_the_table() -> None:
    found = {each.stem for each in (ROOT / "features").iterdir() if not each.name.startswith("_")}
    assert found == set(THERE)


@pytest.mark.parametrize("name", THERE)
def test_the_table_has_the_words_that_the_record_answers_to(name: str) -> None:
    record = registry.wheel(name)
    assert record is not None and record.name == name and record.meaning
    operations = [each for each in record.adds if isinstance(each, Operation)]
    words = {word for each in operations for word in (each.name, each.command) if word}
    words |= {f"[{each.name}]" for each in record.adds if isinstance(each, Section)}
    words |= {f"{each.name}:" for each in record.adds if isinstance(each, Scheme)}
    words |= {claim for each in record.adds if isinstance(each, NoLine) for claim in each.claims()}
    words |= {f"{each.scheme}:" for each in record.adds if isinstance(each, EndpointKind)}
    options = [each for each in record.adds if isinstance(each, Options)]
    words |= {f"{each.command} {notation.partition(' ')[0]}" for each in options for notation in each.arguments}
    words |= {f"relay {each.name}" for each in record.adds if isinstance(each, Lent)}
    words |= {f"{each.verb} {word}" for each in record.adds if isinstance(each, Forms) for word in each.words}
    words |= {word for each in record.adds for word in FUNCTIONS.get(type(each), ())}
    assert words == set(IN_WHEEL[name])
    assert all(isinstance(each, KINDS) for each in record.adds)
    for each in operations:
        assert each.meaning if each.command else each.help
        assert callable(each.run) or not each.run, "a feature names its functions, not their places"


@pytest.mark.parametrize("name", registry.FAMILIES)
def test_the_table_has_the_words_of_a_family(name: str) -> None:
    record = registry.wheel(name)
    if record is None:
        pytest.skip(f"the family {name} is not in this copy of the tree")
    assert record.name == name and record.meaning
    words = {f"dialect={each.name}" for each in record.adds if isinstance(each, Dialect)}
    words |= {f"{each.name}:" for each in record.adds if isinstance(each, Scheme)}
    assert words == set(registry.FAMILIES[name])


@pytest.mark.parametrize("forms", [each for record in registry.wheels() for each in record.adds if type(each) is Forms])
def test_forms_of_a_verb_stand_before_its_own(forms: Forms) -> None:
    verb = VERBS[forms.verb]
    assert verb.usage.startswith(f"{forms.verb} [{forms.usage} | ") and verb.lines == forms.help.strip().split("\n")
    assert [*verb.words][: len(forms.words)] == [*forms.words] != [*verb.words]


def test_each_extra_of_a_feature_is_one_of_the_wheel() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [extra for each in registry.wheels() for extra in each.extras]
    assert set(extras) <= set(project["optional-dependencies"]) and len(extras) == len(set(extras))
