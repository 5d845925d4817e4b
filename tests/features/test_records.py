"""Every feature that is there has a record, and the registry's table says what it answers to."""

from __future__ import annotations

import tomllib

import pytest

from multidrop.api.notebooks import Pictures
from multidrop.base import registry
from multidrop.base.registry import IN_WHEEL
from multidrop.dialects.families import Dialect
from multidrop.shell.at_session import AtSession
from multidrop.shell.connect.scheme import NoLine, Scheme
from multidrop.shell.hooks import Options, Predicting, Switch
from multidrop.shell.operations.operation import Operation
from multidrop.shell.operations.table import VERBS, core
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
    words = {word for each in operations for word in ("" if each.extends else each.name, each.command) if word}
    words |= {claim for each in operations if each.extends for claim in each.claims()}
    words |= {f"[{each.name}]" for each in record.adds if isinstance(each, Section)}
    words |= {f"{each.name}:" for each in record.adds if isinstance(each, Scheme)}
    words |= {claim for each in record.adds if isinstance(each, NoLine) for claim in each.claims()}
    words |= {f"{each.scheme}:" for each in record.adds if isinstance(each, EndpointKind)}
    options = [each for each in record.adds if isinstance(each, Options)]
    words |= {claim for each in options for claim in each.claims()}
    words |= {f"relay {each.name}" for each in record.adds if isinstance(each, Lent)}
    words |= {word for each in record.adds for word in FUNCTIONS.get(type(each), ())}
    assert words == set(IN_WHEEL[name])
    assert all(isinstance(each, KINDS) for each in record.adds)
    assert all(each.meaning for each in operations if each.command)
    assert all(VERBS[each.name].help for each in operations if each.verb)


@pytest.mark.parametrize("name", registry.FAMILIES)
def test_the_table_has_the_words_of_a_family(name: str) -> None:
    record = registry.wheel(name)
    if record is None:
        pytest.skip(f"the family {name} is not in this copy of the tree")
    assert record.name == name and record.meaning
    words = {f"dialect={each.name}" for each in record.adds if isinstance(each, Dialect)}
    words |= {f"{each.name}:" for each in record.adds if isinstance(each, Scheme)}
    assert words == set(registry.FAMILIES[name])


FORMS = [each for each in registry.added(Operation) if each.extends]


@pytest.mark.parametrize("form", FORMS, ids=[each.verb for each in FORMS])
def test_a_form_of_a_feature_takes_the_place_of_the_verbs_own(form: Operation) -> None:
    verb, own = VERBS[form.name], [each for each in core() if each.name == form.name]
    assert verb.forms == (form, *(each for each in own if each.verb != form.verb)) and len(own) == len(verb.forms)
    assert verb.lines == form.help.strip().split("\n")


def test_each_extra_of_a_feature_is_one_of_the_wheel() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = [extra for each in registry.wheels() for extra in each.extras]
    assert set(extras) <= set(project["optional-dependencies"]) and len(extras) == len(set(extras))
